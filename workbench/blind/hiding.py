"""Recordings of a valve with a hidden effect, to try the workbench on: which effect is hidden, and how strong.

    F_c 250 to 1424 N, F_s / F_c 1.05 to 1.35, k_s +-20 %, F_v x 0.5 to 3; all else is the shipped valve's

Each effect's parameters lie between two neighbouring starts that it declares, log-uniformly where they have one sign.
An effect is visible where the valve without it, spring and friction refitted, misses at least half the floor in the
record to be fitted; the floor is what the true valve itself misses: noise, and the dirt. Strengths with which the stem
moves through less than a tenth of its stroke are drawn again: a supply below break-away hides everything.

The same seed draws the same; the bare valve and the commands do not depend on the effects or the dirt.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

from config.arguments import kinds_held
from config.errors import InputError
from config.recording import Recording
from config.results.result import Brief
from config.slave_file import Sensor
from config.valve_file import EffectTable, ValveFile, ValveParameters, find_valve, load_valve
from sim.composition import Composition
from sim.effect import Effect, find_effects, first_effects, shipped_effect
from workbench.blind.input_signal import excitation
from workbench.blind.trial import LEVELS, NOISE_M, Answer, Trial, refitted_rmse_m
from workbench.compare.measures import rms

VISIBLE_FLOORS = 0.5  # a valve without the effect misses as much as half the floor
LEAST_TRAVEL = 0.1
"""Of the stroke, in either record."""

Draw = np.random.Generator


@dataclass(frozen=True, slots=True, repr=False)
class Hidden(Brief):
    """Two recordings, what an engineer knows of the valve, and the answer."""

    base: ValveFile
    fit: Recording
    test: Recording
    truth: ValveFile
    answer: Mapping[str, Any]
    """What is sealed: `salt, seed, dirty, effects, valve, floor_m`, and how far each effect is `visible`."""


@kinds_held
def hide(
    seed: int,
    *,
    effects: int | Sequence[str] = 1,
    dirty: bool = False,
    pressure: bool = False,
    duration_s: float = 30.0,
    period_s: float = 0.01,
) -> Hidden:
    """Draw a valve, its effects and two recordings.

    Args:
        seed: of all that is drawn.
        effects: how many are drawn and hidden, or which: names, or paths of own effects' files.
        dirty: see `workbench.blind.trial`.
        pressure: whether the pressure in the actuator is measured besides.
        duration_s: of each recording.
        period_s: of its samples.

    Raises:
        InputError: an unknown effect, a negative seed, or a duration that holds no sample.
    """
    if seed < 0:
        raise InputError("seed", f"must be 0 or more, got {seed}")
    if not 0.0 < period_s <= duration_s < inf:
        raise InputError("period_s", f"must be above 0 and at most duration_s, got {period_s:g} of {duration_s:g} s")
    streams = np.random.SeedSequence(seed).spawn(5)
    for_valve, for_effects, for_fit, for_test, for_salt = map(np.random.default_rng, streams)
    valve = draw_valve(for_valve)
    known = guess_valve(valve, for_valve)
    drawn = draw_effects(for_effects, effects) if isinstance(effects, int) else find_effects(effects, "effects")
    count = round(duration_s / period_s) + 1
    trials = [Trial(excitation(known, each, count), period_s) for each in (for_fit, for_test)]
    truth, answers = _moving(trials, drawn, valve, known, for_effects)
    fit, test = (
        _record_trial(trial, truth, clean, generator, dirty=dirty, pressure=pressure)
        for trial, clean, generator in zip(trials, answers, (for_fit, for_test), strict=True)
    )
    answer = {
        "salt": for_salt.bytes(16).hex(),
        "seed": seed,
        "dirty": dirty,
        "effects": [{"name": each.name, **each.parameters} for each in truth.effect],
        "valve": valve.model_dump(exclude={"kind"}),
        "floor_m": {"fit": fit[1], "test": test[1]},
        "visible": {each.name: _visible(trials, answers, truth, each, fit[1]) for each in truth.effect},
    }
    return Hidden(ValveFile(valve=known), fit[0], test[0], truth, answer)


def _moving(
    trials: Sequence[Trial], drawn: Sequence[Effect], valve: ValveParameters, known: ValveParameters, generator: Draw
) -> tuple[ValveFile, list[Answer]]:
    """Draw strengths until the stem moves in every trial; return the valve, and what it answers when clean."""
    while True:
        truth = ValveFile(valve=valve, effect=tuple(strength(each, valve, known, generator) for each in drawn))
        composition = Composition.from_file(truth)
        answers = [trial.answer(composition, composition.theta) for trial in trials]
        if all(np.ptp(each.indicated_m) > LEAST_TRAVEL * valve.stroke_m for each in answers):
            return truth, answers


def _record_trial(
    trial: Trial, truth: ValveFile, clean: Answer, generator: Draw, *, dirty: bool, pressure: bool
) -> tuple[Recording, float]:
    """Return the recording and its floor, m."""
    quantum_m = truth.valve.stroke_m / LEVELS if dirty else 0.0
    sensor = Sensor(noise_std_m=NOISE_M, quantum_m=quantum_m, seed=int(generator.integers(2**32)))
    answer = trial.with_disturbances(Composition.from_file(truth), generator) if dirty else clean
    recording = trial.recording(answer.indicated_m, sensor, answer.pressure_pa if pressure else None)
    return recording, rms(recording.position_m - clean.indicated_m)


def _visible(
    trials: Sequence[Trial], answers: Sequence[Answer], truth: ValveFile, effect: EffectTable, floor_m: float
) -> dict[str, Any]:
    others = tuple(each for each in truth.effect if each is not effect)
    clean_m = [each.indicated_m for each in answers]
    fit_m, test_m = refitted_rmse_m(trials, clean_m, ValveFile(valve=truth.valve, effect=others))
    return {"fit_m": fit_m, "test_m": test_m, "is_visible": fit_m > VISIBLE_FLOORS * floor_m}


def draw_valve(generator: Draw) -> ValveParameters:
    """Draw a bare valve near the shipped one."""
    shipped = load_valve(find_valve("seed")).valve
    coulomb_n = _between(generator, 250.0, 1424.0)
    return shipped.model_copy(
        update={
            "name": "hidden",
            "spring_n_per_m": shipped.spring_n_per_m * generator.uniform(0.8, 1.2),
            "viscous_ns_per_m": shipped.viscous_ns_per_m * _between(generator, 0.5, 3.0),
            "coulomb_n": coulomb_n,
            "static_n": coulomb_n * generator.uniform(1.05, 1.35),
        }
    )


def guess_valve(valve: ValveParameters, generator: Draw) -> ValveParameters:
    """Return what an engineer knows of a valve: the drawing's spring, and guesses of friction."""
    coulomb_n = valve.coulomb_n * _between(generator, 0.75, 1.33)
    return valve.model_copy(
        update={
            "spring_n_per_m": valve.spring_n_per_m * generator.uniform(0.9, 1.1),
            "viscous_ns_per_m": valve.viscous_ns_per_m * _between(generator, 0.5, 2.0),
            "coulomb_n": coulomb_n,
            "static_n": coulomb_n * generator.uniform(1.05, 1.35),
        }
    )


def draw_effects(generator: Draw, count: int) -> list[Effect]:
    """Draw different effects, no two of which are one by algebra."""
    pool = [shipped_effect(name, "shipped effects") for name in first_effects()]
    order = [pool[i] for i in generator.permutation(len(pool))]
    chosen: list[Effect] = []
    for effect in order:
        if len(chosen) < count and all(_distinguishable(effect, other) for other in chosen):
            chosen.append(effect)
    return chosen


def _distinguishable(one: Effect, other: Effect) -> bool:
    return one.confounded.get(other.name) != "" and other.confounded.get(one.name) != ""


def strength(effect: Effect, valve: ValveParameters, base: ValveParameters, generator: Draw) -> EffectTable:
    """Draw an effect's parameters for a valve; what is given on a drawing is as known."""
    values = {
        key: each.starts_for(base)[0] if each.given else _strength(each.starts_for(valve), each.off, generator)
        for key, each in effect.parameters.items()
    }
    return EffectTable.model_validate({"name": effect.written, **values})


def _strength(starts: Sequence[float], off: float | None, generator: Draw) -> float:
    ordered = sorted(starts)
    pairs = [pair for pair in pairwise(ordered) if off is None or not pair[0] < off < pair[1]]
    if not pairs:
        return ordered[generator.integers(len(ordered))]
    return _between(generator, *pairs[generator.integers(len(pairs))])


def _between(generator: Draw, low: float, high: float) -> float:
    """Draw log-uniformly between numbers of one sign, else uniformly."""
    if low * high > 0.0:
        return float(low * (high / low) ** generator.uniform())
    return float(generator.uniform(low, high))
