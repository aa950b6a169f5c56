"""The force that a form adds, over its variable; and what the balance of forces misses where slides end in rest.

missing_j = k_s (x_j - x'_j)      N, at landing j; x_j where the stem rests, x'_j where the model, told, slides to
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from config.recording import Column
from config.results.result import Brief
from sim.composition import Composition
from sim.effect import Effect, execute
from workbench.data.held_out import Split
from workbench.discover.grammar import Form
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import problem_of
from workbench.model.free_run import FreeRun

POINTS = 201  # at which it is drawn
P_1_PA = 1e5


@dataclass(frozen=True, slots=True)
class Landing:
    """Where a slide ended in rest, and the force, towards opening, that the balance misses there."""

    position_m: float
    direction: float
    missing_n: float


@dataclass(frozen=True, slots=True, repr=False)
class AddedForce(Brief):
    """What a form adds over its variable."""

    over: Column
    """The variable, (points,), as `unit` says."""
    added: Mapping[str, Column]
    """What it adds, (points,), by what it is, in `of`."""
    words: str
    unit: str
    of: str


def landings(fit: Fit, split: Split) -> list[Landing]:
    """Return the landings of what was fitted, with what the fit misses there."""
    record, composition = split.train.record, Composition.from_file(fit.valve)
    like = problem_of(fit, record).likelihood(composition, tuple(fit.parameters))
    off_m = like.at(composition.theta, fit.onsets_s).landings * like.landing_m
    found = []
    for move, rest in zip(like.moves, like.layout.rest_after.tolist(), strict=True):
        if rest < 0:
            continue
        rows = record.position_m[move.after : move.until + 1][record.valid[move.after : move.until + 1]]
        landed_m = float(np.median(rows))
        direction = float(np.sign(landed_m - record.position_m[move.before]))
        found.append(Landing(landed_m, direction, -fit.valve.valve.spring_n_per_m * float(off_m[rest])))
    return found


def variable_range(form: Form, fit: Fit, split: Split) -> tuple[float, float]:
    """Return from where to where the recordings go in a form's variable, in the unit of the variable."""
    record = split.train.record
    composition = Composition.from_file(fit.valve)
    run = FreeRun(composition, record, from_pressure=fit.from_pressure, by=fit.by).run(composition.theta)
    time_s, moves = record.time_s, problem_of(fit, record).told
    rested_s = [float(time_s[each.before] - time_s[each.rested_from]) for each in moves]
    stem = run.stem_m / fit.valve.valve.stroke_m
    spans = {
        "position": _span(stem),
        "position_and_pressure": _span(stem),
        "speed": (0.0, _span(np.abs(run.velocity_m_per_s))[1]),
        "pressure": _span(run.pressure_pa / P_1_PA),
        "command": _span(record.command_pa),
        "rest": (0.0, max(rested_s, default=0.0)),
        "travel": (0.0, float(np.subtract(*_span(stem)[::-1]))),
        "direction": (-1.0, 1.0),
    }
    return spans.get(form.variable.name, (0.0, float(time_s[-1] - time_s[0])))


def _span(values: Column) -> tuple[float, float]:
    return float(np.nanmin(values)), float(np.nanmax(values))


def added_force(
    form: Form, effect: Effect, values: Mapping[str, float], span: tuple[float, float], fit: Fit
) -> AddedForce:
    """Return what a form adds over its variable.

    Args:
        form: the form.
        effect: the same as an effect.
        values: its parameters by their keys.
        span: from where to where, in the unit of the variable.
        fit: of the valve with it, for the levels that a form scales.
    """
    namespace: dict[str, Any] = {"__name__": effect.name}
    execute(effect.source, effect.path, namespace)
    q = namespace["Parameters"](**values)
    over = np.linspace(*span, POINTS)
    added: dict[str, list[float]] = {}
    for xi in over.tolist():
        for name, value in _force_at(form, namespace, q, xi, fit).items():
            added.setdefault(name, []).append(value)
    unit, of = UNITS.get(form.variable.name, "of the stroke"), OF[form.place.function]
    return AddedForce(over, {name: np.array(each) for name, each in added.items()}, form.variable.words, unit, of)


UNITS = {
    "speed": "m/s", "pressure": "100 kPa", "command": "Pa", "rest": "s", "time": "s", "past": "s after a change of 1",
    "direction": "closing to opening", "": "",
}  # fmt: skip
OF = {"force": "N", "friction": "N", "pressure": "Pa", "sensor": "m"}


def _force_at(form: Form, namespace: Mapping[str, Any], q: Any, xi: float, fit: Fit) -> dict[str, float]:
    """Return what a form adds where its variable is xi."""
    valve = fit.valve.valve
    known = _stem(form, q, xi, valve.stroke_m)
    place = namespace[form.place.function]
    if form.place.function == "friction":
        levels: dict[str, float] = {}
        for words, way in (("opening", 1.0), ("closing", -1.0)):
            call = known | {"F_c": valve.coulomb_n, "F_s": valve.static_n, "direction": way}
            if form.variable.memory == 2:
                call["z"] = [call["z"][0], way]
            if form.variable.name == "direction":
                call["direction"] = 1.0 if xi > 0.0 else -1.0
            coulomb_n, static_n = place(*(call[name] for name in form.arguments))
            levels[f"static friction, {words}"] = way * (static_n - valve.static_n)
            if form.place.name != "static":
                levels[f"Coulomb friction, {words}"] = way * (coulomb_n - valve.coulomb_n)
        return levels
    if form.place.name.endswith("drag"):
        return {
            words: float(place(*((known | {"v": way * xi})[name] for name in form.arguments)))
            for words, way in (("opening", 1.0), ("closing", -1.0))
        }
    entering = known.get("u" if form.place.function == "pressure" else "y", 0.0)
    offset = entering if form.place.function in {"pressure", "sensor"} else 0.0
    return {form.place.words: float(place(*(known[name] for name in form.arguments))) - offset}


def _stem(form: Form, q: Any, xi: float, stroke_m: float) -> dict[str, Any]:
    """Return the arguments of a form's function where its variable is xi; what does not matter is 0."""
    name = form.variable.name
    known: dict[str, Any] = dict.fromkeys(("t", "x", "v", "p", "u", "y"), 0.0) | {"q": q, "direction": 1.0, "z": [0.0]}
    match name:
        case "position" | "position_and_pressure":
            known |= {"x": xi * stroke_m, "y": xi * stroke_m, "p": P_1_PA}
        case "travel":
            known |= {"x": xi * stroke_m, "z": [0.0, 1.0]}
        case "past":
            gone = float(np.exp(-xi / q.time_constant_s))
            known |= {"u": 1.0, "y": 1.0, "z": [1.0 - gone]}
        case "speed":
            known["v"] = xi
        case "pressure":
            known["p"] = P_1_PA * xi
        case "command":
            known["u"] = xi
        case "rest" | "time":
            known["t"] = xi
    return known
