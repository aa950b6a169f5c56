"""`positioner certify`: what is proved of the law of slides on a valve that was identified."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from config.errors import InputError, explain_failure
from positioner.cli.parts.config_argument import add_config, config_file

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile
    from positioner.control.laws.slides.certificate import Certificate, Refused

HELP = "prove bounds of error, excursion and slides a step for an identified valve; moves nothing"
EXAMPLE = "positioner certify site.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_config(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the certificate of each valve; exit status 1 where one is refused."""
    from config.daemon_file import load_valves
    from positioner.control.laws.slides.certificate import Refused

    bounded = True
    source = config_file(arguments)
    for file in load_valves(source):
        found = _certificate(file, source.parent)
        bounded = bounded and not isinstance(found, Refused)
        for line in _lines(file, found):
            print(line)
    return 0 if bounded else 1


def _certificate(file: "DaemonFile", folder: Path) -> "Certificate | Refused":
    from positioner.control.laws.slides.certificate import Refused, certified, known_valve
    from positioner.control.laws.slides.slide_law import SlideSettings
    from positioner.daemon.memory.known_configuration import conditions_of
    from positioner.daemon.memory.memory_file import look_at
    from positioner.daemon.sole_daemon import MEMORY, valve_file_path

    if file.control.law != "slides":
        raise InputError("control.law", f'allowed is "slides", whose landings can be bounded, got {file.control.law!r}')
    if file.law is not None and file.law.valve is not None:
        raise InputError("law.valve", "must not be given: only the straight law and its landings are bounded")
    if file.memory.folder is None:
        raise InputError("memory.folder", "is required: what is known of the valve is read there")
    path = valve_file_path(folder / file.memory.folder, file.valve.name, MEMORY)
    with explain_failure(path, "cannot be read"):
        kept = look_at(path, file.valve.name, conditions_of(file))
    if kept.knowledge is None:
        raise InputError(str(path), kept.problem or "nothing is known of the valve yet: identify it first")
    bounds = SlideSettings.of(file)
    known = known_valve(kept.knowledge, bounds)
    return known if isinstance(known, Refused) else certified(known, bounds)


def _lines(file: "DaemonFile", found: "Certificate | Refused") -> list[str]:
    from positioner.control.laws.slides.certificate import Refused

    name, stroke_m = file.valve.name, file.valve.stroke_m
    if isinstance(found, Refused):
        return [f"{name}: not proved: {found.why}", f"{name}: to be known better: {found.parameter}"]
    return [
        f"{name}: proved for every valve inside the intervals of its identification",
        f"{name}: each move ends, within {100 * found.ends_within_m / stroke_m:.3g} % of the stroke",
        f"{name}: most slides a step {found.most_slides}",
        f"{name}: longest excursion {100 * found.beyond_m / stroke_m:.2f} % of the stroke",
    ]
