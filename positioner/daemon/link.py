"""The link to the device: makes samples of readings, and the connection anew when it is lost.

What the driver cannot get becomes a sample of quality LOST with the last values; a measurement that is no number, one
of NO_NUMBER; a device whose sample counter (or clock) stands still, one of REPEATED. Nothing stale is taken for fresh.

A device that was without commands for too long (its replies were lost, or this daemon stood still) may have acted by
itself or been restarted. It is looked at before it is commanded: what it holds, and its status, which the next
command would clear. Supervision judges both. Many a device that vents or fills by itself keeps its set point and obeys
it again with the next command; what it holds is then what it does, not its set point. Now and then it is asked what it
holds in between: if that is not what it was told, another master writes it, and the cycle commands nothing. More seldom
it is asked whether it still has its time-out and action: one that has not was restarted between two commands, unseen.

The pressure of a sample is that which has acted since the sample before (`positioner.estimation`). A device that
samples on request, after the write, shows the next one already: its pressures are taken a sample late. Of a device that
shows none, the command counts: in lockstep the one just sent, under which a period has passed, else the one before.
"""

import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from threading import Semaphore

from config.codes import GOOD, LOST, NO_NUMBER, REPEATED, Quality
from config.daemon_file import DaemonFile
from config.quantities import ActionName, DeviceStatus
from config.travel import Travel
from drivers.boundary import (
    AsksAhead,
    Driver,
    DriverError,
    KeepsSettings,
    NoNumber,
    NoReply,
    Reading,
    ReadsBack,
    Refused,
)
from positioner.control.sample import Sample, sample_of
from positioner.daemon.backoff import Backoff, Doors, Sayings
from positioner.daemon.logs import log_event
from positioner.daemon.pacing import Pace

log = logging.getLogger(__name__)

LONG_COUNTER = 1 << 16
"""A counter of fewer numbers may well pass half of them from one reading to the next."""
MOST_REFUSALS = 2
"""Exceptions in a row on a connection that stays; after more the device is looked at anew."""
SETTINGS_EVERY = 5
"""Of the times that the device is asked what it holds, the one in which its settings are asked for in its place."""
AWAKE = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
"""The clock that also runs while the gateway sleeps: on macOS, which has no CLOCK_BOOTTIME, the monotonic one does."""
TRIES_AT_START = 3
"""Replies lost in a row at the start, that end it."""


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """How a device is attended to, SI units."""

    longest_unattended_s: float = math.inf
    """From one command to the next; later, the daemon stood still."""
    read_back_s: float = 0.0
    """How often it is asked what it holds; 0 is never."""
    read_back_tolerance_pa: float = 0.0
    """How far that may be from what it was told."""
    pressure_is_after: bool = False
    """Whether the pressure of a reply is that of the command which it answers."""
    shadow: bool = False
    """Whether it is only read."""
    in_lockstep: bool = True
    """Whether it has obeyed a command for a period when it answers."""
    vented_pa: float = 0.0
    filled_pa: float = math.inf
    """What is commanded in place of what it does when it vents or fills by itself."""
    acts_alone_by: ActionName | None = None
    """What it was told to do by itself; None where it cannot be told."""
    retry_every_s: float = 1.0
    """The longest from one attempt to reach it to the next."""
    on_shared_line: bool = False
    """Whether an attempt keeps others waiting."""
    travel: Travel | None = None
    """Turns the device's position, which counts from the closed end, to the stem's; None: it is the stem's."""

    @classmethod
    def of(cls, file: DaemonFile, tolerance_pa: float) -> "LinkSettings":
        """Return what a daemon's file asks for; `tolerance_pa` is that of a restarted device."""
        lockstep = file.cycle.pace == "device"
        read_back_s = 0.0 if file.cycle.shadow else file.safety.read_back_s
        return cls(
            longest_unattended_s=file.longest_unattended_s,
            read_back_s=read_back_s,
            read_back_tolerance_pa=tolerance_pa,
            pressure_is_after=file.samples_after,
            shadow=file.cycle.shadow,
            in_lockstep=lockstep,
            vented_pa=file.pressure.minimum_pa,
            filled_pa=file.pressure.maximum_pa,
            acts_alone_by=file.device.acts_alone_by,
            retry_every_s=file.device.longest_retry_s,
            on_shared_line=file.device.on_shared_line,
            travel=file.valve.travel,
        )


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
        settings: how the device is attended to.
        doors: of all that connect anew; who finds its own closed tries with the next cycle. None: nobody else does.
    """

    def __init__(
        self, driver: Driver, pace: Pace, settings: LinkSettings | None = None, doors: Doors | None = None
    ) -> None:
        self.counts = LinkCounts()
        self.driver = driver
        # Asking what a driver can do takes a tenth of a cycle.
        self._reads_back = driver if isinstance(driver, ReadsBack) else None
        self._keeps_settings = driver if isinstance(driver, KeepsSettings) else None
        self._ahead = driver if isinstance(driver, AsksAhead) else None
        self._asked_pa = 0.0
        self._before_pa: float | None = None
        self._pace = pace
        self._settings = settings or LinkSettings()
        self._doors = doors
        self._lost_a_reply = False
        """Whether the device was there until its last reply was lost."""
        self.longest_unattended_s = self._settings.longest_unattended_s
        """From one command to the next; later, this daemon stood still."""
        self._read_back_s = -math.inf
        self._read_backs = 0
        self._restarted = False
        """Whether the device was found to have lost its settings, and not yet looked at."""
        self._told_pa: float | None = None
        """The last command, if the device has answered it."""
        self._pressure_pa: float | None = None
        """The pressure that acts from the last sample on, if it is known."""
        self._commanded_s = math.inf
        """When the last command set out, or the device was looked at, on the gateway's clock."""
        self._begun_s = self._returned_s = math.inf
        self._unattended_s = 0.0
        self._backoff = Backoff(self._settings.retry_every_s, shared=self._settings.on_shared_line)
        self._sayings = Sayings()
        self._refusals = 0
        self._connected = self._was_reached = False
        self._was_away = True
        """Whether the device was lost, or left alone, since it was looked at last."""
        self._asked_s = math.inf
        """When the exchange under way began."""
        self._reading: Reading | None = None
        self._sample = Sample(now_s=0.0, time_s=0.0, position_m=math.nan, pressure_pa=math.nan, quality=LOST)

    def open(self) -> tuple[float, Reading]:
        """Connect for the first time; return the command in force in the device, in Pa, and a first reading.

        Raises:
            DriverError: the device is not there or does not answer as it should.
        """
        said = "no reply at the start, asked again"
        held_pa, reading = first_reading(self.driver, lambda error: self._say(logging.WARNING, said, reason=str(error)))
        self._connected = self._was_reached = True
        self._was_away = False
        return self._in_force_pa(held_pa, reading), reading

    def exchange(self, command_pa: float) -> Sample:
        """Command a pressure and return the sample that comes back, or what is known without it."""
        now_s = self._asked_s = awake_s()
        self._notice_a_stall(now_s, command_pa)
        try:
            held_pa = self.overwritten_pa() if self._connected else None
            if held_pa is not None:
                self._commanded_s = now_s
                sample = self._fresh(self.driver.read(), held_pa)
                self._sample = sample._replace(held_pa=held_pa, overwritten=True)
            elif self._connected:
                self._commanded_s = now_s
                told_pa, self._told_pa = self._told_pa, None
                reading = self.driver.read() if self._settings.shadow else self.driver.exchange(command_pa)
                self._take(reading, command_pa, told_pa)
            elif (self._unattended_s > 0 or self._backoff.may_try(now_s)) and (
                (door := self._door) is None or door.acquire(blocking=False)
            ):
                self._lost_a_reply = False
                try:
                    self._sample = self._found_again()
                finally:
                    if door is not None:
                        door.release()
            else:  # not asked: what was said last is why
                self._sample = self._lost(NO_NUMBER if self._sample.quality is NO_NUMBER else LOST)
        except DriverError as error:
            self._lose(error)
        self._returned_s = awake_s()
        return self._sample

    @property
    def is_connected(self) -> bool:
        """Whether the next exchange goes over the connection that is there."""
        return self._connected

    @property
    def reply_timeout_s(self) -> float | None:
        """How long an answer may take that need not be waited for; None: this device is one that keeps its thread."""
        driver = self._ahead
        may = driver is not None and not self._settings.shadow and self.driver.capabilities.one_transaction
        return driver.reply_timeout_s if driver is not None and may else None

    def ask(self, command_pa: float) -> int | None:
        """Begin an exchange where nothing is to be done before; return what is ready when something comes back.

        None: `exchange` is to be called.
        """
        driver, now_s = self._ahead, awake_s()
        late = now_s - self._commanded_s > self.longest_unattended_s
        if driver is None or not self._connected or late or self._reads_back_now:
            return None
        self._asked_s = self._commanded_s = now_s
        self._asked_pa, self._before_pa, self._told_pa = command_pa, self._told_pa, None
        try:
            return driver.ask(command_pa)
        except DriverError:
            return None

    def answer(self, *, late: bool) -> Sample | None:
        """Return the sample that comes back of what was asked, or what is known without it; None: not yet."""
        assert self._ahead is not None
        try:
            reading = self._ahead.answer(late=late)
            if reading is None:
                return None
            self._take(reading, self._asked_pa, self._before_pa)
        except DriverError as error:
            self._lose(error)
        self._returned_s = awake_s()
        return self._sample

    def _take(self, reading: Reading, command_pa: float, told_pa: float | None) -> None:
        """Make a sample of the answer to a command; the one before it was `told_pa`, if the device has answered it."""
        self._backoff.succeeded()
        self._refusals = 0
        if self._began_anew(reading):
            self._say(logging.WARNING, "device began anew", device_time_s=reading.device_time_s)
            self.driver.close()
            self._connected, self._was_away = False, True
            self._sample = self._lost()
        else:
            self._sample = self._fresh(reading, command_pa, told_pa)
            self._told_pa = command_pa

    def begin(self) -> None:
        """Be called regularly from now on. What took long before that is no stall, but the device is looked at.

        Whether it was too long the next exchange finds: until then the device goes on being without commands.
        """
        self._begun_s, self._returned_s = awake_s(), math.inf

    def leave(self, command_pa: float, *, holds: bool = False) -> None:
        """Give the device its last command, in Pa, and say so when it cannot be reached; none if it is only read.

        Where that is to hold, one that is lost, or was left alone for too long, keeps what it has: nobody knows whether
        it was restarted, or has acted by itself.
        """
        if self._settings.shadow:
            return
        alone = not self._connected or awake_s() - self._commanded_s > self.longest_unattended_s
        if holds and alone:
            log_event(log, logging.WARNING, "device is lost, and left with what it has", command_pa=command_pa)
            return
        try:
            if not self._connected:
                self.driver.open()
            self.driver.write(command_pa)
        except DriverError as error:
            log_event(log, logging.ERROR, "device not left as configured", reason=str(error), command_pa=command_pa)

    def release(self) -> None:
        """Close the connection."""
        self.driver.close()

    @property
    def _door(self) -> Semaphore | None:
        """Where it may find its way closed before it connects; None: nowhere."""
        if self._doors is None:
            return None
        return self._doors.lost_a_reply if self._lost_a_reply else self._doors.away

    def _notice_a_stall(self, now_s: float, command_pa: float) -> None:
        """Have a device that was left alone looked at before it is commanded; say so where this daemon stood still."""
        since_s, allowed_s = self._commanded_s if self._connected else self._returned_s, self.longest_unattended_s
        if now_s - since_s <= allowed_s:
            return
        self._connected = False
        if 0.0 <= now_s - self._begun_s <= allowed_s:  # it was set up meanwhile
            return
        self._unattended_s, self._was_away = now_s - since_s, True
        log_event(
            log,
            logging.ERROR,
            "the daemon stood still",
            unattended_s=round(self._unattended_s, 4),
            allowed_s=allowed_s,
            commanded_pa=command_pa,
        )

    def overwritten_pa(self) -> float | None:
        """Return what the device holds, if it is time to ask, and it is not what it was told."""
        told_pa, driver = self._told_pa, self._reads_back
        if not self._reads_back_now or told_pa is None or driver is None:
            return None
        self._read_back_s = self._sample.now_s
        self._read_backs += 1
        settings = self._keeps_settings
        if self._read_backs % SETTINGS_EVERY == 0 and settings is not None and settings.has_settings:
            self._require_settings(settings)
            return None
        held_pa = driver.held_pa()
        if abs(held_pa - told_pa) <= self._settings.read_back_tolerance_pa:
            return None
        self._told_pa = None
        self._say(logging.ERROR, "another master wrote the set point", held_pa=held_pa, told_pa=told_pa)
        return held_pa

    @property
    def _reads_back_now(self) -> bool:
        """Whether it is time to ask what the device holds."""
        every_s = self._settings.read_back_s
        if every_s == 0 or self._told_pa is None or self._reads_back is None:
            return False
        return self._sample.now_s - self._read_back_s >= every_s

    def _require_settings(self, driver: KeepsSettings) -> None:
        """Have a device looked at that has lost its settings."""
        if driver.settings_kept():
            return
        self._say(logging.ERROR, "the device has lost its time-out or action: it was restarted")
        self._connected, self._restarted, self._was_away = False, True, True

    def _found_again(self) -> Sample:
        """Connect anew, and look at what the device holds and says without commanding it."""
        self.driver.close()
        set_point_pa = self.driver.open()
        reading = self.driver.read()
        held_pa = self._in_force_pa(set_point_pa, reading)
        before, self._reading = self._reading, None
        self._told_pa = self._pressure_pa = None
        sample = self._fresh(reading, held_pa)._replace(
            held_pa=held_pa,
            unattended_s=self._unattended_s,
            restarted=self._restarted,
        )
        self._connected, self._refusals, self._unattended_s, self._restarted = True, 0, 0.0, False
        self._commanded_s = awake_s()
        self._say_found(held_pa, reading.status)
        repeated = before is not None and _same_sample(before, reading)
        return sample._replace(quality=REPEATED) if repeated else sample

    def _say_found(self, held_pa: float, status: int) -> None:
        """Say that the device is there: it is back, or was never reached before, or was but set up for long."""
        level, event = logging.INFO, "device is looked at after the set-up"
        if self._was_away:
            level, event = logging.WARNING, "device is back" if self._was_reached else "device is there"
        self._say(level, event, held_pa=held_pa, status=status)
        self._was_reached, self._was_away = True, False

    def _in_force_pa(self, set_point_pa: float, reading: Reading) -> float:
        """Return the command that holds the device where it is: its set point, or what it does in its place.

        Where it acts by itself, its pressure shows which of them; where it shows none, what it was told to do says it.
        One that is not ready, for it is operated locally, does what it shows.
        """
        acts_alone = bool(reading.status & DeviceStatus.COMMUNICATION_LOST)
        is_unready = bool(reading.status & DeviceStatus.NOT_READY)
        vented_pa, filled_pa = self._settings.vented_pa, self._settings.filled_pa
        shown_pa = reading.pressure_pa
        if shown_pa is None:
            by_itself_pa = {"vent": vented_pa, "fill": filled_pa} if acts_alone else {}
            return by_itself_pa.get(self._settings.acts_alone_by or "hold", set_point_pa)
        if acts_alone:
            return min((set_point_pa, vented_pa, filled_pa), key=lambda each: abs(each - shown_pa))
        return min(max(shown_pa, vented_pa), filled_pa) if is_unready else set_point_pa

    def _lose(self, error: DriverError) -> None:
        self.counts.lost_replies += 1
        kind = error.kind or type(error).__name__
        self._say(logging.WARNING, "no good reply", kind, reason=str(error))
        self._was_away = True
        self._sample = self._lost(NO_NUMBER if isinstance(error, NoNumber) else LOST)
        refused = isinstance(error, Refused)
        if self._connected and (isinstance(error, NoNumber) or (refused and self._refusals < MOST_REFUSALS)):
            self._refusals += refused
            return
        self.driver.close()
        self._lost_a_reply, self._connected = self._connected, False
        now_s = awake_s()
        self._backoff.failed(now_s, now_s - self._asked_s)

    def _lost(self, quality: Quality = LOST) -> Sample:
        now_s = self._pace.now_s(None)
        return self._sample._replace(
            now_s=now_s,
            quality=quality,
            held_pa=None,
            overwritten=False,
            unattended_s=0.0,
            restarted=False,
        )

    def _say(self, level: int, event: str, kind: str = "", **fields: object) -> None:
        """Log an event, each kind once a minute; then with how many were passed over."""
        passed = self._sayings.unsaid((event, kind), awake_s())
        if passed is not None:
            what = {"kind": kind} if kind else {}
            log_event(log, level, event, **what, **fields, **({"times_unsaid": passed} if passed else {}))

    def _fresh(self, reading: Reading, command_pa: float, before_pa: float | None = None) -> Sample:
        """Return a reading as a sample; it answers `command_pa`, and the command before it was `before_pa`."""
        now_s, travel = self._pace.now_s(reading.device_time_s), self._settings.travel
        repeated = self._count(reading)
        self._reading = reading
        return sample_of(
            now_s=now_s,
            time_s=now_s if reading.device_time_s is None else reading.device_time_s,
            position_m=reading.position_m if travel is None else travel.turned_m(reading.position_m),
            pressure_pa=self._acted_pa(reading, command_pa, before_pa),
            quality=REPEATED if repeated else GOOD,
            status=reading.status,
            emergency=reading.emergency,
        )

    def _acted_pa(self, reading: Reading, command_pa: float, before_pa: float | None) -> float:
        """Return the pressure that has acted since the sample before."""
        shown_pa = reading.pressure_pa
        if shown_pa is None:
            return command_pa if self._settings.in_lockstep or before_pa is None else before_pa
        if not self._settings.pressure_is_after:
            return shown_pa
        acted_pa, self._pressure_pa = self._pressure_pa, shown_pa
        return shown_pa if acted_pa is None else acted_pa

    def _began_anew(self, reading: Reading) -> bool:
        """Return whether the device's clock, or a long counter, runs from its beginning again: then it is looked at."""
        before = self._reading
        if before is None:
            return False
        if reading.device_time_s is not None and before.device_time_s is not None:
            return reading.device_time_s < before.device_time_s
        if reading.sample_counter is None or before.sample_counter is None:
            return False
        counted = self.driver.capabilities.counter_range
        return counted >= LONG_COUNTER and (reading.sample_counter - before.sample_counter) % counted > counted // 2

    def _count(self, reading: Reading) -> bool:
        """Count the samples that were missed; return whether this one came before."""
        before = self._reading
        if before is None:
            return False
        if reading.sample_counter is not None and before.sample_counter is not None:
            passed = reading.sample_counter - before.sample_counter
            if passed < 0:  # it began at 0 again
                passed %= self.driver.capabilities.counter_range
            self.counts.lost_samples += max(passed - 1, 0)
            return passed == 0
        return _same_sample(before, reading)


def first_reading(driver: Driver, tell: Callable[[NoReply], None]) -> tuple[float, Reading]:
    """Connect; return the command that the device holds, Pa, and a reading.

    A reply that is lost is told, and asked for again: one alone ends no daemon that runs, and so none that begins.

    Raises:
        DriverError: the device is not there or does not answer as it should.
    """
    for _ in range(TRIES_AT_START - 1):
        try:
            return driver.open(), driver.read()
        except NoReply as error:
            tell(error)
            driver.close()
    return driver.open(), driver.read()


def _same_sample(before: Reading, reading: Reading) -> bool:
    """Return whether a reading is of a sample that was read before, as counter and clock of the device say."""
    if reading.sample_counter is not None and reading.sample_counter != before.sample_counter:
        return False
    if reading.device_time_s is None:
        return reading.sample_counter is not None
    return reading.device_time_s == before.device_time_s


def awake_s() -> float:
    """Return the time on a clock that also runs while the gateway sleeps."""
    return time.clock_gettime(AWAKE)
