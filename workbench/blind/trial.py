"""A trial of a known valve: it answers a command, after a lead-in that is not recorded. `hiding` draws the valve.

The lead-in is what precedes the last passage of the command, so that the first passage begins as its repetition does.

    dirty     pressure noise between command and valve, an autoregression of 300 Pa and 0.2 s; static friction drawn
              anew at each stop, 4 % standard deviation, never below Coulomb friction; a 12-bit transmitter

`refitted_rmse_m` is what a valve without something misses of such a trial at its best, spring and friction refitted by
scipy to the clean answer from the true values: no code is shared with `workbench.fit.fitting`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from config.recording import Column, Recording
from config.slave_file import Sensor
from config.valve_file import ValveFile
from sim.composition import COULOMB, SPRING, STATIC, VISCOUS, Composition
from sim.karnopp import TOLERANCE, Vector, read
from sim.open_loop import INDICATED, PATH_ROWS, PRESSURE, STEP_S, at_rest, follow
from sim.transmitter import Transmitter
from workbench.blind.input_signal import lead_in
from workbench.compare.measures import rms

NOISE_M = 5e-5
LEAD_IN_S = 5.0
PRESSURE_NOISE_PA, CORRELATION_S = 300.0, 0.2
BREAK_AWAY_JITTER = 0.04  # of static friction, standard deviation from slip to slip
LEVELS = 2**12
DISTURBED_EVERY_S = 2e-3
PRESSURE_STEP_PA = 100.0
"""Of the measured pressure: whole millibars."""
COARSE_S = 1e-3
"""Step of the refit."""
SCALES = ((100.0, 1e-3), (30.0, 3e-4), (5.0, 1e-4))
"""Of the soft-L1 loss, in standard deviations of the noise, and of the differences, as the cost is a staircase."""
MOST_LOG_STATIC = 1.6
"""log(F_s / F_c) at most."""


class Answer(NamedTuple):
    """What a valve indicates at the samples, m, (n,), before the transmitter, and the pressure in its actuator, Pa."""

    indicated_m: Column
    pressure_pa: Column


@dataclass(frozen=True, slots=True)
class Trial:
    """A command, Pa, held for a period, s, from each of its n samples to the next."""

    command_pa: Column
    period_s: float

    def answer_m(self, composition: Composition, theta: Vector, step_s: float = STEP_S) -> Column:
        """Return what a clean valve indicates at the samples, m, (n,); theta, (parameters,), as `Composition.names`."""
        return self.answer(composition, theta, step_s).indicated_m

    def answer(self, composition: Composition, theta: Vector, step_s: float = STEP_S) -> Answer:
        """Return what a clean valve answers; arguments as of `answer_m`."""
        vector = theta.copy()
        state = self._before(composition, vector)
        follow(composition, vector, state, self.lead_in_pa, self.period_s, step_s)
        response = follow(composition, vector, state, self.command_pa[:-1], self.period_s, step_s)
        return Answer(response.indicated_m, response.pressure_pa)

    def with_disturbances(self, composition: Composition, generator: np.random.Generator) -> Answer:
        """Return what a dirty valve answers."""
        parts = max(1, round(self.period_s / DISTURBED_EVERY_S))
        h = self.period_s / parts
        commands = np.repeat(np.concatenate([self.lead_in_pa, self.command_pa[:-1]]), parts)
        commands += _pressure_noise(generator, commands.size, h)
        theta = composition.theta.copy()
        state = self._before(composition, theta)
        command_pa, path = np.empty(1), np.empty((PATH_ROWS, 2))
        go_on = composition.kernel.respond.bound(theta, state, command_pa, np.array([h]), STEP_S, TOLERANCE, path)
        answers, moved = [(read(state).indicated, read(state).p)], True
        for command in commands.tolist():
            rests = read(state).v == 0.0
            if moved and rests:
                varied = 1.0 + BREAK_AWAY_JITTER * generator.standard_normal()
                theta[STATIC] = max(theta[COULOMB], composition.theta[STATIC] * varied)
            moved = not rests
            command_pa[0] = command
            go_on()
            answers.append((path[INDICATED, -1], path[PRESSURE, -1]))
        return Answer(*np.array(answers[self.lead_in_pa.size * parts :: parts]).T)

    def recording(self, indicated_m: Column, sensor: Sensor, pressure_pa: Column | None = None) -> Recording:
        """Return the recording that a transmitter makes of indicated positions, m, and another of pressures, Pa, (n,).

        None: the pressure is not measured.
        """
        transmitter = Transmitter(sensor)
        columns = {
            "time_s": np.arange(self.command_pa.size) * self.period_s,
            "command_pa": self.command_pa,
            "position_m": np.array([transmitter.measure(each) for each in indicated_m.tolist()]),
        }
        if pressure_pa is not None:
            columns["pressure_pa"] = PRESSURE_STEP_PA * np.round(pressure_pa / PRESSURE_STEP_PA)
        return Recording(columns, {"source": "positioner hide"})

    @property
    def lead_in_pa(self) -> Column:
        """The commands before the recorded ones, Pa, (lead-in samples,)."""
        return lead_in(self.command_pa, round(LEAD_IN_S / self.period_s))

    def _before(self, composition: Composition, theta: Vector) -> Vector:
        """Return the state before the lead-in: at rest in the middle of the stroke, in balance with the spring."""
        valve = composition.valve
        middle_m = 0.5 * valve.stroke_m
        balanced_pa = valve.spring_n_per_m * middle_m / valve.diaphragm_area_m2
        return at_rest(composition, theta, -self.lead_in_pa.size * self.period_s, middle_m, balanced_pa)


def _pressure_noise(generator: np.random.Generator, count: int, period_s: float) -> Column:
    kept = float(np.exp(-period_s / CORRELATION_S))
    noise = PRESSURE_NOISE_PA * generator.standard_normal(count)
    for i in range(1, count):
        noise[i] = kept * noise[i - 1] + np.sqrt(1.0 - kept**2) * noise[i]
    return noise


def refitted_rmse_m(trials: Sequence[Trial], answers: Sequence[Column], without: ValveFile) -> list[float]:
    """Return the rms distance, m, of a valve refitted to what the true one answers in the first trial, by trial."""
    known = Composition.from_file(without)
    first = trials[0]

    def error(z: Vector) -> Column:
        return (first.answer_m(known, _theta(known, z), COARSE_S) - answers[0]) / NOISE_M

    start = known.theta
    z = np.log([start[SPRING], start[VISCOUS], start[COULOMB], start[STATIC] / start[COULOMB]])
    lower, upper = z - 1.0, z + 1.0
    lower[-1], upper[-1] = 0.0, MOST_LOG_STATIC
    z = np.clip(z, lower + 1e-6, upper - 1e-6)
    for scale, difference in SCALES:
        found = least_squares(
            error, z, bounds=(lower, upper), loss="soft_l1", f_scale=scale, diff_step=[difference], max_nfev=8
        )
        z = np.clip(found.x, lower + 1e-6, upper - 1e-6)
    theta = _theta(known, z)
    return [rms(trial.answer_m(known, theta) - answer) for trial, answer in zip(trials, answers, strict=True)]


def _theta(composition: Composition, z: Vector) -> Vector:
    theta = composition.theta.copy()
    spring, viscous, coulomb, ratio = np.exp(z).tolist()
    theta[[SPRING, VISCOUS, COULOMB, STATIC]] = spring, viscous, coulomb, coulomb * ratio
    return theta
