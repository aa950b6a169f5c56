"""The measured servo motor of ../shared/data, torque open loop to angle: asymmetric friction, and what only seems so.

Skipped where the recordings are not; they are nobody's to copy. Area 1: newtons are newton metres, metres are radians.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from config.recording import Column, Recording
from config.valve_file import EffectTable, ValveFile
from sim.composition import Composition
from sim.effect import shipped_effect
from workbench.compare.comparison import compare
from workbench.compare.friction_balance import forces
from workbench.data.record import ready
from workbench.diagnosis.diagnosis import Diagnosis, diagnose
from workbench.fit.fitting import fit
from workbench.model.free_run import FreeRun

QUANTUM_RAD = 2.0 * np.pi / 1e4
DATA = Path(__file__).parents[3] / "shared" / "data" / "servo_motor"
MOTOR = ValveFile.model_validate(
    {
        "valve": {
            "name": "servo motor: torque in N m, angle in rad, no spring",
            "mass_kg": 2.0e-4,
            "diaphragm_area_m2": 1.0,
            "spring_n_per_m": 1e-6,
            "viscous_ns_per_m": 2.5e-4,
            "coulomb_n": 0.0303,
            "static_n": 0.0303,
            "stribeck_velocity_m_per_s": 1.0,
            "deadzone_ratio": 1e-3,
            "stroke_m": 40.0,
        }
    }
)

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured recordings are not here")


def recorded(name: str, every: int = 1) -> Recording:
    recording = Recording.read(DATA / f"{name}.csv")
    return Recording({each: column[::every] for each, column in recording.columns.items()})


@pytest.fixture(scope="module")
def diagnosed() -> Diagnosis:
    """100 of the 1000 samples a second: the triangle takes 12 s."""
    effects = ("asymmetric_friction", "stribeck")
    return diagnose(recorded("J_7", 10), MOTOR, test=recorded("J_9", 10), effects=effects, workers=1)


@pytest.mark.long
def test_friction_differs_between_the_directions(diagnosed: Diagnosis) -> None:
    """The error falls to a twentieth. A creep of 2.5 mrad under no load is one event against it, and no more."""
    (found,) = [each.model for each in diagnosed.steps[0].candidates if each.name == "asymmetric_friction"]
    assert found is not None
    assert diagnosed.base.errors.test_rmse_m > 10.0
    assert 0.3 < found.errors.test_rmse_m < 1.9
    # Viscous friction trades with it: searches that end equally low differ by 0.02.
    assert found.fit.parameters["asymmetric_friction.asymmetry"].value == pytest.approx(-0.12, abs=0.02)
    assert "asymmetric_friction" in diagnosed.missing


@pytest.mark.long
def test_a_stribeck_term_is_refused(diagnosed: Diagnosis) -> None:
    tried = [each for each in diagnosed.candidates if each.name == "stribeck"]
    assert len(tried) == len(diagnosed.steps)
    assert not any(each.accepted for each in tried)


@pytest.mark.long
def test_a_motor_that_does_not_repeat_itself_is_not_called_explained(diagnosed: Diagnosis) -> None:
    assert diagnosed.verdict in {"unexplained", "untrusted"}


@pytest.mark.parametrize("name", ["J_3", "J_5", "J_9"])
def test_the_reconstructed_friction_wants_no_positive_stribeck_term(name: str) -> None:
    record = ready(recorded(name))
    found = forces(
        MOTOR.valve, record.time_s, record.position_m, record.command_pa, np.zeros(len(record)), record.scale_m
    )
    v, d = found.velocity_m_per_s, found.direction
    for speed in (0.5, 2.0, 10.0):
        matrix = np.column_stack([v, d, np.ones(v.size), d * np.exp(-((v / speed) ** 2))])
        values, squares, *_ = np.linalg.lstsq(matrix, found.friction_n)
        variance = squares[0] / (v.size - 4) * np.linalg.inv(matrix.T @ matrix)[3, 3]
        assert values[3] < 2.0 * variance**0.5


def test_below_break_away_only_presliding_moves_the_motor() -> None:
    """Its stiffness is read from the rise to the first peak, and predicts the other recording."""
    first, other = recorded("sigma0_1", 10), recorded("sigma0_2", 10)
    rising = first.time_s < 1.0
    stiffness = 1.0 / np.polyfit(first.command_pa[rising], first.position_m[rising], 1)[0]
    assert stiffness == pytest.approx(6.4, rel=0.1)
    yields = EffectTable.model_validate({"name": "presliding", "stiffness_n_per_m": float(stiffness)})
    without = compare(other, MOTOR).rms_m
    extended = compare(other, ValveFile(valve=MOTOR.valve, effect=(yields,))).rms_m
    assert extended < 0.8 * without


def scatter_with(effect: str, names: tuple[str, ...], begin: tuple[float, ...]) -> float:
    """Return the error on the other recording, rad, with an effect fitted to the first by scipy.

    Its standard deviation: where within its first step the encoder stood is not known.
    """

    def error_m(run: str, values: Iterable[float]) -> Column:
        table = EffectTable.model_validate({"name": effect, **dict(zip(names, values, strict=True))})
        composition = Composition.from_file(ValveFile(valve=MOTOR.valve, effect=(table,)))
        record = ready(recorded(run, 10))
        return FreeRun(composition, record).position_m(composition.theta) - record.position_m

    def about_mean(values: Column) -> Column:
        error = error_m("sigma0_1", values)
        return np.asarray(error - error.mean())

    bounds = [shipped_effect(effect, "test").parameters[name] for name in names]
    fitted = least_squares(
        about_mean,
        begin,
        bounds=([each.least for each in bounds], [each.most for each in bounds]),
        x_scale=begin,
        diff_step=[1e-3] * len(begin),
    )
    return float(np.std(error_m("sigma0_2", fitted.x)))


@pytest.mark.long
def test_below_break_away_energy_is_lost() -> None:
    """With the loop the other recording is predicted to its encoder's step; an elastic packing is 3.6 times off."""
    rounding_rad = QUANTUM_RAD / np.sqrt(12.0)
    elastic = scatter_with("presliding", ("stiffness_n_per_m",), (6.4,))
    lossy = scatter_with("presliding_hysteresis", ("stiffness_n_per_m", "loss", "exponent"), (9.0, 0.8, 2.5))
    assert elastic > 3.0 * rounding_rad
    assert lossy < 1.25 * rounding_rad


def test_a_drive_without_a_spring_is_fitted_as_such() -> None:
    springless = ValveFile.model_validate({"valve": MOTOR.valve.model_dump() | {"spring_n_per_m": 0.0}})
    base = fit(recorded("J_7", 10), springless)
    found = fit(recorded("J_7", 10), springless, effects=["asymmetric_friction"], base=base)
    assert "spring_n_per_m" not in found.parameters
    assert base.rms_m > 10.0
    assert found.rms_m < 0.6
    assert found.parameters["coulomb_n"].value == pytest.approx(0.0303, rel=0.1)
