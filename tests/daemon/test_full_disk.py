"""A daemon that keeps everything, and a disk that takes nothing more: control goes on, and so does keeping after it."""

import json
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from config.codes import EventKind, Fault, Mode
from config.recorder_files import files_of
from config.recording import read_recording
from positioner.cli.parts.children import port_in
from positioner.dcs import Dcs
from positioner.history.history_reader import HistoryReader
from tests.children import child, running
from tests.daemon_files import PATIENT, daemon_file, slave_file
from tests.waiting import until

pytestmark = pytest.mark.patient

LONGEST_S = 2.0
"""Of a busy machine between two rows; the disk is full for longer."""
KEPT = ("recorder", "health", "memory", "history")
TABLES = "".join(f"[{each}]\nfolder = '{each}'\n" for each in KEPT) + "[safety]\nstale_after_s = 10.0\n"


def moves(dcs: Dcs, reference: float) -> None:
    dcs.set("reference", reference)
    until(lambda: abs(dcs.get("position") - reference) < 5e-3, "the stem")


def test_a_full_disk_stops_nothing_and_what_follows_is_kept_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)  # what finds no room then comes later
    with running("sim", slave_file(tmp_path), "--listen-port", "0") as slave:
        config = daemon_file(tmp_path, port_in(slave), TABLES, PATIENT)
        with child("run", config) as (process, ready), Dcs("127.0.0.1", port_in(ready), timeout_s=20.0) as dcs:
            dcs.set("mode", Mode.AUTOMATIC)
            moves(dcs, 0.5)
            _, hard = resource.prlimit(process.pid, resource.RLIMIT_FSIZE)
            resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (0, hard))
            dcs.set("mode", Mode.HOLD)  # an event that finds no room
            dcs.set("mode", Mode.AUTOMATIC)
            cycles = dcs.get("cycles")
            moves(dcs, 0.6)
            full_s = time.monotonic() + 1.5 * LONGEST_S
            until(lambda: dcs.get("cycles") > cycles + 500 and time.monotonic() > full_s, "cycles")
            assert (dcs.get("fault"), dcs.get("mode")) == (Fault.NONE, Mode.AUTOMATIC)
            resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (hard, hard))
            newest = files_of(tmp_path / "recorder", "FV-101")[-1]
            size = newest.stat().st_size
            until(lambda: newest.stat().st_size > size, "rows")
            moves(dcs, 0.4)
        log = [json.loads(line) for line in config.with_suffix(".log").read_text().splitlines()]
    assert not [line for line in log if "exception" in line]
    recording = read_recording(newest)
    assert np.diff(recording.time_s).max() < LONGEST_S, "what came while the disk was full has been written"
    assert not recording.columns["unrecorded"].any()
    with HistoryReader(tmp_path / "history") as history:
        events = history.events("FV-101")
    assert [each.number for each in events] == sorted({each.number for each in events})
    assert events[-1].kind == EventKind.STOPPED
    for kept in ("health", "memory"):
        assert not [each for each in (tmp_path / kept).iterdir() if each.suffix not in {".json", ".lock"}], (
            "nothing half done"
        )


def test_a_read_only_disk_is_one_line_before_anything_is_commanded(tmp_path: Path) -> None:
    """On a file system of its own, mounted read-only, where the system lets us."""
    folder = tmp_path / "disk"
    folder.mkdir()
    with running("sim", slave_file(tmp_path), "--listen-port", "0") as slave:
        configs = [
            daemon_file(tmp_path, port_in(slave), f"[{kept}]\nfolder = 'disk/kept'\n", PATIENT).rename(
                tmp_path / f"{kept}.toml"
            )
            for kept in KEPT
        ]
        for said in refused_on_read_only(folder, configs):
            assert "disk/kept" in said
            assert "Read-only file system" in said


def refused_on_read_only(folder: Path, configs: list[Path]) -> list[str]:
    """Return the line that each daemon says when it is refused, the folder being on a disk that takes nothing."""
    if shutil.which("unshare") is None:
        pytest.skip("needs util-linux")
    refused = "{main(['run', each]) for each in sys.argv[1:]} == {2}"
    script = f"import sys; from positioner.cli.main import main; sys.exit(not {refused})"
    mounted = 'mount -t tmpfs -o ro tmpfs "$0" && exec "$@"'
    command = ["unshare", "-Urm", "sh", "-c", mounted, str(folder), sys.executable, "-c", script, *map(str, configs)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=90, check=False)
    if "unshare:" in done.stderr or "mount:" in done.stderr:
        pytest.skip(f"may not mount: {done.stderr.strip()}")
    assert done.returncode == 0, "each ends with status 2"
    lines = [each for each in done.stderr.splitlines() if not each.startswith("{")]
    assert len(lines) == len(configs), done.stderr
    return lines
