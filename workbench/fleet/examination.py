"""One recording held against one model, as far as it takes: looked at, refitted, diagnosed.

    look      the model in free run against the measured position (`workbench.compare`): adequate, and no more is done
    refit     spring and friction fitted anew; if the valve then explains the recording, it has only changed
    diagnose  all else: which effect is missing

The rules of "adequate" and "missing" are those of `compare` and `diagnose`; none is made here. The same recording and
model give the same examination, on whatever machine it runs.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from config.errors import InputError
from config.loading import Schema
from config.recording import Recording
from config.valve_file import ValveFile
from config.writing import valve_toml
from workbench.compare.comparison import Comparison, compare
from workbench.fit.fitted_parameter import Fitted
from workbench.fit.fitting import Fit, fit
from workbench.select.diagnosis import Diagnosis, diagnose

RULES = 1
"""To be raised when an examination would come out differently: what was kept is then made anew."""
UNREADABLE, AS_BEFORE, CHANGED, UNTOLD = "unreadable", "as_before", "changed", "untold"
LEAST_CHANGE = 0.05
"""Of a parameter: what differs by less has not changed, however narrow its interval."""
MOST_CANDIDATES = 5


@dataclass(frozen=True, slots=True)
class Request:
    """What is to be examined: a recording's file and a model's text; `key` names both by their content."""

    key: str
    recording: str
    model: ValveFile
    is_first: bool
    """It is the valve's first: what was known of the valve before is a drawing."""


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
    verdict (`workbench.select.verdict`)."""
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
    effects: tuple[str, ...] = ()
    """What is missing in the model, or one of what may be."""
    rivals: tuple[str, ...] = ()
    """What explains as much as these."""
    evidence: float | None = None
    standard_errors: float | None = None
    changes: tuple[Change, ...] = ()
    candidates: tuple[Tried, ...] = ()
    model: str | None = None
    """The valve file that is the valve's from now on; None: as before."""


def examine(request: Request) -> Examination:
    """Examine a recording; whatever is wrong with it is the outcome."""
    try:
        return _examined(request)
    except InputError as error:
        return unreadable(error.problem)
    except Exception as error:  # of one recording in ten thousand, of any kind: it is listed, the others go on
        return unreadable(f"{type(error).__name__}: {error}")


def unreadable(reason: str) -> Examination:
    """Return what came of a recording that cannot be examined."""
    return Examination(outcome=UNREADABLE, sentence=" ".join(reason.split()))


def _examined(request: Request) -> Examination:
    recording = Recording.read(Path(request.recording))
    looked = compare(recording, request.model)
    figures = _figures(looked, request.model)
    if looked.adequate:
        return Examination(outcome=AS_BEFORE, sentence="as the last model says", error_after_m=looked.rms_m, **figures)
    try:
        return _explained(recording, request, figures)
    except InputError as error:
        off = f"{1e3 * looked.rms_m:.3g} mm from what the last model says"
        return Examination(outcome=UNTOLD, sentence=f"{off}; why, cannot be told: {error.problem}", **figures)


def _explained(recording: Recording, request: Request, figures: Mapping[str, Any]) -> Examination:
    refitted = fit(recording, request.model, workers=1)
    again = compare(recording, refitted.valve)
    if again.adequate:
        return _changed(refitted, again, request, figures)
    return _diagnosed(diagnose(recording, request.model, workers=1), request, figures)


def _figures(looked: Comparison, model: ValveFile) -> dict[str, Any]:
    measured_m = looked.measured_m
    valid = np.isfinite(measured_m)
    return {
        "samples": len(looked.time_s),
        "duration_s": float(looked.time_s[-1] - looked.time_s[0]),
        "valid_share": float(valid.mean()),
        "travel_share": float(np.ptp(measured_m[valid]) / model.valve.stroke_m) if valid.any() else 0.0,
        "slips": len(looked.slips.matched) + len(looked.slips.missed_s),
        "error_before_m": _known(looked.rms_m),
        "floor_m": looked.floor_m,
    }


def _changed(refitted: Fit, again: Comparison, request: Request, figures: Mapping[str, Any]) -> Examination:
    changes = changes_of(request.model, refitted.parameters)
    told = "; ".join(f"{each.name} {_percent(each)}" for each in changes) or "its parameters moved a little"
    return Examination(
        outcome=CHANGED,
        sentence=f"first fitted: {told}" if request.is_first else f"changed: {told}",
        error_after_m=again.rms_m,
        changes=changes,
        model=valve_toml(refitted.valve),
        **figures,
    )


def changes_of(model: ValveFile, parameters: Mapping[str, Fitted]) -> tuple[Change, ...]:
    """Return what of a model lies outside the intervals that a recording gives, and differs by LEAST_CHANGE."""
    tables = {each.name: each.parameters for each in model.effect}
    found = []
    for name, each in parameters.items():
        effect, _, key = name.rpartition(".")
        before = float(tables[effect][key] if effect else getattr(model.valve, key))
        if not each.lower <= before <= each.upper and abs(each.value - before) > LEAST_CHANGE * abs(before):
            bounds = [bound if isfinite(bound) else each.value for bound in (each.lower, each.upper)]
            found.append(Change(name=name, before=before, now=each.value, lower=bounds[0], upper=bounds[1]))
    return tuple(found)


def _percent(change: Change) -> str:
    if change.before == 0.0:
        return f"from 0 to {change.now:.4g}"
    return f"{100.0 * (change.now / change.before - 1.0):+.0f} %"


def _diagnosed(diagnosis: Diagnosis, request: Request, figures: Mapping[str, Any]) -> Examination:
    accepted = diagnosis.verdict in {"missing", "adequate"}
    added = [step.added for step in diagnosis.steps if step.added]
    gain = added[0].gain if added else None
    tried = sorted(
        (each.tried for each in diagnosis.steps[0].candidates),
        key=lambda each: np.inf if each.test is None else each.test,
    )
    return Examination(
        outcome=CHANGED if diagnosis.verdict == "adequate" else diagnosis.verdict,
        sentence=diagnosis.sentence,
        error_after_m=_known(diagnosis.best.errors.test_rmse_m),
        effects=diagnosis.missing,
        rivals=tuple(name for names in diagnosis.indistinguishable for name in names if name not in diagnosis.missing),
        evidence=_known(gain.bic) if gain else None,
        standard_errors=_known(gain.standard_errors) if gain else None,
        changes=changes_of(request.model, diagnosis.base.fit.parameters) if accepted else (),
        candidates=tuple(
            Tried(name=each.name, held_out_m=each.test, remark=each.rejection_reason)
            for each in tried[:MOST_CANDIDATES]
        ),
        model=valve_toml(diagnosis.best.fit.valve) if accepted else None,
        **figures,
    )


def _known(value: float) -> float | None:
    return value if isfinite(value) else None
