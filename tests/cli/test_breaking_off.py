"""Ctrl-C during long work: how far it came is said, and nothing is written."""

import os
import signal
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from config.recording import Recording, write_recording
from positioner.cli.main import main
from positioner.cli.parts.breaking_off import end_as_by_ctrl_c


def test_a_discovery_that_is_broken_off_says_how_far_it_came(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken_off(*_: Any, progress: Any, **__: Any) -> None:
        progress("fitting 5 forms", 0.4)
        raise KeyboardInterrupt

    monkeypatch.setattr("workbench.discover.discovery.discover", broken_off)
    columns = {name: np.arange(3.0) for name in ("time_s", "command_pa", "position_m")}
    write_recording(tmp_path / "rec.csv", Recording(columns))
    out = tmp_path / "form.py"
    assert main(["discover", str(tmp_path / "rec.csv"), "--valve", "seed", "-o", str(out)]) == 130
    assert (
        "positioner discover: broken off; so far fitting 5 forms: 40%; nothing was written" in capsys.readouterr().err
    )
    assert not out.exists()


def test_a_file_whose_reading_is_broken_off_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken_off(_: Path) -> Recording:
        raise KeyboardInterrupt

    monkeypatch.setattr(Recording, "read", broken_off)
    assert main(["estimate", str(tmp_path / "rec.csv")]) == 130
    assert "positioner estimate: broken off; so far reading " in capsys.readouterr().err


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGHUP], ids=["terminated", "the terminal is gone"])
def test_who_plays_on_a_valve_is_ended_as_by_ctrl_c_which_vetoes(
    end: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = SimpleNamespace(verdict="one_of", sentence="one of two")
    monkeypatch.setattr("workbench.diagnosis.diagnosis.diagnose", lambda *_, **__: found)
    monkeypatch.setattr("workbench.discriminate.discrimination.rivals_of", lambda _: {})
    monkeypatch.setattr("positioner.cli.parts.experiment_player.require_ready", lambda *_: None)
    monkeypatch.setattr("positioner.cli.parts.experiment_player.player_on", lambda *_: None)

    def ended(*_: Any, **__: Any) -> None:
        assert signal.getsignal(end) is signal.default_int_handler, "it would end these tests"
        os.kill(os.getpid(), end)

    monkeypatch.setattr("workbench.discriminate.discrimination.discriminate", ended)
    before = signal.getsignal(end)
    monkeypatch.chdir(tmp_path)
    Path("site.toml").write_text("[valve]\nstroke_m = 0.1\n")
    write_recording(Path("rec.csv"), Recording({n: np.arange(3.0) for n in ("time_s", "command_pa", "position_m")}))
    assert main(["discriminate", "site.toml", "--rec", "rec.csv", "--valve", "seed", "--out", "told"]) == 130
    assert signal.getsignal(end) is before
    assert "positioner discriminate: broken off; nothing is named" in capsys.readouterr().err


def test_under_nohup_a_terminal_that_is_gone_ends_nothing() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with end_as_by_ctrl_c():
            os.kill(os.getpid(), signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)
