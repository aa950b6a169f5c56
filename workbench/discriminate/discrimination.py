"""Rivals told apart by experiments: design, play, refit all on all recordings, weigh; until one is left.

    resolved       the best one's odds have reached 100 : 1
    one_class      all rivals are one by algebra: no record of pressure and position tells them apart
    not_separable  a refit imitates every experiment inside the bounds: separation 1
    budget_spent   the moves allowed are used up
    unexplained    the best one does not explain the experiments: the effect is none of the rivals
    stopped        the valve did not play an experiment: a permissive, a veto, a fault

How they are weighed stands in `rival_odds`. Members of one class by algebra (`equivalence`) are one rival; no
experiment is played for them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, log
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from config.experiment_limits import ExperimentLimits
from config.recording import Recording
from config.results.block import Block, Table
from config.results.result import Result
from sim.effect import Effect
from workbench.diagnosis.diagnosis import Diagnosis
from workbench.discriminate.experiment_design import (
    IMITATED,
    MOST_MOVES,
    DesignedExperiment,
    Terms,
)
from workbench.discriminate.rival_odds import ODDS, RivalOdds
from workbench.discriminate.rivals_by_pressure import race_by_pressure
from workbench.fit.fit_result import Fit
from workbench.fit.parameter_estimate import parameters_json
from workbench.select.effect_search import Progress
from workbench.select.equivalence import classes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BUDGET = 60
"""Moves."""
FEW_MOVES, SURE = 3, 3.0
"""An experiment of few moves will do if a rival's cost is so many times the valve's that answered."""
LEAST_TOLD = 0.25
"""Of the log odds wanted, or of what an experiment promised: an input that told less waits until all have told."""

Outcome = Literal["resolved", "one_class", "not_separable", "budget_spent", "unexplained", "stopped"]


@dataclass(frozen=True, slots=True)
class Played:
    """What came of an experiment: its recording, or why there is none."""

    recording: Recording | None
    problem: str = ""


Player = Callable[[DesignedExperiment], Played]
"""Plays an experiment on the valve, real or simulated."""


Designer = Callable[[RivalOdds, Terms], DesignedExperiment | None]
"""Chooses the next experiment; None if none is allowed."""


def by_design(race: RivalOdds, terms: Terms) -> DesignedExperiment | None:
    """Return the experiment that separates the likeliest rivals the most."""
    return race.experiment(terms)


@dataclass(frozen=True, slots=True)
class Round:
    """An experiment played: moves used by then, and the odds of each rival against the best, at most 1."""

    name: str
    separation: float
    moves: int
    odds: Mapping[str, float]


@dataclass(frozen=True, slots=True, repr=False)
class Discrimination(Result):
    """What the experiments came to."""

    outcome: Outcome
    named: tuple[str, ...]
    """The effect that was found, with those that are one with it by algebra; empty if none."""
    rivals: tuple[tuple[str, ...], ...]
    """Classes by algebra."""
    rounds: tuple[Round, ...]
    odds: float
    """Of the best against all others together."""
    fits: Mapping[str, Fit]
    recordings: tuple[Recording, ...]
    """Of the experiments."""
    problem: str

    @property
    def moves(self) -> int:
        """Used."""
        return self.rounds[-1].moves if self.rounds else 0

    @property
    def lost(self) -> tuple[str, ...]:
        """The first of each class against which the experiments have come to `ODDS`."""
        odds = self.rounds[-1].odds if self.rounds else {}
        return tuple(each[0] for each in self.rivals if odds.get(each[0], 1.0) < 1.0 / ODDS)

    @property
    def sentence(self) -> str:
        """Say what came of it."""
        who = " or ".join("/".join(each) for each in self.rivals)
        left = " or ".join("/".join(each) for each in self.rivals if each[0] not in self.lost)
        lost = f"; ruled out: {', '.join(self.lost)}" if self.lost else ""
        after = f"after {self.moves} moves in {len(self.rounds)} experiments"
        told = f"; best odds {_odds(self.odds)}" if self.rounds else ""
        match self.outcome:
            case "resolved":
                same = f" ({' and '.join(self.named[1:])} would look the same)" if len(self.named) > 1 else ""
                return f"{self.named[0]} is missing{same}: odds {_odds(self.odds)} {after}"
            case "one_class":
                return f"{who}: one by algebra, no record of pressure and position tells them apart"
            case "not_separable":
                return f"{left}: cannot be told apart by this valve within these permissives ({after}{told}{lost})"
            case "budget_spent":
                return f"{left}: not told apart {after}, the budget{told}{lost}"
            case "unexplained":
                return f"none of {who} explains the experiments: something else is missing ({after})"
        return f"{who}: not told apart, the valve did not play on: {self.problem} ({after})"

    def blocks(self) -> list[Block]:
        """Say the outcome, and each round."""
        names = [each[0] for each in self.rivals]
        rows = [
            (
                str(i),
                each.name,
                str(each.moves),
                f"{each.separation:.3g}",
                *(f"{each.odds[name]:.2g}" for name in names),
            )
            for i, each in enumerate(self.rounds, start=1)
        ]
        table = [Table(("round", "experiment", "moves", "separation", *names), rows)] if rows else []
        return [f"{self.outcome}: {self.sentence}", *table]

    def frame_columns(self) -> dict[str, list[object]]:
        """Return a row an experiment."""
        columns: dict[str, list[object]] = {
            "experiment": [each.name for each in self.rounds],
            "moves": [each.moves for each in self.rounds],
            "separation": [each.separation for each in self.rounds],
        }
        return columns | {each[0]: [row.odds[each[0]] for row in self.rounds] for each in self.rivals}

    def plot(self) -> "Figure":
        """Draw the odds of each rival against the best, experiment by experiment."""
        from config.results.drawing import MEASURED, legend, line, panels

        figure, (axes,) = panels({"odds against the best": 3.0}, "moves")
        moves = np.array([each.moves for each in self.rounds], dtype=np.float64)
        for name in (each[0] for each in self.rivals):
            line(axes, moves, np.array([each.odds[name] for each in self.rounds]), MEASURED, name)
        axes.set_yscale("log")
        legend(axes)
        return figure

    def as_json(self) -> dict[str, Any]:
        """Return it in plain types; SI units, in the names."""
        return {
            "outcome": self.outcome,
            "sentence": self.sentence,
            "named": list(self.named),
            "rivals": [list(each) for each in self.rivals],
            "lost": list(self.lost),
            "odds": self.odds,
            "moves": self.moves,
            "problem": self.problem,
            "rounds": [
                {"experiment": each.name, "separation": each.separation, "moves": each.moves, "odds": dict(each.odds)}
                for each in self.rounds
            ],
            "fits": {
                name: {"rmse_m": each.rms_m, "parameters": parameters_json(each.parameters)}
                for name, each in self.fits.items()
            },
        }


def discriminate(
    fits: Mapping[str, Fit],
    recordings: Sequence[Recording],
    player: Player,
    bounds: ExperimentLimits,
    library: Mapping[str, Effect],
    *,
    budget: int = BUDGET,
    design: Designer = by_design,
    seed: int = 0,
    workers: int | None = None,
    on_round: Callable[[Round], None] | None = None,
    progress: Progress | None = None,
) -> Discrimination:
    """Tell rivals apart by experiments on the valve.

    Args:
        fits: by the name of the effect in which they differ: each valve as fitted to the recordings.
        recordings: so far.
        player: plays an experiment.
        bounds: that every experiment stays inside.
        library: the effects by name.
        budget: moves allowed.
        design: chooses the next experiment.
        seed: of the designs.
        workers: threads, by default one a core.
        on_round: told each round when it is weighed.
        progress: called with what is being done, and the fraction of the budget used; 1 where a round ends.

    Raises:
        InputError: the recordings hold too little.
    """
    gathered = tuple(tuple(sorted(each, key=list(fits).index)) for each in classes(fits, library))
    if len(gathered) > 1:
        fits = race_by_pressure(fits, recordings, library, workers)
    race = RivalOdds({each[0]: fits[each[0]] for each in gathered}, tuple(recordings), workers)
    rounds: list[Round] = []
    experiments: list[Recording] = []
    outcome: Outcome | None = "one_class" if len(gathered) == 1 else None
    problem, used = "", 0
    waiting: set[str] = set()
    tell = progress or (lambda _what, _done: None)
    while outcome is None:
        left, number = budget - used, len(rounds) + 1
        tell(f"choosing experiment {number}", used / budget)
        chosen = _choose_experiment(race, Terms(bounds, left, seed + len(rounds), frozenset(waiting)), design)
        if chosen is None or chosen.separation < IMITATED:
            if waiting:
                waiting.clear()
                continue
            outcome = "not_separable"
            break
        tell(f"playing experiment {number}, {chosen.course.name}, {chosen.course.duration_s:.0f} s", used / budget)
        played = player(chosen)
        if played.recording is None:
            outcome, problem = "stopped", played.problem
            break
        experiments.append(played.recording)
        used += chosen.course.moves
        tell(f"refitting the rivals to experiment {number}", used / budget)
        before = race.odds
        race = race.with_recording(played.recording)
        if abs(log(max(race.odds, 1e-9)) - log(max(before, 1e-9))) < LEAST_TOLD * log(ODDS):
            waiting.add(chosen.course.name)
        rounds.append(Round(chosen.course.name, chosen.separation, used, race.relative))
        tell(f"experiment {number} weighed", 1.0)
        if on_round:
            on_round(rounds[-1])
        outcome = race.decided or ("budget_spent" if used >= budget else None)
    named = next(each for each in gathered if each[0] == race.best) if outcome in ("resolved", "one_class") else ()
    return Discrimination(outcome, named, gathered, tuple(rounds), race.odds, race.fits, tuple(experiments), problem)


def _choose_experiment(race: RivalOdds, terms: Terms, design: Designer) -> DesignedExperiment | None:
    """Return the shortest experiment that will do by what it separates, or else the one that separates most."""
    best = None
    for most in sorted({min(each, terms.most_moves) for each in (FEW_MOVES, MOST_MOVES)}):
        chosen = design(race, replace(terms, most_moves=most))
        if chosen is None:
            continue
        if chosen.separation >= SURE:
            return chosen
        if best is None or chosen.separation > best.separation:
            best = chosen
    return best


def rivals_of(diagnosis: Diagnosis) -> dict[str, Fit]:
    """Return the fits of the first set with more than one member; empty if there is none."""
    for step in diagnosis.steps:
        fits = {each.name: each.model.fit for each in step.indistinguishable if each.model}
        if len(fits) > 1:
            return fits
    return {}


def _odds(odds: float) -> str:
    return f"{odds:.3g} : 1" if odds < inf else "beyond number"
