"""The search by a beam, on fits made by hand: when it ends, which steps it comes to, what it tries."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from config.recording import Column, Recording
from config.valve_file import ValveFile
from sim.effect import Effect
from tests.workbench.hand_made import AT_FLOOR, FLOOR_M, LIBRARY, errors_of, fit_of, model_of, terms_of, valve_with
from workbench.data.held_out import Split, split
from workbench.fit.breaking_off import BrokenOff
from workbench.fit.fit_problem import Problem
from workbench.fit.fit_result import Fit, Terms
from workbench.fit.fitting import Trial
from workbench.fit.likelihood import Likelihood
from workbench.fit.minimiser import End
from workbench.model.simulation_regime import DYNAMIC
from workbench.select import effect_search
from workbench.select.effect_candidates import EffectStep, EvaluatedModel, judged_step
from workbench.select.effect_search import EffectSearch
from workbench.select.selection_thresholds import SELECTION
from workbench.select.separating_experiment import Experiment
from workbench.select.tangent_preview import TangentScore

Effects = frozenset[str]
Ends = Callable[[Effects], float]
"""From the effects of a model to the error that its fit comes to, in floors."""
Searched = Callable[..., tuple[EffectStep, ...]]
COARSE = 1.1
"""Factor on the cost and the error of a search that is not gone on with."""


@dataclass(frozen=True)
class ByHand(Trial):
    """A trial made by hand: what it comes to at its end."""

    fit: Fit

    @classmethod
    def of(cls, fit: Fit, before: Fit) -> "ByHand":
        like, coarse = SimpleNamespace(parameters=tuple(fit.parameters)), SimpleNamespace(cost=COARSE * fit.cost)
        return cls(cast(Likelihood, like), (cast(End, coarse),), before.terms, fit)

    @property
    def terms(self) -> Terms:
        return terms_of(COARSE * self.fit.cost / AT_FLOOR)


def names(step: EffectStep) -> list[str]:
    return [each.name for each in step.candidates]


def added(steps: Sequence[EffectStep]) -> list[str]:
    return [step.added.name for step in steps if step.added]


class Engine:
    """The functions by which a search fits, each fit coming to what the test says."""

    def __init__(self, ends: Ends, most: float) -> None:
        self._ends, self._most, self._made = ends, most, 0

    def _fit(self, *effects: str) -> Fit:
        self._made += 1
        if self._made > self._most:
            raise BrokenOff
        floors = self._ends(frozenset(effects))
        return fit_of(*effects, cost=floors * AT_FLOOR, rms_m=floors * FLOOR_M)

    def base_fit(self, _: object, valve: ValveFile, **__: object) -> Fit:
        return self._fit(*(each.name for each in valve.effect))

    def glimpse(self, _: object, known: ValveFile, effects: Sequence[str], before: Fit) -> Trial:
        return ByHand.of(self._fit(*(each.name for each in known.effect), *effects), before)

    def advance(self, trial: ByHand) -> Trial:
        return trial

    def settled(self, trial: ByHand) -> ByHand:
        return trial

    def finish(self, _: object, trial: ByHand, __: float) -> Fit:
        return trial.fit

    def leave_off(self, _: object, trial: ByHand) -> Fit:
        return replace(trial.fit, cost=COARSE * trial.fit.cost, rms_m=COARSE * trial.fit.rms_m)

    def changes(self, _: object, library: Mapping[str, Effect], __: int) -> Mapping[str, object]:
        return dict(library)

    def rank(self, _: object, by: Mapping[str, object]) -> tuple[TangentScore, ...]:
        return tuple(TangentScore(name, 1.0) for name in by)

    def evaluated(self, found: Fit, _: Split) -> EvaluatedModel:
        return EvaluatedModel(found, errors_of(found.rms_m), FLOOR_M)


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> Searched:
    """Search with a library of these names."""

    def searched(
        ends: Ends, *library: str, workers: int = 2, broken_off_after: float = np.inf
    ) -> tuple[EffectStep, ...]:
        engine = Engine(ends, broken_off_after)
        for name in (
            "base_fit",
            "glimpse",
            "advance",
            "settled",
            "finish",
            "leave_off",
            "evaluated",
            "changes",
            "rank",
        ):
            monkeypatch.setattr(effect_search, name, getattr(engine, name))
        monkeypatch.setattr(effect_search, "Left", lambda *_: None)
        search = search_of({name: LIBRARY[name] for name in library}, monkeypatch, workers)
        base = search.base(valve_with())
        try:
            return search.steps(base)
        except BrokenOff:
            return search.so_far(base)

    return searched


@cache
def recorded() -> Split:
    """A recording that every search here is given: its fits are made by hand."""
    time_s: Column = np.asarray(0.01 * np.arange(1200), np.float64)
    position_m = 0.05 + 0.03 * np.sin(1.3 * time_s) + FLOOR_M * np.random.default_rng(1).standard_normal(1200)
    return split([Recording({"time_s": time_s, "command_pa": 8e5 * position_m, "position_m": position_m})])


def search_of(library: Mapping[str, Effect], monkeypatch: pytest.MonkeyPatch, workers: int = 2) -> EffectSearch:
    parts = recorded()
    of = Problem(parts.train.record, (), DYNAMIC, from_pressure=False, load_n=1.0)
    monkeypatch.setattr(effect_search, "problem", lambda *_, **__: of)
    return EffectSearch(parts, library, valve_with(), workers=workers, progress=lambda _what, _done: None)


def ends_of_two(there: Effects, *, runner_up: float, in_the_way: bool) -> float:
    """One effect alone does better than either of the two that are missing, and leads nowhere."""
    if {"ip_lag", "asymmetric_friction"} <= there and not (in_the_way and "presliding" in there):
        return 1.0
    if "presliding" in there:
        return 4.95 if len(there) == 1 else 4.0
    return runner_up if "ip_lag" in there else 20.0


@pytest.mark.parametrize("runner_up", [5.0, 7.0, 13.0])
@pytest.mark.parametrize("in_the_way", [True, False], ids=["in the way", "needless"])
def test_two_that_are_missing_are_found_though_another_alone_does_better(
    searched: Searched, runner_up: float, in_the_way: bool
) -> None:
    """97018: a backlash stood in for a lag and a preload; the lag alone had nearly as much evidence."""
    library = "presliding", "ip_lag", "asymmetric_friction"
    steps = searched(lambda there: ends_of_two(there, runner_up=runner_up, in_the_way=in_the_way), *library)
    assert added(steps) == ["ip_lag", "asymmetric_friction"]
    assert steps[0].added
    assert steps[1].before is steps[0].added.model


def test_what_imitated_two_is_idle_beside_both_and_left_out(searched: Searched) -> None:
    """84001: three did better than either of the two that were missing, and one of them stayed in the answer."""
    imitations = {"presliding": 4.0, "backlash": 4.5, "stribeck": 4.6}

    def ends(there: Effects) -> float:
        if {"ip_lag", "asymmetric_friction"} <= there:
            return 1.0
        alone = min((floors for name, floors in imitations.items() if name in there), default=18.0 if there else 20.0)
        return alone if len(there) < 2 else 0.8 * alone - 0.3 * ("asymmetric_friction" in there)

    assert added(searched(ends, *imitations, "ip_lag", "asymmetric_friction")) == ["asymmetric_friction", "ip_lag"]


def test_an_answer_of_three_whose_second_was_no_candidate_at_first_is_read_as_it_is(searched: Searched) -> None:
    """A hysteresis comes after presliding, which showed behind the lag alone: there is no model of it alone."""

    def ends(there: Effects) -> float:
        if "ip_lag" not in there:
            return 20.0
        left = 3.0 if "presliding_hysteresis" in there else 5.0 if "presliding" in there else 8.0
        return left * (0.34 if "backlash" in there and left == 3.0 else 1.0)

    found = added(searched(ends, "ip_lag", "presliding", "presliding_hysteresis", "backlash"))
    assert found == ["ip_lag", "presliding_hysteresis", "backlash"]


def test_what_is_far_behind_is_not_searched_to_its_end(searched: Searched) -> None:
    floors = {"ip_lag": 1.0, "backlash": 1.5, "stribeck": 9.0, "quadratic_drag": 10.0, "friction_drift": 18.0}
    (step,) = searched(lambda there: min((floors[each] for each in there), default=100.0), *floors)
    found = {each.name: each.model.errors.test_rmse_m / FLOOR_M for each in step.candidates if each.model}
    to_the_end = sorted(floors, key=lambda name: floors[name])[: SELECTION.beam]
    assert found == pytest.approx({n: each * (1.0 if n in to_the_end else COARSE) for n, each in floors.items()})


def test_it_ends_with_the_effect_that_explains_all(searched: Searched) -> None:
    (step,) = searched(lambda there: 1.0 if "ip_lag" in there else 20.0, "backlash", "ip_lag")
    assert step.added
    assert step.added.name == "ip_lag"
    assert names(step) == ["ip_lag", "backlash"]


@pytest.mark.parametrize(("left", "found"), [(1.2, ["ip_lag", "backlash"]), (1.05, ["ip_lag"])])
def test_what_explains_all_but_leaves_room_is_not_the_end(searched: Searched, left: float, found: list[str]) -> None:
    """A second effect of two thirds of the floor hides behind the first one's success; of a third there is no sign."""

    def ends(there: Effects) -> float:
        return 20.0 if "ip_lag" not in there else 1.0 if "backlash" in there else left

    steps = searched(ends, "backlash", "ip_lag")
    assert added(steps) == found


def test_it_ends_where_nothing_is_accepted(searched: Searched) -> None:
    first, last = searched(lambda there: 5.0 if "ip_lag" in there else 20.0, "backlash", "ip_lag")
    assert first.added
    assert last.added is None
    assert last.before is first.added.model
    assert names(last) == ["backlash"], "what is there is not tried again"


def test_the_steps_do_not_depend_on_the_workers(searched: Searched) -> None:
    """Nor on which fit is done first."""

    def ends(there: Effects) -> float:
        time.sleep(0.02 * ("stribeck" in there))
        return 100.0 / 3.0 ** len(there)

    library = ("stribeck", "ip_lag", "backlash")
    alone, together = ([names(step) for step in searched(ends, *library, workers=workers)] for workers in (1, 3))
    assert alone == together


@pytest.mark.parametrize(
    ("floors_first", "tried"),
    [(1.0, False), (5.0, True), (20.0, False)],
    ids=["it explains all", "it leaves something", "it has no evidence"],
)
def test_an_effect_that_comes_after_another_is_tried_where_that_leaves_something(
    searched: Searched, floors_first: float, tried: bool
) -> None:
    def ends(there: Effects) -> float:
        if "presliding_hysteresis" in there:
            return 1.0
        return floors_first if "presliding" in there else 20.0

    steps = searched(ends, "backlash", "presliding", "presliding_hysteresis")
    assert ("presliding_hysteresis" in names(steps[0])) == tried
    if tried:
        (step,) = steps
        assert step.added
        assert (step.added.name, step.added.model and step.added.model.explained) == ("presliding_hysteresis", True)


def test_what_comes_after_another_may_be_added_where_an_earlier_step_had_not_tried_it(
    searched: Searched,
) -> None:
    """Presliding shows only behind the lag: the hysteresis that comes after it was no candidate of the first step."""
    floors = {frozenset({"ip_lag"}): 8.0, frozenset({"ip_lag", "presliding"}): 5.0}
    both = frozenset({"ip_lag", "presliding_hysteresis"})

    def ends(there: Effects) -> float:
        return 1.0 if both <= there else floors.get(there, 20.0)

    steps = searched(ends, "ip_lag", "presliding", "presliding_hysteresis")
    assert "presliding_hysteresis" not in names(steps[0])
    assert added(steps) == ["ip_lag", "presliding_hysteresis"]


def test_without_the_other_it_is_tried_from_the_first(searched: Searched) -> None:
    (step,) = searched(lambda there: 1.0 if there else 20.0, "presliding_hysteresis")
    assert names(step) == ["presliding_hysteresis"]


def test_it_adds_three_at_most(searched: Searched) -> None:
    library = ("ip_lag", "backlash", "stribeck", "quadratic_drag")
    steps = searched(lambda there: 100.0 / 3.0 ** len(there), *library)
    assert [step.added is not None for step in steps] == [True, True, True]


def test_broken_off_anywhere_the_model_is_the_one_of_the_effects_that_are_named(
    searched: Searched,
) -> None:
    """A runner-up was being tried: what was named was the effect before, what was printed the runner-up's error."""
    library = "presliding", "ip_lag", "asymmetric_friction", "backlash"
    turned = 0
    for fits in range(1, 60):
        steps = searched(
            lambda there: ends_of_two(there, runner_up=5.0, in_the_way=True),
            *library,
            workers=1,
            broken_off_after=fits,
        )
        named = tuple(step.added.name for step in steps if step.added)
        here = steps[-1].added.model if steps[-1].added else steps[-1].before
        assert here
        assert here.effects == named, f"broken off after {fits} fits"
        turned += named[:1] == ("ip_lag",)
    assert turned, "some of them after the search had turned to the runner-up"


def test_a_rival_that_is_accepted_after_the_added_one_is_missing_too(
    searched: Searched,
) -> None:
    first, last = searched(lambda there: 25.0 / 5.0 ** len(there), "ip_lag", "backlash")
    assert last.added
    assert {each.name for each in first.indistinguishable} == {"ip_lag"}, "the other did as well, and comes after it"


def test_the_experiment_is_for_the_first_set_that_a_record_can_tell_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []

    def experiment(fits: Sequence[Fit], *_: object, **__: object) -> Experiment:
        asked.append([each.valve.effect[0].name for each in fits])
        return Experiment("staircase", 7.0, np.arange(4.0), np.ones(4))

    monkeypatch.setattr(effect_search, "experiment", experiment)
    search = search_of(LIBRARY, monkeypatch)
    before = model_of(cost=20.0 * AT_FLOOR, error_m=20.0 * FLOOR_M)
    one_class, two = (
        judged_step(before, {name: model_of(name) for name in rivals}, 1, LIBRARY)
        for rivals in (("preload", "sensor_offset"), ("preload", "sensor_offset", "dead_time"))
    )
    assert search.experiment([one_class]) is None
    assert search.experiment([one_class, two]) is not None
    assert [sorted(each) for each in asked] == [["dead_time", "preload"]]


@pytest.mark.parametrize("alone", [3.001, 4.5], ids=["a rival alone", "worse alone"])
@pytest.mark.parametrize(
    ("beside", "rivals"), [(2.5, ["ip_lag"]), (1.0, ["ip_lag", "backlash"])], ids=["worse", "as good"]
)
def test_what_had_evidence_in_the_first_step_is_asked_again_beside_what_the_second_added(
    searched: Searched, beside: float, rivals: list[str], alone: float
) -> None:
    """While stribeck is missing a play may do as well as a lag or worse; beside it, the true one explains all."""
    floors = {
        frozenset[str](): 6.0,
        frozenset({"ip_lag"}): 3.0,
        frozenset({"backlash"}): alone,
        frozenset({"stribeck"}): 5.9,
        frozenset({"ip_lag", "backlash"}): 3.0,
        frozenset({"ip_lag", "stribeck"}): 1.0,
        frozenset({"backlash", "stribeck"}): beside,
    }

    def ends(there: Effects) -> float:
        return floors.get(there, 1.0)

    steps = searched(ends, "ip_lag", "backlash", "stribeck")
    assert added(steps) == ["ip_lag", "stribeck"]
    assert sorted(each.name for each in steps[0].indistinguishable) == sorted(rivals)
