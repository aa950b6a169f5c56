"""Modbus, both ends, on pymodbus: `server`, `connection` and `register_answers` answer, `client` asks.

`pdu` and `exception_codes` are what frames carry, `rtu` and `serial_line` the serial line, `layout` packs values into
registers, `tls` is Modbus/TCP Security. What is pymodbus's and what is ours: docs/decisions/0012-pymodbus.md.
"""
