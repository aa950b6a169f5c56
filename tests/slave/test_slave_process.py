"""`positioner sim` as a process: ready line, both clocks, a clean end, bad input in one line."""

import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from config.modbus_map import SIMULATED_MAP
from positioner.cli.parts.children import port_in
from sim.slave.clocks import MOST_CATCH_UP_S
from tests.children import child, ended, running
from tests.independent import IndependentClient, independent_client

pytestmark = pytest.mark.real_time

COMMAND = SIMULATED_MAP.command_pa.address
ENDED_WELL = (0, "", "")


def start(config: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "positioner.cli", "sim", str(config), *options]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@contextmanager
def slave(path: Path, text: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Run a slave on a free port until it listens; make sure that it ends."""
    path.write_text(text)
    with start(path, "--listen-port", "0") as process:
        try:
            assert process.stdout is not None
            ready = process.stdout.readline().split()
            assert ready[:2] == ["listening", "on"], process.stderr and process.stderr.read()
            yield process, int(ready[2].removeprefix("127.0.0.1:"))
        finally:
            process.kill()


def end(process: subprocess.Popen[str], number: signal.Signals) -> tuple[int, str, str]:
    process.send_signal(number)
    out, error = process.communicate(timeout=60)
    return process.returncode, out, error


def sample(client: IndependentClient) -> tuple[float, float, int, int, int]:
    words = client.read_input(0, COMMAND)
    return struct.unpack(">ffIQH", struct.pack(f">{COMMAND}H", *words))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_serves_in_lockstep_until_told_to_end(tmp_path: Path, number: signal.Signals) -> None:
    text = "[clock]\nmode = 'lockstep'\nperiod_s = 0.002\n"
    with slave(tmp_path / "slave.toml", text) as (process, port), independent_client(port) as client:
        for _ in range(20):
            client.write(COMMAND, [0x4788, 0xB800])  # 70 kPa
        position_m, pressure_pa, counter, time_us, status = sample(client)
        assert (pressure_pa, counter, time_us, status) == (70e3, 20, 40_000, 0)
        assert position_m > 0.01
        assert end(process, number) == ENDED_WELL, "with a client connected"


def test_its_file_says_where_it_keeps_its_quantities(tmp_path: Path) -> None:
    text = (
        "[clock]\nmode = 'lockstep'\n[initial]\nposition_m = 0.05\npressure_pa = 40000.0\n[bus.map]\n"
        "position_m = { address = 0, type = 'int16', scale = 1e-5 }\n"
        "command_pa = { address = 10, type = 'uint16', scale = 100.0 }\n"
    )
    with slave(tmp_path / "slave.toml", text) as (_, port), independent_client(port) as client:
        client.write(10, [401])
        assert (client.read_holding(0, 1), client.read_holding(10, 1)) == ([5000], [401])


def test_real_time_runs_on_by_itself_and_acts_on_silence(tmp_path: Path) -> None:
    text = "[communication]\ntimeout_s = 0.02\naction = 'fill'\n[supply]\nmaximum_pa = 90e3\n"
    (tmp_path / "slave.toml").write_text(text)
    with child("sim", tmp_path / "slave.toml", "--listen-port", "0") as (process, ready):
        with independent_client(port_in(ready)) as client:
            first = last = sample(client)
            for _ in range(100_000):
                if last[3] >= first[3] + 50_000:
                    break
                last = sample(client)
            assert 50_000 <= last[3] - first[3] < 10_000_000
            assert last[2] * 1000 == last[3]
            assert last[4] == 1
            assert last[1] == 90e3
            assert last[0] > 0.001
            time.sleep(1.2 * MOST_CATCH_UP_S)  # nobody asks; had it not gone on by itself, it would say so now
            sample(client)
        process.signal(signal.SIGTERM)
        assert process.ended() == ENDED_WELL


def test_a_port_in_use_and_bad_files_are_one_line_and_status_2(tmp_path: Path) -> None:
    (tmp_path / "slave.toml").write_text("")
    with running("sim", tmp_path / "slave.toml", "--listen-port", "0") as ready:
        port = str(port_in(ready))
        said = {
            ("slave.toml", "--listen-port", port): f"127.0.0.1:{port}: cannot listen there: Address already in use",
            ("none.toml",): "cannot be read: No such file",
            ("bad.toml",): "clock.mode",
            ("ageing.toml",): "below coulomb_n",
        }
        (tmp_path / "bad.toml").write_text("[clock]\nmode = 'fast'\n")
        (tmp_path / "ageing.toml").write_text("[[change]]\nat_s = 5\ncoulomb_n = 1e4\n")
        for (name, *options), line in said.items():
            done = ended("sim", tmp_path / name, *options)
            assert (done.status, done.out, done.log.count("\n")) == (2, "", 1), done.log
            assert line in done.log


def test_help_does_not_load_the_model() -> None:
    code = (
        "import sys\nfrom positioner.cli import sim\nimport argparse\nparser = argparse.ArgumentParser()\n"
        "sim.add_arguments(parser)\nparser.format_help()\n"
        "print([name for name in sys.modules if name in ('sim', 'numpy', 'pydantic', 'pymodbus')])"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=os.environ)
    assert shown.stdout == "[]\n"
