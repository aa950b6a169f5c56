"""Modbus, both ends: `server` and `connection` answer, `client` asks, `rtu` and `serial_line` are the serial line.

`layout` packs values into registers, `tls` is Modbus/TCP Security.
"""
