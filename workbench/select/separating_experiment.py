"""The experiment that separates valves which the recordings so far do not tell apart.

Each input of a menu is played to one valve; its rivals are then refitted to what it answers. The separation is the rms
error that the worst-placed rival is left with, in units of the noise; the input with the largest is chosen. What a
refit can imitate separates nothing, however different the two looked before.

Every input stays within the commands of the recordings and holds its first level until the valve has settled, so that
it can be played to a valve at rest, or by `positioner simulate VALVE.toml --input FILE`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config.recording import Recording
from config.results.result import Brief
from config.whole_file import beside
from sim.composition import Composition
from sim.open_loop import respond
from workbench.data.noise_floor import with_noise
from workbench.data.record import Record, ready
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import problem_of
from workbench.fit.likelihood import soft_weight
from workbench.fit.minimiser import derivatives
from workbench.fit.onsets import with_onsets
from workbench.fit.threads import on_threads
from workbench.select.selection_thresholds import SELECTION

LENGTH_S = 24.0
"""Of an input of the menu: small steps last half a second, others a second and more."""
REST_S = 2.0
"""Held at its first level before."""
MARGIN = 0.02
"""Of the range of the commands, kept free at both ends."""

Command = NDArray[np.float64]
Shape = Callable[[Command], Command]


@dataclass(frozen=True, slots=True, repr=False)
class Experiment(Brief):
    """An input, and by how many times the noise it separates the least distinct pair."""

    name: str
    separation: float
    time_s: Command
    command_pa: Command

    @property
    def separates(self) -> bool:
        """Whether the wrong rival leaves more than noise."""
        return self.separation >= SELECTION.noise_known_to

    @property
    def sentence(self) -> str:
        """Which input it is, and what it is worth."""
        if self.separates:
            return f"{self.name}; a refit of the wrong rival leaves {self.separation:.3g} times the noise"
        return f"no input of the menu tells all rivals apart; after the best, {self.name}, a refit leaves noise alone"

    def write(self, path: Path) -> None:
        """Write `time_s, command_pa`."""
        rows = zip(self.time_s.tolist(), self.command_pa.tolist(), strict=True)
        text = "".join(f"{time:.6g},{command:.6g}\n" for time, command in rows)
        with beside(path) as new:
            new.write_text(f"# experiment: {self.name}\ntime_s,command_pa\n{text}", encoding="utf-8")


def _steps(phase: Command) -> Command:
    """Steps of rising height, up and down, with holds."""
    k = np.floor(phase * 16).astype(int)
    return np.asarray(np.where(k % 2 == 0, 0.1, 0.1 + 0.055 * (k + 1)))


def _ramps(phase: Command) -> Command:
    """Slow ramps up and down, each faster than the one before."""
    edges = np.cumsum([0.0, 0.36, 0.24, 0.16, 0.12, 0.07, 0.05])
    return np.asarray(np.interp(phase, edges, [0.05, 0.95, 0.05, 0.95, 0.05, 0.95, 0.05]))


def _restarts(phase: Command) -> Command:
    """Ramps up and down broken by holds of different lengths, so that motion restarts the way it went."""
    edges = np.array([0, 0.06, 0.10, 0.16, 0.24, 0.30, 0.42, 0.48, 0.56, 0.60, 0.68, 0.74, 0.84, 0.90, 1.0])
    levels = np.array([0.05, 0.35, 0.35, 0.6, 0.6, 0.95, 0.95, 0.7, 0.7, 0.45, 0.45, 0.25, 0.25, 0.05, 0.05])
    return np.asarray(np.interp(phase, edges, levels))


def _small_steps(phase: Command) -> Command:
    """Small steps against a stuck stem round three levels, with a larger one between."""
    k = np.floor(phase * 48).astype(int)
    return 0.2 + 0.3 * (k // 16) + 0.02 * (k % 8) * (-1.0) ** k


def _triangle(phase: Command) -> Command:
    """Triangle of growing amplitude round the middle."""
    return np.asarray(0.5 + 0.48 * phase * np.interp(phase * 8 % 1, [0, 0.25, 0.75, 1], [0, 1, -1, 0]))


def _staircase(phase: Command) -> Command:
    """A stair up and down, in equal small stairs."""
    return 0.05 + 0.9 * np.round(20 * (1.0 - np.abs(2.0 * phase - 1.0))) / 20


def _bursts(phase: Command) -> Command:
    """Fast reversals, then a hold, at several levels."""
    fast = np.sign(np.sin(2 * np.pi * 80 * phase)) * (phase * 4 % 1 < 0.6)
    return 0.3 + 0.13 * np.floor(phase * 4) + 0.2 * fast


MENU: Mapping[str, Shape] = {
    "steps of rising height": _steps,
    "ramps of rising speed": _ramps,
    "restarts in the same direction after holds": _restarts,
    "small steps against the stuck stem": _small_steps,
    "triangle of growing amplitude": _triangle,
    "staircase": _staircase,
    "bursts of fast reversals": _bursts,
}
"""Commands between 0 and 1, over a phase from 0 to 1."""


def experiment(fits: Sequence[Fit], record: Record, *, seed: int = 0, workers: int | None = None) -> Experiment:
    """Choose the input that best tells these fitted valves apart.

    Args:
        fits: two or more.
        record: gives the range of the commands, the period and the noise.
        seed: of the noise.
        workers: threads, by default one a core.
    """

    def rated(name: str) -> Experiment:
        time_s, command_pa = _input(MENU[name], record)
        return Experiment(name, _separation(fits, time_s, command_pa, record, seed), time_s, command_pa)

    return max(on_threads(rated, list(MENU), workers), key=lambda each: each.separation)


def _input(shape: Shape, record: Record) -> tuple[Command, Command]:
    least, most = float(record.command_pa.min()), float(record.command_pa.max())
    time_s = np.asarray(record.period_s * np.arange(round((REST_S + LENGTH_S) / record.period_s)), dtype=np.float64)
    phase = np.clip((time_s - REST_S) / LENGTH_S, 0.0, 1.0 - 1e-9)
    level = np.where(time_s < REST_S, shape(np.zeros(1))[0], shape(phase))
    command_pa = least + (most - least) * np.clip(level, MARGIN, 1.0 - MARGIN)
    return time_s, np.asarray(command_pa, dtype=np.float64)


def _separation(fits: Sequence[Fit], time_s: Command, command_pa: Command, record: Record, seed: int) -> float:
    """Return the least error, in units of the noise, that a rival refitted to another's answer is left with."""
    return min(
        _left(answer, rival)
        for truth, answer in _answers(fits, time_s, command_pa, record.scale_m, seed)
        for rival in fits
        if rival is not truth
    )


def _answers(
    fits: Sequence[Fit], time_s: Command, command_pa: Command, noise_m: float, seed: int
) -> Iterator[tuple[Fit, Record]]:
    for truth in fits:
        composition = Composition.from_file(truth.valve)
        periods_s = np.diff(time_s)
        step_s = min(float(periods_s.max()), composition.step_s)
        response = respond(composition, composition.theta, command_pa[:-1], periods_s, step_s=step_s)
        noise = noise_m * np.random.default_rng(seed).standard_normal(time_s.size)
        columns = {"time_s": time_s, "command_pa": command_pa, "position_m": response.indicated_m + noise}
        # The first hold brings the valve from rest to where the input begins: a free run starts after it.
        settled = time_s >= REST_S
        yield truth, ready(with_noise(Recording({name: column[settled] for name, column in columns.items()}), noise_m))


def _left(answer: Record, rival: Fit) -> float:
    """Return the rms residual of the rival on an answer, told when the stem moves, less what its parameters take up.

    What these take up is worked out by their derivatives: one step of a refit tells inputs apart.
    """
    of, composition = problem_of(rival, answer), Composition.from_file(rival.valve)
    like = of.likelihood(composition, tuple(rival.parameters))
    onsets_s, groups = with_onsets(like, composition.theta)
    jacobian = derivatives(like, like.coordinates(composition.theta), onsets_s)
    weight = np.sqrt(soft_weight(groups.whole))
    r = weight * groups.whole
    left = r - (weight[:, None] * jacobian) @ np.linalg.lstsq(weight[:, None] * jacobian, r)[0]
    return float(np.sqrt(np.mean(left**2)))
