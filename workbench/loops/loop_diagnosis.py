"""The verdict on one loop: it sticks (how much), something else (what), or it cannot be told (why, what would tell).

The evidence comes from `causes`, the limits from `loop_thresholds`.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from config.extras import import_extra
from config.results.block import Block, Table
from config.results.result import Result
from workbench.loops.calibration import CALIBRATION, Evidence, Witness
from workbench.loops.causes import Causes, Rows, fitted_path, hold_causes, of_output, rows_of
from workbench.loops.controller_law import ControllerLaw, see_law
from workbench.loops.literature_votes import Vote, votes
from workbench.loops.loop_record import LoopRecord
from workbench.loops.loop_thresholds import LIMITS
from workbench.loops.oscillation import Oscillation, find_oscillation
from workbench.loops.quality_gates import Gate, closed_gates
from workbench.loops.remedies import Remedy, find_remedies

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Verdict = Literal["sticks", "something else", "cannot be told"]


@dataclass(frozen=True, slots=True, repr=False)
class LoopDiagnosis(Result):
    """What is said of a loop.

    Attributes:
        record: of the loop.
        verdict: one of three.
        cause: what it is, where the valve does not stick; "" where nothing is named.
        evidence: for friction; of an insufficient record by its output alone.
        probability: that the valve sticks; None where the record is insufficient.
        oscillation, setpoint: of OP, which has PV's period and less noise, and of SP; None where SP stands.
        law: the controller's.
        gates: why the record is insufficient.
        causes: as they were held against each other; None where the record is insufficient.
        votes: of the literature's methods.
        remedies: what to do about a valve that sticks; none where it does not, or the law is not seen.
    """

    record: LoopRecord
    verdict: Verdict
    cause: str
    evidence: Evidence
    probability: float | None
    oscillation: Oscillation
    setpoint: Oscillation | None
    law: ControllerLaw
    gates: tuple[Gate, ...]
    causes: Causes | None
    votes: tuple[Vote, ...]
    remedies: tuple[Remedy, ...] = ()

    @property
    def variance_cost(self) -> float:
        """Standard deviation of PV against its set point, in shares of PV's or SP's typical size."""
        error = self.record.pv - (self.record.pv.mean() if self.record.sp is None else self.record.sp)
        return float(error.std() / max(abs(float(self.record.pv.mean())), 1e-12))

    @property
    def sentence(self) -> str:
        """The whole in one line."""
        if self.verdict == "sticks":
            assert self.causes is not None
            friction = self.causes.friction
            jump = f", slip jump {friction.slip_jump_pct:.2g} %" if friction.size.told else ""
            return (
                f"{self.record.name}: the valve sticks ({self.sticks_said} %): apparent stiction "
                f"{friction.size.said} % of the output{jump}"
            )
        if self.verdict == "something else":
            return f"{self.record.name}: not the valve's friction: {self.because}"
        if self.gates:
            return f"{self.record.name}: insufficient: {self.because}"
        return f"{self.record.name}: cannot be told (probability of sticking {self.sticks_said} %): {self.because}"

    @property
    def because(self) -> str:
        """What else it is, or why it cannot be told, and what to do."""
        if self.gates:
            said = "; ".join(each.says for each in self.gates)
            instead = "; ".join(dict.fromkeys(each.instead for each in self.gates))
            return f"{said}; record {instead}"
        return self.advice or self.cause or OPEN

    @property
    def sticks_said(self) -> str:
        """Probability that it sticks, %, as people read it."""
        return "–" if self.probability is None else f"{min(99.0, 100 * self.probability):.0f}"

    @property
    def stiction_said(self) -> str:
        """S and its interval, % of the output, as people read them; of a valve that sticks."""
        return self.causes.friction.size.said if self.verdict == "sticks" and self.causes else "–"

    @property
    def advice(self) -> str:
        """What to do: first the valve, and until then what costs the least error; "" where it does not stick."""
        if self.verdict != "sticks":
            return ""
        better = [(r.error_ratio, r) for r in self.remedies[1:] if r.error_ratio is not None and r.error_ratio < 1.0]
        first = "to do: maintenance of the valve, packing and positioner"
        if not better:
            return first + ("" if self.remedies else "; no settings: the record does not show the controller's law")
        _, least = min(better, key=lambda each: each[0])
        ratios = f"error {ratio(least.error_ratio)} of now, travel {ratio(least.travel_ratio)}"
        return f"{first}; until then {least.name}, {least.settings}: {ratios}, simulated"

    def blocks(self) -> list[Block]:
        """Return the verdict, what to do, the causes, and the votes beside it."""
        advice = [self.advice] if self.advice else []
        tables = (self.cause_table, self.remedy_table, self.vote_table)
        said = [self.sentence, *advice, *self.record.notes, self._motion(), self._law()]
        return [*said, *(each for each in tables if each.rows)]

    @property
    def cause_table(self) -> Table:
        """Causes as they were held against each other; no rows where none was."""
        costs = sorted(self.causes.costs.items(), key=lambda item: item[1]) if self.causes else []
        rows = [(name, f"{cost - costs[0][1]:.1f}") for name, cost in costs]
        by = self.evidence
        told = f"{by.pv.nats:+.1f} nats by PV, {by.output.nats:+.1f} by OP; sticks with {self.sticks_said} %"
        return Table(("cause of PV", "behind the best, nats"), rows, f"Evidence for friction: {told}")

    @property
    def remedy_table(self) -> Table:
        """What to do, and what it brings; no rows where nothing is."""
        rows = [(r.name, ratio(r.error_ratio), ratio(r.travel_ratio), r.settings) for r in self.remedies]
        return Table(("what to do", "error", "travel", ""), rows, REMEDIES)

    @property
    def vote_table(self) -> Table:
        """What the literature's methods say."""
        rows = [(each.method, f"{each.index:.2f}", each.says) for each in self.votes]
        return Table(("method of the literature", "index", ""), rows)

    def _motion(self) -> str:
        each, record = self.oscillation, self.record
        kind = "oscillates" if each.regular else "does not oscillate regularly"
        return (
            f"the loop {kind}: period {each.period_s:.4g} s, regularity {each.regularity:.1f} (from "
            f"{LIMITS.regular:g} on regular), {each.cycles:.0f} cycles, a sample each {record.period_s:g} s"
        )

    def _law(self) -> str:
        law, acts = self.law, ACTS[self.law.action]
        if not law.seen:
            return f"controller: {acts}; no PI law is seen in the output ({100 * law.explained:.0f} % of its changes)"
        return (
            f"controller: {acts}; gain {law.gain:.3g} % a unit of PV, reset time {law.reset_s:.4g} s, "
            f"{100 * law.explained:.0f} % of the output's changes"
        )

    def frame_columns(self) -> Mapping[str, Any]:
        """Return the record."""
        record = self.record
        columns = {
            "time_s": record.time_s + record.period_s * np.arange(record.pv.size),
            "op_pct": record.op_pct,
            "pv": record.pv,
        }
        return columns if record.sp is None else columns | {"sp": record.sp}

    def as_json(self) -> dict[str, Any]:
        """Return the verdict for other programs."""
        friction = self.causes.friction if self.causes else None
        return {
            "loop": self.record.name,
            "verdict": self.verdict,
            "cause": self.cause,
            "probability_sticks": self.probability,
            "stiction_pct": friction.size.stiction_pct if friction and friction.size.told else None,
            "stiction_pct_95": [friction.size.low_pct, friction.size.high_pct] if friction else None,
            "slip_jump_pct": friction.slip_jump_pct if friction else None,
            "evidence_nats": {"pv": self.evidence.pv.nats, "op": self.evidence.output.nats},
            "costs_nats": self.causes.costs if self.causes else {},
            "period_s": self.oscillation.period_s,
            "regularity": self.oscillation.regularity,
            "variance_cost": self.variance_cost,
            "controller": asdict(self.law),
            "insufficient": [asdict(each) for each in self.gates],
            "remedies": [asdict(each) for each in self.remedies],
            "votes": {vote.method: {"index": vote.index, "says": vote.says} for vote in self.votes},
            "sentence": self.sentence,
            "advice": self.advice,
        }

    def plot(self) -> "Figure":
        """Return OP and PV over time, and PV over OP."""
        pyplot = import_extra("matplotlib.pyplot", "plot")
        columns = self.frame_columns()
        figure, (over_time, over_output) = pyplot.subplots(1, 2, figsize=(11, 3.6), width_ratios=(2.2, 1))
        over_time.plot(columns["time_s"], columns["op_pct"])
        over_time.set(xlabel="time, s", ylabel="OP, %")
        over_time.twinx().plot(columns["time_s"], columns["pv"], color="tab:orange")
        over_output.plot(columns["op_pct"], columns["pv"], linewidth=0.6)
        over_output.set(xlabel="OP, %", ylabel="PV")
        figure.suptitle(self.sentence)
        return figure  # type: ignore[no-any-return]


REMEDIES = "Over today's values, simulated on the identified loop (–: that loop does not swing as the record does):"
ACTS = {
    1: "reverse acting, OP falls as PV rises",
    -1: "direct acting, OP rises as PV rises",
    0: "its action does not show, both signs of the process are tried",
}
"""By the sign that the process's gain then has."""
OPEN = "record larger moves, 20 more cycles, or the stem's own position"


def ratio(value: float | None) -> str:
    """Return a ratio as people read it."""
    return "–" if value is None else f"{value:.2f}"


def diagnose_loop(record: LoopRecord, known: Causes | None = None) -> LoopDiagnosis:
    """Return what is said of a loop's record; `known` are its causes where they were worked out before."""
    oscillation = find_oscillation(record.op_pct, record.period_s)
    law = see_law(record)
    setpoint = None
    if record.sp is not None and record.sp.var() > LIMITS.setpoint_moves * record.pv.var():
        setpoint = find_oscillation(record.sp, record.period_s)
    gates = closed_gates(record, oscillation)
    said = votes(record, oscillation) if np.ptp(record.op_pct) > 0.0 else ()
    if gates:
        alone = Evidence(Witness(), output_alone(record, oscillation))
        return LoopDiagnosis(record, "cannot be told", "", alone, None, oscillation, setpoint, law, gates, None, said)
    causes = known or hold_causes(record, oscillation, law.action)
    probability = CALIBRATION.probability(causes.evidence)
    verdict: Verdict = "cannot be told"
    cause = ""
    if probability >= LIMITS.sticks_probability:
        verdict = "sticks"
    elif probability <= LIMITS.other_probability:
        verdict, cause = "something else", _other(oscillation, setpoint, causes)
    treatable = verdict == "sticks" and law.seen and np.isfinite(law.reset_s)
    remedies = _remedies(record, oscillation, law, causes) if treatable else ()
    return LoopDiagnosis(
        record, verdict, cause, causes.evidence, probability, oscillation, setpoint, law, gates, causes, said, remedies
    )


def output_alone(record: LoopRecord, oscillation: Oscillation, ask: Callable[[Rows], Witness] = of_output) -> Witness:
    """Return what a record's output says of friction; nothing where it stands, is short, or has few samples a cycle."""
    short = record.op_pct.size < LIMITS.fewest_samples
    slow = oscillation.period_s < LIMITS.fewest_a_cycle * record.period_s
    return Witness() if short or slow or np.ptp(record.op_pct) == 0.0 else ask(rows_of(record, oscillation))


def _remedies(record: LoopRecord, oscillation: Oscillation, law: ControllerLaw, causes: Causes) -> tuple[Remedy, ...]:
    error = record.pv - (record.pv.mean() if record.sp is None else record.sp)
    path = fitted_path(record, oscillation, causes.friction)
    noise = float(np.diff(path.pv - path.pv_fitted).std() / np.sqrt(2.0))
    return find_remedies(float(np.sqrt((error**2).mean())), law, causes, noise, record.period_s)


def _other(oscillation: Oscillation, setpoint: Oscillation | None, causes: Causes) -> str:
    """Return what else moves a loop whose valve does not stick.

    Tight tuning and an oscillation from outside are not told apart: where one frequency rules, PV over OP at it is
    minus the controller's inverse in both.
    """
    if setpoint is not None:
        return "PV follows a set point that moves"
    if not oscillation.regular:
        return "irregular disturbances, which the valve answers"
    curved = causes.costs["linear"] - causes.costs["nonlinear"] > 2.0 * LIMITS.interval_cost
    through = ", through a curved process or valve" if curved else ""
    return f"tight tuning, or an oscillation from outside{through}: in manual the first stops, the second goes on"
