"""`[law] valve` and `play --extended`, by the commands a person types."""

from pathlib import Path

import pytest

from config.valve_file import load_valve, shipped_valve
from positioner.cli.main import main

HARD = '\n[[effect]]\nname = "spring_hardening"\ncubic_n_per_m3 = 1e6\n'
PLAY = '\n[[effect]]\nname = "backlash"\nwidth_m = 5e-4\n'
"""What landings do not show, for the sensor does not."""
DAEMON = '[valve]\nstroke_m = 0.1016\n[law]\nvalve = "better.toml"\n[device]\nport = 1\n'
Capture = pytest.CaptureFixture[str]


def written(path: Path, more: str, stroke: str = "0.1016") -> Path:
    text = shipped_valve("seed").read_text(encoding="utf-8")
    assert "stroke_m = 0.1016" in text
    path.write_text(text.replace("stroke_m = 0.1016", f"stroke_m = {stroke}") + more, encoding="utf-8")
    load_valve(path)
    return path


def test_play_prints_what_either_law_leaves(tmp_path: Path, capsys: Capture) -> None:
    valve = written(tmp_path / "better.toml", PLAY)
    reference = tmp_path / "reference.csv"
    steps_m = (0.06, 0.064, 0.061, 0.07, 0.066, 0.066)
    reference.write_text("\n".join(["time_s,reference_m", *(f"{2 * i},{x}" for i, x in enumerate(steps_m)), ""]))
    words = ["play", str(valve), "--reference", str(reference), "--law", "slides", "--period-s", "0.02"]
    assert main([*words, "--extended", str(valve), "-o", str(tmp_path / "run.csv")]) == 0
    said = capsys.readouterr().out.splitlines()
    before, after = (float(line.split(": ")[1].split(" %")[0]) for line in said if line.startswith("error of the stem"))
    assert after < 0.01 < before
    # The steps make 0.197 strokes; those of a per cent and less are two slides each, there and back.
    *_, last = (line for line in said if line.startswith("error of the stem"))
    travelled, asked = (float(each.split()[0]) for each in last.split(", ")[-2:])
    assert asked == pytest.approx((0.004 + 0.003 + 0.009 + 0.004) / 0.1016, abs=0.006)
    assert asked < travelled < 1.5


@pytest.mark.parametrize(
    ("more", "stroke", "said"),
    [
        ('\n[[effect]]\nname = "own.py"\n', "0.1016", "better.toml: effect own declares no inverse"),
        (HARD, "0.04", "law.valve: {folder}/better.toml: stroke_m is 0.04 m, the daemon's [valve] has 0.1016 m"),
        (HARD.replace("1e6", "-1e6"), "0.1016", "cubic_n_per_m3: must be a number from 0 to 1e+12"),
    ],
)
def test_the_daemon_does_not_start_with_another_valve(
    tmp_path: Path, capsys: Capture, more: str, stroke: str, said: str
) -> None:
    (tmp_path / "own.py").write_text("def force(x): return -x\n")
    written(tmp_path / "better.toml", more, stroke)
    daemon = tmp_path / "daemon.toml"
    daemon.write_text(DAEMON)
    assert main(["doctor", str(daemon)]) == 1
    (line,) = (each for each in capsys.readouterr().out.splitlines() if each.startswith("law"))
    assert "FAILS" in line
    assert said.format(folder=tmp_path) in line
    assert main(["run", str(daemon)]) == 2
    line = capsys.readouterr().err
    assert said.format(folder=tmp_path) in line
    assert line.count("\n") == 1
