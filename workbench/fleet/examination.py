"""One recording held against one model, as far as it takes: looked at, refitted, diagnosed.

    look      the model in free run against the measured position (`workbench.compare`): explained, and no more is done
    refit     spring and friction fitted anew; if the valve then explains the recording, it has changed, or is as before
              where its parameters are
    diagnose  all else: which effect is missing

Explained is what `compare` calls adequate, and closer, as what a refit bends itself round would be missed:

    e <= max(1.1, 1 + 5 / sqrt n) floor          rms over n samples: of few, it and the floor scatter by themselves
    sqrt(share) e <= 0.3 floor                   the part of it that goes on from sample to sample, which noise does not

The rules of "missing" are those of `diagnose`. The same recording and model give the same examination, on
whatever machine it runs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from config.errors import InputError
from config.loading import Schema
from config.recording import Recording
from config.valve_file import ValveFile
from config.valve_file_writer import valve_toml
from sim.effect import find_effect
from workbench.compare.comparison import NUMERICAL, Comparison, compare
from workbench.data.kept_results import key_of
from workbench.diagnosis.diagnosis import Diagnosis, diagnose
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import fit
from workbench.fit.parameter_estimate import Fitted

RULES = 5
"""To be raised when an examination would come out differently: what was kept is then made anew."""
UNREADABLE, AS_BEFORE, CHANGED, UNTOLD = "unreadable", "as_before", "changed", "untold"
LEAST_CHANGE = 0.05
"""Of a parameter: what differs by less has not changed, however narrow its interval."""
LEAST_CHANGE_OF_EFFECT = 0.2
"""The same of an effect's: two recordings of one play gave 3.81 and 4.08 mm, intervals of 0.01 mm about a stair."""
LOOK_FLOORS = 1.1
"""Times the floor that a look or a refit may leave of many samples; more is diagnosed. `python -m
benchmarks.fleet_triage` has what each value misses."""
CHANCE_RISE = 5.0
"""Some four standard deviations of e / floor, times sqrt n: floors are estimated, too, from the samples at rest."""
STRUCTURE_FLOORS = 0.3
"""Times the floor that the structured part of the error may have."""
RISEN = 1.25
"""Times the floor of the recording behind the model: a floor that lies higher is itself something new. Laps that differ
by a friction that drifts raise it, and the drift would lie below it."""
MOST_CANDIDATES = 5  # kept of a diagnosis, for the table


@dataclass(frozen=True, slots=True)
class Request:
    """What is to be examined: a recording's file and a model's text; `key` names both by their content."""

    key: str
    recording: str
    model: ValveFile
    known_by: str | None = None
    """The recording by which the model was accepted, or the drawing confirmed; None: it is a mere drawing."""

    floor_m: float | None = None
    """Of that recording; None: unknown."""

    @property
    def is_first(self) -> bool:
        """Whether what was known of the valve before is a drawing."""
        return self.known_by is None


def request_key(recording: Path, model: ValveFile, known_by: str) -> str:
    """Return the name of an examination: of the bytes of the recording and of all that judges it.

    Args:
        recording: the file.
        model: what it is held against.
        known_by: the name of the examination by which the model was accepted; empty for a drawing.

    Raises:
        OSError: the recording cannot be read.
    """
    own = [find_effect(each.name, str(recording)).source for each in model.effect if each.name.endswith(".py")]
    return key_of(recording, [RULES, known_by, valve_toml(model), *own])


class Change(Schema):
    """A parameter that left its interval: before, now, and the 95 % interval of now."""

    name: str
    before: float
    now: float
    lower: float
    upper: float


class Tried(Schema):
    """An effect that a diagnosis tried, and the error, rms, m, that it left on what was held out."""

    name: str
    held_out_m: float | None
    remark: str


class Examination(Schema):
    """What came of a recording; lengths are rms unless they say otherwise. None is unknown."""

    outcome: str
    """as_before, changed, unreadable, untold (off, in a recording that holds too little to say why), or a diagnosis'
    verdict (`workbench.diagnosis.verdict`)."""
    sentence: str
    samples: int = 0
    duration_s: float = 0.0
    valid_share: float = 0.0
    travel_share: float = 0.0
    """What the stem swept, of the stroke."""
    slips: int = 0
    error_before_m: float | None = None
    """Of the model as it was."""
    error_after_m: float | None = None
    """Of the model that explains the recording best."""
    floor_m: float | None = None
    dead_band_share: float | None = None
    """Of the stroke, 2 F_c / k_s: how far the stem's place depends on which way it came, by the model that explains the
    recording best."""
    jump_share: float | None = None
    """Of the stroke, (F_s - F_c) / k_s: how far it jumps at break-away."""
    effects: tuple[str, ...] = ()
    """What is missing in the model, or one of what may be."""
    rivals: tuple[str, ...] = ()
    """What explains as much as these."""
    evidence: float | None = None
    held_out_evidence: float | None = None
    changes: tuple[Change, ...] = ()
    candidates: tuple[Tried, ...] = ()
    model: str | None = None
    """The valve file that is the valve's from now on; None: as before."""


def examine(request: Request) -> Examination:
    """Examine a recording; whatever is wrong with it is the outcome."""
    try:
        return _examine(request)
    except InputError as error:
        return unreadable(error.problem)
    except Exception as error:  # of one recording in ten thousand, of any kind: it is listed, the others go on
        return unreadable(f"{type(error).__name__}: {error}")


def unreadable(reason: str) -> Examination:
    """Return what came of a recording that cannot be examined."""
    return Examination(outcome=UNREADABLE, sentence=" ".join(reason.split()))


def _examine(request: Request) -> Examination:
    recording = Recording.read(Path(request.recording))
    looked = compare(recording, request.model)
    figures = _figures(looked, request.model)
    if is_at_floor(looked, request.model, request.floor_m):
        return Examination(
            outcome=AS_BEFORE,
            sentence="as the last model says",
            error_after_m=looked.rms_m,
            **_friction(request.model),
            **figures,
        )
    try:
        return _examine_adequate(recording, request, figures)
    except InputError as error:
        off = f"{1e3 * looked.rms_m:.3g} mm from what the last model says"
        return Examination(outcome=UNTOLD, sentence=f"{off}; why, cannot be told: {error.problem}", **figures)


def _examine_adequate(recording: Recording, request: Request, figures: Mapping[str, Any]) -> Examination:
    explained = refit(recording, request.model, request.floor_m)
    if explained is not None:
        return _examine_refit(*explained, request, figures)
    return _examine_diagnosis(diagnose(recording, request.model, workers=1), request, figures)


def refit(recording: Recording, model: ValveFile, known_floor_m: float | None = None) -> tuple[Fit, Comparison] | None:
    """Return the valve refitted, and how it compares; None: no refit explains the recording.

    Args:
        recording: what was measured.
        model: where the refit begins.
        known_floor_m: of the recording behind the model, rms; None: unknown.

    Raises:
        InputError: the recording holds too little.
    """
    found, again = refit_valve(recording, model)
    return (found, again) if is_at_floor(again, model, known_floor_m) else None


def refit_valve(recording: Recording, model: ValveFile) -> tuple[Fit, Comparison]:
    """Return the valve refitted, and how it compares, whatever it leaves.

    Raises:
        InputError: the recording holds too little.
    """
    found = fit(recording, model, workers=1)
    return found, compare(recording, found.valve)


def is_at_floor(comparison: Comparison, model: ValveFile, known_floor_m: float | None = None) -> bool:
    """Whether a model explains a recording, so that nothing need be diagnosed.

    Args:
        comparison: of the recording with the model.
        model: a valve file.
        known_floor_m: of the recording behind the model, rms; None: unknown.
    """
    reached_m = floors_allowed(comparison.valid_samples) * (floor_to_reach_m(comparison, known_floor_m) or 0.0)
    close = comparison.rms_m <= max(reached_m, NUMERICAL * model.valve.stroke_m)
    return comparison.adequate and close and not is_structured(comparison, known_floor_m)


def floors_allowed(samples: int) -> float:
    """Return how many floors a look or a refit may leave of so many samples."""
    return max(LOOK_FLOORS, 1.0 + CHANCE_RISE / float(np.sqrt(samples)))


def is_structured(comparison: Comparison, known_floor_m: float | None = None) -> bool:
    """Whether the error goes on from sample to sample by more than noise does; of a valve whose laps differ, it does.

    Args:
        comparison: of the recording with the model.
        known_floor_m: of the recording behind the model, rms, m: laps that differ there, too, are how this valve is.
    """
    noise_m, floor_m = comparison.noise_m, floor_to_reach_m(comparison, known_floor_m)
    if noise_m is None or floor_m is None or (known_floor_m or floor_m) > RISEN * noise_m:
        return False
    return comparison.structured_m > STRUCTURE_FLOORS * floor_m


def floor_to_reach_m(comparison: Comparison, known_floor_m: float | None) -> float | None:
    """Return the floor by which a recording is judged, rms, m; None: unknown."""
    if comparison.floor_m is None or known_floor_m is None:
        return comparison.floor_m
    return min(comparison.floor_m, RISEN * known_floor_m)


def _figures(looked: Comparison, model: ValveFile) -> dict[str, Any]:
    measured_m = looked.measured_m
    valid = np.isfinite(measured_m)
    return {
        "samples": len(looked.time_s),
        "duration_s": float(looked.time_s[-1] - looked.time_s[0]),
        "valid_share": float(valid.mean()),
        "travel_share": float(np.ptp(measured_m[valid]) / model.valve.stroke_m) if valid.any() else 0.0,
        "slips": len(looked.slips.matched) + len(looked.slips.missed_s),
        "error_before_m": _finite_or_none(looked.rms_m),
        "floor_m": looked.floor_m,
    }


def _friction(file: ValveFile) -> dict[str, Any]:
    valve = file.valve
    if valve.spring_n_per_m == 0.0:
        return {}
    per_n = 1.0 / (valve.spring_n_per_m * valve.stroke_m)
    return {"dead_band_share": 2.0 * valve.coulomb_n * per_n, "jump_share": (valve.static_n - valve.coulomb_n) * per_n}


def _examine_refit(found: Fit, again: Comparison, request: Request, figures: Mapping[str, Any]) -> Examination:
    changes = changes_of(request.model, found.parameters)
    if not request.is_first:
        changes = _beyond_what_was_known(changes, request)
    return Examination(
        **_outcome_of_refit(changes, request),
        error_after_m=again.rms_m,
        changes=changes,
        model=valve_toml(found.valve) if changes or request.is_first else None,
        **_friction(found.valve),
        **figures,
    )


def _outcome_of_refit(changes: Sequence[Change], request: Request) -> dict[str, Any]:
    """Say what a refit that explains the recording means.

    Where nothing changed the model stays: parameters that crept along with each refit would hide a drift for ever.
    """
    told = "; ".join(f"{each.name} {_percent(each)}" for each in changes)
    if request.is_first:
        return {"outcome": CHANGED, "sentence": f"first fitted: {told or 'as the drawing says'}"}
    if changes:
        return {"outcome": CHANGED, "sentence": f"changed: {told}"}
    return {"outcome": AS_BEFORE, "sentence": "as the last model says, parameters within their intervals"}


def changes_of(model: ValveFile, parameters: Mapping[str, Fitted]) -> tuple[Change, ...]:
    """Return what of a model lies outside the intervals that a recording gives, and differs enough."""
    tables = {each.name: each.parameters for each in model.effect}
    found = []
    for name, each in parameters.items():
        effect, _, key = name.rpartition(".")
        before = float(tables[effect][key] if effect else getattr(model.valve, key))
        least = (LEAST_CHANGE_OF_EFFECT if effect else LEAST_CHANGE) * abs(before)
        if not each.lower <= before <= each.upper and abs(each.value - before) > least:
            bounds = [bound if isfinite(bound) else each.value for bound in (each.lower, each.upper)]
            found.append(Change(name=name, before=before, now=each.value, lower=bounds[0], upper=bounds[1]))
    return tuple(found)


def _beyond_what_was_known(changes: Sequence[Change], request: Request) -> tuple[Change, ...]:
    """Return the changes of which the recording behind the model knew better; of most, it left an interval open."""
    if not changes or request.known_by is None:
        return tuple(changes)
    try:
        recording = Recording.read(Path(request.known_by))
        known = fit(recording, request.model, workers=1).parameters
    except InputError:  # it is gone by now, or too short for a fit: the model stands as it is
        return tuple(changes)
    return tuple(
        each
        for each in changes
        if each.name not in known or each.upper < known[each.name].lower or known[each.name].upper < each.lower
    )


def _percent(change: Change) -> str:
    if change.before == 0.0:
        return f"from 0 to {change.now:.4g}"
    return f"{100.0 * (change.now / change.before - 1.0):+.0f} %"


def _examine_diagnosis(diagnosis: Diagnosis, request: Request, figures: Mapping[str, Any]) -> Examination:
    accepted = diagnosis.verdict in {"missing", "adequate"}
    added = [step.added for step in diagnosis.steps if step.added]
    gain = added[0].gain if added else None
    tried = sorted(
        (each.tried for each in diagnosis.steps[0].candidates),
        key=lambda each: np.inf if each.test is None else each.test,
    )
    changes = changes_of(request.model, diagnosis.base.fit.parameters) if accepted else ()
    said: dict[str, Any] = {"outcome": diagnosis.verdict, "sentence": diagnosis.sentence}
    if diagnosis.verdict == "adequate":
        changes = _beyond_what_was_known(changes, request)
        said = _outcome_of_refit(changes, request)
        accepted = bool(changes) or request.is_first
    return Examination(
        **said,
        error_after_m=_finite_or_none(diagnosis.best.errors.test_rmse_m),
        effects=diagnosis.missing,
        rivals=tuple(name for names in diagnosis.indistinguishable for name in names if name not in diagnosis.missing),
        evidence=_finite_or_none(gain.bic) if gain else None,
        held_out_evidence=_finite_or_none(gain.held_out_evidence) if gain else None,
        changes=changes,
        candidates=tuple(
            Tried(name=each.name, held_out_m=each.test, remark=each.rejection_reason)
            for each in tried[:MOST_CANDIDATES]
        ),
        model=valve_toml(diagnosis.best.fit.valve) if accepted else None,
        **_friction(diagnosis.best.fit.valve),
        **figures,
    )


def _finite_or_none(value: float) -> float | None:
    return value if isfinite(value) else None
