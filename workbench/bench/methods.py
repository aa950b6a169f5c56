"""What methods say of a case: ours, and He's, Hägglund's, Horch's and Kano's (`workbench.loops.shape_methods`).

Of a loop of several records ours takes the mean of their evidence, the others the median of their indices. Of OP alone
He's method speaks, and no other.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from config.recording import Recording
from config.valve_file import load_valve
from workbench.bench.cases import EFFECTS, Case
from workbench.bench.scores import Answer
from workbench.diagnosis.diagnosis import diagnose
from workbench.loops import LoopDiagnosis, LoopRecord, diagnose_loop
from workbench.loops.calibration import CALIBRATION, Evidence, mean_evidence
from workbench.loops.joint import together
from workbench.loops.oscillation import find_oscillation
from workbench.loops.shape_methods import Vote, he
from workbench.loops.thresholds import LIMITS

OURS = "positioner"


def answers_of(case: Case) -> list[Answer]:
    """Return what each method says of a case."""
    if case.set == EFFECTS:
        return [_of_effect(case)]
    said = [diagnose_loop(each) for each in loop_records(case)]
    indices: dict[str, list[float]] = {}
    for vote in [vote for each in said for vote in each.votes] or [_of_output(path) for path in case.files]:
        indices.setdefault(vote.method, []).append(vote.index)
    others = [Answer(case.set, case.name, name, float(np.median(of)), "", None) for name, of in indices.items()]
    return [*_of_loop(case, said), *others]


def loop_records(case: Case) -> list[LoopRecord]:
    """Return the records of a case that hold PV."""
    tables = [np.genfromtxt(path, delimiter=",", names=True) for path in case.files]
    return [
        LoopRecord.of_samples(case.name, each["time_s"], each["op_pct"], each["pv"], each["sp"])
        for each in tables
        if "pv" in (each.dtype.names or ())
    ]


def _of_output(path: Path) -> Vote:
    """Return He's vote on a record of OP alone."""
    columns = np.genfromtxt(path, delimiter=",", names=True)
    period_s = float(np.median(np.diff(columns["time_s"])))
    return he(columns["op"], find_oscillation(columns["op"], period_s).period_s / period_s)


def evidence_of(said: list[LoopDiagnosis]) -> Evidence:
    """Return the evidence of a loop's records: of those that tell, or OP's and PV's phase alone where none does."""
    return mean_evidence([each.evidence for each in said if each.causes] or [each.evidence for each in said])


def _of_loop(case: Case, said: list[LoopDiagnosis]) -> Iterator[Answer]:
    if said:
        joint = together(said)
        called = (joint.probability or 0.0) >= LIMITS.sticks_probability
        size = joint.stiction_pct[0] if joint.stiction_pct else None
        score = CALIBRATION.probability(evidence_of(said))
        yield Answer(case.set, case.name, OURS, score, "sticks" if called else "", size)


def _of_effect(case: Case) -> Answer:
    (folder,) = case.files
    fit, test = (Recording.read(folder / name) for name in ("fit.csv", "test.csv"))
    found = diagnose(fit, load_valve(folder / "valve.toml"), test=test, workers=1)
    names = sorted({name for each in found.choices for name in each})
    return Answer(case.set, case.name, OURS, 0.0, " ".join(names), None)
