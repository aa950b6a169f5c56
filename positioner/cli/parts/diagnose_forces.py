"""`positioner diagnose` on a bench's recording or a static curve: the balance of forces in place of a simulation."""

import argparse
import time

from config.errors import InputError
from positioner.cli.parts.given_names import naming
from positioner.cli.parts.model_arguments import read_valve
from positioner.cli.parts.output_files import write_json


def run_forces(arguments: argparse.Namespace) -> int:
    """Diagnose the balance of forces and print; 0 if nothing is missing, else 1."""

    from workbench.data.imposed_motion import read_imposed
    from workbench.forces.force_diagnosis import diagnose_forces
    from workbench.forces.force_diagnosis_json import as_json
    from workbench.report import Subject, report_forces

    if arguments.effects is not None:
        raise InputError("--effects", "goes with recordings that hold a command; here the position is imposed")
    for name in ("from_s", "to_s", "noise_m"):
        if getattr(arguments, name) is not None:
            raise InputError(f"--{name.replace('_', '-')}", "goes with recordings that hold a command")
    began_s = time.monotonic()
    valve = read_valve(arguments.valve)
    recordings = [read_imposed(path) for path in arguments.recordings]
    test = read_imposed(arguments.test) if arguments.test else None
    with naming({"recording": ", ".join(map(str, arguments.recordings)), "valve file": arguments.valve}):
        diagnosis = diagnose_forces(recordings, valve, test=test)
    print("the recording has no command: forces are balanced, nothing is simulated")
    print(diagnosis.summary())
    if arguments.json is not None:
        whole = as_json(diagnosis) | {"seconds": time.monotonic() - began_s}
        write_json(arguments.json, whole)
    if arguments.report is not None:
        files = tuple(str(path) for path in (*arguments.recordings, arguments.test) if path)
        report_forces(diagnosis, arguments.report, Subject(valve, files, recordings[0].metadata))
    return 0 if diagnosis.verdict == "adequate" else 1
