"""The link to the device: makes samples of readings, and the connection anew when it is lost.

What the driver cannot get becomes a sample of quality LOST with the last values; a measurement that is no number, one
of NO_NUMBER; a device whose sample counter (or clock) stands still, one of REPEATED. Nothing stale is taken for fresh.

A device that was without commands for too long (its replies were lost, or this daemon stood still) may have acted by
itself or been restarted. It is looked at before it is commanded: what it holds, and its status, which the next
command would clear. Supervision judges both.
"""

import logging
import math
import time
from dataclasses import dataclass, replace

from config.codes import Quality
from drivers.boundary import Driver, DriverError, NoNumber, Reading, Refused
from positioner.control.sample import Sample
from positioner.daemon.backoff import Backoff, Sayings
from positioner.daemon.logs import log_event
from positioner.daemon.pacing import Pace

log = logging.getLogger(__name__)

MOST_REFUSALS = 2
"""Exceptions in a row on a connection that stays; after more the device is looked at anew."""


@dataclass(slots=True)
class LinkCounts:
    """What went wrong on the bus since the start."""

    lost_samples: int = 0
    lost_replies: int = 0


class Link:
    """Owns the driver. Used by the cycle thread alone.

    Args:
        driver: of the device.
        pace: says what time it is.
        longest_unattended_s: from one command to the next; later, the daemon stood still.
    """

    def __init__(self, driver: Driver, pace: Pace, longest_unattended_s: float = math.inf) -> None:
        self.counts = LinkCounts()
        self._driver = driver
        self._pace = pace
        self._longest_unattended_s = longest_unattended_s
        self._commanded_s = math.inf
        """When the last command set out, or the device was looked at, on the gateway's clock."""
        self._returned_s = math.inf
        self._unattended_s = 0.0
        self._backoff = Backoff()
        self._sayings = Sayings()
        self._refusals = 0
        self._connected = False
        self._reading: Reading | None = None
        self._sample = Sample(0.0, 0.0, math.nan, math.nan, Quality.LOST)

    def open(self) -> tuple[float, Reading]:
        """Connect for the first time; return the command the device holds, in Pa, and a first reading.

        Raises:
            DriverError: the device is not there or does not answer as it should.
        """
        held_pa = self._driver.open()
        self._connected = True
        return held_pa, self._driver.read()

    @property
    def longest_unattended_s(self) -> float:
        """From one command to the next; later, this daemon stood still."""
        return self._longest_unattended_s

    def exchange(self, command_pa: float) -> Sample:
        """Command a pressure and return the sample that comes back, or what is known without it."""
        now_s = awake_s()
        self._notice_a_stall(now_s, command_pa)
        try:
            if self._connected:
                self._commanded_s = now_s
                self._sample = self._fresh(self._driver.exchange(command_pa), command_pa)
                self._backoff.succeeded()
                self._refusals = 0
            elif self._unattended_s > 0 or self._backoff.may_try(now_s):
                self._sample = self._found_again()
            else:
                self._sample = self._lost()
        except DriverError as error:
            self._lose(error)
        self._returned_s = awake_s()
        return self._sample

    def begin(self) -> None:
        """Be called regularly from now on. What took long before that is no stall, but the device is looked at."""
        self._connected &= awake_s() - self._commanded_s <= self._longest_unattended_s
        self._returned_s = math.inf

    def leave(self, command_pa: float) -> None:
        """Give the device its last command, in Pa, and say so when it cannot be reached."""
        try:
            if not self._connected:
                self._driver.open()
            self._driver.write(command_pa)
        except DriverError as error:
            log_event(log, logging.ERROR, "device not left as configured", reason=str(error), command_pa=command_pa)

    def release(self) -> None:
        """Close the connection."""
        self._driver.close()

    def _notice_a_stall(self, now_s: float, command_pa: float) -> None:
        """Have the device looked at before it is commanded, where this daemon stood still."""
        since_s = self._commanded_s if self._connected else self._returned_s
        if now_s - since_s <= self._longest_unattended_s:
            return
        self._unattended_s = now_s - since_s
        self._connected = False
        log_event(
            log,
            logging.ERROR,
            "the daemon stood still",
            unattended_s=round(self._unattended_s, 4),
            allowed_s=self._longest_unattended_s,
            commanded_pa=command_pa,
        )

    def _found_again(self) -> Sample:
        """Connect anew, and look at what the device holds and says without commanding it."""
        self._driver.close()
        held_pa = self._driver.open()
        reading = self._driver.read()
        before, self._reading = self._reading, None
        sample = replace(self._fresh(reading, held_pa), held_pa=held_pa, unattended_s=self._unattended_s)
        self._connected, self._refusals, self._unattended_s = True, 0, 0.0
        self._commanded_s = awake_s()
        self._say(logging.WARNING, "device is back", held_pa=held_pa, status=reading.status)
        repeated = before is not None and _same_sample(before, reading)
        return replace(sample, quality=Quality.REPEATED) if repeated else sample

    def _lose(self, error: DriverError) -> None:
        self.counts.lost_replies += 1
        kind = error.kind or type(error).__name__
        self._say(logging.WARNING, "no good reply", kind, reason=str(error))
        self._sample = self._lost()
        if isinstance(error, NoNumber):
            self._sample = replace(self._sample, quality=Quality.NO_NUMBER)
        refused = isinstance(error, Refused)
        if self._connected and (isinstance(error, NoNumber) or (refused and self._refusals < MOST_REFUSALS)):
            self._refusals += refused
            return
        self._driver.close()
        self._connected = False
        self._backoff.failed(awake_s())

    def _lost(self) -> Sample:
        now_s = self._pace.now_s(None)
        return replace(self._sample, now_s=now_s, quality=Quality.LOST, held_pa=None, unattended_s=0.0)

    def _say(self, level: int, event: str, kind: str = "", **fields: object) -> None:
        """Log an event, each kind once a minute; then with how many were passed over."""
        passed = self._sayings.unsaid((event, kind), awake_s())
        if passed is not None:
            log_event(log, level, event, **fields, **({"times_unsaid": passed} if passed else {}))

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
        )

    def _count(self, reading: Reading) -> bool:
        """Count the samples that were missed; return whether this one came before."""
        before = self._reading
        if before is None:
            return False
        if reading.sample_counter is not None and before.sample_counter is not None:
            passed = (reading.sample_counter - before.sample_counter) % self._driver.capabilities.counter_range
            self.counts.lost_samples += max(passed - 1, 0)
            return passed == 0
        return _same_sample(before, reading)


def _same_sample(before: Reading, reading: Reading) -> bool:
    """Return whether a reading is of a sample that was read before, as counter and clock of the device say."""
    if reading.sample_counter is not None and reading.sample_counter != before.sample_counter:
        return False
    if reading.device_time_s is None:
        return reading.sample_counter is not None
    return reading.device_time_s == before.device_time_s


def awake_s() -> float:
    """Return the time on a clock that also runs while the gateway sleeps."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)
