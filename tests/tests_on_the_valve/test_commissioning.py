"""Commissioning of a valve that nobody has described, in virtual time; and the file that it writes."""

from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from config.codes import Fault, ValveTestVerdict
from config.daemon_file import DaemonFile, load_daemon
from config.errors import InputError
from config.recording import Recording
from config.slave_file import DeviceFault, Initial
from config.toml_editing import with_values
from config.travel import ActionWord
from config.valve_file import EffectTable
from positioner.cli.commission import write_proposals
from positioner.cli.main import main
from positioner.cli.parts.own_valve import unknown_travel
from positioner.control.played_experiment import ROUNDING
from positioner.control.settings import Settings
from positioner.response.figure import Figure, no_value
from positioner.tests_on_the_valve.air_rates import air_rates
from positioner.tests_on_the_valve.commissioning import Commissioned, Proposal, commission, of_one_that_sticks
from positioner.tests_on_the_valve.small_steps import SmallSteps, programme, small_steps
from tests.control.virtual_loop import VirtualLoop
from tests.tests_on_the_valve.virtual_valve import (
    AREA_M2,
    MAXIMUM_PA,
    MIDWAY,
    ORDINARY,
    PARAMETERS,
    PRELOAD_N,
    SLOPE,
    STROKE_M,
    VirtualValve,
    daemon_file,
    told,
)

UNKNOWN = unknown_travel(daemon_file())
BOUNDS = Settings.of(UNKNOWN).experiment
OFF_M = 1e-3
"""The reading's zero."""
WITHIN_S = 300.0
"""Wherever the stem is at first."""
SITE = f"""# FV-1, behind the boiler
[valve]
name = "FV-1"     # as the plant calls it

[cycle]
pace = "device"

[pressure]
maximum_pa = {MAXIMUM_PA}   # the regulator's

[safety]
stale_after_s = 0.5
"""


def commissioned(**valve: object) -> tuple[Commissioned, VirtualValve]:
    stranger = VirtualValve(file=UNKNOWN, **valve)  # type: ignore[arg-type]
    return commission(stranger, "FV-1", BOUNDS), stranger


@contextmanager
def written(folder: Path, action: ActionWord, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Path, VirtualValve]]:
    """Commission by the command, on a valve in memory in place of one on a bus."""
    site = folder / "site.toml"
    site.write_text(SITE)
    initial = MIDWAY if action == "air_to_open" else Initial()
    off = EffectTable(name="sensor_offset", offset_m=OFF_M)  # type: ignore[call-arg]
    valve = ORDINARY.model_copy(update={"effect": (*ORDINARY.effect, off)})
    stranger = VirtualValve(valve, file=UNKNOWN, noise=1e-3, action=action, initial=initial)

    @contextmanager
    def in_memory(_file: DaemonFile, _source: Path) -> Iterator[VirtualValve]:
        yield stranger

    monkeypatch.setattr("positioner.cli.commission.own_valve", in_memory)
    yield site, stranger


@pytest.mark.parametrize("action", ["air_to_open", pytest.param("air_to_close", marks=pytest.mark.long)])
def test_a_valve_that_nobody_has_described_runs_after_it(
    action: ActionWord, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with written(tmp_path, action, monkeypatch) as (site, stranger):
        assert main(["commission", str(site), "--yes"]) == 0, capsys.readouterr().err
    assert "# FV-1, behind the boiler" in site.read_text()
    assert 'name = "FV-1"     # as the plant calls it' in site.read_text()
    assert "# the regulator's" in site.read_text()
    file = load_daemon(site)
    assert file.valve.stroke_m == pytest.approx(STROKE_M, rel=5e-3)
    assert file.valve.action == action
    assert file.pressure.maximum_pa == MAXIMUM_PA, "the regulator's: a mended valve may need more than this one"
    assert file.law is not None
    assert file.law.b_over_c_pa_per_m == pytest.approx(-SLOPE, rel=0.01)
    low_pa = (PRELOAD_N + 0.12 * 207.5) / AREA_M2
    assert file.law.offset_pa == pytest.approx(low_pa - SLOPE * OFF_M, rel=0.03)
    assert "its zero is off, set it in the device" in capsys.readouterr().out
    assert stranger.cycle.snapshot.sample.time_s < WITHIN_S
    loop = VirtualLoop(file, stranger.device)
    for opening in (0.3, 0.7, 0.65):
        loop.refer_to(file.valve.travel.stem_m(opening) / file.valve.stroke_m, 15.0)
        reading_m = stranger.device.stem_m + OFF_M
        assert file.valve.travel.opening(reading_m) == pytest.approx(opening, abs=0.01)


def test_from_full_air_it_takes_less_than_five_minutes_too() -> None:
    found, valve = commissioned(noise=1e-3, initial=Initial(position_m=STROKE_M, pressure_pa=MAXIMUM_PA))
    assert found.outcome.passed
    assert valve.cycle.snapshot.sample.time_s < WITHIN_S


def test_where_nobody_agrees_nothing_is_moved_nor_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with written(tmp_path, "air_to_open", monkeypatch) as (site, stranger):
        monkeypatch.setattr("builtins.input", lambda _: "n")
        assert main(["commission", str(site)]) == 1
        assert "nothing was moved" in capsys.readouterr().out
        assert stranger.device.samples == 3 + 1  # those of its own start
    assert site.read_text() == SITE


def test_a_greatest_pressure_is_written_where_nobody_has(tmp_path: Path) -> None:
    proposed = (Proposal("pressure", "maximum_pa", 116e3, "enough"),)
    for text, expected in ((SITE, MAXIMUM_PA), (SITE.replace("maximum_pa", "minimum_pa = 0.0 #"), 116e3)):
        site = tmp_path / "site.toml"
        site.write_text(text.replace("[valve]", "[valve]\nstroke_m = 0.04"))
        assert write_proposals(site, load_daemon(site), proposed, Namespace(yes=True, name=None)) == 0
        assert load_daemon(site).pressure.maximum_pa == expected


def stuck() -> Commissioned:
    return commissioned(valve=told(coulomb_n=9e3, static_n=9.5e3))[0]


def unsupplied() -> Commissioned:
    return commissioned(faults=(DeviceFault(kind="supply", at_s=0.0, to_pa=61e3),))[0]


def springless() -> Commissioned:
    """Return what a cylinder comes to that a constant pressure pushes back."""
    return commissioned(valve=told(spring_n_per_m=0.0))[0]


@pytest.mark.parametrize(
    ("bad", "verdict"),
    [
        (stuck, ValveTestVerdict.NOT_MOVED),
        (unsupplied, ValveTestVerdict.NO_SUPPLY),
        (springless, ValveTestVerdict.NO_SPRING),
    ],
)
def test_what_is_wrong_ends_it_in_a_code_and_proposes_nothing(bad: object, verdict: ValveTestVerdict) -> None:
    found = bad()  # type: ignore[operator]
    assert (found.outcome.verdicts, found.proposals) == ((verdict,), ())


def test_a_fault_on_the_way_ends_it_under_the_command_in_force_never_vented() -> None:
    found, valve = commissioned(faults=(DeviceFault(kind="nan", at_s=40.0, over_s=5.0),))
    assert found.outcome.verdicts == (ValveTestVerdict.BROKEN_OFF,)
    assert "fault: the measurement is impossible" in found.outcome.notes[0]
    assert valve.cycle.snapshot.decision.fault is Fault.IMPLAUSIBLE
    held_pa = valve.command_pa()
    valve.watch(5.0)
    assert valve.command_pa() == held_pa > 0.0


@pytest.mark.parametrize(("filling", "venting"), [(30e3, 20e3), (30e3, 200e3)])
def test_the_rates_of_a_booster_are_found_where_the_command_is_faster(filling: float, venting: float) -> None:
    time_s = np.arange(0.0, 30.0, 0.05)
    command_pa = np.interp(time_s, (0.0, 1.0, 2.4, 13.0, 14.4), (0.0, 0.0, 140e3, 140e3, 0.0))
    pressure_pa = [0.0]
    for asked_pa in command_pa[1:].tolist():
        change_pa = asked_pa - pressure_pa[-1]
        pressure_pa.append(pressure_pa[-1] + min(max(change_pa, -0.05 * venting), 0.05 * filling))
    columns = {"time_s": time_s, "command_pa": command_pa, "position_m": 0.0 * time_s}
    found = air_rates(Recording(columns | {"pressure_pa": np.array(pressure_pa)}), 100e3)
    assert found[0].value == pytest.approx(filling, rel=0.01)
    if venting < 100e3:
        assert found[1].value == pytest.approx(venting, rel=0.01)
    else:
        assert found[1].reason == "as fast as the command, 100 kPa/s"
    assert "no pressure is measured" in (air_rates(Recording(columns), 100e3)[0].reason or "")


def test_who_interrupts_it_gets_the_command_before_back() -> None:
    valve = VirtualValve(file=UNKNOWN)
    held_pa, turn, count = valve.command_pa(), valve.turn, 0

    def interrupted() -> None:
        nonlocal count
        count += 1
        if count == 1000:
            raise KeyboardInterrupt
        turn()

    valve.turn = interrupted
    with pytest.raises(KeyboardInterrupt):
        commission(valve, "FV-1", BOUNDS)
    assert valve.command_pa() == held_pa
    assert not valve.cycle.snapshot.decision.experiment.commands


def test_a_daemon_that_serves_the_valve_is_in_service(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import socket

    with socket.create_server(("127.0.0.1", 0)) as served:
        site = tmp_path / "site.toml"
        site.write_text(f"[valve]\nstroke_m = 0.04\n[supervisory]\nport = {served.getsockname()[1]}\n")
        assert main(["commission", str(site), "--yes"]) == 1
        assert "the valve is in service; end that daemon first" in capsys.readouterr().err
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(socket, "create_connection", Mock(side_effect=TimeoutError("timed out")))
            assert main(["commission", str(site), "--yes"]) == 1
        assert "cannot be told: timed out" in capsys.readouterr().err, "a daemon that has not come to answer is one"


@pytest.mark.parametrize(
    ("text", "values", "expected"),
    [
        ("", {("valve", "stroke_m"): 0.04}, "[valve]\nstroke_m = 0.04\n"),
        ("[a]\nx = 1 # one\n[b]\nx = 2\n", {("b", "x"): 3}, "[a]\nx = 1 # one\n[b]\nx = 3\n"),
        ('[a]\n  s = "x # y"  # why\n', {("a", "s"): "z"}, '[a]\n  s = "z"  # why\n'),
        ("[a]\n[b]\n", {("a", "x"): 1.5}, "[a]\nx = 1.5\n[b]\n"),
    ],
)
def test_values_go_into_a_text_whose_comments_stay(
    text: str, values: dict[tuple[str, str], float | str], expected: str
) -> None:
    assert with_values(text, values).lstrip("\n") == expected


@pytest.mark.parametrize("text", ["a = { x = 1 }\n", "a.x = 1\n", "[[a]]\nx = 1\n", "[a]\nx = [\n 1 ]\n"])
def test_a_text_that_cannot_be_changed_by_a_line_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="by hand"):
        with_values(text, {("a", "x"): 2})


@pytest.mark.parametrize(
    ("dead_band", "plus_minus"),
    [(Figure(7500.0, 300.0), 275.0), (Figure(6000.0, 300.0), 50.0), (no_value("noise"), 50.0)],
)
def test_friction_of_a_stem_that_sticks_is_known_no_better_than_it_sticks(dead_band: Figure, plus_minus: float) -> None:
    """It breaks loose at 3750 Pa and stops at no more than 3200: the mean is within 275 Pa above what ramps show."""
    told = of_one_that_sticks(Figure(3200.0, 50.0), dead_band)
    assert told.value == 3200.0
    assert told.plus_minus == pytest.approx(plus_minus, rel=0.02)


def test_small_steps_bracket_dead_band_and_resolution() -> None:
    """A slide lands at F_c: back, F_c and F_s are to be overcome; onward, what F_s is more than F_c."""
    valve = VirtualValve(told(coulomb_n=400.0, static_n=440.0))
    asked = SmallSteps(2.0 * 420.0 / AREA_M2)
    played = valve.play(programme(asked, Settings.of(valve.file).experiment, valve.command_pa(), STROKE_M))
    assert played.recording is not None
    outcome = small_steps(played.recording, "FV-1", STROKE_M, SLOPE)
    assert outcome.verdicts == (ValveTestVerdict.PASSED,)
    for name, true_n in (("dead_band_pa", 840.0), ("resolution_pa", 40.0)):
        figure = outcome.figure(name)
        assert figure.value == pytest.approx(true_n / AREA_M2, abs=figure.plus_minus)
    assert outcome.figure("least_move_m").value == pytest.approx(40.0 / PARAMETERS.spring_n_per_m, rel=0.4)


def test_steps_over_the_wire_are_no_faster_than_permitted() -> None:
    """Times and pressures go as float32, which rounds a leap of a millisecond late in a program by a part of itself."""
    bounds = Settings.of(daemon_file()).experiment
    program = programme(SmallSteps(5750.0, held_s=2.0), bounds, 60e3, STROKE_M)
    time_s, pressure_pa = np.array(program.points, dtype=np.float32).astype(float).T
    assert np.max(np.abs(np.diff(pressure_pa)) / np.diff(time_s)) <= bounds.rate_pa_per_s * (1.0 + ROUNDING)


def test_steps_without_room_are_refused() -> None:
    bounds = Settings.of(daemon_file()).experiment
    with pytest.raises(InputError, match="no room for"):
        programme(SmallSteps(100e3), bounds, 70e3, STROKE_M)
