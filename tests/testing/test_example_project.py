"""The example project of `docs/pytest.md`, which has a package called `config` of its own, made and run."""

import re
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "pytest.md"
BLOCK = re.compile(r"^```python ([\w/.]+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
REAL_TIME = """
import pytest


@pytest.mark.parametrize("valve_slave", [{"clock": {"mode": "real_time"}}], indirect=True)
def test_in_real_time_the_valve_goes_on_by_itself(valve_slave):
    first = valve_slave.read().device_time_s
    while valve_slave.read().device_time_s < first + 0.1:
        pass
"""
WRONG = """
import pytest


@pytest.mark.parametrize("valve_slave", [{"clock": {"mode": "fast"}}, {"valve": "none"}], indirect=True)
def test_it(valve_slave):
    pass
"""


def run_pytest(folder: Path, *options: str) -> "subprocess.CompletedProcess[str]":
    """Run pytest there, as its owner does."""
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *options]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False, timeout=200)


def test_the_example_project_passes_beside_its_own_config(tmp_path: Path) -> None:
    for file, text in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text(text, encoding="utf-8")
    assert (tmp_path / "config" / "__init__.py").is_file()
    (tmp_path / "test_real_time.py").write_text(REAL_TIME)
    done = run_pytest(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "6 passed" in done.stdout


def test_what_the_tables_may_not_say_fails_the_test_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "test_wrong.py").write_text(WRONG)
    done = run_pytest(tmp_path, "-r", "N")
    assert done.returncode == 1
    lines = [line for line in done.stdout.splitlines() if line.startswith("valve_slave: ")]
    assert len(lines) == 2, done.stdout
    assert "clock.mode: Input should be 'real_time' or 'lockstep', got 'fast'" in lines[0]
    assert "by name there are: ordinary, rotary, seed" in lines[1]
    assert "Traceback" not in done.stdout + done.stderr
