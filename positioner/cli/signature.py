"""`positioner signature`: slow ramps over the whole travel, on the running valve or from recordings of them."""

import argparse

from positioner.cli.parts.valve_test import (
    add_test_arguments,
    bounds_of,
    checked,
    finished,
    played_all,
    playing,
    recordings_of,
    require_whole_travel,
)

HELP = "test: friction, spring rate, bench set and seat load, by slow ramps over the travel (moves the valve)"
EXAMPLE = "positioner signature site.toml --area-m2 0.07 --keep as_left"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_test_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Play the ramps, or read their recordings; print what they show; 0 if all is there and as it was, else 1."""
    from config.recording import Recording
    from positioner.tests_on_the_valve.signature import Nameplate, programmes, signature

    file = checked(arguments)
    if arguments.rec:
        recordings = [Recording.read(path) for path in arguments.rec]
    else:
        from positioner.cli.parts.experiment_player import RunningValve, require_ready

        assert file is not None
        require_whole_travel(file, "signature", arguments.config)
        require_ready(file, arguments)
        valve = RunningValve(file, arguments)
        programs = programmes(bounds_of(file), valve.command_pa(), str(arguments.config))
        with playing("signature", file, arguments):
            recordings = recordings_of(played_all(valve, programs, len(programs)))
    name = str(arguments.rec[0]) if file is None else file.valve.name
    stroke_m = arguments.stroke_m if file is None else file.valve.stroke_m
    return finished(signature(recordings, Nameplate(name, stroke_m, arguments.area_m2)), file, arguments)
