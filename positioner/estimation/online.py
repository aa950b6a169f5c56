"""Identification of a sticking valve, sample by sample: motion, identifier, friction and validity put together.

A record of the last N samples, one derivative window, goes ahead of the identifier: a sample is used when it leaves
the record at its old end. So when motion is detected, its beginning is still to come and time zero is put exactly
there; when the stem is found to have stopped, the samples of the standstill that were taken for motion are dropped
unused. The estimates are one derivative window old for that, and say so by `time_s`.

Where somebody refines (`Refinement`), the samples since the restart are to be fitted by maximum likelihood when the
window is complete: a job, which is taken (`taken_job`). The progress stays short of 1 until the result is back: it
replaces the algebraic one if it is acceptable. With eta_1 = 1 (`passive_identification`), no excitation will fill a
window: each ordinary move goes out when the stem has come to rest, with the posterior of the moves before it as the
prior (`passive_identification`).
"""

from collections import deque
from dataclasses import dataclass, replace
from math import hypot, inf, isfinite, nan

import numpy as np

from config.codes import Refusal, Sampling
from positioner.estimation.algebraic import Identifier
from positioner.estimation.array import Array
from positioner.estimation.batch import BatchResult, BatchSettings
from positioner.estimation.breakaway_force import after_event, with_validity
from positioner.estimation.derivatives import Derivatives
from positioner.estimation.estimates import NO_BREAKAWAY, Directions, Estimate, Estimates, no_estimate, no_estimates
from positioner.estimation.friction_estimator import RunningMeans
from positioner.estimation.motion_detector import MotionDetector, motion_start
from positioner.estimation.passive_identification import MovesPosterior, posterior_after
from positioner.estimation.refiner import Refinement, RefinementJob
from positioner.estimation.running_noise import PositionNoise
from positioner.estimation.sample_window import SampleWindow
from positioner.estimation.validity import ValidityCheck
from positioner.estimation.weighted_least_squares import Solution

READINGS = 16
"""Times per window at which (13) is solved."""
PROGRESS_WHILE_REFINING = 0.99
"""Progress while the refinement is awaited."""
GROSS = 1e-3
"""Of the stroke: residuals beyond this are not those of a loop in real time."""
REFINEMENT_TIMEOUT_S = 2.0
"""Time after which a refinement is no longer awaited."""
MOST_KEPT = 200_000
"""Samples kept for a refinement: a window at the seed's 10 us twice over."""
REST_BEFORE_S = 0.2
"""Of the rest before an excitation, that goes out with it: its first sample beyond says when it was taken."""
MOVE_REST_S = 0.2
"""Of the rest before a move, that goes out with it; and the longest time a move takes, below."""
MOVE_S = 3.0


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """How the identification is done.

    Attributes:
        stroke_m: full travel, the unit of position.
        pressure_pa: span of the actuator pressure, the unit of pressure.
        noise_std_m: standard deviation of the position's white noise, resolution / sqrt(12) included; None: measured.
        pressure_noise_std_pa: the same of the pressure. 1 Pa does what A / k_s = 1.2 um would do (the seed's valve).
        pressure_held: see `Identifier`.
        sampling: of the device, as it is said to be; by that each pressure that is given has acted until its sample.
        window_s: length of motion after which the identification is complete.
        minimum_window_s: length of motion before which nothing is estimated.
        derivative_window_s: length of the derivative filters.
        moving_threshold_m_per_s: velocity below which the stem counts as stopped; above the model's dead zone.
        largest_relative_std: standard deviation up to which an estimate is valid, as a share of its value.
    """

    stroke_m: float
    pressure_pa: float
    noise_std_m: float | None = None
    pressure_noise_std_pa: float = 0.0
    pressure_held: bool = True
    sampling: Sampling = Sampling.BEFORE
    window_s: float = 0.8
    minimum_window_s: float = 0.4
    derivative_window_s: float = 0.05
    moving_threshold_m_per_s: float = 1e-3
    largest_relative_std: float = 0.05

    def __post_init__(self) -> None:
        for name in ("stroke_m", "pressure_pa", "derivative_window_s", "moving_threshold_m_per_s"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, it is {getattr(self, name)!r}")
        if not 0 < self.minimum_window_s <= self.window_s:
            raise ValueError(
                f"minimum_window_s must be positive and at most window_s ({self.window_s!r} s), "
                f"it is {self.minimum_window_s!r}"
            )


class Identification:
    """The estimates of one valve from its samples.

    Attributes:
        estimates: what is known by now.
        velocity_m_per_s, acceleration_m_per_s2: (19), (21) at the latest sample; NaN until the filters are full.
        direction: of the detected motion, +1 up, -1 down, 0 none.
        moves: ordinary moves that gave acceptable estimates, by passive identification.
    """

    def __init__(self, settings: IdentificationSettings) -> None:
        self._settings = settings
        self._refinement: Refinement | None = None
        self._job: RefinementJob | None = None
        self._kept: list[tuple[float, float, float]] = []
        self._before: deque[tuple[float, float, float]] = deque()  # samples of a stem at rest
        self._awaited_since_s: float | None = None
        self._posterior: MovesPosterior | None = None
        self._broke_away, self._broke_away_s = NO_BREAKAWAY, 0.0
        self._passive = False
        self._sampling = settings.sampling  # as found out last
        self.moves = 0
        self._rest_in: int | None = None  # samples until a move's rest is long enough
        self._ended, self._ended_ago = 0, 0  # direction of the last motion if it was too short, samples since it ended
        self._turned = False  # whether the stem seemed to turn round without a rest: a sensor may have jumped
        self._identifier = Identifier(
            settings.window_s, settings.stroke_m, settings.pressure_pa, pressure_held=settings.pressure_held
        )
        self._record = SampleWindow(settings.derivative_window_s)
        self._noise = PositionNoise()
        self._derivatives = Derivatives()
        self._motion = MotionDetector(settings.moving_threshold_m_per_s)
        self._means = RunningMeans()
        self._solution: Solution | None = None  # the last whose b/c was valid
        self._requested = (False, False)
        self._relative_variance = inf  # of the estimates, by what was asked for last
        self._age = 0  # of the oldest sample in the record, in samples since the motion began
        self._clear_record()
        self._restart_window()
        self.estimates = no_estimates(Refusal.NOT_STARTED)

    @property
    def direction(self) -> int:
        """Direction of the detected motion."""
        return self._motion.direction

    def restart(self) -> None:
        """Begin a new identification: all is forgotten, but for (a, b, c) to find friction with."""
        self._clear_record()
        self._noise.restart()
        self._restart_window()
        self._kept = list(self._before)
        self._before.clear()
        self._awaited_since_s = self._rest_in = None
        self._ended, self._turned = 0, False
        self._relative_variance = inf
        self.estimates = no_estimates(Refusal.WAITING_FOR_MOTION)

    def look_on(self, time_s: float, position_m: float, pressure_pa: float, *, at_rest: bool) -> None:
        """Take a fresh sample while nothing is identified: where the stem rests tells when it leaves."""
        before = self._before
        if not at_rest or (before and not 0.0 < time_s - before[-1][0] < REST_BEFORE_S):
            before.clear()
        if at_rest and isfinite(position_m) and isfinite(pressure_pa):
            before.append((time_s, position_m, pressure_pa))
            while time_s - before[0][0] > REST_BEFORE_S:
                before.popleft()

    def update(
        self,
        time_s: float,
        position_m: float,
        pressure_pa: float,
        *,
        parameters: bool,
        friction: bool,
        passive: bool = False,
        refinement: Refinement | None = None,
    ) -> Estimates:
        """Take a fresh sample.

        A gap as long as the record, or a clock that does not advance, breaks the record, which then begins anew. A
        sample with a value that is not a finite number counts as missing.

        Args:
            time_s: the device's time stamp.
            position_m: stem position.
            pressure_pa: actuator pressure.
            parameters: whether to identify a, b, c.
            friction: whether to estimate k, from a, b, c of this identification or of the last one.
            passive: whether the stem moves as the DCS asks, without excitation.
            refinement: as it stands; None where nobody refines.
        """
        if not (isfinite(time_s) and isfinite(position_m) and isfinite(pressure_pa)):
            return self.estimates
        if (parameters, friction) != self._requested:
            self._request(parameters, friction)
        self._refinement = refinement
        self._passive = passive and refinement is not None
        self._take(time_s, position_m, pressure_pa)
        if refinement is not None:
            self._refine(refinement, time_s, position_m, pressure_pa)
        if self._record.full:
            self._detect_motion()
            wanted = any(self._requested) and not self._complete and not self._passive
            if wanted and self._motion.direction and self._age >= 0:
                self._collect()
        return self.estimates

    @property
    def _noise_std_m(self) -> float:
        known = self._settings.noise_std_m
        return self._noise.std_m if known is None else known

    def taken_job(self) -> RefinementJob | None:
        """Return the job that is to be done since the last update, once."""
        job, self._job = self._job, None
        return job

    def _refine(self, refinement: Refinement, time_s: float, position_m: float, pressure_pa: float) -> None:
        """Keep the sample, hand out what is complete, take what comes back."""
        kept = self._kept
        if kept and time_s <= kept[-1][0]:
            kept.clear()
        kept.append((time_s, position_m, pressure_pa))
        if len(kept) > MOST_KEPT or (self._passive and time_s - kept[0][0] > 2 * MOVE_S):
            del kept[: len(kept) // 2]
        if self._rest_in is not None:
            self._rest_in -= 1
            if self._rest_in <= 0:
                self._rest_in = None
                self._hand_out(time_s)
        if refinement.result is not None:
            self._take_refined(refinement.result, time_s)
        elif self._awaited_since_s is not None and (
            not refinement.pending or time_s - self._awaited_since_s > REFINEMENT_TIMEOUT_S
        ):
            self._awaited_since_s = None
            self.estimates = replace(self.estimates, progress=1.0)

    def _hand_out(self, time_s: float) -> None:
        """Let what was kept be fitted; what nobody takes, for a job is under way or nobody is there, is not awaited."""
        settings = self._settings
        stamps_s, position_m, shown_pa = np.array(self._kept).T
        if settings.sampling is Sampling.AFTER:  # they were taken a sample late
            shown_pa = np.append(shown_pa[1:], shown_pa[-1:])
        # What an excitation has found out holds for ordinary moves, too.
        checked = Sampling.UNKNOWN if self._passive else settings.sampling
        if self._passive and self._sampling is Sampling.AFTER:
            shown_pa = np.append(shown_pa[:1], shown_pa[:-1])
        asked = BatchSettings(
            noise_std_m=settings.noise_std_m,
            pressure_noise_std_pa=settings.pressure_noise_std_pa,
            pressure_held=settings.pressure_held,
            sampling=checked,
            moving_threshold_m_per_s=settings.moving_threshold_m_per_s,
            largest_relative_std=settings.largest_relative_std,
        )
        prior = self._posterior.prior(time_s) if self._passive and self._posterior is not None else None
        self._job = RefinementJob(stamps_s, position_m, shown_pa, asked, prior)
        if not self._passive:
            self._awaited_since_s = time_s
        else:
            self._kept = [each for each in self._kept if each[0] > time_s - MOVE_REST_S]

    def _take_refined(self, result: BatchResult, time_s: float) -> None:
        self._awaited_since_s = None
        fits = result.fit is not None and result.estimates.b_over_c.reason is not Refusal.MODEL_DOES_NOT_FIT
        if result.fit is not None and fits:
            before = self._posterior if self._passive else None
            self._posterior = posterior_after(before, result.fit, time_s, result.estimates.directions)
        parameters, friction = self._requested
        refined = result.estimates.only(parameters=parameters, friction=friction)
        if self._passive and self._posterior is not None:
            refined = replace(refined, directions=self._posterior.directions)
        if not self._passive:
            refined = replace(refined, sampling=result.sampling)
            self._sampling = result.sampling or self._settings.sampling
        if refined.acceptable:
            broke_before = self._broke_away if self._passive else NO_BREAKAWAY
            broke_away = after_event(broke_before, refined.breakaway, time_s - self._broke_away_s)
            self._broke_away, self._broke_away_s = broke_away, time_s
            self.estimates = replace(refined, breakaway=with_validity(broke_away, self._settings.largest_relative_std))
            self.moves += self._passive
        elif not self._passive:
            # Of samples that are far from any motion of the model the integrals know nothing either, nor of pressures
            # that act otherwise than was said. A loop in real time, whose commands come into force a little early or
            # late, stays well below.
            gross_m = GROSS * self._settings.stroke_m
            gross = result.fit is not None and result.fit.residual_std_m > gross_m
            less_sure = self._less_sure(result.open_share)
            refused = self._sampling is not self._settings.sampling or result.contradicted or (not fits and gross)
            refused = refused or (self.estimates.acceptable and not less_sure.acceptable)
            self.estimates = refined if refused else replace(less_sure, progress=1.0)

    def _less_sure(self, open_share: Array | None) -> Estimates:
        """Return the estimates, b/c and k/c known to no better than shares, those of a fit, say they are."""
        if open_share is None:
            return self.estimates
        slope, friction = self.estimates.b_over_c, self.estimates.k_over_c
        slope, friction = self._known_to(slope, open_share[4]), self._known_to(friction, open_share[5])
        return replace(self.estimates, b_over_c=slope, k_over_c=friction)

    def _known_to(self, each: Estimate, share: float) -> Estimate:
        """Return an estimate of which a share is open."""
        if not each.valid:
            return each
        std = hypot(each.std, share * each.value)
        unsure = not std <= self._settings.largest_relative_std * abs(each.value)
        return replace(each, std=std, reason=Refusal.TOO_UNCERTAIN if unsure else Refusal.VALID)

    def _request(self, parameters: bool, friction: bool) -> None:
        self._requested = (parameters, friction)
        self._relative_variance = inf  # what was known before gives way to whatever is acceptable
        self._restart_window()
        if any(self._requested) and not self.estimates.acceptable:
            self.estimates = no_estimates(Refusal.WAITING_FOR_MOTION)

    def _restart_window(self) -> None:
        self._collecting = self._complete = False
        self._elapsed_s = 0.0

    def _take(self, time_s: float, position_m: float, pressure_pa: float) -> None:
        """Append a sample to the record, or begin a new one with it."""
        record = self._record
        if record.breaks(time_s):
            self._kept.clear()
            self._clear_record()
            self._interrupt(Refusal.RECORD_BROKEN)
        record.append(time_s, position_m, pressure_pa)

    def _clear_record(self) -> None:
        self._record.clear()
        self._motion.stop()
        self._until_block = 0
        self.velocity_m_per_s = self.acceleration_m_per_s2 = nan

    def _detect_motion(self) -> None:
        """Take the derivatives at the latest sample and find whether, and since when, the stem moves."""
        record = self._record
        time_s, position_m = record.time_s, record.position_m
        velocity, acceleration, slope = self._derivatives.estimate(time_s, position_m)
        record.set_derivatives(velocity, acceleration)
        self.velocity_m_per_s, self.acceleration_m_per_s2 = velocity, acceleration

        if not self._until_block:
            self._noise.add(position_m)
            self._until_block = record.length
        self._until_block -= 1
        noise_m = self._noise_std_m
        before = self._motion.direction
        direction = self._motion.update(slope, self._derivatives.slope_gain * noise_m)
        self._age += 1
        self._ended_ago += 1
        if direction == before:
            return
        if before:
            unexamined = self._elapsed_s < self._settings.minimum_window_s
            self._ended, self._ended_ago = before if unexamined else 0, 0
            self._interrupt(Refusal.MOTION_ENDED)
            if self._passive and any(self._requested):
                self._rest_in = record.length
        if direction:
            self._age = -motion_start(position_m, direction, noise_m)
            self._turned = self._turned or self._turns_against_the_pressure(direction)

    def _turns_against_the_pressure(self, direction: int) -> bool:
        """Whether a stem seems to turn round soon after a motion too short to examine, though the pressure does not."""
        record = self._record
        soon = direction == -self._ended and self._ended_ago <= 2 * record.length
        return soon and direction * float(record.pressure_pa[-1] - record.pressure_pa[0]) <= 0.0

    def _collect(self) -> None:
        """Use the oldest sample of the record, on its way out."""
        time_s, position_m, pressure_pa, velocity, acceleration = self._record.oldest()
        if not self._collecting:
            self._collecting = True
            self._identifier.restart()
            self._means.restart()
            self._zero_s, self._next_reading_s = time_s, 0.0
        parameters, friction = self._requested
        if parameters:
            self._identifier.update(time_s, position_m, pressure_pa)
        settings = self._settings
        self._elapsed_s = time_s - self._zero_s
        # The jerk with which motion begins is no polynomial: the filters' window has to be clear of it.
        settled = self._age >= self._record.length - 1 and self._elapsed_s >= settings.minimum_window_s / 2
        if friction and settled:
            if settings.pressure_held:  # the step at this instant counts half before it, half after it
                pressure_pa = float(self._record.pressure_pa[:2].sum()) / 2
            self._means.add(acceleration, velocity, position_m, pressure_pa)
        self._complete = self._elapsed_s >= settings.window_s
        if self._elapsed_s >= self._next_reading_s or self._complete:
            self._next_reading_s += settings.window_s / READINGS
            self._publish(self._read(time_s))
        if self._complete and self._refinement is not None and not self._passive:
            self._hand_out(float(self._record.time_s[-1]))
            self.estimates = replace(self.estimates, progress=PROGRESS_WHILE_REFINING)

    def _read(self, time_s: float) -> Estimates:
        """Return what the window says so far."""
        progress = min(1.0, self._elapsed_s / self._settings.window_s)
        if self._elapsed_s < self._settings.minimum_window_s:
            return replace(no_estimates(Refusal.WINDOW_TOO_SHORT), progress=progress)
        if self._turned and not self._passive:
            return replace(no_estimates(Refusal.MODEL_DOES_NOT_FIT), progress=progress)
        a, b, c, b_over_c = self._read_parameters()
        k, k_over_c = self._read_friction()
        directions = Directions(self._motion.direction)
        return Estimates(a, b, c, k, b_over_c, k_over_c, progress=progress, time_s=time_s, directions=directions)

    def _read_parameters(self) -> tuple[Estimate, Estimate, Estimate, Estimate]:
        if not self._requested[0]:
            return (no_estimate(Refusal.NOT_ASKED),) * 4
        solution = self._identifier.solve(self._noise_std_m, self._settings.pressure_noise_std_pa)
        if solution is None:
            return (no_estimate(Refusal.ILL_CONDITIONED),) * 4
        a, b, c, b_over_c = self._validity_check().parameters(solution)
        if b_over_c.valid:
            self._solution = solution
        return a, b, c, b_over_c

    def _read_friction(self) -> tuple[Estimate, Estimate]:
        if not self._requested[1]:
            return (no_estimate(Refusal.NOT_ASKED),) * 2
        if self._solution is None:
            return (no_estimate(Refusal.PARAMETERS_MISSING),) * 2
        means = self._means.means(self._derivatives.weights)
        if means is None:
            return (no_estimate(Refusal.WINDOW_TOO_SHORT),) * 2
        return self._validity_check().friction(self._solution, means, self._motion.direction)

    def _validity_check(self) -> ValidityCheck:
        settings = self._settings
        noise_m, noise_pa = self._noise_std_m, settings.pressure_noise_std_pa
        return ValidityCheck(settings.largest_relative_std, noise_m, noise_pa, settings.stroke_m)

    def _publish(self, fresh: Estimates) -> None:
        """Take fresh estimates, unless an earlier motion gave estimates with a smaller variance."""
        relative_variance = fresh.relative_variance if fresh.acceptable else inf
        if relative_variance < self._relative_variance or not self.estimates.acceptable:
            self.estimates = replace(fresh, breakaway=self.estimates.breakaway)
            self._relative_variance = relative_variance
        else:
            self.estimates = replace(self.estimates, progress=fresh.progress)

    def _interrupt(self, reason: Refusal) -> None:
        """Close the window; say why if it was too short to have given anything."""
        if self._complete or not any(self._requested):
            return
        if self._elapsed_s < self._settings.minimum_window_s and not self.estimates.acceptable:
            self.estimates = no_estimates(reason)
        self._restart_window()
