"""Ctrl-C during long work: what is known is said, and the command ends without waiting for its searches."""

import signal
import time
from pathlib import Path

import pytest

from config.recording import write_recording
from config.writing import valve_toml
from tests.children import Child
from tests.workbench.valves import SEED, record_of, with_effect

pytestmark = pytest.mark.real_time

LATEST_S = 5.0
"""One on a machine that is free; a search that is under way takes longer on one that is not."""


def test_a_diagnosis_that_is_broken_off_says_what_is_known(tmp_path: Path) -> None:
    write_recording(tmp_path / "rec.csv", record_of(with_effect(SEED, "preload", force_n=200.0), 3, 3000))
    (tmp_path / "known.toml").write_text(valve_toml(SEED), encoding="utf-8")
    child = Child("diagnose", tmp_path / "rec.csv", "--valve", str(tmp_path / "known.toml"))
    try:
        assert child.line().startswith("tangent preview")
        child.signal(signal.SIGINT)
        began_s = time.monotonic()
        ended = child.ended()
        assert time.monotonic() - began_s < LATEST_S
        assert ended.status == 130
        assert "positioner diagnose: broken off; so far fitting the valve as it is: 100%" in ended.log
        assert "nothing was written" in ended.log
    finally:
        child.close()
