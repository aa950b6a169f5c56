"""`positioner estimate`: identification from a recording, by the daemon's own estimators."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from config.registers import ESTIMATED
from positioner.cli.parts.export_arguments import add_export_arguments, read_any
from positioner.cli.parts.given_names import naming
from positioner.cli.parts.output_files import write_json
from positioner.cli.parts.progress import at_work

if TYPE_CHECKING:
    from positioner.estimation.recording_estimates import RecordingEstimates

HELP = "estimate spring and friction from a recording; exit status 1 if nothing is valid"
EXAMPLE = "positioner estimate rec.csv --json estimated.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("recording", type=Path, metavar="REC", help="a recording, CSV or Parquet")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers as JSON")
    parser.add_argument(
        "--noise-m",
        type=float,
        metavar="M",
        help="standard deviation of the position's noise (measured in the recording)",
    )
    parser.add_argument(
        "--pressure",
        choices=("held", "linear"),
        help="pressure between samples: held or linear (the likelier of the two)",
    )
    add_export_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Estimate and print; 0 if the ratios that the law needs are valid, else 1."""
    from positioner.estimation.recording_estimates import estimate

    held = None if arguments.pressure is None else arguments.pressure == "held"
    recording = read_any(arguments.recording, arguments, None)
    what = f"{len(recording)} samples are read, identifying from them"
    with naming({"noise_std_m": "--noise-m"}), at_work("estimate", what):
        estimated = estimate(recording, noise_std_m=arguments.noise_m, pressure_held=held)
    print(f"{arguments.recording}: {estimated.summary()}")
    write_json(arguments.json, as_json(estimated), indent=1)
    return 0 if estimated.law_ready else 1


def as_json(estimated: "RecordingEstimates") -> dict[str, object]:
    """Return the numbers: per name value, std, valid and reason; null where there is none."""
    found, law = estimated.found, estimated.static_law
    numbers: dict[str, object] = {name: _one(getattr(estimated.estimates, name)) for name in ESTIMATED}
    return numbers | {
        "breakaway_pa": _one(estimated.estimates.breakaway),
        "noise_std_m": found.noise_std_m,
        "residual_std_m": found.fit.residual_std_m if found.fit is not None else None,
        "condition": found.condition,
        "pressure": found.pressure,
        "time_stamps_evened": found.evened,
        "motions": found.segments,
        "left_out": found.left_out,
        "static_law": {
            "slope_pa_per_m": _one(law.slope),
            "up_pa": _one(law.up),
            "down_pa": _one(law.down),
            "offset_pa": _one(law.offset),
            "landings": law.landings,
            "residual_m": law.residual_m,
        },
        "notes": list(estimated.notes),
    }


def _one(each: Any) -> dict[str, object]:
    return {
        "value": each.value,
        "std": each.std,
        "valid": each.valid,
        "reason": "" if each.valid else each.reason.text,
    }
