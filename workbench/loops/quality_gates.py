"""What a record cannot tell, said before anything is worked out, each with what to record instead."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workbench.loops.loop_record import Array, LoopRecord
from workbench.loops.loop_thresholds import LIMITS
from workbench.loops.oscillation import POWER, Oscillation


@dataclass(frozen=True, slots=True)
class Gate:
    """A reason for which nothing is said of the valve.

    Attributes:
        code: one word for programs.
        says: what is wrong.
        instead: what to record.
    """

    code: str
    says: str
    instead: str


def closed_gates(record: LoopRecord, oscillation: Oscillation) -> tuple[Gate, ...]:
    """Return why a record is insufficient; none where it is not."""
    return (*_of_mode(record), *_of_samples(record, oscillation), *_of_storage(record))


def _of_mode(record: LoopRecord) -> Iterator[Gate]:
    op_pct = record.op_pct
    if record.automatic is not None and (manual := 1.0 - float(record.automatic.mean())) > LIMITS.most_manual:
        yield Gate("manual", f"the loop is in manual for {100 * manual:.0f} % of the record", "it in automatic")
    elif np.ptp(op_pct) == 0.0:
        yield Gate("manual", f"the output stands at {op_pct[0]:g} % throughout", "the loop in automatic")
    if np.ptp(record.pv) == 0.0:
        yield Gate("still", f"the process value stands at {record.pv[0]:g} throughout", "a transmitter that works")
    low, high = op_pct <= LIMITS.saturation_pct, op_pct >= 100.0 - LIMITS.saturation_pct
    if np.ptp(op_pct) > 0.0 and (share := float((low | high).mean())) > LIMITS.most_saturated:
        yield Gate(
            "saturated", f"the output is at its limit for {100 * share:.0f} % of the record", "a time of less load"
        )


def _of_samples(record: LoopRecord, oscillation: Oscillation) -> Iterator[Gate]:
    count = record.pv.size
    if count < LIMITS.fewest_samples:
        yield Gate("short", f"{count} samples are too few", f"{LIMITS.fewest_samples} samples or more")
    elif oscillation.regular and oscillation.cycles < LIMITS.fewest_cycles:
        longer_s = 2.0 * LIMITS.fewest_cycles * oscillation.period_s
        yield Gate("short", f"{oscillation.cycles:.1f} cycles are too few", f"{longer_s:.0f} s or more")
    if np.ptp(record.op_pct) > 0.0 and (turned := turns(record.op_pct)) < LIMITS.fewest_turns:
        yield Gate(
            "one way",
            f"the output turns {turned} times: stiction shows when it turns",
            "longer, over a few of its turns",
        )
    a_cycle = oscillation.period_s / record.period_s
    if a_cycle < LIMITS.fewest_a_cycle and oscillation.regular:
        finer_s = oscillation.period_s / 20.0
        yield Gate("slow", f"{a_cycle:.1f} samples a cycle are too few", f"a sample every {finer_s:.2g} s")
    elif a_cycle < LIMITS.fewest_a_cycle:
        noise = f"{1.0 - POWER:.0%} of the output's power swings within {a_cycle:.1f} samples, as noise does"
        yield Gate("slow", noise, "PV behind a filter, so that the output is less noisy")
    if record.missing > LIMITS.most_missing:
        yield Gate("missing", f"{100 * record.missing:.0f} % of the samples have no value", "a whole stretch")


def _of_storage(record: LoopRecord) -> Iterator[Gate]:
    if record.missing > LIMITS.most_missing:
        return  # what was filled in is straight
    for name, values in (("output", record.op_pct), ("process value", record.pv)):
        if np.ptp(values) == 0.0:
            continue
        if (share := straight_share(values)) > LIMITS.most_straight:
            yield Gate(
                "compressed",
                f"{100 * share:.0f} % of the {name} lie on straight lines, as a historian interpolates",
                "raw values: compression and exception deviation at zero",
            )
        if (levels := np.unique(values).size) < LIMITS.fewest_levels:
            yield Gate("rounded", f"the {name} has {levels} values in all", f"the {name} with two more digits")


def turns(values: Array) -> int:
    """Return how often a signal, (n,), comes back by `LIMITS.turn_share` of its span."""
    back = LIMITS.turn_share * float(np.ptp(values))
    count, way = 0, 0
    low = high = float(values[0])
    for value in values.tolist():
        low, high = min(low, value), max(high, value)
        if way >= 0 and value < high - back:
            count, way, low, high = count + (way > 0), -1, value, value
        elif way <= 0 and value > low + back:
            count, way, low, high = count + (way < 0), 1, value, value
    return count


def straight_share(values: Array) -> float:
    """Return the share of the moving samples, of (n,), that lie exactly between their neighbours."""
    slopes = np.diff(values)
    moving = np.abs(slopes[1:]) > 0.0
    tolerance = LIMITS.straight_tolerance * float(np.ptp(values))
    straight = np.abs(np.diff(slopes)) <= tolerance
    return float((straight & moving).sum() / max(1, moving.sum())) if moving.mean() > 0.1 else 0.0
