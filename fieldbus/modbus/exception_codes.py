"""The exceptions of Modbus: how a request is refused, and what a code means in words.

Source: MODBUS Application Protocol Specification V1.1b3, section 7.
"""

from pymodbus.constants import ExcCodes
from pymodbus.pdu import ExceptionResponse

from fieldbus.modbus.pdu import encoded

EXCEPTION = 0x80
"""Added to the function code of a request that is refused."""

_TEXTS: dict[int, str] = {
    ExcCodes.ILLEGAL_FUNCTION: "illegal function",
    ExcCodes.ILLEGAL_ADDRESS: "illegal data address",
    ExcCodes.ILLEGAL_VALUE: "illegal data value",
    ExcCodes.DEVICE_FAILURE: "slave device failure",
    ExcCodes.ACKNOWLEDGE: "acknowledge",
    ExcCodes.DEVICE_BUSY: "slave device busy",
    ExcCodes.NEGATIVE_ACKNOWLEDGE: "negative acknowledge",
    ExcCodes.MEMORY_PARITY_ERROR: "memory parity error",
    ExcCodes.GATEWAY_PATH_UNAVIABLE: "gateway path unavailable",
    ExcCodes.GATEWAY_NO_RESPONSE: "gateway target device failed to respond",
}


def exception_reply(function: int, code: ExcCodes) -> bytes:
    """Return the PDU that refuses a request."""
    return encoded(ExceptionResponse(function, code))


def exception_code(request: bytes, reply: bytes) -> int | None:
    """Return the code with which a reply PDU refuses a request; None, it does not."""
    return reply[1] if len(reply) == 2 and reply[0] == request[0] | EXCEPTION else None


def exception_text(code: int) -> str:
    """Return a code in words, such as "exception 2, illegal data address"."""
    return f"exception {code}, {_TEXTS.get(code, 'not in the specification')}"
