"""The ground floor: what people write and read, declared once. Imports no other room.

files     valve_file, slave_file, daemon_file; loading reads, writing writes a valve's; shipped: valves, profiles
[device]  device (Modbus), canopen_device, bus_plugins (buses of other packages); hosts, serial_port, tls_table
device    quantities (what it measures and obeys), modbus_map (its registers), register_format (values in words)
DCS       registers (the supervisory table), codes (every code and its text), roles (who may write)
records   recording, historian_export; noise (of a recorded position)
errors    InputError (exit status 2), CommandFailed (1), each one line; extras (which package is not installed)
"""
