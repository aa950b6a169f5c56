"""`positioner certify`: a certificate from what a daemon has kept of its valve, or what is missing for one."""

from dataclasses import replace
from pathlib import Path

import pytest

from config.daemon_file import DaemonFile, load_valves
from positioner.cli.main import main
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.daemon.memory.known_configuration import conditions_of
from positioner.daemon.memory.memory_file import write_memory
from positioner.daemon.sole_daemon import MEMORY, valve_file_path
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.breakaway_distance import BreakawayDistance, Interval
from positioner.estimation.landings.landing_detector import SlideOutcome

RATIOS = Ratios(-800e3, -20e3)
STROKE_M = 0.1


def landing(number: int) -> SlideOutcome:
    """Return a slide that landed on its balance, give or take 2 um."""
    direction, x = (1, -1)[number % 2], 0.03 + 0.002 * number
    command_pa = RATIOS.balance_pa(x + 2e-6 * (-1) ** (number // 2), direction)
    return SlideOutcome(-1.0 - number, direction, x - direction * 0.02, command_pa, x, 1e-6, moved=True, landing=True)


KNOWN = ValveKnowledge(
    ratios=RATIOS,
    covariance=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    residual_m=2e-6,
    landings=tuple(landing(number) for number in range(16)),
    distances=BreakawayDistance(*(4 * [Interval(4.9e-3, 5e-3, seen=True)])),
)


@pytest.fixture
def site(tmp_path: Path) -> Path:
    path = tmp_path / "site.toml"
    path.write_text(
        f'[valve]\nname = "v"\nstroke_m = {STROKE_M}\n[memory]\nfolder = "kept"\n'
        '[device]\nbus = "modbus"\nhost = "127.0.0.1"\nport = 1\n'
    )
    return path


def keep(site: Path, knowledge: ValveKnowledge) -> None:
    (file,) = load_valves(site)
    assert isinstance(file, DaemonFile)
    assert file.memory.folder is not None
    (site.parent / "kept").mkdir()
    write_memory(valve_file_path(site.parent / file.memory.folder, "v", MEMORY), "v", conditions_of(file), knowledge)


def test_a_valve_that_is_known_well_has_its_certificate(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    keep(site, KNOWN)
    assert main(["certify", str(site)]) == 0
    said = capsys.readouterr().out
    assert "proved for every valve inside the intervals" in said
    assert "each move ends, within" in said
    assert "most slides a step" in said


def test_what_is_known_too_badly_is_named(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    keep(site, replace(KNOWN, distances=BreakawayDistance()))
    assert main(["certify", str(site)]) == 1
    assert "to be known better: break-away distances" in capsys.readouterr().out


def test_nothing_is_certified_of_a_valve_that_nobody_has_identified(
    site: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["certify", str(site)]) == 2
    assert "identify it first" in capsys.readouterr().err
