"""What to type after a diagnosis: words that a shell and `positioner extend` read as they are meant."""

import argparse
import shlex
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from positioner.cli import discover, extend
from positioner.cli.diagnose import add_arguments
from positioner.cli.parts.next_step import discover_command, extend_commands, not_written
from workbench.diagnosis.diagnosis import Diagnosis

EXPORT = ["--column", "position_m=PV 1:%", "--column", "command_pa=OUT:bar", "--range-pa", "20000", "100000"]
MORE = ["--stroke-m", "0.04", "--decimal", ",", "--status", "Quality=Good", "--sheet", "Sheet 2"]
MORE += ["--from-s", "-3.5", "--to-s", "1234567.25", "--noise-m", "5e-05"]


def diagnosed(verdict: str, *steps: tuple[str, ...], parameters_off: bool = False) -> Any:
    """A diagnosis as far as its next step goes: of each step what was added, then what does as well."""
    named = [
        SimpleNamespace(
            added=SimpleNamespace(name=names[0]),
            indistinguishable=[SimpleNamespace(name=each) for each in names] if len(names) > 1 else [],
        )
        for names in steps
    ]
    missing = tuple(names[0] for names in steps)
    found: Any = SimpleNamespace(verdict=verdict, steps=named, missing=missing, parameters_off=parameters_off)
    choices: Any = Diagnosis.choices
    found.choices = choices.fget(found)
    return found


def asked(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return parser.parse_args(words)


def read_by_extend(command: str) -> argparse.Namespace:
    program, name, *words = shlex.split(command)
    assert (program, name) == ("positioner", "extend")
    parser = argparse.ArgumentParser()
    extend.add_arguments(parser)
    return parser.parse_args(words)


def test_one_missing_effect_is_one_command() -> None:
    arguments = asked("my rec.csv", "b.csv", "--valve", "v.toml", "--test", "t.csv", *EXPORT, *MORE)
    (command,) = extend_commands(diagnosed("missing", ("backlash",)), arguments)
    read = read_by_extend(command)
    assert (read.valve, read.effect, read.fit) == ("v.toml", ["backlash"], [Path("my rec.csv"), Path("b.csv")])
    assert read.test == Path("t.csv")
    exported = ("column", "stroke_m", "range_pa", "decimal", "time_format", "status", "sheet")
    for name in (*exported, "from_s", "to_s", "noise_m"):
        assert getattr(read, name) == getattr(arguments, name)


def test_effects_found_one_after_another_are_added_together() -> None:
    found = diagnosed("missing", ("ip_lag",), ("backlash",))
    (command,) = extend_commands(found, asked("r.csv", "--valve", "seed"))
    assert read_by_extend(command).effect == ["ip_lag", "backlash"]


def test_where_the_parameters_alone_were_off_the_valve_is_refitted_with_nothing_added() -> None:
    (command,) = extend_commands(diagnosed("adequate", parameters_off=True), asked("r.csv", "--valve", "seed"))
    assert read_by_extend(command).effect == []


def test_each_rival_has_its_command() -> None:
    found = diagnosed("one_of", ("ip_lag",), ("preload", "sensor_offset"))
    commands = extend_commands(found, asked("r.csv", "--valve", "seed"))
    assert [read_by_extend(each).effect for each in commands] == [["ip_lag", "preload"], ["ip_lag", "sensor_offset"]]


@pytest.mark.parametrize("verdict", ["adequate", "unexplained", "untrusted"])
def test_nothing_is_to_be_added_where_nothing_is_sure(verdict: str) -> None:
    found = diagnosed(verdict, *([("backlash",)] if verdict != "adequate" else []))
    assert extend_commands(found, asked("r.csv", "--valve", "seed")) == []
    assert not_written(Path("b.toml"), found).startswith("b.toml: not written: ")


def test_the_noise_and_the_stretch_that_were_said_are_said_again() -> None:
    arguments = asked("r.csv", "--valve", "seed", "--noise-m", "5e-5", "--from-s", "100.25", "--to-s", "1e5")
    (command,) = extend_commands(diagnosed("missing", ("backlash",)), arguments)
    read = read_by_extend(command)
    assert (read.noise_m, read.from_s, read.to_s) == (5e-5, 100.25, 1e5)


def test_what_is_unexplained_is_given_to_discover_as_it_was_to_diagnose() -> None:
    arguments = asked("my rec.csv", "b.csv", "--valve", "v.toml", "--test", "t.csv", *EXPORT, *MORE)
    program, name, *words = shlex.split(discover_command(arguments))
    assert (program, name) == ("positioner", "discover")
    parser = argparse.ArgumentParser()
    discover.add_arguments(parser)
    read = parser.parse_args(words)
    assert (read.valve, read.recordings, read.test) == ("v.toml", arguments.recordings, Path("t.csv"))
    for given in ("column", "stroke_m", "range_pa", "noise_m", "from_s"):
        assert getattr(read, given) == getattr(arguments, given)
    assert read.out == Path("found.py")
