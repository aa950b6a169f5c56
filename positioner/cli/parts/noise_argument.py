"""The argument by which somebody who knows a sensor's noise says it."""

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from config.recording import Recording


def add_noise_argument(parser: argparse.ArgumentParser) -> None:
    """Declare it."""
    parser.add_argument(
        "--noise-m",
        type=float,
        metavar="M",
        help="standard deviation of the position's noise, rounding included (measured where the stem rests)",
    )


def noise_said(recording: "Recording", arguments: argparse.Namespace) -> "Recording":
    """Return a recording that says its noise, if the command line does.

    Raises:
        InputError: it is not positive.
    """
    from positioner.cli.parts.naming import naming
    from workbench.data.noise_floor import with_noise

    with naming({"noise_m": "--noise-m"}):
        return with_noise(recording, arguments.noise_m)
