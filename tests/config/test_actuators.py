"""What is neither simulated nor positioned is refused wherever somebody writes it, with what would be needed."""

from pathlib import Path

import pytest

from config.actuators import NEEDED
from config.errors import InputError
from config.valve_file import load_valve, shipped_valve
from positioner.cli.main import main
from workbench.page.desk import name_valve

SITE = '[valve]\nstroke_m = 0.04\nactuator = "{}"\n'
SLAVE = 'valve = "ordinary"\nactuator = "{}"\n'
ORDINARY = shipped_valve("ordinary").read_text()


@pytest.mark.parametrize("actuator", NEEDED)
@pytest.mark.parametrize(
    ("command", "text"), [("run", SITE), ("commission", SITE), ("signature", SITE), ("doctor", SITE), ("sim", SLAVE)]
)
def test_a_plants_file(
    command: str, text: str, actuator: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "site.toml"
    path.write_text(text.format(actuator))
    assert main([command, str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "actuator: is neither simulated nor positioned: " in line
    assert NEEDED[actuator] in line


@pytest.mark.parametrize("actuator", NEEDED)
def test_a_valve_file_wherever_it_is_read_the_workbenchs_page_too(actuator: str, tmp_path: Path) -> None:
    path = tmp_path / "v.toml"
    path.write_text(ORDINARY.replace("[valve]", f'[valve]\nactuator = "{actuator}"', 1))
    for read in (load_valve, lambda each: name_valve(str(each))):
        with pytest.raises(InputError, match=r"valve\.actuator: is neither simulated nor positioned: ") as refused:
            read(path)
        assert NEEDED[actuator] in str(refused.value)


def test_the_one_that_is_may_be_written(tmp_path: Path) -> None:
    path = tmp_path / "v.toml"
    path.write_text(ORDINARY.replace("[valve]", '[valve]\nactuator = "spring_return"', 1))
    assert load_valve(path) == load_valve(shipped_valve("ordinary"))
