from functools import cache
from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.recording import Column, Recording
from config.valve_file import EffectTable, ValveFile
from tests.pages.laid_out import hidden
from tests.workbench.hand_made import LIBRARY
from tests.workbench.valves import with_effect
from webpage.units import Units
from workbench.compare.comparison import compare
from workbench.data.record import Record, ready
from workbench.page.live_model import STRONGEST, LiveModel
from workbench.page.recording_opening import Opened
from workbench.page.time_figure import LINES, TimeFigure, Window, window_of


@cache
def record() -> Record:
    return ready(hidden().fit)


@cache
def preloaded() -> ValveFile:
    table = EffectTable.model_validate({"name": "preload", "force_n": 100.0})
    return ValveFile(valve=hidden().base.valve, effect=(table,))


def test_it_says_what_compare_says() -> None:
    live = LiveModel(record(), hidden().base)
    assert live.curve().rms_m == pytest.approx(compare(hidden().fit, hidden().base).rms_m, rel=1e-12)


def test_ten_million_samples_are_refused_at_once_as_for_a_fit() -> None:
    still = np.zeros(10_000_000)
    recording = Recording({"time_s": np.arange(still.size, dtype=np.float64), "command_pa": still, "position_m": still})
    with pytest.raises(InputError, match="10000000 samples would take hours to fit; allowed are 1000000 samples"):
        Opened.of("still.csv", Path("still.csv"), recording)


def test_a_move_is_a_parameter_of_the_valve_file_and_is_undone() -> None:
    live = LiveModel(record(), hidden().base)
    given = live.curve().rms_m
    spring = live.parameters["spring_n_per_m"]
    live.keep()
    live.move(spring, 0.25)
    assert live.valve.valve.spring_n_per_m == pytest.approx(live.value_at(spring, 0.25))
    assert live.curve().rms_m == pytest.approx(compare(hidden().fit, live.valve).rms_m, rel=1e-12)
    assert live.undo()
    assert live.curve().rms_m == given
    assert not live.undo()


@pytest.mark.parametrize("name", ["coulomb_n", "static_n", "preload.force_n", "mass_kg"])
def test_a_slider_goes_over_the_whole_range_and_static_friction_never_falls_below_sliding(name: str) -> None:
    live = LiveModel(record(), preloaded())
    moved = live.parameters[name]
    for share in (0.0, 0.3, 1.0):
        live.move(moved, share)
        assert live.share(moved) == pytest.approx(share, abs=1e-9)
        assert live.valve.valve.static_n >= live.valve.valve.coulomb_n * (1.0 - 1e-12)


def test_a_slider_goes_as_far_as_such_a_valve_may_and_a_number_as_far_as_is_physical() -> None:
    """A sensor's offset went to 10 m, a preload to a million newtons."""
    offset = EffectTable.model_validate({"name": "sensor_offset", "offset_m": 1e-3})
    valve = hidden().base.valve
    live = LiveModel(record(), ValveFile(valve=valve, effect=(offset,)))
    moved, coulomb, static = (live.parameters[name] for name in ("sensor_offset.offset_m", "coulomb_n", "static_n"))
    ends = [live.value_at(moved, share) for share in (0.0, 1.0)]
    assert ends == pytest.approx([-0.12 * valve.stroke_m, 0.12 * valve.stroke_m])
    assert live.value_at(coulomb, 1.0) == pytest.approx(10.0 * valve.coulomb_n)
    live.put(moved, 500.0, per_si=1e3)
    assert live.value(moved) == 0.5, "as typed, in mm"
    assert live.share(moved) == 1.0, "the slider stands at its end"
    live.put(coulomb, 1000.0)
    assert live.value(static) / live.value(coulomb) == pytest.approx(valve.static_n / valve.coulomb_n)
    live.put(static, 1500.0)
    assert live.valve.valve.static_n == pytest.approx(1500.0)
    for name, value in (("static_n", 900.0), ("mass_kg", -1.0), ("sensor_offset.offset_m", 11.0)):
        with pytest.raises(InputError, match=rf"{name}: allowed is .* to .*, got {value:g}"):
            live.put(live.parameters[name], value)
    with pytest.raises(InputError, match=r"allowed is -1e\+04 to 1e\+04, got 11000"):
        live.put(moved, 11e3, per_si=1e3)
    assert live.undo()
    assert live.value(static) == pytest.approx(1000.0 * valve.static_n / valve.coulomb_n)


@pytest.mark.parametrize(
    ("name", "key"), [("end_stop", "lower_m"), ("supply_limit", "supply_pa"), ("backlash", "width_m")]
)
def test_a_slider_reaches_no_stop_or_supply_that_no_valve_has(name: str, key: str) -> None:
    """Where an effect vanishes at the end of what is physical, its slider went there: a stop 100 m away."""
    valve = hidden().base.valve
    declared = {key: each.starts_for(valve)[-1] for key, each in LIBRARY[name].parameters.items()}
    live = LiveModel(record(), with_effect(hidden().base, name, **declared))
    longest = valve.stroke_m if key.endswith("_m") else valve.spring_n_per_m * valve.stroke_m / valve.diaphragm_area_m2
    moved = live.parameters[f"{name}.{key}"]
    assert max(abs(live.value_at(moved, share)) for share in (0.0, 1.0)) <= STRONGEST * longest


def test_an_effect_switched_off_is_the_valve_without_it() -> None:
    live = LiveModel(record(), preloaded())
    live.switch("preload", False)
    assert live.valve.effect == ()
    assert live.curve().rms_m == pytest.approx(compare(hidden().fit, hidden().base).rms_m, rel=1e-9)
    live.switch("preload", True)
    assert live.valve == preloaded()


def test_the_figure_keeps_extremes_and_every_sample_when_it_is_looked_at_closely() -> None:
    count = 100_000
    time_s: Column = 0.01 * np.arange(count, dtype=np.float64)
    position_m = 0.05 + 0.02 * np.sin(0.01 * time_s)
    position_m[77_777] += 1e-3
    record = ready(Recording({"time_s": time_s, "command_pa": 1e5 * position_m, "position_m": position_m}))
    figure = TimeFigure(record, 0.1, Units("mm"))
    drawn = figure.data(("measured",))
    assert len(drawn["y"][0]) < 4000
    assert 1e3 * position_m[77_777] == pytest.approx(np.nanmax([each or np.nan for each in drawn["y"][0]]), rel=1e-3)
    figure.window = Window(777.0, 778.0)
    close = figure.data(("command",))
    assert len(close["x"][0]) == pytest.approx(200, abs=5)
    assert [each["name"] for each in figure.figure()["data"][: len(LINES)]] == list(LINES)


def test_a_window_is_what_the_plot_says() -> None:
    whole = Window(0.0, 9.0)
    assert window_of({"xaxis.range[0]": 1, "xaxis.range[1]": 2.5}, whole) == Window(1.0, 2.5)
    assert window_of({"xaxis.autorange": True}, whole) == whole
    assert window_of({"xaxis.range": [1, 2]}, whole) == Window(1.0, 2.0)
    assert window_of({"yaxis.range[0]": 1, "yaxis.range[1]": 2.5}, whole) is None


def test_what_cannot_be_simulated_is_refused() -> None:
    with pytest.raises(InputError, match="position_m"):
        Opened.of("r.csv", Path("r.csv"), Recording({"time_s": np.arange(9.0), "command_pa": np.arange(9.0)}))
