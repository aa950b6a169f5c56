"""Which effect is missing in a balance of forces (`force_balance`): forward steps, each effect tried in every one.

The rule by which an effect is accepted is that of `evidence`, over strokes or readings in place of seconds.

All is explained if the median error comes within a factor of the floor, which is a median too: a row at a reversal may
count for either direction, and is off by twice the friction whatever the balance.

An effect that does as well as the one added, and is still accepted after it, is no rival of it but missing too: rivals
are those that have nothing left to explain then.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from config.recording import Recording
from config.valve_file import ValveFile
from sim.effect import Effect, shipped_effect
from workbench.data.imposed_motion import Rows, rows_of
from workbench.forces.force_balance import Balance, ForceFit, ForceModel, floor_of
from workbench.select.equivalence import told_apart
from workbench.select.evidence import AT_FLOOR, LEAST_BIC, LEAST_GAIN, LEAST_STANDARD_ERRORS, alike, fall

MOST_ADDED = 3


@dataclass(frozen=True, slots=True)
class ForceCandidate:
    """An effect tried in one step; `why_not` is empty if it is accepted."""

    step: int
    name: str
    fit: ForceFit
    bic: float
    held_out: float
    standard_errors: float
    why_not: str


@dataclass(frozen=True, slots=True)
class ForceStep:
    """One forward step."""

    before: ForceFit
    candidates: tuple[ForceCandidate, ...]
    added: ForceCandidate | None
    alike: tuple[str, ...]
    """The added one and its rivals: the held-out errors do not tell them from it, and after it they explain nothing."""


@dataclass(frozen=True, slots=True)
class ForceDiagnosis:
    """What is missing in the balance of forces, and all that led to it; verdicts as those of `diagnosis`."""

    verdict: str
    sentence: str
    base: ForceFit
    best: ForceFit
    steps: tuple[ForceStep, ...]
    floor_n: float | None
    rows: Rows

    @property
    def missing(self) -> tuple[str, ...]:
        """The effects added, in order."""
        return tuple(step.added.name for step in self.steps if step.added)

    @property
    def indistinguishable(self) -> tuple[tuple[str, ...], ...]:
        """For each step with more than one equally good effect, their names."""
        return tuple(step.alike for step in self.steps if len(step.alike) > 1)

    @property
    def candidates(self) -> tuple[ForceCandidate, ...]:
        """All candidates of all steps."""
        return tuple(each for step in self.steps for each in step.candidates)


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
    if balance.fitted(ForceModel(), bounded=False).parameters["coulomb_n"] < 0.0 and rows.load_n is not None:
        balance = Balance(rows.turned(), valve.valve, tested=test is not None)
    return _searched(balance)


def _searched(balance: Balance) -> ForceDiagnosis:
    here = ForceModel()
    base = fit = balance.fitted(here)
    steps: list[ForceStep] = []
    while True:
        floor_n = floor_of(balance.rows, fit.residual_n)
        found = {name: _best(balance, here, name) for name in balance.names if name not in here.effects}
        step = _step(len(steps) + 1, fit, {name: fitted for name, (_, fitted) in found.items()})
        if steps:
            steps[-1] = _without(steps[-1], [each.name for each in step.candidates if not each.why_not])
        explained = floor_n is not None and fit.typical_n <= AT_FLOOR * floor_n
        if len(steps) == MOST_ADDED or (steps and explained):
            break
        steps.append(step)
        if step.added is None:
            break
        here, fit = found[step.added.name]
    return ForceDiagnosis(*_verdict(fit, steps, floor_n), base, fit, tuple(steps), floor_n, balance.rows)


def _without(step: ForceStep, accepted_after: Sequence[str]) -> ForceStep:
    """Return the step without the rivals that are accepted after it all the same."""
    return replace(step, alike=tuple(name for name in step.alike if name not in accepted_after))


def _best(balance: Balance, before: ForceModel, name: str) -> tuple[ForceModel, ForceFit]:
    """Return the shape of an effect that fits best, on what is fitted."""
    fits = [(model, balance.fitted(model)) for model in balance.candidates(before, name)]
    return min(fits, key=lambda each: each[1].train_rms_n)


def _step(number: int, before: ForceFit, fits: Mapping[str, ForceFit]) -> ForceStep:
    candidates = sorted((_candidate(number, name, before, fit) for name, fit in fits.items()), key=lambda c: -c.bic)
    accepted = [each for each in candidates if not each.why_not]
    if not accepted:
        return ForceStep(before, tuple(candidates), None, ())
    added = accepted[0]
    as_good = [each.name for each in accepted if alike(added.fit.logs, each.fit.logs)]
    return ForceStep(before, tuple(candidates), added, tuple(as_good))


def _candidate(number: int, name: str, before: ForceFit, fit: ForceFit) -> ForceCandidate:
    bic = before.bic - fit.bic
    held_out, standard_errors = fall(before.logs, fit.logs)
    why_not = fit.beyond
    if not why_not and bic <= LEAST_BIC:
        why_not = f"evidence {bic:.3g}, more than {LEAST_BIC:g} needed"
    elif not why_not and held_out <= LEAST_GAIN:
        why_not = f"the held-out error falls by {100 * held_out:.2g} %, more than {100 * LEAST_GAIN:g} % needed"
    elif not why_not and standard_errors <= LEAST_STANDARD_ERRORS:
        why_not = (
            f"the held-out error falls by {standard_errors:.2g} standard errors, "
            f"more than {LEAST_STANDARD_ERRORS:g} needed"
        )
    return ForceCandidate(number, name, fit, bic, held_out, standard_errors, why_not)


def _verdict(best: ForceFit, steps: Sequence[ForceStep], floor_n: float | None) -> tuple[str, str]:
    names = " and ".join(step.added.name for step in steps if step.added)
    before_n, after_n = steps[0].before.test_rms_n, best.test_rms_n
    fell = f"the held-out error falls from {before_n:.3g} to {after_n:.3g} N"
    rivals = "".join(_apart(step.alike) for step in steps if len(step.alike) > 1)
    if floor_n is not None and best.typical_n > AT_FLOOR * floor_n:
        part = f" A part of it is {names}: {fell}.{rivals}" if names else f" The held-out error is {after_n:.3g} N."
        return "unexplained", (
            f"Something is left that the balance does not explain: it is off by {best.typical_n:.3g} N, where strokes "
            f"repeat each other to {floor_n:.3g} N.{part}"
        )
    if not names:
        return "adequate", f"Nothing is missing: no effect lowers the held-out error of {after_n:.3g} N as it must."
    open_end = "" if floor_n is not None else " What is left is not judged: the curve passes each place once."
    if rivals:
        return "one_of", f"Missing: {names}, or another that does as well; {fell}.{rivals}{open_end}"
    return "missing", f"Missing: {names}; {fell}.{open_end or ' Nothing is left to explain.'}"


def _apart(names: Sequence[str]) -> str:
    library: dict[str, Effect] = {name: shipped_effect(name, "effects") for name in names}
    pairs = [(name, other) for i, name in enumerate(names) for other in names[i + 1 :]]
    said = [
        f" {name} or {other}: {told_apart(name, other, library)}."
        for name, other in pairs
        if told_apart(name, other, library)
    ]
    return "".join(said) or f" Equally good: {', '.join(names)}."
