"""`positioner diagnose` on a bench's recording or a static curve: the balance of forces in place of a simulation."""

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from workbench.forces.force_diagnosis import ForceDiagnosis


def run_forces(arguments: argparse.Namespace) -> int:
    """Diagnose the balance of forces and print; 0 if nothing is missing, else 1."""
    import json
    import time

    from config.errors import InputError
    from config.valve_file import find_valve, load_valve
    from positioner.cli.parts.naming import naming
    from workbench.data.imposed_motion import read_imposed
    from workbench.forces.force_diagnosis import diagnose_forces
    from workbench.forces.force_diagnosis_json import as_json
    from workbench.report import Subject, report_forces, require_plotly

    if arguments.effects is not None:
        raise InputError("--effects", "goes with recordings that hold a command; here the position is imposed")
    if arguments.report is not None:
        require_plotly(arguments.report)
    began_s = time.monotonic()
    valve = load_valve(find_valve(arguments.valve))
    recordings = [read_imposed(path) for path in arguments.recordings]
    test = read_imposed(arguments.test) if arguments.test else None
    with naming({"recording": ", ".join(map(str, arguments.recordings)), "valve file": arguments.valve}):
        diagnosis = diagnose_forces(recordings, valve, test=test)
    print("\n".join(_lines(diagnosis)))
    if arguments.json is not None:
        whole = as_json(diagnosis) | {"seconds": time.monotonic() - began_s}
        arguments.json.write_text(json.dumps(whole, allow_nan=False) + "\n", encoding="utf-8")
    if arguments.report is not None:
        files = tuple(str(path) for path in (*arguments.recordings, arguments.test) if path)
        report_forces(diagnosis, arguments.report, Subject(valve, files, recordings[0].metadata))
    return 0 if diagnosis.verdict == "adequate" else 1


def _lines(diagnosis: "ForceDiagnosis") -> list[str]:
    floor = "" if diagnosis.floor_n is None else f", floor {diagnosis.floor_n:.4g}"
    lines = ["no command in it: a balance of forces, not a simulation", f"{diagnosis.verdict}: {diagnosis.sentence}"]
    for number, step in enumerate(diagnosis.steps, start=1):
        before = step.before
        lines += [
            "",
            f"step {number}: error {before.train_rms_n:.4g} N rms fitted, {before.test_rms_n:.4g} held out{floor}",
            f"  {'effect':<20}{'fitted N':>11}{'held out N':>13}{'evidence':>10}{'gain':>7}{'std errors':>12}",
        ]
        for each in step.candidates:
            lines.append(
                f"  {each.name:<20}{each.fit.train_rms_n:>11.4g}{each.fit.test_rms_n:>13.4g}{each.gain.bic:>10.1f}"
                f"{each.gain.held_out:>7.0%}{each.gain.standard_errors:>12.1f}  {each.rejection_reason or 'accepted'}"
            )
    lines += ["", f"with {' and '.join(diagnosis.missing) or 'nothing added'}:"]
    for name, value in diagnosis.best.parameters.items():
        std = diagnosis.best.deviations.get(name)
        lines.append(f"  {name} = {value:.6g}" + ("" if std is None else f" (std {std:.2g})"))
    return lines + [f"  recording: {note}" for note in diagnosis.rows.notes]
