"""Response figures of signals whose figures are known in closed form: uneven, noisy, with gaps, overshooting."""

import math
from dataclasses import replace

import numpy as np
import pytest

from config.recording import Column, Recording
from positioner.response import Figure, ResponseFigures, as_json, respond

T63, T86 = 0.632, 0.865


def uneven(rng: np.random.Generator, until_s: float, period_s: float) -> Column:
    """Times whose distances vary between half and one and a half of the period."""
    return np.cumsum(rng.uniform(0.5, 1.5, int(until_s / period_s)) * period_s)


def first_order(
    time_s: Column, at_s: float, dead_s: float, tau_s: float, travel_m: float, start_m: float = 0.02
) -> Recording:
    """A reference step, and a first-order answer to it after a dead time."""
    since_s = np.maximum(time_s - at_s - dead_s, 0.0)
    stepped = time_s >= at_s
    # The row at the step is at the step's own time: the recording says when the reference changed.
    return Recording(
        {
            "time_s": time_s,
            "command_pa": np.full_like(time_s, 5e4),
            "position_m": start_m + travel_m * (1 - np.exp(-since_s / tau_s)),
            "reference_m": np.where(stepped, start_m + travel_m, start_m),
        }
    )


def noisy(recording: Recording, rng: np.random.Generator, std_m: float) -> Recording:
    columns = dict(recording.columns)
    columns["position_m"] = columns["position_m"] + rng.normal(0.0, std_m, len(recording))
    return replace(recording, columns=columns)


def close(figure: Figure, true: float, floor: float = 0.0) -> bool:
    """Whether a figure is within three times its own uncertainty."""
    assert figure.value is not None, figure.reason
    assert figure.plus_minus is not None
    return abs(figure.value - true) <= 3 * figure.plus_minus + floor


def the_step(response: ResponseFigures) -> tuple[Figure, Figure, Figure, Figure]:
    assert len(response.steps) == 1, response
    step = response.steps[0]
    return step.dead_time_s, step.t63_s, step.t86_s, step.overshoot_percent


@pytest.mark.parametrize("travel_m", [0.01, -0.01])
def test_dead_time_t63_and_t86_of_a_first_order_answer_sampled_unevenly(travel_m: float) -> None:
    rng = np.random.default_rng(1)
    time_s = np.sort(np.append(uneven(rng, 8.0, 0.01), 3.0))
    dead, t63, t86, overshoot = the_step(respond(first_order(time_s, 3.0, 0.25, 0.4, travel_m)))
    # The answer is observable at half a percent, 0.005 τ after the dead time.
    assert dead.value == pytest.approx(0.25 + 0.005 * 0.4, abs=2e-3)
    assert t63.value == pytest.approx(0.25 + 0.4 * -math.log(1 - T63), abs=1e-3)
    assert t86.value == pytest.approx(0.25 + 0.4 * -math.log(1 - T86), abs=1e-3)
    assert overshoot.value == 0.0


def test_travel_gain_and_error_are_those_of_the_ends() -> None:
    recording = first_order(np.arange(0, 8, 0.01), 3.0, 0.1, 0.3, 0.01)
    columns = dict(recording.columns)
    columns["reference_m"] = np.where(recording.time_s >= 3.0, 0.0325, 0.02)
    step = respond(replace(recording, columns=columns)).steps[0]
    assert step.travel_m.value == pytest.approx(0.01, rel=1e-5)
    assert step.static_gain.value == pytest.approx(0.8, rel=1e-5)
    assert step.final_error_m.value == pytest.approx(-0.0025, rel=1e-4)


@pytest.mark.parametrize("noise", [0.002, 0.01, 0.03])
def test_uncertainties_cover_the_errors_under_noise(noise: float) -> None:
    """Of 60 noisy recordings the truth lies within the uncertainty in most, within three times in all but a few."""
    rng = np.random.default_rng(2)
    true = (0.25 + 0.4 * -math.log(1 - T63), 0.25 + 0.4 * -math.log(1 - T86))
    errors = []
    for _ in range(60):
        time_s = np.sort(np.append(uneven(rng, 8.0, 0.005), 3.0))
        recording = noisy(first_order(time_s, 3.0, 0.25, 0.4, 0.01), rng, noise * 0.01)
        _, *determined, overshoot = the_step(respond(recording))
        assert overshoot.value == 0.0, "noise is no overshoot"
        for figure, truth in zip(determined, true, strict=True):
            assert figure.value is not None
            assert figure.plus_minus is not None
            errors.append((figure.value - truth) / figure.plus_minus)
    assert np.mean(np.abs(errors) < 1) > 0.55
    assert np.mean(np.abs(errors) < 3) > 0.97
    assert abs(np.mean(errors)) < 0.5, "no bias to speak of"


def test_noise_at_rest_is_not_taken_for_the_end_of_the_dead_time() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        time_s = np.sort(np.append(uneven(rng, 20.0, 0.002), 3.0))
        dead, *_ = the_step(respond(noisy(first_order(time_s, 3.0, 5.0, 0.4, 0.01), rng, 1e-4)))
        # 5 σ is 5 % of the move here: observable 0.05 τ after the dead time.
        assert dead.value == pytest.approx(5.0 - 0.4 * math.log(0.95), abs=0.02)


def test_a_move_that_drowns_in_noise_has_a_travel_and_no_times() -> None:
    rng = np.random.default_rng(4)
    step = respond(noisy(first_order(np.arange(0, 8, 0.005), 3.0, 0.1, 0.3, 0.01), rng, 1e-3)).steps[0]
    assert close(step.travel_m, 0.01)
    assert step.t63_s.value is None
    assert step.t63_s.reason is not None
    assert "times its rests' scatter" in step.t63_s.reason


@pytest.mark.parametrize("noise_m", [0.0, 1e-4])
def test_the_overshoot_of_a_second_order_answer(noise_m: float) -> None:
    rng = np.random.default_rng(5)
    zeta, omega, travel_m = 0.4, 6.0, 0.01
    time_s = np.sort(np.append(uneven(rng, 14.0, 0.004), 3.0))
    since_s = np.maximum(time_s - 3.0, 0.0)
    damped = omega * math.sqrt(1 - zeta**2)
    answer = 1 - np.exp(-zeta * omega * since_s) * (
        np.cos(damped * since_s) + zeta * omega / damped * np.sin(damped * since_s)
    )
    recording = first_order(time_s, 3.0, 0.0, 1.0, travel_m)
    columns = dict(recording.columns) | {"position_m": 0.02 + travel_m * answer + rng.normal(0, noise_m, len(time_s))}
    *_, overshoot = the_step(respond(replace(recording, columns=columns)))
    true = 100 * math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2))
    assert close(overshoot, true, floor=0.02 * true)
    if not noise_m:
        assert overshoot.value == pytest.approx(true, rel=0.02)


@pytest.mark.parametrize(("period_s", "resolved"), [(1.0, False), (0.05, False), (0.01, False), (0.002, True)])
def test_times_that_the_sampling_cannot_carry_are_refused(period_s: float, resolved: bool) -> None:
    """A valve of 30 ms: sampled once a second it would seem to take 0.632 s, wherever straight lines are drawn."""
    time_s = np.arange(0.0, 60.0 * max(period_s, 0.1), period_s)
    at_s = float(time_s[len(time_s) // 2])
    dead, t63, t86, overshoot = the_step(
        respond(noisy(first_order(time_s, at_s, 0.0, 0.03, 0.01), np.random.default_rng(1), 1e-6))
    )
    assert (t63.value is not None) == resolved
    if resolved:
        assert close(t63, 0.03, 2e-4)
        assert close(t86, 0.06, 2e-4)
    else:
        for each in (dead, t63, overshoot):
            assert each.value is None
            assert each.reason is not None
            assert "the samples are too far apart" in each.reason


def test_a_gap_over_the_answer_makes_its_times_untold_and_keeps_the_others() -> None:
    recording = first_order(np.arange(0, 8, 0.005), 3.0, 0.1, 0.3, 0.01)
    t63_s = 3.0 + 0.1 + 0.3
    hole = (recording.time_s > t63_s - 0.15) & (recording.time_s < t63_s + 0.1)
    columns = dict(recording.columns)
    columns["position_m"] = np.where(hole, np.nan, recording.position_m)
    response = respond(replace(recording, columns=columns))
    dead, t63, t86, _ = the_step(response)
    assert t63.value is None
    assert t63.reason is not None
    assert "gap of 0.25 s" in t63.reason
    assert dead.value == pytest.approx(0.1015, abs=3e-3)
    assert t86.value == pytest.approx(0.1 + 0.3 * -math.log(1 - T86), abs=3e-3)
    assert response.notes[0].startswith(f"{int(hole.sum())} of {len(recording)} rows have no position")


def test_positions_in_mm_are_asked_about() -> None:
    recording = first_order(np.arange(0, 8, 0.005), 3.0, 0.1, 0.3, 0.01)
    in_mm = replace(recording, columns={**recording.columns, "position_m": 1e3 * recording.position_m})
    assert respond(recording).notes == ()
    assert respond(in_mm).notes == ("positions go to 30 m: are they in mm, or in %? Then position_m=THEIRS:mm, or :%",)


def test_a_gap_before_the_step_leaves_its_beginning_unknown() -> None:
    recording = first_order(np.arange(0, 8, 0.005), 3.0, 0.1, 0.3, 0.01)
    kept = (recording.time_s < 2.5) | (recording.time_s > 3.02)
    response = respond(Recording({name: column[kept] for name, column in recording.columns.items()}))
    _, t63, *_ = the_step(response)
    assert t63.reason == "the recording has a gap of 0.53 s before the step"


def test_a_stem_that_has_not_settled_has_no_t86() -> None:
    _, t63, t86, overshoot = the_step(respond(first_order(np.arange(0, 4.0, 0.005), 3.0, 0.1, 0.8, 0.01)))
    for figure in (t63, t86, overshoot):
        assert figure.reason == "the stem had not settled before the hold ended"


def test_a_ramp_and_a_sine_hold_no_step() -> None:
    time_s = np.arange(0, 10, 0.01)
    for wave in (0.001 * time_s, 0.01 * np.sin(time_s)):
        recording = Recording(
            {"time_s": time_s, "command_pa": 1e5 + 1e6 * wave, "position_m": wave, "reference_m": wave}
        )
        response = respond(recording)
        assert response.input == "none"
        assert response.notes == (
            "reference_m does not step from one held value to another",
            "command_pa does not step from one held value to another",
        )


def test_steps_of_the_command_serve_where_the_reference_only_follows_the_stem() -> None:
    recording = first_order(np.arange(0, 8, 0.01), 3.0, 0.1, 0.3, 0.01)
    # A stem that slips at once, and a reference that is set to it, as the daemon does outside automatic.
    position_m = np.where(recording.time_s >= 3.05, 0.03, 0.02)
    columns = dict(recording.columns) | {"position_m": position_m, "reference_m": position_m.copy()}
    columns["command_pa"] = np.where(recording.time_s >= 3.0, 6e4, 5e4)
    response = respond(replace(recording, columns=columns))
    assert response.input == "command_pa"
    assert response.steps[0].static_gain.value == pytest.approx(1e-6)


def test_a_noisy_analogue_command_steps_too() -> None:
    rng = np.random.default_rng(6)
    recording = first_order(np.arange(0, 8, 0.01), 3.0, 0.1, 0.3, 0.01)
    columns = {name: recording.columns[name] for name in ("time_s", "position_m")}
    columns["command_pa"] = np.where(recording.time_s >= 3.0, 6e4, 5e4) + rng.normal(0, 100, len(recording))
    response = respond(Recording(columns))
    assert [round(step.size, -2) for step in response.steps] == [1e4]


def test_a_rounding_transmitter_is_recognised_and_its_chatter_is_no_response() -> None:
    quantum_m = 2.5e-5
    recording = first_order(np.arange(0, 8, 0.005), 3.0, 0.1, 0.3, 0.01)
    columns = dict(recording.columns) | {"position_m": np.round(recording.position_m / quantum_m) * quantum_m}
    response = respond(replace(recording, columns=columns))
    assert response.notes == ("positions are whole multiples of 0.025 mm",)
    dead, t63, *_ = the_step(response)
    assert dead.value == pytest.approx(0.1, abs=0.01)
    assert t63.value == pytest.approx(0.1 + 0.3 * -math.log(1 - T63), abs=0.01)


def test_everything_is_plain_json() -> None:
    import json

    rng = np.random.default_rng(7)
    response = respond(noisy(first_order(np.arange(0, 8, 0.01), 3.0, 0.1, 0.3, 0.01), rng, 1e-3))
    determined = json.loads(json.dumps(as_json(response), allow_nan=False))
    assert determined["steps"][0]["t63_s"]["value"] is None
    assert determined["summary"]["travel_m"]["count"] == 1
