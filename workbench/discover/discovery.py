"""Discover: the form of an effect that nobody has written down. A form, not a cause.

The valve is fitted as it is. If that leaves nothing to explain, no form is sought. Else forms of the grammar are
ranked (`form_proposal`) and fitted one beside another, as effects' files, by the machinery of a diagnosis: the same
likelihood, the same rule on what was held out, the same floor. A form is believed only if it passes that rule and
leaves nothing to explain: a falling error alone proves nothing, of many forms less than of few. What does as well
stands beside it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import cpu_count
from typing import TYPE_CHECKING, Literal

from config.arguments import kinds_held
from config.errors import InputError
from config.recording import Recording
from config.results.block import Block
from config.results.result import Result
from config.valve_file import ValveFile
from workbench.data.held_out import Split, split
from workbench.data.noise_floor import say_m
from workbench.discover.added_force import Landing, landings
from workbench.discover.form_search import search_forms
from workbench.discover.found_form import FoundForm
from workbench.fit.parameter_estimate import parameter_table
from workbench.select.candidate_table import candidate_columns, candidate_table, lengths
from workbench.select.effect_candidates import EffectCandidate, EvaluatedModel
from workbench.select.effect_search import EffectSearch, Progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Outcome = Literal["found", "one_of", "none", "explained", "unjudged"]


@dataclass(frozen=True, slots=True, repr=False)
class Discovery(Result):
    """The form of what is missing, and all that led to it."""

    outcome: Outcome
    base: EvaluatedModel
    found: tuple[FoundForm, ...]
    """The best first, then those that do as well."""
    candidates: tuple[EffectCandidate, ...]
    """All that was fitted, by evidence, named by the forms' names."""
    untried: tuple[str, ...]
    split: Split
    landings: tuple[Landing, ...]

    @property
    def sentence(self) -> str:
        """What was found, in one sentence."""
        length = self.base.fit.kind.length
        floor = say_m(self.split.floor_m, length)
        match self.outcome:
            case "explained":
                return "nothing is left to explain: the valve as it is, refitted, is at the floor; no form is sought"
            case "unjudged" if self.split.early:
                return f"{self.split.early.sentence}. {self.split.early.advice}"
            case "unjudged":
                return "the noise is unknown, and with it whether anything is missing: say it, --noise-m M"
            case "none":
                return f"no form explains the recordings: {self._best_so_far()}, floor {floor}"
        best = self.found[0]
        error = f"{length.said(best.model.errors.test_rmse_m, '.4g')} rms held out, floor {floor}"
        rivals = f"; {len(self.found) - 1} more do as well" if len(self.found) > 1 else ""
        return f"a form, not a cause: {best.form.words}; {error}{rivals}"

    def _best_so_far(self) -> str:
        fitted = [each for each in self.candidates if each.model]
        if not fitted or not fitted[0].model:
            return "none could be fitted"
        left = self.base.fit.kind.length.said(fitted[0].model.errors.test_rmse_m, ".4g")
        return f"the best, {fitted[0].name}, leaves {left} rms held out"

    def blocks(self) -> list[Block]:
        """Say what was found, its equation and parameters, and what was tried."""
        errors, kind = self.base.errors, self.base.fit.kind
        title = (
            f"without: error {kind.length.said(errors.train_rmse_m, '.4g')} rms fitted, "
            f"{kind.length.number(errors.test_rmse_m, '.4g')} held out, floor {say_m(self.split.floor_m, kind.length)}"
        )
        said: list[Block] = [self.sentence]
        for each in self.found[:1]:
            said += ["\n".join(f"    {line}" for line in each.form.equations)]
            said.append(f"shown {each.shown}; beyond, nothing is known of it")
            said.append(parameter_table(each.model.fit.parameters, kind))
        said += [f"does as well: {each.form.words}: {each.form.equations[1]}" for each in self.found[1:]]
        if self.candidates:
            said.append(candidate_table([each.tried for each in self.candidates], lengths(kind), title))
        if self.untried:
            said.append(f"not fitted: {', '.join(self.untried)}")
        return said

    def frame_columns(self) -> dict[str, list[object]]:
        """Return a row a form: errors, m, evidence, accepted or why not."""
        return candidate_columns([each.tried for each in self.candidates], lengths(self.base.fit.kind))

    def plot(self) -> "Figure":
        """Draw what the best form adds over its variable, and what the landings miss where it is a force at rest."""
        from config.results.drawing import BETTER, MEASURED, MODEL, QUIET, legend, line, panels

        figure, (axes,) = panels({"": 4.0}, "position, of the stroke")
        if not self.found:
            self._draw_landings(axes, {1.0: MEASURED, -1.0: MODEL})
        for each, colour in zip(self.found[:1], (BETTER,), strict=False):
            added = each.added
            if each.form.is_static and each.form.variable.name == "position":
                self._draw_landings(axes, {1.0: MEASURED, -1.0: QUIET})
            for number, (name, values) in enumerate(added.added.items()):
                line(axes, added.over, values, (colour, MODEL, MEASURED, QUIET)[number % 4], name)
            axes.set_xlabel(f"{added.words}, {added.unit}" if added.words else "everywhere")
            axes.set_ylabel(f"added, {added.of}")
            axes.set_title(f"a form, not a cause: {each.form.words}", pad=24, fontsize=10)
        legend(axes)
        return figure

    def _draw_landings(self, axes: object, colours: Mapping[float, str]) -> None:
        """Mark what the balance without the form misses where slides ended in rest."""
        stroke_m = self.base.fit.valve.valve.stroke_m
        for way, words in ((1.0, "missing, landed opening"), (-1.0, "missing, landed closing")):
            there = [each for each in self.landings if each.direction == way]
            x, y = [each.position_m / stroke_m for each in there], [each.missing_n for each in there]
            axes.scatter(x, y, s=14, color=colours[way], label=words, alpha=0.7)  # type: ignore[attr-defined]


@kinds_held
def discover(
    recording: Recording | Sequence[Recording],
    valve: ValveFile,
    *,
    test: Recording | None = None,
    workers: int | None = None,
    from_pressure: bool = False,
    on_proposal: Callable[[tuple[str, ...]], None] | None = None,
    progress: Progress | None = None,
) -> Discovery:
    """Find the form of what a valve file lacks to explain a recording.

    Args:
        recording: one or several.
        valve: where the fit begins; its own effects stay.
        test: held out; by default the last third of the recording.
        workers: threads, by default one a core; the result does not depend on it.
        from_pressure: drive the stem by its measured pressure; no form is sought before that.
        on_proposal: given the forms' names, the likeliest first, as soon as they are there.
        progress: called with what is being done, and the fraction of it done.

    Raises:
        InputError: the recording holds too little, other units than SI, a set point and no command, or no pressure
            where it is to drive the stem.
    """
    parts = split([recording] if isinstance(recording, Recording) else recording, test)
    if parts.train.record.by_setpoint:
        raise InputError("recording", "has a set point and no pressure: a form is sought where command_pa is there")
    threads = workers or cpu_count() or 1
    tell = progress or (lambda _what, _done: None)
    search = EffectSearch(parts, {}, valve, workers=threads, progress=tell, from_pressure=from_pressure)
    base = search.base(valve)
    parts = search.split
    if base.explained or parts.floor_m is None or parts.early:
        return Discovery("explained" if base.explained and not parts.early else "unjudged", base, (), (), (), parts, ())
    searched = search_forms(parts, valve, base, workers=threads, progress=tell, on_proposal=on_proposal)
    found = searched.found
    outcome: Outcome = "none" if not found else "found" if len(found) == 1 else "one_of"
    missing = tuple(landings(base.fit, parts))
    return Discovery(outcome, base, found, searched.candidates, searched.untried, parts, missing)
