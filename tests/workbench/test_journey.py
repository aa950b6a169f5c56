"""The whole journey, blind: compare fails, diagnose names the effect, extend adds it, the error falls, compare holds.

The recordings come from generators that share no code with the model (LuGre, elasto-plastic); one case
arrives as a historian's export. Small libraries and short recordings keep it short; the campaign is in benchmarks/.
"""

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.recording import Recording, write_recording
from config.valve_file import ValveFile
from config.valve_file_writer import valve_toml
from positioner.cli.main import main
from tests.workbench.generators import case

DURATION_S, UNTIL_A_PLAY_SHOWS_S = 10.0, 20.0
"""A play b is friction of k_s b / 2 wherever motions begin with reversals: 40 moves of the shorter one do."""
TOLD_OR_FREE = 0.1
"""Of the error: what told onsets, and those of a free run, may differ by, a share of a sample in each slide."""
STAGES = "extended", "refitted"


@dataclass(frozen=True)
class Blind:
    """Recordings, what is known, what is hidden; how commands read the recordings."""

    fit: Recording
    test: Recording
    known: ValveFile
    hidden: str
    rival: str
    is_export: bool = False


def generated(
    kind: str, law: str, seed: int, rival: str, *, duration_s: float = DURATION_S, is_export: bool = False
) -> Blind:
    made = case(kind, law=law, seed=seed, duration_s=duration_s)
    assert made.hidden
    return Blind(made.fit, made.test, made.base, made.hidden, rival, is_export)


def export(path: Path, recording: Recording, stroke_m: float) -> None:
    """Write it as a historian does: its own names, per cent, bar, semicolons and decimal commas."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, delimiter=";")
        writer.writerow(["Time", "OUT", "PV"])
        for t, u, y in zip(recording.time_s, recording.command_pa, recording.position_m, strict=True):
            writer.writerow([f"{each:.9g}".replace(".", ",") for each in (t, u / 1e5, 100.0 * y / stroke_m)])


MAPPING = [f"--column={each}" for each in ("time_s=Time", "command_pa=OUT:bar", "position_m=PV:%")]


@pytest.mark.long
@pytest.mark.parametrize(
    "blind",
    [
        pytest.param(
            lambda: generated(
                "backlash", "elasto_plastic", 2, "ip_lag", duration_s=UNTIL_A_PLAY_SHOWS_S, is_export=True
            ),
            id="elasto-plastic, export",
        ),
        pytest.param(lambda: generated("asymmetric_friction", "lugre", 1, "sensor_lag"), id="LuGre"),
    ],
)
def test_the_hidden_effect_is_found_and_added_and_the_error_falls(
    blind: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    given: Blind = blind()
    for name, recording in (("fit.csv", given.fit), ("test.csv", given.test)):
        if given.is_export:
            export(Path(name), recording, given.known.valve.stroke_m)
        else:
            write_recording(Path(name), recording)
    Path("known.toml").write_text(valve_toml(given.known), encoding="utf-8")
    mapping = MAPPING if given.is_export else []

    before = asked("compare", "test.csv", "--valve", "known.toml", *mapping, status=1)
    words = ["fit.csv", "--valve", "known.toml", "--test", "test.csv", "--effects", given.rival, given.hidden]
    said = asked("diagnose", *words, *mapping, status=1)
    assert said["verdict"] in {"missing", "one_of"}, said["sentence"]
    assert given.hidden in {*said["missing"], *(each for names in said["indistinguishable"] for each in names)}
    words = ["known.toml", "--effect", *said["missing"], "--fit", "fit.csv", "--test", "test.csv", "-o", "new.toml"]
    extended = asked("extend", *words, *mapping, status=0)
    with_it_m, without_m = (np.sqrt(extended[each]["test_rmse_m"] ** 2 - extended["floor_m"] ** 2) for each in STAGES)
    assert with_it_m < 0.5 * without_m, "beyond the floor"
    assert extended["extended"]["test_rmse_m"] == pytest.approx(said["best"]["test_rmse_m"], rel=0.1)
    after = asked("compare", "test.csv", "--valve", "new.toml", *mapping)
    assert after["rms_m"] == pytest.approx(extended["extended"]["test_rmse_m"], rel=TOLD_OR_FREE)
    assert after["rms_m"] < 0.1 * before["rms_m"]
    assert after["fit_percent"] > 99.0


def asked(command: str, *words: str, status: int | None = None) -> dict[str, Any]:
    found = main([command, *words, "--json", f"{command}.json"])
    assert status is None or found == status
    answer: dict[str, Any] = json.loads(Path(f"{command}.json").read_text())
    return answer
