"""What methods say of a case: ours, and He's, Hägglund's, Horch's and Kano's (`workbench.loops.literature_votes`).

Of a loop of several records ours takes the mean of their evidence, the others the median of their indices. Of OP alone
ours has a score and calls none, He's method has its index, and the others nothing.
"""

from pathlib import Path

import numpy as np

from config.recording import Recording
from config.valve_file import load_valve
from workbench.bench.cases import EFFECTS, Case
from workbench.bench.scores import Answer
from workbench.diagnosis.diagnosis import diagnose
from workbench.loops import LoopDiagnosis, LoopRecord, diagnose_loop
from workbench.loops.calibration import CALIBRATION, Evidence, Witness, mean_evidence
from workbench.loops.causes import of_output_backwards
from workbench.loops.joint import together
from workbench.loops.literature_votes import Vote, he
from workbench.loops.loop_diagnosis import output_alone
from workbench.loops.loop_thresholds import LIMITS
from workbench.loops.oscillation import find_oscillation

OURS = "positioner"


def answers_of(case: Case) -> list[Answer]:
    """Return what each method says of a case."""
    if case.set == EFFECTS:
        return [_of_effect(case)]
    said = [diagnose_loop(each) for each in loop_records(case)]
    alone = [] if said else [_of_output(path) for path in case.files]
    indices: dict[str, list[float]] = {}
    for vote in [*(vote for each in said for vote in each.votes), *(vote for vote, _ in alone)]:
        indices.setdefault(vote.method, []).append(vote.index)
    others = [Answer(case.set, case.name, name, float(np.median(of)), "", None) for name, of in indices.items()]
    if said:
        return [_of_loop(case, said), *others]
    score = CALIBRATION.probability(mean_evidence([evidence for _, evidence in alone]))
    return [Answer(case.set, case.name, OURS, score, "", None), *others]


def loop_records(case: Case) -> list[LoopRecord]:
    """Return the records of a case that hold PV."""
    return [
        LoopRecord.of_samples(case.name, each["time_s"], each["op_pct"], each["pv"], each["sp"])
        for each in map(_table, case.files)
        if "pv" in (each.dtype.names or ())
    ]


def _table(path: Path) -> np.ndarray:
    return np.genfromtxt(path, delimiter=",", names=True)


def _of_output(path: Path) -> tuple[Vote, Evidence]:
    """Return He's vote on a record of OP alone, and ours."""
    columns = _table(path)
    output = columns["op"]
    record = LoopRecord.of_samples(path.stem, columns["time_s"], output, output)
    oscillation = find_oscillation(record.op_pct, record.period_s)
    vote = he(record.op_pct, oscillation.period_s / record.period_s)
    return vote, Evidence(Witness(), output_alone(record, oscillation, of_output_backwards))


def evidence_of(said: list[LoopDiagnosis]) -> Evidence:
    """Return the evidence of a loop's records: of those that tell, or of their outputs where none does."""
    return mean_evidence([each.evidence for each in said if each.causes] or [each.evidence for each in said])


def _of_loop(case: Case, said: list[LoopDiagnosis]) -> Answer:
    joint = together(said)
    called = (joint.probability or 0.0) >= LIMITS.sticks_probability
    size = joint.size.stiction_pct if joint.size and joint.size.told else None
    score = CALIBRATION.probability(evidence_of(said))
    return Answer(case.set, case.name, OURS, score, "sticks" if called else "", size)


def _of_effect(case: Case) -> Answer:
    (folder,) = case.files
    fit, test = (Recording.read(folder / name) for name in ("fit.csv", "test.csv"))
    found = diagnose(fit, load_valve(folder / "valve.toml"), test=test, workers=1)
    names = sorted({name for each in found.choices for name in each})
    return Answer(case.set, case.name, OURS, 0.0, " ".join(names), None)
