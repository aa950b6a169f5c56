"""pymodbus's messages as bytes: what a frame carries, a function code and its data."""

from pymodbus.pdu import ModbusPDU


def encoded(message: ModbusPDU) -> bytes:
    """Return the PDU of a request or a reply.

    Raises:
        ValueError: an address or a count that the function does not allow (where pymodbus checks it).
    """
    return bytes((message.function_code,)) + message.encode()
