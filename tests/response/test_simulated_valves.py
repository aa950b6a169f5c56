"""Response figures of simulated valves against what their physics says, and of measured recordings."""

import math
from pathlib import Path

import numpy as np
import pytest

from config.recording import Recording, read_recording, write_recording
from config.valve_file import find_valve, load_valve
from positioner.cli.main import main
from positioner.response import respond
from sim.valve import Valve

DATA = Path(__file__).parents[3] / "shared" / "data"
PERIOD_S = 1e-3
NOISE_M = 1e-5


def stepped(levels_pa: list[float], hold_s: float = 0.4) -> Recording:
    """The seed's valve under held pressures, with white sensor noise."""
    command_pa = np.repeat(np.array(levels_pa, dtype=np.float64), round(hold_s / PERIOD_S))
    valve = Valve.from_file(load_valve(find_valve("seed")))
    indicated_m = valve.run(command_pa, np.full(len(command_pa), PERIOD_S)).indicated_m[:-1]
    noise_m = np.random.default_rng(0).normal(0.0, NOISE_M, len(command_pa))
    time_s = PERIOD_S * np.arange(len(command_pa), dtype=np.float64)
    return Recording({"time_s": time_s, "command_pa": command_pa, "position_m": indicated_m + noise_m})


def test_dead_band_and_resolution_are_those_of_the_friction() -> None:
    """From slow upward rest F_c opposes: it moves on after (F_s - F_c)/A, back after (F_s + F_c)/A."""
    up = [20e3, *np.arange(60e3, 80e3, 500.0).tolist()]
    down = np.arange(80e3, 18e3, -1e3).tolist()
    response = respond(stepped(up + down, hold_s=0.2))
    seed = load_valve(find_valve("seed")).valve
    A = seed.diaphragm_area_m2
    assert response.input == "command_pa"
    for figure, true in (
        (response.dead_band, (seed.static_n + seed.coulomb_n) / A),
        (response.resolution, (seed.static_n - seed.coulomb_n) / A),
    ):
        assert figure.value is not None, figure.reason
        assert figure.plus_minus is not None
        assert abs(figure.value - true) <= figure.plus_minus + 0.005 * true


def test_t63_and_t86_of_the_moving_stem_are_those_of_its_two_poles() -> None:
    """Upward from rest the stem is linear, m x'' = A u - F_v x' - k_s x - F_c: two real poles, solved here."""
    seed = load_valve(find_valve("seed")).valve
    response = respond(stepped([20e3, 60e3, 100e3]))
    slow, fast = sorted(
        np.roots([seed.mass_kg, seed.viscous_ns_per_m, seed.spring_n_per_m]).real.tolist(), reverse=True
    )
    t = np.linspace(0, 0.1, 100_001)
    y = 1 - (fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (fast - slow)
    step = response.steps[1]
    for figure, level in ((step.t63_s, 0.632), (step.t86_s, 0.865)):
        assert figure.value == pytest.approx(float(t[int((y >= level).argmax())]), abs=2e-4)
    assert step.travel_m.value == pytest.approx(40e3 * seed.diaphragm_area_m2 / seed.spring_n_per_m, rel=2e-3)
    assert step.overshoot_percent.value == 0.0


def test_without_small_steps_it_is_told_so() -> None:
    response = respond(stepped([20e3, 60e3, 100e3, 30e3, 90e3]))
    for figure in (response.dead_band, response.resolution):
        assert figure.value is None
        assert figure.reason is not None
        assert figure.reason.startswith("this recording does not hold a series of small steps")


@pytest.mark.long
def test_a_played_run_is_cut_at_its_excitation_and_named_step_by_step(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "ref.csv").write_text("time_s,reference_m\n0,0.05\n1,0.065\n2,0.04\n2.5,0.041\n3,0.041\n")
    play = ["play", "seed", "--reference", str(tmp_path / "ref.csv"), "--noise-m", "1e-5", "-o"]
    assert main([*play, str(tmp_path / "run.csv")]) == 0
    capsys.readouterr()
    assert main(["response", str(tmp_path / "run.csv"), "--json", str(tmp_path / "figures.json")]) == 0
    out = capsys.readouterr().out
    assert "4 steps of reference_m" in out
    assert "Td, T63, T86, overshoot of step 4: the stem did not move" in out
    assert "of the daemon's own excitation (state S3) were left out" in out
    response = respond(read_recording(tmp_path / "run.csv"))
    up = response.steps[1]
    assert up.final_error_m.value == pytest.approx(0.0, abs=2e-4)
    assert response.static_gain.value == pytest.approx(1.0, abs=0.02)


def test_no_step_is_exit_status_1_and_a_bad_file_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flat = Recording({name: np.linspace(0, 1, 50) for name in ("time_s", "command_pa", "position_m")})
    write_recording(tmp_path / "flat.csv", flat)
    assert main(["response", str(tmp_path / "flat.csv")]) == 1
    assert "command_pa does not step" in capsys.readouterr().out
    assert main(["response", str(tmp_path / "none.csv")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.skipif(not DATA.exists(), reason="the shared measurements are not here")
@pytest.mark.parametrize("name", ["J_2", "Fs_1", "sigma0_1"])
def test_measured_ramps_hold_no_step(name: str) -> None:
    """A servo motor under triangles and ramps of torque: nothing is held, so nothing steps."""
    response = respond(read_recording(DATA / "servo_motor" / f"{name}.csv"))
    assert response.steps == ()
    assert math.isnan(response.noise_m or math.nan)
