"""The link to the device: makes samples of readings, and the connection anew when it is lost.

What the driver cannot get becomes a sample of quality LOST with the last values; a device whose sample counter (or
clock) stands still, one of quality REPEATED. Nothing stale is taken for fresh.
"""

import logging
import math
from dataclasses import dataclass, replace

from config.codes import Quality
from drivers.boundary import Driver, DriverError, Reading
from positioner.control.sample import Sample
from positioner.daemon.logs import log_event
from positioner.daemon.pacing import Pace

log = logging.getLogger(__name__)

COUNTER_RANGE = 1 << 32
"""The device's sample counter wraps here."""


@dataclass(slots=True)
class LinkCounts:
    """What went wrong on the bus since the start."""

    lost_samples: int = 0
    lost_replies: int = 0


class Link:
    """Owns the driver. Used by the cycle thread alone."""

    def __init__(self, driver: Driver, pace: Pace) -> None:
        self.counts = LinkCounts()
        self._driver = driver
        self._pace = pace
        self._connected = False
        self._reading: Reading | None = None
        self._sample = Sample(0.0, 0.0, math.nan, math.nan, Quality.LOST)
        self._held_pa: float | None = None

    def open(self) -> tuple[float, Reading]:
        """Connect for the first time; return the command the device holds, in Pa, and a first reading.

        Raises:
            DriverError: the device is not there or does not answer as it should.
        """
        held_pa = self._driver.open()
        self._connected = True
        return held_pa, self._driver.read()

    def exchange(self, command_pa: float) -> Sample:
        """Command a pressure and return the sample that comes back, or what is known without it."""
        try:
            if not self._connected:
                self._reconnect()
            # A device found again keeps what it holds until supervision has looked at it.
            command_pa = command_pa if self._held_pa is None else self._held_pa
            self._sample = self._fresh(self._driver.exchange(command_pa), command_pa)
            self._held_pa = None
        except DriverError as error:
            self._lose(error)
        return self._sample

    def leave(self, command_pa: float) -> None:
        """Give the device its last command, in Pa, and say so when it cannot be reached."""
        try:
            self._driver.write(command_pa)
        except DriverError as error:
            log_event(log, logging.ERROR, "device not left as configured", reason=str(error), command_pa=command_pa)

    def release(self) -> None:
        """Close the connection."""
        self._driver.close()

    def _reconnect(self) -> None:
        self._held_pa = self._driver.open()
        self._connected = True
        self._reading = None
        log_event(log, logging.WARNING, "device is back", held_pa=self._held_pa)

    def _lose(self, error: DriverError) -> None:
        self.counts.lost_replies += 1
        if self._connected:
            log_event(log, logging.WARNING, "no good reply", reason=str(error))
        self._driver.close()
        self._connected = False
        self._sample = replace(self._sample, now_s=self._pace.now_s(None), quality=Quality.LOST, held_pa=None)

    def _fresh(self, reading: Reading, command_pa: float) -> Sample:
        now_s = self._pace.now_s(reading.device_time_s)
        repeated = self._count(reading)
        self._reading = reading
        return Sample(
            now_s=now_s,
            time_s=now_s if reading.device_time_s is None else reading.device_time_s,
            position_m=reading.position_m,
            pressure_pa=command_pa if reading.pressure_pa is None else reading.pressure_pa,
            quality=Quality.REPEATED if repeated else Quality.GOOD,
            status=reading.status,
            held_pa=self._held_pa,
        )

    def _count(self, reading: Reading) -> bool:
        """Count the samples that were missed; return whether this one came before."""
        before = self._reading
        if before is None:
            return False
        if reading.sample_counter is not None and before.sample_counter is not None:
            passed = (reading.sample_counter - before.sample_counter) % COUNTER_RANGE
            self.counts.lost_samples += max(passed - 1, 0)
            return passed == 0
        return reading.device_time_s is not None and reading.device_time_s == before.device_time_s
