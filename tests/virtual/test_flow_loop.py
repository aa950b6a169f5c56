"""A flow loop without a valve: process, controller and both together against closed form."""

import cmath
from math import exp, hypot, pi, sqrt

import numpy as np
import pytest

from benchmarks.flow.course import FlowCourse, course_of_stem, figures
from benchmarks.flow.loop import FlowController, FlowLoop, FlowProcess

PROCESS = FlowProcess(time_constant_s=2.0, gain=1.5, disturbance=0.02, disturbance_period_s=90.0)
QUIET = FlowProcess(disturbance=0.0)
OMEGA = 2 * pi / PROCESS.disturbance_period_s


def test_a_step_of_the_stem_is_answered_exponentially() -> None:
    assert QUIET.after(0.2, 0.7, 5.0, 2.0) == pytest.approx(0.7 - 0.5 * exp(-1))


def test_many_steps_make_one() -> None:
    flow = 0.3
    for k in range(100):
        flow = PROCESS.after(flow, 0.5, 0.1 * k, 0.1)
    assert flow == pytest.approx(PROCESS.after(0.3, 0.5, 0.0, 10.0), rel=1e-12)


def test_the_process_obeys_its_equation() -> None:
    flow, time_s, step_s = 0.4, 17.0, 1e-6
    slope = (PROCESS.after(flow, 0.5, time_s, step_s) - flow) / step_s
    disturbance = PROCESS.disturbance * np.sin(OMEGA * time_s)
    assert 2.0 * slope == pytest.approx(1.5 * 0.5 + disturbance - flow, abs=1e-6)


def test_the_controller_is_a_pi() -> None:
    controller = FlowController(setpoint=0.6, gain=0.5, integral_time_s=2.0, period_s=0.5)
    integral, references = 0.3, []
    for _ in range(4):
        reference, integral = controller.after(integral, 0.5)
        references.append(reference)
    assert references == pytest.approx([0.3 + 0.5 * 0.1 * (1 + 0.25 * n) for n in (1, 2, 3, 4)])


def test_its_integral_stands_at_the_end_of_the_travel() -> None:
    controller = FlowController(setpoint=0.6, gain=2.0)
    assert controller.after(0.9, 0.1) == (1.0, 0.9)
    assert controller.after(0.1, 1.0) == (0.0, 0.1)


def test_lambda_tuning_makes_the_closed_loop_a_lag_of_lambda() -> None:
    """From 0.1 off its setpoint, with so short a period that it is none."""
    process = FlowProcess(disturbance=0.0, gain=2.0)
    tuned = FlowController.tuned(process, closed_s=6.0, setpoint=0.6)
    controller = FlowController(tuned.setpoint, tuned.gain, tuned.integral_time_s, period_s=1e-3)
    flow, integral, time_s = 0.5, 0.25, 0.0
    for _ in range(6000):
        reference, integral = controller.after(integral, flow)
        flow = process.after(flow, reference, time_s, 1e-3)
        time_s += 1e-3
    assert flow == pytest.approx(0.6 - 0.1 * exp(-1), abs=1e-4)


def test_the_loop_of_a_valve_without_friction_leaves_what_its_sensitivity_says() -> None:
    """S = 1 / (1 + G C) at z = exp(i omega T), G = K (1 - p)/(z - p), C = k + k T/T_i z/(z - 1)."""
    controller = FlowController.tuned(PROCESS, closed_s=6.0)
    time_s = np.arange(0.0, 900.0, 0.5)
    course = course_of_stem(FlowLoop(PROCESS, controller), time_s)
    z, p = cmath.exp(0.5j * OMEGA), exp(-0.5 / 2.0)
    process = PROCESS.gain * (1 - p) / (z - p)
    pi_controller = controller.gain * (1 + 0.25 * z / (z - 1))
    amplitude = PROCESS.disturbance / hypot(1, 2.0 * OMEGA) / abs(1 + process * pi_controller)
    steady = course.flow[time_s >= 450.0] - 0.6
    assert np.max(np.abs(steady)) == pytest.approx(amplitude, rel=1e-3)
    assert np.std(steady) == pytest.approx(amplitude / sqrt(2), rel=1e-3)


def test_the_controller_acts_at_its_own_period_however_fast_the_cycle() -> None:
    loop = FlowLoop(QUIET, FlowController(period_s=0.5), begin_s=3.0)
    acted = [k for k in range(101) if loop.advance(3.0 + 0.02 * k, 0.6)]
    assert acted == [0, 25, 50, 75, 100]


def test_figures_by_hand() -> None:
    """A square wave of the stem of 10 % of the stroke in 10 s each way, the flow 2 % above and below."""
    time_s = np.arange(0.0, 80.0, 0.1)
    wave = np.where(time_s % 20.0 < 10.0, 1.0, -1.0)
    course = FlowCourse(time_s, 0.6 + 0.02 * wave, 0.6 + 0 * wave, 0.6 + 0.05 * wave)
    found = figures(course, FlowCourse(time_s, 0.6 + 0 * wave, course.reference_pu, course.stem_pu), 0.6, from_s=20.0)
    assert found.deviation_std == found.added_std == pytest.approx(0.02, rel=1e-3)
    assert found.peak_to_peak == pytest.approx(0.04)
    assert found.absolute_error_s == pytest.approx(0.02 * 59.9)
    minutes = 59.9 / 60
    assert found.strokes_per_minute == pytest.approx(6 * 0.1 / minutes, rel=1e-6)
    assert found.reversals_per_minute == pytest.approx(6 / minutes)
