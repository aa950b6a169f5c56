"""The units for systemd: right by its own checks, as hard as docs/gateway.md says, and what they rest on is true."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from positioner.cli.main import command_parser
from positioner.daemon.pacing import FIFO_PRIORITY

DEPLOY = Path(__file__).parents[2] / "deploy"
UNITS = sorted((DEPLOY / "systemd").glob("*.service"))
TOLD = (DEPLOY.parent / "docs" / "gateway.md").read_text()
DAEMON = (DEPLOY / "systemd" / "positioner@.service").read_text()
ANALYZE = shutil.which("systemd-analyze")

each_unit = pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
with_systemd = pytest.mark.skipif(ANALYZE is None, reason="needs systemd-analyze, of Debian's package systemd")


def keys(text: str) -> dict[str, str]:
    return dict(re.findall(r"^(\w+)=(.*)$", text, re.MULTILINE))


@each_unit
def test_a_unit_runs_a_command_that_there_is(unit: Path) -> None:
    program, *words = keys(unit.read_text())["ExecStart"].split()
    assert program == "/opt/positioner/bin/positioner"
    command_parser().parse_args(words)


def test_the_daemon_has_the_rights_that_its_loop_asks_for_and_is_restarted_but_for_bad_input() -> None:
    said = keys(DAEMON)
    assert int(said["LimitRTPRIO"]) >= FIFO_PRIORITY
    assert (said["Type"], said["Restart"], said["RestartPreventExitStatus"]) == ("notify", "on-failure", "2")
    assert said["LimitMEMLOCK"] == "infinity"


@with_systemd
@each_unit
def test_systemd_finds_nothing_wrong(unit: Path, tmp_path: Path) -> None:
    copy = tmp_path / unit.name.replace("@", "@daemon")
    text = unit.read_text().replace("/opt/positioner/bin/positioner", sys.executable)
    copy.write_text(text)
    words = [str(ANALYZE), "verify", "--man=no", "--recursive-errors=no", str(copy)]
    said = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (said.returncode, [line for line in said.stderr.splitlines() if unit.stem in line]) == (0, []), said.stderr


@with_systemd
@each_unit
def test_a_unit_is_as_hard_as_the_documents_say(unit: Path) -> None:
    words = [str(ANALYZE), "security", "--offline=true", "--no-pager", str(unit)]
    said = subprocess.run(words, capture_output=True, text=True, check=False)
    found = re.search(r"exposure level for .*: ([\d.]+)", said.stdout)
    assert found, said.stdout + said.stderr
    told = re.search(rf"\| `deploy/systemd/{re.escape(unit.name)}` \| ([\d.]+) \|", TOLD)
    assert told, unit.name
    assert float(found[1]) <= float(told[1])


def test_the_container_runs_as_nobody_and_ends_by_the_signal_that_is_caught() -> None:
    text = (DEPLOY / "container" / "Containerfile").read_text()
    assert "USER 65534:65534" in text
    assert "STOPSIGNAL SIGTERM" in text
    assert "--require-hashes -r /source/deploy/locked/gateway.txt" in text
    locked = (DEPLOY / "locked" / "gateway.txt").read_text()
    of_extras = {"cryptography", "canopen", "prometheus-client"}  # TLS, CANopen, metrics
    assert of_extras <= set(re.findall(r"^([\w-]+)==", locked, re.MULTILINE))
