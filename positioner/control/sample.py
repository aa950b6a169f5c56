"""One measurement, as the control core takes it. Time comes in as data."""

from typing import NamedTuple

from config.codes import Quality
from positioner.control.keyword_records import by_name


class Sample(NamedTuple):
    """What one cycle knows of the valve. After a lost reply the last values stand, with quality LOST."""

    now_s: float
    """Time of this cycle, on the clock by which ages are measured."""
    time_s: float
    """Time of the measurement, on the device's clock where it has one."""
    position_m: float
    pressure_pa: float
    quality: Quality = Quality.GOOD
    status: int = 0
    """The device's own bits, `DeviceStatus`; 0 is healthy."""
    held_pa: float | None = None
    """The command the device held, when it was looked at anew and not commanded in this cycle."""
    overwritten: bool = False
    """Whether it then held what this daemon had not given it, though nothing had been lost: somebody else wrote it."""
    restarted: bool = False
    """Whether it had lost what it was told beside the command: it was restarted, whatever it holds."""
    emergency: int = 0
    """The device's own code of what is wrong with it (CANopen: of its last EMCY); 0: nothing."""
    unattended_s: float = 0.0
    """For how long the daemon had not commanded the device, where that was too long; 0 otherwise."""


sample_of = by_name(Sample)
