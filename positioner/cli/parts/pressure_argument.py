"""The argument by which the stem is driven by its measured pressure, not by the model's."""

import argparse


def add_pressure_argument(parser: argparse.ArgumentParser) -> None:
    """Declare it."""
    parser.add_argument(
        "--from-pressure",
        action="store_true",
        help="use the measured pressure_pa as input; effects before it are not tried",
    )
