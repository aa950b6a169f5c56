"""The forward search, on fits made by hand: when it ends, and what it makes of searches that failed."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest

from config.recording import Column, Recording
from config.valve_file import ValveFile
from sim.effect import Effect
from tests.workbench.hand_made import AT_FLOOR, FLOOR_M, LIBRARY, errors_of, fit_of, model_of, valve_with
from workbench.data.held_out import split
from workbench.fit.breaking_off import BrokenOff
from workbench.fit.fit_result import Fit
from workbench.fit.fitted_parameter import Fitted
from workbench.select import effect_search
from workbench.select.block_errors import BlockErrors
from workbench.select.effect_candidates import EffectStep, judged_step
from workbench.select.effect_search import EffectSearch
from workbench.select.experiment import Experiment

Effects = frozenset[str]
Ends = Callable[[Effects, Effects], float]
"""From the effects a fit begins with, and those it is to add, to the error that it comes to, in floors."""


COMES_TO_NOTHING = "friction_drift"
"""Its searches are made to end at the base: no other test has it."""


@dataclass(frozen=True)
class Begun:
    """A fit made by hand as it is begun: where it is on the way, what its first search comes to, and what all do."""

    way: Fit
    first: Fit
    best: Fit
    all_of: list[str]
    """Effects whose searches have all begun."""
    workers: int = 1
    up_to: float = np.inf
    """Cost up to which its ends are gone on from."""
    error = SimpleNamespace(count=AT_FLOOR / 0.5)

    @property
    def screening_cost(self) -> float:
        return self.way.cost

    @property
    def cost(self) -> float:
        return self.first.cost

    @property
    def rms_m(self) -> float:
        return self.first.rms_m

    @property
    def shows(self) -> bool:
        """Whether its first search makes something better than the base; that of `COMES_TO_NOTHING` does not."""
        return all(each.name != COMES_TO_NOTHING for each in self.best.valve.effect)

    @property
    def not_gone_on(self) -> Fit:
        """What all searches come to that are not gone on from: half of the way from the first to the best."""
        cost, rms_m = 0.5 * (self.first.cost + self.best.cost), 0.5 * (self.first.rms_m + self.best.rms_m)
        return replace(self.best, cost=cost, rms_m=rms_m)

    def all_begun(self) -> "Begun":
        self.all_of.extend(each.name for each in self.best.valve.effect)
        return self

    def carried(self) -> "Begun":
        return self

    def gone_on_up_to(self, cost: float) -> "Begun":
        return replace(self, up_to=min(self.up_to, cost))

    def settled(self, _: int) -> "Begun":
        return self

    def left(self) -> Fit:
        return self.way

    def by_one(self) -> Fit:
        return self.first

    def judged(self, **_: object) -> Fit:
        return self.first

    def finished(self, **_: object) -> Fit:
        return self.best if self.cost <= self.up_to else self.not_gone_on


def names(step: EffectStep) -> list[str]:
    return [each.name for each in step.candidates]


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[EffectStep, ...]]:
    """Search with a library of these names, each fit coming to what the test says."""

    def searched(
        ends: Ends,
        *library: str,
        local_minimum: float = np.inf,
        workers: int = 2,
        way: float = 1.0,
        first: float = 1.0,
        from_landings: list[tuple[str, bool]] | None = None,
        all_of: list[str] | None = None,
        strengths: Mapping[str, Fitted] | None = None,
        noise: bool = False,
        broken_off_after: float = np.inf,
    ) -> tuple[EffectStep, ...]:
        fits = count()

        def made(valve: ValveFile, effects: Sequence[str]) -> Fit:
            if next(fits) >= broken_off_after:
                raise BrokenOff
            there = tuple(each.name for each in valve.effect)
            floors = ends(frozenset(there), frozenset(effects))
            return fit_of(*there, *effects, cost=floors * AT_FLOOR, rms_m=floors * FLOOR_M)

        def fit(_: Recording, valve: ValveFile, **__: object) -> Fit:
            return made(valve, ())

        def begun_fit(_: Recording, valve: ValveFile, effects: Sequence[str], __: Fit, *, landed: bool) -> Begun:
            if from_landings is not None:
                from_landings.append((effects[0], landed))
            best = made(valve, effects)
            on_the_way, of_first = (
                replace(best, cost=part * best.cost, rms_m=part * best.rms_m) for part in (way * first, first)
            )
            return Begun(on_the_way, of_first, best, [] if all_of is None else all_of)

        def block_errors(found: Fit, _: object) -> BlockErrors:
            return errors_of(found.rms_m)

        monkeypatch.setattr(effect_search, "fit", fit)
        monkeypatch.setattr(effect_search, "begun_fit", begun_fit)

        def profiled(found: Fit, _: object) -> Fit:
            return replace(found, parameters={**found.parameters, **(strengths or {})})

        monkeypatch.setattr(effect_search, "profiled", profiled)
        monkeypatch.setattr(effect_search, "block_errors", block_errors)
        monkeypatch.setattr(EffectSearch, "_local_minimum", lambda *_: local_minimum)
        monkeypatch.setattr(EffectSearch, "_noise", lambda *_: noise)
        search = search_of({name: LIBRARY[name] for name in library}, workers)
        base = search.base(valve_with())
        try:
            steps = search.steps(base)
        except BrokenOff:
            return search.so_far(base)
        return search.proved(steps)[0] if strengths else steps

    return searched


def search_of(library: Mapping[str, Effect], workers: int = 2) -> EffectSearch:
    time_s: Column = np.asarray(0.01 * np.arange(1200), np.float64)
    position_m = 0.05 + 0.03 * np.sin(1.3 * time_s) + FLOOR_M * np.random.default_rng(1).standard_normal(1200)
    parts = split([Recording({"time_s": time_s, "command_pa": 8e5 * position_m, "position_m": position_m})])
    return EffectSearch(parts, library, valve_with().valve, seed=0, workers=workers, progress=lambda _what, _done: None)


def test_it_ends_with_the_effect_that_explains_all(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    (step,) = searched(lambda there, added: 1.0 if "ip_lag" in there | added else 20.0, "backlash", "ip_lag")
    assert step.added
    assert step.added.name == "ip_lag"
    assert names(step) == ["ip_lag", "backlash"]


@pytest.mark.parametrize(("left", "found"), [(1.2, ["ip_lag", "backlash"]), (1.05, ["ip_lag"])])
def test_what_explains_all_but_leaves_room_is_not_the_end(
    searched: Callable[..., tuple[EffectStep, ...]], left: float, found: list[str]
) -> None:
    """A second effect of two thirds of the floor hides behind the first one's success; of a third there is no sign."""

    def ends(there: Effects, added: Effects) -> float:
        effects = there | added
        return 20.0 if "ip_lag" not in effects else 1.0 if "backlash" in effects else left

    steps = searched(ends, "backlash", "ip_lag")
    assert [each.added.name for each in steps if each.added] == found


def test_it_ends_where_nothing_is_accepted(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    first, last = searched(lambda there, added: 5.0 if "ip_lag" in there | added else 20.0, "backlash", "ip_lag")
    assert first.added
    assert last.added is None
    assert last.before is first.added.model
    assert names(last) == ["backlash"], "what is there is not tried again"


@pytest.mark.parametrize(("floors_second", "count"), [(17.0, 2), (15.0, 3)], ids=["next to nothing", "something"])
def test_it_ends_where_the_second_step_brings_next_to_nothing(
    searched: Callable[..., tuple[EffectStep, ...]], floors_second: float, count: int
) -> None:
    def ends(there: Effects, added: Effects) -> float:
        return {0: 20.0, 1: 18.0, 2: floors_second}.get(len(there | added), 9.0)

    assert len(searched(ends, "backlash", "ip_lag", "stribeck")) == count


@pytest.mark.parametrize(("floors_stand_in", "found"), [(18.0, "stribeck"), (7.0, "ip_lag")])
def test_no_runner_up_is_tried_where_two_steps_leave_most_of_the_error(
    searched: Callable[..., tuple[EffectStep, ...]], floors_stand_in: float, found: str
) -> None:
    """The runner-up would lead farther."""

    def ends(there: Effects, added: Effects) -> float:
        effects = there | added
        if "stribeck" in effects:
            return floors_stand_in if len(effects) == 1 else 0.85 * floors_stand_in
        return {0: 20.0, 1: 1.01 * floors_stand_in}.get(len(effects), 0.8 * floors_stand_in)

    first, *_ = searched(ends, "stribeck", "ip_lag", "backlash")
    assert first.added
    assert first.added.name == found


def test_the_steps_do_not_depend_on_the_workers(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    """Nor on which fit is done first."""

    def ends(there: Effects, added: Effects) -> float:
        time.sleep(0.02 * ("stribeck" in added))
        return 100.0 / 3.0 ** len(there | added)

    library = ("stribeck", "ip_lag", "backlash")
    alone, together = ([names(step) for step in searched(ends, *library, workers=workers)] for workers in (1, 3))
    assert alone == together


@pytest.mark.parametrize(
    ("floors_first", "tried"),
    [(1.0, False), (5.0, True), (20.0, False)],
    ids=["it explains all", "it leaves something", "it has no evidence"],
)
def test_an_effect_that_comes_after_another_is_tried_where_that_leaves_something(
    searched: Callable[..., tuple[EffectStep, ...]], floors_first: float, tried: bool
) -> None:
    def ends(there: Effects, added: Effects) -> float:
        if "presliding_hysteresis" in there | added:
            return 1.0
        return floors_first if "presliding" in there | added else 20.0

    steps = searched(ends, "backlash", "presliding", "presliding_hysteresis")
    assert ("presliding_hysteresis" in names(steps[0])) == tried
    if tried:
        (step,) = steps
        assert step.added
        assert (step.added.name, step.added.model and step.added.model.explained) == ("presliding_hysteresis", True)


def test_what_comes_after_another_may_be_added_where_an_earlier_step_had_not_tried_it(
    searched: Callable[..., tuple[EffectStep, ...]],
) -> None:
    """Presliding shows only behind the lag: the hysteresis that comes after it was no candidate of the first step."""
    floors = {frozenset({"ip_lag"}): 8.0, frozenset({"ip_lag", "presliding"}): 5.0}
    both = frozenset({"ip_lag", "presliding_hysteresis"})

    def ends(there: Effects, added: Effects) -> float:
        return 1.0 if both <= there | added else floors.get(there | added, 20.0)

    steps = searched(ends, "ip_lag", "presliding", "presliding_hysteresis")
    assert "presliding_hysteresis" not in names(steps[0])
    assert [step.added.name for step in steps if step.added] == ["ip_lag", "presliding_hysteresis"]


def test_without_the_other_it_is_tried_from_the_first(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    (step,) = searched(lambda there, added: 1.0 if there | added else 20.0, "presliding_hysteresis")
    assert names(step) == ["presliding_hysteresis"]


def test_it_adds_three_at_most(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    library = ("ip_lag", "backlash", "stribeck", "quadratic_drag")
    steps = searched(lambda there, added: 100.0 / 3.0 ** len(there | added), *library)
    assert [step.added is not None for step in steps] == [True, True, True]


def test_what_stood_in_for_a_failed_search_does_not_stay(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    """Alone, the search for the true effect ends too high, so that another is added; beside it the true one is found.

    From there the true one alone is searched once more, and explains all.
    """

    def ends(there: Effects, added: Effects) -> float:
        if "spring_hardening" in there:
            return 1.0
        if "spring_hardening" in added:
            return 1.0 if "flow_force" in there else 8.0
        return 5.0 if "flow_force" in there | added else 20.0

    (step,) = searched(ends, "flow_force", "spring_hardening")
    assert step.added
    assert step.added.name == "spring_hardening"
    assert step.added.model
    assert step.added.model.effects == ("spring_hardening",)
    assert step.added.model.explained


def ends_of_two(there: Effects, *, runner_up: float, in_the_way: bool = False) -> float:
    """One effect alone does better than either of the two that are missing, and leads nowhere."""
    if {"ip_lag", "asymmetric_friction"} <= there and not (in_the_way and "presliding" in there):
        return 1.0
    if "presliding" in there:
        return 4.95 if len(there) == 1 else 4.0
    return runner_up if "ip_lag" in there else 20.0


def test_broken_off_anywhere_the_model_is_the_one_of_the_effects_that_are_named(
    searched: Callable[..., tuple[EffectStep, ...]],
) -> None:
    """A runner-up was being tried: what was named was the effect before, what was printed the runner-up's error."""
    library = "presliding", "ip_lag", "asymmetric_friction", "backlash"
    turned = 0
    for fits in range(1, 60):
        steps = searched(
            lambda there, added: ends_of_two(there | added, runner_up=5.0, in_the_way=True),
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


def test_the_runner_up_is_tried_where_the_added_one_leads_nowhere(
    searched: Callable[..., tuple[EffectStep, ...]],
) -> None:
    """With the added one the search for both others fails, too."""
    first, last = searched(
        lambda there, added: ends_of_two(there | added, runner_up=5.0, in_the_way=True),
        "presliding",
        "ip_lag",
        "asymmetric_friction",
    )
    assert first.added
    assert last.added
    assert [first.added.name, last.added.name] == ["ip_lag", "asymmetric_friction"]
    assert last.before is first.added.model


def test_the_next_by_evidence_is_tried_though_held_out_it_is_worse(
    searched: Callable[..., tuple[EffectStep, ...]],
) -> None:
    """97018: a backlash stood in for a lag and a preload; the lag alone had nearly as much evidence."""
    steps = searched(
        lambda there, added: ends_of_two(there | added, runner_up=7.0, in_the_way=True),
        "presliding",
        "ip_lag",
        "asymmetric_friction",
    )
    assert [step.added.name for step in steps if step.added] == ["ip_lag", "asymmetric_friction"]


def test_what_stood_in_for_two_is_taken_out(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    """The runner-up is so much worse alone that it is not tried; beside the stand-in both are found in the end."""
    steps = searched(
        lambda there, added: ends_of_two(there | added, runner_up=13.0), "presliding", "ip_lag", "asymmetric_friction"
    )
    assert [step.added.name for step in steps if step.added] == ["ip_lag", "asymmetric_friction"]


def test_what_was_added_after_a_stand_in_is_fitted_without_it_though_it_had_not_been_tried(
    searched: Callable[..., tuple[EffectStep, ...]],
) -> None:
    """The hysteresis comes after presliding, which shows only behind the lag, and the lag is not needed beside both."""
    found = frozenset({"presliding_hysteresis", "backlash"})
    floors = {frozenset({"ip_lag"}): 8.0, frozenset({"ip_lag", "presliding"}): 5.0}
    floors |= {frozenset({"presliding_hysteresis"}): 12.0, frozenset({"ip_lag", "presliding_hysteresis"}): 3.0}

    def ends(there: Effects, added: Effects) -> float:
        return 1.0 if found <= there | added else floors.get(there | added, 20.0)

    steps = searched(ends, "ip_lag", "presliding", "presliding_hysteresis", "backlash")
    assert [step.added.name for step in steps if step.added] == ["presliding_hysteresis", "backlash"]


def test_a_rival_that_is_accepted_after_the_added_one_is_missing_too(
    searched: Callable[..., tuple[EffectStep, ...]],
) -> None:
    first, last = searched(lambda there, added: 25.0 / 5.0 ** len(there | added), "ip_lag", "backlash")
    assert last.added
    assert {each.name for each in first.indistinguishable} == {"ip_lag"}, "the other did as well, and comes after it"


def test_an_optimisers_failure_does_not_look_like_physics(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    """From the parameters of the valve with the effect, the one without comes as low: its own search had failed."""
    made = iter([20.0, 1.0])
    steps = searched(lambda there, added: 1.0 if there | added else next(made), "ip_lag", local_minimum=AT_FLOOR)
    (step,) = steps
    assert step.added is None
    assert step.before.explained, "the base as it was fitted again"


@pytest.mark.parametrize(
    ("lower", "alone", "named"),
    [
        (-0.1, 1.0, ["ip_lag"]),
        (-0.1, 1.1, ["ip_lag"]),
        (-0.1, 2.0, ["ip_lag", "flow_force"]),
        (0.1, 1.0, ["ip_lag", "flow_force"]),
    ],
    ids=["none, and needless", "none, and without it at the floor", "none, but needed", "some"],
)
def test_an_effect_whose_evidence_is_anothers_is_not_named(
    searched: Callable[..., tuple[EffectStep, ...]], lower: float, alone: float, named: list[str]
) -> None:
    """A dead time on a wrong step of its stair, put right beside a flow force of 0: the lag alone, from there, does."""

    def ends(there: Effects, added: Effects) -> float:
        if {"ip_lag", "flow_force"} <= there | added:
            return 1.0
        if "ip_lag" in there:
            return alone
        return 5.0 if "ip_lag" in added else 20.0

    strength = {"flow_force.force_n": Fitted(0.1, 0.1, lower, 0.3, False, True)}
    steps = searched(ends, "ip_lag", "flow_force", strengths=strength)
    assert [step.added.name for step in steps if step.added] == named
    assert steps[-1].before.explained == (named == ["ip_lag"])


def test_what_the_base_left_behind_is_refitted_from_it(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    """No effect makes a valve worse: a search that ends above the base has failed, and is made anew from a better."""
    bases, backlashes = iter([20.0, 4.0]), iter([19.0, 4.0])

    def ends(there: Effects, added: Effects) -> float:
        if "backlash" in added:
            return next(backlashes)
        return 3.9 if there | added else next(bases)

    begun: list[tuple[str, bool]] = []
    first = searched(ends, "backlash", "ip_lag", local_minimum=4.0 * AT_FLOOR, from_landings=begun)[0]
    assert begun.count(("backlash", False)) == 1, (
        "landings, which know nothing of the base, are not searched from again"
    )
    errors_m = {each.name: each.model.errors.test_rmse_m for each in first.candidates if each.model}
    assert errors_m["backlash"] == pytest.approx(4.0 * FLOOR_M)


def error_in_floors(step: EffectStep, name: str) -> float:
    (errors,) = (each.model.errors for each in step.candidates if each.name == name and each.model)
    return errors.test_rmse_m / FLOOR_M


def test_what_is_far_behind_is_not_searched_further(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    floors = {"ip_lag": 1.0, "backlash": 18.0, "stribeck": 9.0}
    (step,) = searched(lambda _, added: min((floors[each] for each in added), default=100.0), *floors, first=1.5)
    errors = floors | {"backlash": 1.5 * 18.0, "stribeck": 1.25 * 9.0}
    assert {name: error_in_floors(step, name) for name in floors} == pytest.approx(errors)


@pytest.mark.parametrize("least", [1.0, 10.0], ids=["leaves nothing", "leaves much"])
def test_what_is_behind_another_is_not_gone_on_from(
    searched: Callable[..., tuple[EffectStep, ...]], least: float
) -> None:
    floors = {"ip_lag": least, "backlash": 4.0 * least, "stribeck": 1.9 * least}
    step, *_ = searched(lambda _, added: min((floors[each] for each in added), default=1e3), *floors, first=1.1)
    errors = floors | {"backlash": 1.05 * 4.0 * least}
    assert {name: error_in_floors(step, name) for name in floors} == pytest.approx(errors)


def test_what_has_come_to_nothing_is_not_gone_on_from(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    floors = {"ip_lag": 2.0, COMES_TO_NOTHING: 2.1}
    step, *_ = searched(lambda _, added: min((floors[each] for each in added), default=1e3), *floors, first=1.1)
    assert error_in_floors(step, "ip_lag") == pytest.approx(2.0)
    assert error_in_floors(step, COMES_TO_NOTHING) == pytest.approx(1.05 * 2.1)


@pytest.mark.parametrize(("noise", "base"), [(True, 3.0), (False, 1.0)], ids=["leaves noise", "explains all"])
def test_beside_what_leaves_nothing_one_search_tells_and_all_are_made_where_there_is_evidence(
    searched: Callable[..., tuple[EffectStep, ...]], noise: bool, base: float
) -> None:
    """Nor are they gone on from where the base explains all: what it lacks lies beside it."""
    floors = {"ip_lag": 0.9 * base, "backlash": 0.993 * base}
    begun: list[str] = []
    step, *_ = searched(
        lambda _, added: min((floors[each] for each in added), default=base),
        *floors,
        first=1.005,
        noise=noise,
        all_of=begun,
    )
    assert begun[0] == "ip_lag"
    errors = {"ip_lag": floors["ip_lag"] * (1.0 if noise else 1.0025), "backlash": 1.005 * floors["backlash"]}
    assert {name: error_in_floors(step, name) for name in floors} == pytest.approx(errors)


def test_what_is_far_behind_on_the_way_waits_there(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    floors = {"ip_lag": 1.0, "backlash": 18.0, "stribeck": 9.0}
    begun: list[str] = []
    (step,) = searched(
        lambda _, added: min((floors[each] for each in added), default=100.0), *floors, way=2.0, all_of=begun
    )
    assert {name: error_in_floors(step, name) for name in floors} == pytest.approx(floors | {"backlash": 2.0 * 18.0})
    assert set(begun) == {"ip_lag", "stribeck"}


def test_what_waits_is_searched_on_where_something_is_left(searched: Callable[..., tuple[EffectStep, ...]]) -> None:
    floors = {"ip_lag": 3.0, "backlash": 35.0}
    step = searched(lambda _, added: min((floors[each] for each in added), default=100.0), *floors, way=2.0)[0]
    assert {name: error_in_floors(step, name) for name in floors} == pytest.approx(floors)


def test_what_is_named_is_searched_in_full_however_far_behind(
    searched: Callable[..., tuple[EffectStep, ...]],
) -> None:
    floors = {"sensor_offset": 1.0, "preload": 18.0}
    (step,) = searched(lambda _, added: min((floors[each] for each in added), default=100.0), *floors, first=1.5)
    assert {each.name for each in step.indistinguishable} == {"preload", "sensor_offset"}, "one by algebra"
    assert {name: error_in_floors(step, name) for name in floors} == pytest.approx(floors)


def test_the_experiment_is_for_the_first_set_that_a_record_can_tell_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []

    def experiment(fits: Sequence[Fit], *_: object, **__: object) -> Experiment:
        asked.append([each.valve.effect[0].name for each in fits])
        return Experiment("staircase", 7.0, np.arange(4.0), np.ones(4))

    monkeypatch.setattr(effect_search, "experiment", experiment)
    search = search_of(LIBRARY)
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
    searched: Callable[..., tuple[EffectStep, ...]], beside: float, rivals: list[str], alone: float
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

    def ends(there: Effects, added: Effects) -> float:
        return floors.get(there | added, 1.0)

    steps = searched(ends, "ip_lag", "backlash", "stribeck")
    assert [step.added.name for step in steps if step.added] == ["ip_lag", "stribeck"]
    assert sorted(each.name for each in steps[0].indistinguishable) == sorted(rivals)
