"""The file of the daemon: `positioner run CONFIG.toml`."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from config.device import ActionName, ModbusTcpDevice
from config.loading import Fraction, NonNegative, Positive, Schema, load


class PositionedValve(Schema):
    """Table `[valve]`: what the controller must know of the valve before it identifies anything."""

    name: str = "valve"
    stroke_m: Positive
    breakaway_pa: Positive | None = None
    """F_s / A where it is known: the excitation's constant part must exceed it."""


class Cycle(Schema):
    """Table `[cycle]`: in real time, or as fast as a device in lockstep answers, on the device's clock."""

    pace: Literal["real_time", "device"] = "real_time"
    period_s: Annotated[float, Field(ge=2e-4, le=10)] = 1e-3
    """Of the loop in real time; a device in lockstep has its own."""


class PressureLimits(Schema):
    """Table `[pressure]`: every command lies between these."""

    minimum_pa: NonNegative = 0.0
    maximum_pa: Positive = 420e3

    @model_validator(mode="after")
    def _minimum_is_below_maximum(self) -> Self:
        if self.minimum_pa >= self.maximum_pa:
            raise ValueError(f"minimum_pa must be below maximum_pa ({self.maximum_pa:g} Pa)")
        return self


class Safety(Schema):
    """Table `[safety]`: what ends in the safe state, and what that is."""

    action: ActionName = "hold"
    """On a fault of the device or its bus, and when the daemon ends."""
    lost_after_cycles: Annotated[int, Field(ge=1)] = 3
    stale_after_s: Positive = 0.1
    travel_margin: Fraction = 0.1
    """A position farther than this fraction of the stroke outside the stroke is implausible."""
    heartbeat_timeout_s: NonNegative = 0.0
    """Silence of the DCS that is a fault; 0 is never."""
    heartbeat_action: ActionName = "hold"


class Identification(Schema):
    """Table `[identification]`: the window of the algebraic identifier, its derivative filters, the sensors' noise."""

    window_s: Positive = 0.8
    minimum_window_s: Positive = 0.4
    derivative_window_s: Positive = 0.05
    noise_std_m: Positive | None = None
    """Standard deviation of the position sensor's noise; measured at rest where nobody has said."""
    pressure_noise_std_pa: NonNegative = 0.0

    @model_validator(mode="after")
    def _windows_nest(self) -> Self:
        if self.minimum_window_s > self.window_s:
            raise ValueError(f"minimum_window_s must be at most window_s ({self.window_s:g} s)")
        return self


class Excitation(Schema):
    """Table `[excitation]`: what S3 applies until the DCS writes otherwise, and how long at the most."""

    alpha_pa: NonNegative = 0.0
    beta_pa: NonNegative = 13238.0
    omega_rad_per_s: Positive = 1.0
    limit_s: Positive = 10.0


class Law(Schema):
    """Table `[law]`: an earlier identification's ratios, so that a restart need not excite the valve again."""

    b_over_c_pa_per_m: Annotated[float, Field(lt=0)]
    k_over_c_pa: Annotated[float, Field(lt=0)]


class Supervisory(Schema):
    """Table `[supervisory]`: where the DCS finds the registers. Port 0 takes any free one; the daemon says which."""

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 5502
    unit: Annotated[int, Field(ge=1, le=247)] = 1


class Recorder(Schema):
    """Table `[recorder]`: recordings in a folder, a new file at a size, the oldest deleted beyond a number."""

    folder: str
    file_bytes: Annotated[int, Field(ge=10_000)] = 50_000_000
    keep_files: Annotated[int, Field(ge=1)] = 20


class Log(Schema):
    """Table `[log]`: JSON lines on standard error."""

    level: Literal["debug", "info", "warning", "error"] = "info"


class DaemonFile(Schema):
    """A whole daemon file."""

    valve: PositionedValve
    device: ModbusTcpDevice = ModbusTcpDevice()
    cycle: Cycle = Cycle()
    pressure: PressureLimits = PressureLimits()
    safety: Safety = Safety()
    identification: Identification = Identification()
    excitation: Excitation = Excitation()
    law: Law | None = None
    supervisory: Supervisory = Supervisory()
    recorder: Recorder | None = None
    log: Log = Log()


def load_daemon(path: Path) -> DaemonFile:
    """Read a daemon file.

    Raises:
        InputError: names file, key, value and what is allowed.
    """
    return load(DaemonFile, path)
