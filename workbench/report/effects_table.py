"""What a report says of effects: the verdict, the race they ran, what each added one is, which were not told apart."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from sim.effect import Effect, find_effect
from workbench.report import effect_ranking
from workbench.report.display_units import Quantity
from workbench.report.effect_ranking import RankedEffect
from workbench.report.report_html import Html, Row, keep_lines, plot, section, subheading, table, text
from workbench.select.equivalence import classes, distinguishing_record
from workbench.select.forward_selection import Candidate, CandidateT, FittedT, ForwardStep
from workbench.select.selection_thresholds import SELECTION

VERDICTS = {
    "adequate": ("good", "Nothing is missing that this recording could show."),
    "missing": ("good", "The missing effect is found."),
    "one_of": ("open", "It is one of several effects; this recording cannot show which."),
    "unexplained": ("bad", "Something is missing that no effect here explains."),
    "unjudged": ("open", "This recording cannot show whether anything is missing."),
    "unfinished": ("open", "Broken off: the results until then."),
    "untrusted": ("bad", "The fit is not to be trusted: searches from different starts disagree."),
}
KINDS = {"added": "good", "as good": "set"}
"""How a row is marked by what came of its effect."""


@dataclass(frozen=True, slots=True)
class RankedStep:
    """A forward step: what was there, its held-out error, SI, and all that was tried beside it."""

    beside: tuple[str, ...]
    before: float
    tried: Sequence[RankedEffect]


def headline(verdict: str, missing: Sequence[str], *, parameters_off: bool = False) -> tuple[str, str]:
    """Return how a verdict is marked, and its first words; `parameters_off`: nothing is missing, once refitted."""
    if parameters_off:
        return "open", "No effect is missing: the parameters were wrong."
    if verdict == "missing" and len(missing) > 1:
        return "good", "The missing effects are found."
    return VERDICTS[verdict]


def ranks(step: ForwardStep[FittedT, CandidateT]) -> list[RankedEffect]:
    """Return what came of each effect of a step."""

    def outcome(each: Candidate) -> str:
        if step.added and each.name == step.added.name:
            return "added"
        if each.name in {rival.name for rival in step.indistinguishable}:
            return "as good"
        return "accepted" if each.accepted else "refused"

    return [RankedEffect(each.tried, outcome(each)) for each in step.candidates]


def show_tried(steps: Sequence[RankedStep], floor: float | None, of: Quantity) -> Html:
    """Return the section of all steps."""
    shown = [
        text(
            "Each effect was added in turn, and the whole model refitted with it. "
            f"An effect is accepted if its evidence exceeds {SELECTION.least_evidence:g} on the fitted part and "
            f"{SELECTION.least_held_out:g} on the held-out part, and its parameters are physically possible."
        )
    ]
    dashed = "dashed the floor, " if floor is not None else ""
    for number, race in enumerate(steps, start=1):
        rows = sorted(race.tried, key=lambda each: each.order)
        shown += [
            subheading(f"Step {number}: beside {', '.join(race.beside)}" if race.beside else f"Step {number}"),
            plot(
                f"plot-ranking-{number}",
                effect_ranking.ranking(rows, race.before, floor, of),
                110 + 26 * len(rows),
                f"Held-out error, rms, with each effect added; {dashed}dotted the error without any of them. "
                "The scale is logarithmic.",
            ),
            table(
                f"table-ranking-{number}",
                [
                    "Effect",
                    "Outcome",
                    f"Held-out error, {of.unit}",
                    f"Fitted, {of.unit}",
                    "Evidence, held out",
                    "Evidence",
                ],
                [_row_of(each, of) for each in rows],
                (0, 1),
            ),
        ]
    return section("ranking", "The effects that were tried", *shown)


def _row_of(each: RankedEffect, of: Quantity) -> Row:
    return Row(
        [
            each.tried.name,
            each.said,
            of.shown(each.tried.test),
            of.shown(each.tried.train),
            "–" if each.tried.gain is None else f"{each.tried.gain.held_out_evidence:.3g}",
            "–" if each.tried.gain is None else f"{each.tried.gain.bic:.4g}",
        ],
        _effect(each.tried.name).text.rstrip("."),
        KINDS.get(each.outcome, ""),
    )


def show_added(names: Sequence[str], *parameters: Html) -> Html:
    """Return the section of what was added, with its equations; `parameters` is HTML that follows."""
    parts = []
    for effect in map(_effect, names):
        parts += [subheading(effect.name), text(effect.text, f"In a record: {effect.looks}" if effect.looks else "")]
        parts.append(keep_lines(effect.equation))
    if not parts:
        parts = [text("No effect was added; the parameters below are those of the valve itself, refitted.")]
    return section("added", "What was added", *parts, *parameters)


def not_told_apart(
    sets: Sequence[Sequence[str]], tried: Collection[str], missing: Sequence[str], otherwise: str
) -> Html:
    """Return the section of what could not be told apart; `otherwise` where the effects' files say nothing of it."""
    title = "What could not be told apart"
    if not sets:
        nothing = "No other effect explains the recording as well as the one that was added."
        return section("indistinguishable", title, text(nothing if missing else NO_QUESTION))
    library = {name: _effect(name) for name in tried}
    rows = [
        _two(name, other, library, otherwise)
        for names in sets
        for i, name in enumerate(names)
        for other in names[i + 1 :]
    ]
    return section(
        "indistinguishable",
        title,
        text(
            f"These explain the recording equally well: {'; '.join(' or '.join(names) for names in sets)}. "
            "This recording cannot show which it is. One of each set was added; it is not proved."
        ),
        table("table-indistinguishable", ["This", "or this", "What would tell them apart"], rows, (0, 1, 2)),
    )


NO_QUESTION = "No effect was accepted."


def _two(name: str, other: str, library: Mapping[str, Effect], otherwise: str) -> Row:
    same = len(classes((name, other), library)) == 1
    none = "none of pressure and position: their equations are the same" if same else otherwise
    return Row([name, other, distinguishing_record(name, other, library) or none])


def _effect(name: str) -> Effect:
    return find_effect(name, "effects")
