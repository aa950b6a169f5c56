"""What the commands that hold a model against recordings share: what judges, the sensor's noise, the measured pressure.

`read_fitted` reads the recordings, or exports in their place, that such a command names.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from positioner.cli.parts.export_arguments import add_export_arguments, read_any
from positioner.cli.parts.given_names import naming

if TYPE_CHECKING:
    from config.recording import Recording
    from config.valve_file import ValveFile


def add_test(parser: argparse.ArgumentParser) -> None:
    """Declare the recording that judges."""
    text = "a recording that judges and is not fitted (the last third of the others)"
    parser.add_argument("--test", type=Path, metavar="REC", help=text)


def add_pressure(parser: argparse.ArgumentParser) -> None:
    """Declare that the stem is driven by its measured pressure, not by the model's."""
    text = "drive the model by the measured pressure_pa; effects between command and pressure are not tried"
    parser.add_argument("--from-pressure", action="store_true", help=text)


def add_noise_and_exports(parser: argparse.ArgumentParser) -> None:
    """Declare the sensor's noise, and how another program's file is read."""
    text = "standard deviation of the position's noise, rounding included (measured where the stem rests)"
    parser.add_argument("--noise-m", type=float, metavar="M", help=text)
    add_export_arguments(parser)


def read_fitted(
    paths: Sequence[Path], arguments: argparse.Namespace, valve: "ValveFile"
) -> "tuple[list[Recording], Recording | None]":
    """Return the recordings that are fitted, and the one that judges; each says its noise, if the command line does.

    Raises:
        InputError: as `read_any`; a noise that is not positive.
    """
    fitted = [read_with_noise(each, arguments, valve) for each in paths]
    return fitted, read_with_noise(arguments.test, arguments, valve) if arguments.test else None


def read_with_noise(path: Path, arguments: argparse.Namespace, valve: "ValveFile") -> "Recording":
    """Return one of them; raises as `read_fitted`."""
    from workbench.data.noise_floor import with_noise

    recording = read_any(path, arguments, valve.valve.stroke_m)
    with naming({"noise_m": "--noise-m"}):
        return with_noise(recording, arguments.noise_m)
