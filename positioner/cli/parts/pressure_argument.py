"""The argument by which the stem is driven by its measured pressure, not by the model's."""

import argparse


def add_pressure_argument(parser: argparse.ArgumentParser) -> None:
    """Declare it."""
    parser.add_argument(
        "--from-pressure",
        action="store_true",
        help="drive the stem by the measured pressure_pa; what acts before it is neither tried nor fitted",
    )
