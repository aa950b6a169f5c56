"""Daemon and slave as processes on a serial line (two pseudo-terminals): `run`, `probe`, `doctor`, bad input."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from config.codes import Fault, Mode
from config.daemon_file import load_daemon
from config.errors import InputError
from positioner.cli import doctor
from positioner.cli.main import main
from positioner.cli.parts.children import port_in
from positioner.cli.parts.pseudo_line import pseudo_line
from positioner.dcs import Dcs
from sim.slave.slave import Slave
from tests.children import ended, running
from tests.daemon_files import LAW
from tests.waiting import until

pytestmark = pytest.mark.real_time


@dataclass
class Line:
    """A slave on one end of a line, and the daemon's file for the other."""

    daemon: Path
    other_end: str


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Line]:
    folder = tmp_path_factory.mktemp("serial")
    with pseudo_line() as (end, other_end):
        (folder / "slave.toml").write_text(
            f'[bus]\nkind = "rtu"\nserial = {{path = "{other_end}", baud = 115200}}\n'
            "[sensor]\nnoise_std_m = 1e-5\n[initial]\nposition_m = 0.03\npressure_pa = 24000.0\n"
        )
        daemon = folder / "daemon.toml"
        daemon.write_text(
            f'[valve]\nstroke_m = 0.1016\n[device]\nbus = "rtu"\nserial = {{path = "{end}", baud = 115200}}\n'
            f"reply_timeout_s = 1.0\n[cycle]\nperiod_s = 0.02\n[supervisory]\nport = 0\n{LAW}"
        )
        with running("sim", folder / "slave.toml") as slave:
            assert slave == f"listening on {other_end}"
            yield Line(daemon, other_end)


def test_probe_and_doctor_watch(line: Line, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["probe", str(line.daemon), "--count", "1"]) == 0
    assert ", plausible" in capsys.readouterr().out
    word, position_m, *_ = doctor.check_bus(load_daemon(line.daemon), line.daemon).split()
    assert word == "position"
    assert float(position_m) == pytest.approx(0.03, abs=1e-4)


def test_the_daemon_moves_the_valve(line: Line) -> None:
    with running("run", line.daemon) as daemon, Dcs("127.0.0.1", port_in(daemon)) as dcs:
        assert dcs.get("command") == pytest.approx(24000.0)
        dcs.set("mode", Mode.AUTOMATIC)
        dcs.set("reference", 0.6)
        until(lambda: abs(dcs.get("position") - 0.6) < 0.005, "the stem at the reference")
        assert dcs.get("fault") == Fault.NONE


def test_bad_input_is_one_line_and_status_2(line: Line, tmp_path: Path) -> None:
    files = {
        "gone.toml": '[bus]\nkind = "rtu"\nserial.path = "/dev/ttyNONE"\n',
        "null.toml": '[bus]\nkind = "rtu"\nserial.path = "/dev/null"\n',
        "busy.toml": f'[bus]\nkind = "rtu"\nserial.path = "{line.other_end}"\n',
        "baud.toml": '[bus]\nkind = "rtu"\nserial = {path = "/dev/null", baud = 110}\n',
        "port.toml": f'[bus]\nkind = "rtu"\nserial.path = "{line.other_end}"\n',
        "daemon.toml": '[valve]\nstroke_m = 0.1\n[device]\nbus = "rtu"\nserial.path = "/dev/ttyNONE"\n',
    }
    said = {
        "gone.toml": "/dev/ttyNONE: cannot listen there: No such file or directory",
        "null.toml": "/dev/null: cannot listen there: is not a serial line",
        "busy.toml": f"{line.other_end}: cannot listen there: is used by another process",
        "baud.toml": "bus.serial.baud: Input should be 1200, 2400,",
        "port.toml": "--listen-port: is of Modbus TCP",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    for name, words in said.items():
        with pytest.raises(InputError) as caught:
            Slave(tmp_path / name, 0 if name == "port.toml" else None)
        assert words in str(caught.value)
        assert "\n" not in str(caught.value)
    done = ended("run", tmp_path / "daemon.toml")
    assert (done.status, done.out, done.log.count("\n")) == (2, "", 1), done.log
    assert "/dev/ttyNONE unit 1: No such file or directory" in done.log
