"""The simulated slave: the valve as a device on a fieldbus, in a process of its own (`positioner sim`).

`device` is the I/P with position transmitter as pure logic, `clocks` says who lets its time pass, `registers` lays
it out for Modbus, `modbus_rtu` serves it on a serial line, `modbus` puts valve, device, clock and server together from
a slave file.
On CANopen `canopen_dictionary` lays it out, `canopen_node` is the node, `canopen` puts it on its bus; `slave` makes
whichever a file names.
"""
