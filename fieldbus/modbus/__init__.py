"""Modbus, both ends, on pymodbus. What is pymodbus's and what is ours: docs/decisions/0012-pymodbus.md.

Its files:

    server, server_connection, function_codes   answers on TCP: the server, one client's frames, what a request gets
    admission, request_counts                   who gets a place, and how often each host may ask; how often who asked
    client, client_errors                       asks on TCP; why there is no reply
    framing, host_address                       how frames lie in its stream; where its server is
    serial_line, terminal, rtu                  the serial line, what it is on POSIX, and the frames on it
    pdu, exception_codes, register_packing      what frames carry; how a refusal is said; values in registers
    tls, client_roles                           mutual TLS; who a client is, and what its role permits
"""
