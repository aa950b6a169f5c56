"""The slave file: what the shipped example says, and one line for each kind of fault."""

from pathlib import Path

import pytest

from config.errors import InputError
from config.loading import SHIPPED
from config.slave_file import SlaveFile, load_slave, valve_path


def test_the_example_says_the_defaults_but_for_noise_and_ageing() -> None:
    example = load_slave(SHIPPED / "profiles" / "slave.toml")
    assert example.sensor.noise_std_m > 0
    assert example.change
    changed = {"sensor": example.sensor, "change": example.change}
    assert example == SlaveFile().model_copy(update=changed)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[clock]\nperiod_s = 1.5e-6\n", "whole number of microseconds"),
        ("[clock]\nperiod_s = 0.0\n", "clock.period_s"),
        ("[clock]\nmode = 'fast'\n", "clock.mode"),
        ("[sensor]\nnoise_std_m = -1e-5\n", "sensor.noise_std_m"),
        ("[sensor]\nnoise = 1\n", "allowed here: noise_std_m, quantum_m, seed"),
        ("[[change]]\nat_s = 1.0\n", "names no parameter to change"),
        ("[bus]\nunit = 0\n", "bus.unit"),
    ],
)
def test_a_fault_is_one_line_that_names_file_and_key(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "slave.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_slave(path)
    assert str(path) in str(caught.value)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_periods_are_whole_microseconds() -> None:
    for period_us in (1, 7, 10, 33, 1000, 20000):
        clock = SlaveFile.model_validate({"clock": {"period_s": period_us * 1e-6}}).clock
        assert clock.period_us == period_us


def test_a_valve_beside_the_file_or_a_shipped_one(tmp_path: Path) -> None:
    path = tmp_path / "slave.toml"
    (tmp_path / "mine.toml").write_text("")
    assert valve_path(SlaveFile(valve="mine.toml"), path) == tmp_path / "mine.toml"
    assert valve_path(SlaveFile(), path).name == "seed.toml"
    with pytest.raises(InputError, match=r"no file 'other.toml' beside it"):
        valve_path(SlaveFile(valve="other.toml"), path)
