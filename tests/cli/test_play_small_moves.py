"""`positioner play --law slides`: what the seed's law cannot do, by the command a person types."""

from pathlib import Path

import numpy as np
import pytest

from config.recording import read_recording
from positioner.cli.main import main

STROKE_M = 0.1016
STEPS_M = (0.06, 0.0605, 0.0602, 0.0615, 0.0612)
HOLD_S = 2.0


def played(tmp_path: Path, law: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the references, m, and where the stem was at the end of each, m."""
    reference = tmp_path / "reference.csv"
    rows = [f"{HOLD_S * index},{value}" for index, value in enumerate((*STEPS_M, STEPS_M[-1]))]
    reference.write_text("\n".join(["time_s,reference_m", *rows, ""]))
    out = tmp_path / f"{law}.csv"
    words = ["play", "seed", "--reference", str(reference), "--law", law, "--noise-m", "1e-5"]
    words += ["--period-s", "5e-3", "-o", str(out)]
    assert main(words) == 0
    columns = read_recording(out).columns
    ends = np.searchsorted(columns["time_s"], HOLD_S * np.arange(1, len(STEPS_M) + 1) - 1e-3)
    return np.array(STEPS_M), columns["position_m"][ends]


def test_small_steps_are_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked_m, found_m = played(tmp_path, "slides")
    assert np.abs(found_m - asked_m)[1:].max() < 1e-3 * STROKE_M + 5e-5
    assert "identified b/c = -81" in capsys.readouterr().out


def test_the_seeds_law_leaves_the_stem_where_it_was(tmp_path: Path) -> None:
    asked_m, found_m = played(tmp_path, "seed")
    assert found_m[0] == pytest.approx(asked_m[0], abs=2e-4), "a large step it makes"
    assert np.ptp(found_m) < 1e-4
    assert np.abs(found_m - asked_m).max() > 5e-3 * STROKE_M


def test_another_law_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["play", "seed", "--reference", str(tmp_path / "r.csv"), "--law", "pid", "-o", str(tmp_path / "o.csv")])
    assert caught.value.code == 2
    assert "slides" in capsys.readouterr().err
