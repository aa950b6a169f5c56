"""A serial line as a person describes it: its path, how its characters look, and the times that follow.

t_c     = b / B                  s, one character: b bits (start, 8 data, parity, stop) at B baud
t_3.5   = 3.5 t_c                s, least silence between two frames; 1.75 ms above 19200 baud, whatever B is
"""

from typing import Annotated, Literal

from pydantic import Field

from config.loading import NearFileName, Schema

FASTEST_SCALED_BAUD = 19200
FIXED_SILENCE_S = 1.75e-3

Baud = Literal[1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600]
RtuUnit = Annotated[int, Field(ge=1, le=247)]


class SerialPort(Schema):
    """A serial line and how its characters look; the defaults are the specification's."""

    path: NearFileName
    """Of the serial device, such as /dev/ttyUSB0."""
    baud: Baud = 19200
    parity: Literal["none", "even", "odd"] = "even"
    stop_bits: Annotated[int, Field(ge=1, le=2)] = 1
    local_echo: bool = False
    """Whether a two-wire adapter hands back all that is sent."""

    @property
    def character_s(self) -> float:
        """How long one character takes."""
        return (1 + 8 + (self.parity != "none") + self.stop_bits) / self.baud

    @property
    def silence_s(self) -> float:
        """The least silence between two frames."""
        return 3.5 * self.character_s if self.baud <= FASTEST_SCALED_BAUD else FIXED_SILENCE_S
