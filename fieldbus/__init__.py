"""What the wire carries, for both ends of it: the driver and the daemon's server, the simulated slave and the tests.

    modbus     the server of registers, the client, frames on a serial line, TLS
    canopen    the words of our device, its electronic data sheet, a CAN bus between processes

Stands on `config`; knows neither controller nor model.
"""
