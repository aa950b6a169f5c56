"""The simulated slave: the valve as a device on a fieldbus, in a process of its own (`positioner sim`).

Its files:

    slave                                     valve, device, clock and server, on whichever bus a file names
    simulated_device, clocks                  the I/P with position transmitter as pure logic; who lets its time pass
    faults                                    it drops, freezes, jumps and restarts, by its file
    device_registers                          laid out for Modbus
    rtu_server                                served on a serial line
    canopen_dictionary, canopen_node          laid out for CANopen; the node as pure logic
    canopen_slave                             the node on its bus
"""
