"""Why a request to a Modbus server got no reply: each kind a class, the text in words."""

from fieldbus.modbus.exception_codes import exception_text


class ClientError(Exception):
    """No reply to a request; the text says why, in words."""


class NotConnected(ClientError):
    """The server was not reached, or the connection has ended."""


class NobodyThere(NotConnected):
    """Nobody accepts a connection at the address."""


class ReplyTimeout(ClientError):
    """No whole reply came within the time-out."""


class UnexpectedReply(ClientError):
    """What came is no reply to the request.

    Args:
        frame: what came.
        said: what is wrong with it, where that is known.
    """

    def __init__(self, frame: bytes, said: str = "") -> None:
        super().__init__(f"the reply does not fit: {said + ': ' if said else ''}{frame.hex(' ')}")


class OtherTransaction(UnexpectedReply):
    """A reply with the number of another transaction."""

    def __init__(self, frame: bytes, came: int, asked: int) -> None:
        super().__init__(frame, f"transaction {came} came, {asked} was asked")


class DuplicatedReply(UnexpectedReply):
    """The reply to the request before came a second time."""

    def __init__(self, frame: bytes) -> None:
        super().__init__(frame, "the reply to the request before came twice")


class OtherUnit(UnexpectedReply):
    """A reply of another unit."""

    def __init__(self, frame: bytes, came: int, asked: int) -> None:
        super().__init__(frame, f"unit {came} answered, unit {asked} was asked")
        self.came = came


class SerialFrame(UnexpectedReply):
    """A reply framed as on a serial line, where one of Modbus TCP was wanted."""

    def __init__(self, frame: bytes) -> None:
        super().__init__(frame, "it is framed as on a serial line")


class Refused(ClientError):
    """The server refuses the request with an exception."""

    def __init__(self, code: int) -> None:
        super().__init__(exception_text(code))
        self.code = code
