"""Ctrl-C during long work: how far it came is said, and nothing is written."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.recording import Recording, write_recording
from positioner.cli.main import main


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
