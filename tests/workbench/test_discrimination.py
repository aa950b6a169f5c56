"""The odds on hand-made fits, the rounds with a scripted designer and player, and one whole journey in virtual time."""

import json
from collections.abc import Sequence
from dataclasses import replace
from math import log
from pathlib import Path
from types import SimpleNamespace
from typing import Literal

import numpy as np
import pytest

from config.experiment_limits import ExperimentLimits
from config.recording import Recording
from config.valve_file import EffectTable, ValveFile
from positioner.cli.main import main
from sim.composition import Composition
from sim.effect import shipped_effect, shipped_effects
from sim.open_loop import respond
from tests.workbench.hand_made import AT_FLOOR, fit_of
from tests.workbench.valves import drawn_valve, record_of, with_effect
from workbench.discriminate import rival_odds
from workbench.discriminate.discrimination import SURE, Discrimination, Played, Player, Round, discriminate
from workbench.discriminate.experiment_design import (
    MOST_MOVES,
    Course,
    DesignedExperiment,
    Leg,
    Terms,
    tells_apart,
)
from workbench.discriminate.rival_odds import ASKED, RivalOdds, Weighed, evidence
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import fit
from workbench.select.selection_thresholds import SELECTION
from workbench.select.separating_experiment import REST_S

LIBRARY = {name: shipped_effect(name, "library") for name in shipped_effects()}
BARE = drawn_valve(np.random.default_rng(11))
LAGGING = with_effect(BARE, "ip_lag", time_constant_s=0.06)
RIVALS = ("ip_lag", "dead_time")
PERIOD_S = 0.01
BOUNDS = ExperimentLimits(0.0, 90e3, 400e3, 12.0, -1.0, 1.0)
COURSE = Course("by hand", 10e3, (Leg(60e3, 0.1, 2.0), Leg(15e3, 0.1, 2.0)))


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record_of(LAGGING, 1, 700)


@pytest.fixture(scope="module")
def fits(recording: Recording) -> dict[str, Fit]:
    base = fit(recording, BARE)
    return {name: fit(recording, BARE, effects=(name,), base=base) for name in RIVALS}


def weighed(left: float, logs: Sequence[float], *effects: str) -> Weighed:
    """Return a rival that leaves so many times the noise's mean square, and these errors event by event."""
    return Weighed(fit_of(*effects, cost=left * AT_FLOOR), np.array(logs))


NOTHING = [0.0] * 20


def apart(size: float) -> list[float]:
    """Return errors, event by event, that differ from none by so much, with some scatter."""
    return [size * (1.0 + 0.1 * (-1.0) ** i) for i in range(20)]


def test_log_odds_by_hand() -> None:
    independent = sum(each.independent for each in fit_of().terms.each)
    best, rival = weighed(1.0, NOTHING), weighed(1.1, apart(0.15))
    assert evidence(best, rival) == pytest.approx(0.5 * independent * log(1.1))
    assert evidence(rival, best) == pytest.approx(-evidence(best, rival))


def test_a_parameter_more_costs_the_rival_evidence() -> None:
    best = weighed(1.0, NOTHING)
    more = evidence(best, weighed(1.1, apart(0.15), "ip_lag")) - evidence(best, weighed(1.1, apart(0.15)))
    assert more == pytest.approx(0.5 * log(fit_of().terms.events))


def test_one_event_that_went_wrong_gives_little_odds() -> None:
    assert evidence(weighed(1.0, NOTHING), weighed(1.8, [3.0] + [0.0] * 19)) < log(6.0)


def test_events_that_hardly_agree_say_hardly_more_than_chance() -> None:
    one_deviation_in_five = [0.1 + 0.5 * (-1.0) ** i for i in range(24)] + [0.1]
    best = weighed(1.0, [0.0] * 25)
    assert evidence(best, weighed(1.1, one_deviation_in_five)) == pytest.approx(1.67, rel=0.1)


def test_where_events_speak_against_what_all_residuals_say_nothing_is_said() -> None:
    assert evidence(weighed(1.0, NOTHING), weighed(1.1, apart(-0.15))) == 0.0


def test_the_moves_of_a_course_are_the_times_its_command_sets_out() -> None:
    way = np.sign(np.diff(COURSE.sample_every(PERIOD_S)[1]))
    assert np.sum((way != 0) & (way != np.concatenate([[0], way[:-1]]))) == COURSE.moves == 2


def test_a_course_stays_inside_its_bounds() -> None:
    wild = Course("wild", 200e3, (Leg(-50e3, 0.0, 60.0), Leg(100e3, 1.0, 60.0)))
    tame = wild.within(BOUNDS)
    time_s, command_pa = tame.sample_every(1e-3)
    assert command_pa.min() >= BOUNDS.minimum_pa
    assert command_pa.max() <= BOUNDS.maximum_pa
    assert tame.duration_s <= BOUNDS.longest_s * (1 + 1e-9)
    assert np.max(np.abs(np.diff(command_pa)) / np.diff(time_s)) <= BOUNDS.rate_pa_per_s * (1 + 1e-6)


def test_a_pair_that_no_course_tells_apart_is_left_out_unless_there_is_no_other() -> None:
    rated = np.array([[0.2, 0.0005, -0.3], [-0.1, 0.0, 0.002]])
    assert tells_apart(rated, 1e-3).tolist() == [True, False, True]
    assert tells_apart(rated[:, 1:2], 1e-3).tolist() == [True]


def test_an_experiment_is_designed_for_the_likeliest(
    fits: dict[str, Fit], recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    race = RivalOdds({f"ip_lag {i}": fits["ip_lag"] for i in range(ASKED + 1)}, (recording,), 1)
    asked: list[object] = []
    monkeypatch.setattr(rival_odds, "design_experiment", lambda left, *_, **__: asked.extend(left))
    race.experiment(Terms(BOUNDS))
    assert len(race.alive) > ASKED
    assert asked == race.alive[:ASKED]


def answer_of(valve: ValveFile, chosen: DesignedExperiment) -> Played:
    """Let a valve answer."""
    composition = Composition.from_file(valve)
    time_s, command_pa = chosen.course.sample_every(PERIOD_S)
    response = respond(composition, composition.theta, command_pa[:-1], PERIOD_S)
    noise_m = 5e-5 * np.random.default_rng(chosen.course.moves).standard_normal(time_s.size)
    columns = {"time_s": time_s, "command_pa": command_pa, "position_m": response.indicated_m + noise_m}
    return Played(Recording({name: column[time_s >= REST_S] for name, column in columns.items()}))


def answering(chosen: DesignedExperiment) -> Played:
    return answer_of(LAGGING, chosen)


class Design:
    """A designer that says one thing of few moves, and the same or another of many; it notes on what terms."""

    def __init__(
        self, separation: float, course: Course = COURSE, of_many: float | None = None, many: Course | None = None
    ) -> None:
        self.course = course
        self._few = DesignedExperiment(course, separation)
        self._many = DesignedExperiment(many or course, of_many or separation)
        self.terms: list[Terms] = []

    @property
    def asked(self) -> list[int]:
        return [each.most_moves for each in self.terms]

    def __call__(self, race: RivalOdds, terms: Terms) -> DesignedExperiment | None:
        self.terms.append(terms)
        return self._few if terms.most_moves < MOST_MOVES else self._many


def silent(_: DesignedExperiment) -> Played:
    return Played(None, "vetoed")


def test_one_class_by_algebra_is_said_and_nothing_is_played(fits: dict[str, Fit], recording: Recording) -> None:
    twins = {"preload": fits["ip_lag"], "sensor_offset": fits["ip_lag"]}
    found = discriminate(twins, [recording], silent, BOUNDS, LIBRARY)
    assert (found.outcome, found.rounds) == ("one_class", ())
    assert set(found.named) == {"preload", "sensor_offset"}
    assert "one by algebra" in found.sentence


def test_what_a_refit_imitates_is_not_played(fits: dict[str, Fit], recording: Recording) -> None:
    found = discriminate(fits, [recording], silent, BOUNDS, LIBRARY, design=Design(1.0))
    assert (found.outcome, found.named, found.rounds) == ("not_separable", (), ())
    assert "cannot be told apart by this valve within these permissives" in found.sentence


@pytest.mark.long
def test_little_promised_is_played_while_moves_are_left(fits: dict[str, Fit], recording: Recording) -> None:
    """A valve that scatters: no experiment promises the odds however often it is repeated; they are played."""
    twin = {"ip_lag": fits["ip_lag"], "rate_limit": fits["ip_lag"]}
    found = discriminate(twin, [recording], answering, BOUNDS, LIBRARY, design=Design(1.002), budget=4)
    assert (found.outcome, found.moves) == ("budget_spent", 4)


@pytest.mark.long
def test_a_run_that_told_nothing_waits(fits: dict[str, Fit], recording: Recording) -> None:
    twin = {"ip_lag": fits["ip_lag"], "rate_limit": fits["ip_lag"]}
    design = Design(2.0)
    found = discriminate(twin, [recording], answering, BOUNDS, LIBRARY, design=design, budget=4)
    assert (found.outcome, found.moves) == ("budget_spent", 4)
    assert design.terms[0].without == frozenset()
    assert design.terms[-1].without == frozenset({COURSE.name})


@pytest.mark.long
def test_where_nothing_else_promises_all_are_asked_again(fits: dict[str, Fit], recording: Recording) -> None:
    twin = {"ip_lag": fits["ip_lag"], "rate_limit": fits["ip_lag"]}

    class Once(Design):
        def __call__(self, race: RivalOdds, terms: Terms) -> DesignedExperiment | None:
            chosen = super().__call__(race, terms)
            return None if terms.without else chosen

    design = Once(2.0)
    found = discriminate(twin, [recording], answering, BOUNDS, LIBRARY, design=design, budget=4)
    assert (found.outcome, found.moves) == ("budget_spent", 4)
    assert frozenset({COURSE.name}) in [each.without for each in design.terms]
    assert design.terms[-1].without == frozenset()


@pytest.mark.parametrize("outcome", ["not_separable", "budget_spent"])
def test_who_is_ruled_out_is_said(outcome: Literal["not_separable", "budget_spent"]) -> None:
    rivals = ("flow_force",), ("sensor_nonlinearity",), ("preload", "sensor_offset")
    last = Round("staircase", 1.0, 6, {"flow_force": 1.0, "sensor_nonlinearity": 0.4, "preload": 0.009})
    found = Discrimination(outcome, (), rivals, (last,), 2.4, {}, (), "")
    assert found.sentence.startswith("flow_force or sensor_nonlinearity: ")
    assert "ruled out: preload" in found.sentence
    assert found.as_json()["lost"] == ["preload"]


@pytest.mark.parametrize(
    ("few", "many", "asked", "played"),
    [(SURE, 9.0, [3], "few moves"), (1.5, 1.4, [3, 8], "few moves"), (1.4, 1.5, [3, 8], "many moves")],
)
def test_few_moves_are_played_where_they_will_do(
    fits: dict[str, Fit], recording: Recording, few: float, many: float, asked: list[int], played: str
) -> None:
    told: list[str] = []

    def noted(chosen: DesignedExperiment) -> Played:
        told.append(chosen.course.name)
        return silent(chosen)

    courses = replace(COURSE, name="few moves"), replace(COURSE, name="many moves", legs=3 * COURSE.legs)
    design = Design(few, courses[0], many, courses[1])
    discriminate(fits, [recording], noted, BOUNDS, LIBRARY, design=design, budget=30)
    assert (design.asked, told) == (asked, [played])


def test_what_the_valve_does_not_play_stops_it(fits: dict[str, Fit], recording: Recording) -> None:
    told: list[tuple[str, float]] = []
    design = Design(2.0)
    found = discriminate(
        fits, [recording], silent, BOUNDS, LIBRARY, design=design, progress=lambda *each: told.append(each)
    )
    playing = f"playing experiment 1, {design.course.name}, {design.course.duration_s:.0f} s"
    assert told == [("choosing experiment 1", 0.0), (playing, 0.0)]
    assert (found.outcome, found.named) == ("stopped", ())
    assert "vetoed" in found.sentence


@pytest.mark.long
def test_twins_spend_the_budget_and_nothing_is_named(fits: dict[str, Fit], recording: Recording) -> None:
    twin = {"ip_lag": fits["ip_lag"], "rate_limit": fits["ip_lag"]}
    design = Design(2.0)
    found = discriminate(twin, [recording], answering, BOUNDS, LIBRARY, design=design, budget=4)
    assert (found.outcome, found.named, found.moves) == ("budget_spent", (), 4)
    assert len(found.recordings) == len(found.rounds) == 2
    assert max(design.asked) <= 4
    assert found.odds == pytest.approx(1.0)


@pytest.fixture
def words(fits: dict[str, Fit], recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """A command line; all but the diagnosis and the wire, which have their own tests."""
    rivals = [SimpleNamespace(name=name, model=SimpleNamespace(fit=each)) for name, each in fits.items()]
    steps = [SimpleNamespace(indistinguishable=rivals)]
    diagnosis = SimpleNamespace(verdict="one_of", sentence="one of two", steps=steps)
    monkeypatch.setattr("workbench.diagnosis.diagnosis.diagnose", lambda *_, **__: diagnosis)
    monkeypatch.setattr("positioner.cli.parts.experiment_player.require_ready", lambda *_: None)
    monkeypatch.setattr("positioner.cli.parts.experiment_player.player_on", lambda *_: answering)
    config, rec = tmp_path / "site.toml", tmp_path / "rec.csv"
    config.write_text(
        f"[valve]\nstroke_m = {BARE.valve.stroke_m}\n[pressure]\nmaximum_pa = 80e3\n"
        "[experiment]\ntravel_window = [0.0, 1.0]\nrate_limit_pa_per_s = 400e3\nlimit_s = 6.0\n"
    )
    recording.write(rec)
    return ["discriminate", str(config), "--rec", str(rec), "--valve", "seed", "--out", str(tmp_path / "told")]


@pytest.mark.long
def test_the_command_tells_a_lag_from_a_dead_time(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "told"
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "resolved: ip_lag is missing" in said
    assert "separation" in said.splitlines()[1], "a line a round, as it comes"
    verdict = json.loads((out / "verdict.json").read_text())
    assert (verdict["outcome"], verdict["named"]) == ("resolved", ["ip_lag"])
    assert verdict["odds"] is None or verdict["odds"] >= 100.0
    assert 0 < verdict["moves"] <= 12
    assert len(list(out.glob("experiment-*.csv"))) == len(verdict["rounds"]) > 0
    assert set(verdict["fits"]["ip_lag"]) == {"rmse_m", "parameters"}


def test_broken_off_it_says_that_nothing_is_named_and_keeps_what_was_played(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken_off(_fits: object, _recordings: object, player: Player, *_: object, **__: object) -> None:
        player(DesignedExperiment(COURSE, 1.0))
        raise KeyboardInterrupt

    monkeypatch.setattr("workbench.discriminate.discrimination.discriminate", broken_off)
    assert main(words) == 130
    told = tmp_path / "told"
    said = capsys.readouterr().err
    assert f"positioner discriminate: broken off; nothing is named; what was played is in {told}" in said
    kept = Recording.read(told / "experiment-1.csv")
    assert kept.time_s[-1] == pytest.approx(COURSE.duration_s, abs=3.0)
    assert not (told / "verdict.json").exists()
    first = (told / "experiment-1.csv").read_bytes()
    assert main(words) == 130
    assert (told / "experiment-1.csv").read_bytes() == first, "no valve plays it again"
    assert (told / "experiment-2.csv").exists()


def test_a_time_limit_that_leaves_no_room_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = tmp_path / "site.toml"
    config.write_text("[valve]\nstroke_m = 0.1\n[experiment]\nrate_limit_pa_per_s = 10e3\nlimit_s = 60.0\n")
    assert main(["discriminate", str(config), "--rec", "none.csv", "--valve", "seed"]) == 2
    assert "site.toml: experiment.limit_s must exceed 126 s" in capsys.readouterr().err


@pytest.mark.long
def test_an_effect_that_begins_to_act_only_then_gives_no_odds(fits: dict[str, Fit], recording: Recording) -> None:
    growing = EffectTable.model_validate({"name": "position_friction", "growth": 0.4, "travel_m": BARE.valve.stroke_m})
    changed = ValveFile(valve=LAGGING.valve, effect=(*LAGGING.effect, growing))
    found = discriminate(
        fits, [recording], lambda chosen: answer_of(changed, chosen), BOUNDS, LIBRARY, design=Design(2.0), budget=4
    )
    assert found.named == ()


def test_the_best_is_not_named_if_it_does_not_explain_the_experiments(
    fits: dict[str, Fit], recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("workbench.discriminate.rival_odds.SELECTION", replace(SELECTION, rarely_off=0.5))
    found = discriminate(fits, [recording], answering, BOUNDS, LIBRARY, design=Design(2.0))
    assert (found.outcome, found.named) == ("unexplained", ())
    assert found.odds >= 100.0
    assert "something else is missing" in found.sentence
