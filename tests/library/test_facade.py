"""`import positioner as pos`: every name there, nothing loaded before it is asked for, what is missing in one line."""

import inspect
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path
from typing import Any, assert_type

import numpy as np
import pytest

import positioner as pos

ROOT = Path(__file__).parents[2]
WITHOUT = """
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {extras!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Missing())
import positioner as pos
"""


def python(code: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=False, timeout=60)


def without(*extras: str) -> str:
    return WITHOUT.format(extras=extras)


def test_every_name_is_there_and_completion_shows_it() -> None:
    for name in pos.__all__:
        assert getattr(pos, name).__doc__, name
    assert set(pos.__all__) <= set(dir(pos))


def test_what_the_library_says_it_offers_is_what_it_loads() -> None:
    assert sorted(pos._LIVES_IN) == sorted(pos.__all__)


def test_importing_it_loads_nothing_but_the_standard_library() -> None:
    at_any_start = python("import sys; print(*sys.modules)").stdout.split()
    loaded = python("import sys; import positioner; print(*sys.modules)").stdout.split()
    assert [name for name in loaded if name.startswith("positioner")] == ["positioner"]
    assert {name.partition(".")[0] for name in loaded} - sys.stdlib_module_names <= {"positioner", *at_any_start}


def test_a_gateway_has_all_that_needs_no_extra() -> None:
    named = "Device Driver Reading NoReply Recording InputError valve respond estimate write_valve Port"
    absent = without("numba", "llvmlite", "scipy", "matplotlib", "pandas", "pyarrow", "plotly", "canopen")
    done = python(absent + "\n".join(f"pos.{name}" for name in named.split()))
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("name", "missing"), [("compare", "llvmlite"), ("fit", "scipy"), ("simulate", "llvmlite")])
def test_what_needs_an_extra_names_it_in_one_line(name: str, missing: str) -> None:
    done = python(without(missing) + f"pos.{name}")
    assert done.stderr.splitlines()[-1] == (
        f"ModuleNotFoundError: positioner.{name} needs {missing}, which is not installed: "
        "pip install 'positioner[sim,plot]'"
    )
    assert "During handling" not in done.stderr


def test_a_name_that_is_not_there_is_told_with_those_that_are() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'comparison'; it has: .*compare, diagnose"):
        getattr(pos, "comparison")  # noqa: B009


def test_version_is_the_distributions() -> None:
    assert pos.__version__ == version("positioner")


def test_every_package_that_is_shipped_says_that_it_is_typed() -> None:
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert [name for name in wheel["packages"] if not (ROOT / name / "py.typed").is_file()] == []


def test_type_checkers_see_through_it() -> None:
    """Held by mypy, which reads this file."""
    valve = pos.valve("seed")
    assert_type(valve, pos.ValveFile)
    assert_type(pos.simulate(valve, [0.0, 0.1], [0.0, 0.0]), pos.Recording)


@pytest.mark.parametrize(
    ("time_s", "command_pa", "said"),
    [
        ([0.0, 1.0], [0.0], "time_s holds 2 values, command_pa 1; allowed are equally many, 2 or more"),
        ([0.0, 0.0], [0.0, 1.0], "time_s must increase strictly"),
        ([0.0, 1.0], [0.0, float("nan")], "command_pa must be a series of finite numbers"),
        ([[0.0, 1.0]], [0.0, 1.0], r"time_s must be a series of finite numbers, its shape is \(1, 2\)"),
    ],
)
def test_a_series_that_is_none_is_refused_in_one_line(time_s: list[float], command_pa: list[float], said: str) -> None:
    with pytest.raises(pos.InputError, match=said):
        pos.simulate(pos.valve("seed"), time_s, command_pa)


def test_a_noise_below_zero_is_refused() -> None:
    with pytest.raises(pos.InputError, match="noise_std_m"):
        pos.simulate(pos.valve("seed"), [0.0, 1.0], [0.0, 1.0], noise_std_m=-1.0)
    with pytest.raises(pos.InputError, match="noise_std_m: must be positive, it is 0"):
        pos.estimate(pos.simulate(pos.valve("seed"), [0.0, 1.0], [0.0, 1.0]), noise_std_m=0.0)


def test_a_simulated_recording_is_the_valves_answer_and_survives_its_file(tmp_path: Path) -> None:
    valve = pos.valve("seed")
    time_s, command_pa = [0.0, 0.5, 1.5, 2.0], [0.0, 60e3, 60e3, 0.0]
    recording = pos.simulate(valve, time_s, command_pa)
    assert recording.time_s.tolist() == time_s
    assert recording.position_m[2] > 0.1 * valve.valve.stroke_m > recording.position_m[1]
    recording.write(tmp_path / "rec.csv")
    again = pos.Recording.read(tmp_path / "rec.csv")
    assert again.columns.keys() == recording.columns.keys()
    assert all((again.columns[name] == column).all() for name, column in recording.columns.items())


@pytest.fixture
def valve() -> pos.ValveFile:
    return pos.valve("seed")


@pytest.fixture
def recording(valve: pos.ValveFile) -> pos.Recording:
    return pos.simulate(valve, [0.0, 1.0], [0.0, 1.0])


@pytest.mark.parametrize("name", [name for name in pos.__all__ if name.islower()])
def test_every_function_says_what_it_may_be_given(name: str) -> None:
    function = getattr(pos, name)
    first = next(iter(inspect.signature(function).parameters))
    with pytest.raises(pos.InputError, match=rf"^{first}: must be a .*, got a Device$"):
        function(*[pos.Device(bus="modbus")] * 3)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda r, _: pos.compare(r, "seed"), "valve: must be a ValveFile (valve(name) reads one), got 'seed'"),  # type: ignore[arg-type]
        (
            lambda r, v: pos.diagnose([r, "b.csv"], v),  # type: ignore[list-item]
            "recording: must be a Recording (Recording.read(file) reads one) or a list of Recordings, "
            "got a list of Recording and str",
        ),
        (
            lambda r, v: pos.extend(r, v, "backlash"),
            "effects: must be a list of texts, got 'backlash'; one is ['backlash']",
        ),
        (lambda *_: pos.hide(seed="3"), "seed: must be a whole number, got '3'"),  # type: ignore[arg-type]
        (
            lambda _, v: pos.simulate(v, "now", [0.0]),
            "simulate: time_s must be a series of finite numbers, got 'now'",
        ),
        (lambda *_: pos.Recording("r.csv"), "recording: allowed are columns by their names, got 'r.csv'"),  # type: ignore[arg-type]
    ],
)
def test_another_kind_of_thing_is_refused_in_one_line(
    call: Any, said: str, recording: pos.Recording, valve: pos.ValveFile
) -> None:
    with pytest.raises(pos.InputError) as refused:
        call(recording, valve)
    assert str(refused.value) == said


def test_numbers_of_other_libraries_are_taken_and_a_wrong_call_stays_pythons_own(valve: pos.ValveFile) -> None:
    simulated = pos.simulate(valve, [0.0, 1.0], [0.0, 1.0], noise_std_m=np.float32(1e-5), seed=np.int64(1))  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'valve'"):
        pos.compare(simulated)  # type: ignore[call-arg]
