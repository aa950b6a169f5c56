"""Which effect is missing in a balance of forces (`force_balance`): forward steps, each effect tried in every one.

The rule by which an effect is accepted is that of `effect_acceptance`, over strokes or readings in place of seconds.

All is explained if the median error comes within a factor of the floor, which is a median too: a row at a reversal may
count for either direction, and is off by twice the friction whatever the balance.

An effect that does as well as the one added, and is still accepted after it, is no rival of it but missing too: rivals
are those that have nothing left to explain then. One step more than is added shows which.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from config.arguments import kinds_held
from config.recording import Recording
from config.results.block import Block, Table
from config.results.result import Result
from config.valve_file import ValveFile
from sim.effect import Effect
from workbench.data.imposed_motion import Rows, rows_of
from workbench.diagnosis.verdict import Verdict
from workbench.diagnosis.verdict_sentence import rivals_sentence, verdict_line
from workbench.forces.force_balance import Balance, ForceFit, ForceModel, floor_of
from workbench.select.block_errors import indistinguishable, relative_error_reduction
from workbench.select.candidate_table import NEWTONS, Tried, candidate_columns, candidate_table, draw_race
from workbench.select.effect_acceptance import Gain, no_better
from workbench.select.forward_selection import Candidate, ForwardSelection, ForwardStep, without_missing
from workbench.select.selection_thresholds import SELECTION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BALANCE_FLOORS = 1.25
"""A balance reaches the floor if its median error is within this of what strokes differ by among themselves."""


@dataclass(frozen=True, slots=True, repr=False)
class ForceCandidate(Candidate):
    """An effect fitted beside the balance before."""

    fit: ForceFit
    gain: Gain

    @property
    def tried(self) -> Tried:
        """Its row of the table."""
        errors_n = (self.fit.train_rms_n, self.fit.test_rms_n, self.fit.median_error_n)
        return Tried(self.step, self.name, *errors_n, self.gain, self.rejection_reason)


ForceStep = ForwardStep[ForceFit, ForceCandidate]


@dataclass(frozen=True, slots=True, repr=False)
class ForceDiagnosis(Result, ForwardSelection[ForceFit, ForceCandidate]):
    """What is missing in the balance of forces, and all that led to it; verdicts as those of `verdict`."""

    verdict: Verdict
    sentence: str
    base: ForceFit
    best: ForceFit
    floor_n: float | None
    rows: Rows

    def blocks(self) -> list[Block]:
        """Say the verdict, what was tried in each step, and the parameters of the best balance."""
        said: list[Block] = [verdict_line(self.verdict, self.sentence)]
        floor = "" if self.floor_n is None else f", floor {self.floor_n:.4g}"
        for number, step in enumerate(self.steps, start=1):
            before = step.before
            title = (
                f"step {number}: error {before.train_rms_n:.4g} N rms fitted, {before.test_rms_n:.4g} held out{floor}"
            )
            said.append(candidate_table([each.tried for each in step.candidates], NEWTONS, title))
        rows = [
            (name, f"{value:.6g}", "" if std is None else f"{std:.2g}")
            for name, value in self.best.parameters.items()
            for std in (self.best.deviations.get(name),)
        ]
        said.append(
            Table(("parameter", "value", "std"), rows, f"with {' and '.join(self.missing) or 'nothing added'}:")
        )
        return said + [f"recording: {note}" for note in self.rows.notes]

    def frame_columns(self) -> dict[str, list[object]]:
        """Return a row a candidate of each step: errors, N, evidence, accepted or why not."""
        return candidate_columns([each.tried for each in self.candidates], NEWTONS)

    def plot(self) -> "Figure":
        """Draw the held-out error with each effect in the first step; those added and their rivals in colour."""
        step = self.steps[0]
        chosen = {*self.missing, *(each.name for each in step.indistinguishable)}
        tried = [each.tried for each in step.candidates]
        return draw_race(tried, chosen, step.before.test_rms_n, self.floor_n, NEWTONS)


@kinds_held
def diagnose_forces(
    recordings: Recording | Sequence[Recording], valve: ValveFile, *, test: Recording | None = None
) -> ForceDiagnosis:
    """Find what a balance of forces lacks.

    Args:
        recordings: of a bench, `time_s, pressure_pa, position_m, load_n`, or static curves (`imposed.read_imposed`).
        valve: its stroke, mass, and for a static curve its area.
        test: held out from the fit; by default what is left out is predicted in turn.

    Raises:
        InputError: a column is missing, there is too little, of one direction only, or other units than SI.
    """
    given = [recordings] if isinstance(recordings, Recording) else list(recordings)
    rows = rows_of([*given, *([test] if test else [])], valve.valve)
    balance = Balance(rows, valve.valve, tested=test is not None)
    if balance.fit_model(ForceModel(), bounded=False).parameters["coulomb_n"] < 0.0 and rows.load_n is not None:
        balance = Balance(rows.turned(), valve.valve, tested=test is not None)
    return _search(balance)


def _search(balance: Balance) -> ForceDiagnosis:
    here = ForceModel()
    base = fit = balance.fit_model(here)
    library = balance.library
    steps: list[ForceStep] = []
    while True:
        floor_n = floor_of(balance.rows, fit.residual_n)
        found = {name: _best(balance, here, name) for name in library if _is_new(name, here.effects, library)}
        step = _step(len(steps) + 1, fit, {name: fitted for name, (_, fitted) in found.items()}, library)
        if steps:
            steps[-1] = without_missing(steps[-1], step, library)
        explained = floor_n is not None and fit.median_error_n <= BALANCE_FLOORS * floor_n
        if len(steps) == SELECTION.most_added or (steps and explained):
            break
        steps.append(step)
        if step.added is None:
            break
        here, fit = found[step.added.name]
    said, sentence = _verdict(fit, steps, floor_n, library)
    return ForceDiagnosis(tuple(steps), said, sentence, base, fit, floor_n, balance.rows)


def _is_new(name: str, there: Sequence[str], library: Mapping[str, Effect]) -> bool:
    """Whether an effect is neither there already nor a form of one that is."""
    return name not in there and all(library[name].after != each and library[each].after != name for each in there)


def _best(balance: Balance, before: ForceModel, name: str) -> tuple[ForceModel, ForceFit]:
    """Return the shape of an effect that fits best, on what is fitted."""
    fits = [(model, balance.fit_model(model)) for model in balance.candidates(before, name)]
    return min(fits, key=lambda each: each[1].train_rms_n)


def _step(number: int, before: ForceFit, fits: Mapping[str, ForceFit], library: Mapping[str, Effect]) -> ForceStep:
    tried = {name: _candidate(number, name, before, fit) for name, fit in fits.items()}
    judged = (_after_first(each, tried.get(library[each.name].after)) for each in tried.values())
    candidates = tuple(sorted(judged, key=lambda each: -each.gain.bic))
    accepted = [each for each in candidates if each.accepted]
    if not accepted:
        return ForwardStep(before, candidates, None, ())
    added = accepted[0]
    rivals = tuple(each for each in accepted if indistinguishable(added.fit.logs, each.fit.logs))
    return ForwardStep(before, candidates, added, rivals)


def _after_first(candidate: ForceCandidate, first: ForceCandidate | None) -> ForceCandidate:
    """Reject what does no better than the effect that it comes after."""
    if first is None or candidate.rejection_reason or candidate.gain.bic > first.gain.bic + SELECTION.least_evidence:
        return candidate
    return replace(candidate, rejection_reason=no_better(first.name))


def _candidate(number: int, name: str, before: ForceFit, fit: ForceFit) -> ForceCandidate:
    held_out, _ = relative_error_reduction(before.logs, fit.logs)
    gain = Gain(before.bic - fit.bic, held_out, 2.0 * sum(before.logs - fit.logs))
    return ForceCandidate(number, name, fit.range_violation or gain.rejection_reason, fit, gain)


def _verdict(
    best: ForceFit, steps: Sequence[ForceStep], floor_n: float | None, library: Mapping[str, Effect]
) -> tuple[Verdict, str]:
    names = " and ".join(step.added.name for step in steps if step.added)
    before_n, after_n = steps[0].before.test_rms_n, best.test_rms_n
    fell = f"the held-out error falls from {before_n:.3g} to {after_n:.3g} N"
    rivals = "".join(rivals_sentence([each.name for each in step.indistinguishable], library) for step in steps)
    if floor_n is not None and best.median_error_n > BALANCE_FLOORS * floor_n:
        part = f" A part of it is {names}: {fell}.{rivals}" if names else f" The held-out error is {after_n:.3g} N."
        return "unexplained", (
            f"Something is left that the balance does not explain: it is off by {best.median_error_n:.3g} N, and "
            f"repeated strokes differ by {floor_n:.3g} N only.{part}"
        )
    if not names:
        return (
            "adequate",
            f"Nothing is missing: no effect lowers the held-out error, {after_n:.3g} N, by more than chance.",
        )
    open_end = "" if floor_n is not None else " What is left is not judged: the curve passes each place once."
    if rivals:
        return "one_of", f"Missing: {names}, or another that does as well; {fell}.{rivals}{open_end}"
    return "missing", f"Missing: {names}; {fell}.{open_end or ' Nothing is left to explain.'}"
