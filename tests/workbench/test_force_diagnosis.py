"""Diagnosis from forces under an imposed position, on benches with a known answer, and its bad input."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.recording import LONGEST_LINE, Column, Recording, write_recording
from config.valve_file_writer import valve_toml
from positioner.cli.main import main
from tests.cases import few_always
from tests.workbench.benches import (
    AREA_M2,
    COULOMB_N,
    SPRING_N_PER_M,
    VALVE,
    VISCOUS_NS_PER_M,
    WEIGHT_N,
    bench,
    benches,
)
from workbench.data.imposed_motion import is_imposed, read_imposed, rows_of
from workbench.diagnosis.diagnosis import diagnose
from workbench.forces.force_balance import Balance, ForceModel
from workbench.forces.force_diagnosis import ForceDiagnosis, diagnose_forces
from workbench.forces.force_diagnosis_json import as_json

Capture = pytest.CaptureFixture[str]


FOUR_PA = (5e4, 1.5e5, 2.5e5, 3.5e5)
FINE_S = 0.01
"""Period where numbers are held to per cents."""


@cache
def diagnosed(seed: int = 1, **hidden: float) -> ForceDiagnosis:
    return diagnose_forces(benches(seed, **hidden), VALVE)


@pytest.mark.parametrize("seed", few_always([1, 9]))
def test_nothing_hidden_nothing_found(seed: int) -> None:
    """The rows at reversals, which count for one direction or the other, bias viscous friction by some per cent."""
    found = diagnosed(seed, period_s=FINE_S)
    assert found.verdict == "adequate", found.sentence
    assert found.missing == ()
    true = {
        "diaphragm_area_m2": AREA_M2,
        "spring_n_per_m": SPRING_N_PER_M,
        "viscous_ns_per_m": VISCOUS_NS_PER_M,
        "coulomb_n": COULOMB_N,
        "constant_n": WEIGHT_N,
    }
    for name, value in true.items():
        assert found.base.parameters[name] == pytest.approx(value, rel=0.1 if name == "viscous_ns_per_m" else 0.02), (
            name
        )


def test_friction_that_grows_with_pressure_is_found_and_nothing_else() -> None:
    found = diagnosed(mu=1e-4)
    assert (found.verdict, found.missing) == ("missing", ("pressure_friction",))
    assert found.best.parameters["pressure_friction.growth_n_per_pa"] == pytest.approx(1e-4, rel=0.05)
    assert found.floor_n is not None
    assert found.best.median_error_n < 1.7
    assert found.base.test_rms_n > 4.0


@pytest.mark.parametrize(("growth_n", "exponent"), few_always([(40.0, 0.5), (6.0, 2.0), (6.0, 3.0)]))
def test_friction_that_grows_otherwise_than_pressure_is_told_from_one_that_grows_with_it(
    growth_n: float, exponent: float
) -> None:
    levels = enumerate(FOUR_PA)
    grows = {"growth_n": growth_n, "exponent": exponent, "period_s": FINE_S}
    found = diagnose_forces([bench(level_pa, i, **grows) for i, level_pa in levels], VALVE)
    assert found.missing == ("pressure_power_friction",)
    assert found.best.parameters["pressure_power_friction.exponent"] == exponent
    assert found.best.parameters["pressure_power_friction.growth_n"] == pytest.approx(growth_n, rel=0.1)
    linear = next(each for each in found.steps[0].candidates if each.name == "pressure_friction")
    assert linear.fit.test_rms_n > 1.2 * found.best.test_rms_n


def test_friction_that_grows_with_pressure_is_not_called_a_power_of_it() -> None:
    found = diagnose_forces([bench(level_pa, i, growth_n=12.0) for i, level_pa in enumerate(FOUR_PA)], VALVE)
    assert found.missing == ("pressure_friction",)
    assert found.indistinguishable == ()
    (faster,) = (each for each in found.steps[0].candidates if each.name.startswith("pressure_power"))
    assert "explains no better than pressure_friction" in faster.rejection_reason


def test_viscous_friction_of_two_directions_is_found_and_never_negative() -> None:
    found = diagnosed(extra_ns_per_m=300.0)
    assert found.missing == ("asymmetric_viscosity",)
    assert found.best.parameters["asymmetric_viscosity.extra_ns_per_m"] == pytest.approx(300.0, rel=0.1)
    beyond = diagnosed(extra_ns_per_m=400.0, viscous_ns_per_m=-150.0)
    tried = [each for each in beyond.candidates if each.name == "asymmetric_viscosity"]
    assert any("the rows want viscous_ns_per_m below 0" in each.rejection_reason for each in tried)


def test_two_effects_are_found_one_after_the_other() -> None:
    found = diagnosed(mu=1e-4, yield_m=2e-3)
    assert set(found.missing[:2]) == {"pressure_friction", "presliding"}
    assert found.indistinguishable == ()
    assert 1e-3 < found.best.parameters["presliding.yield_m"] < 4e-3


def test_friction_that_falls_with_speed_is_found_and_its_opposite_is_refused() -> None:
    found = diagnosed(excess_n=25.0)
    assert found.missing[:1] == ("stribeck",)
    opposite = diagnosed(excess_n=-25.0)
    tried = [each for each in opposite.candidates if each.name == "stribeck"]
    assert tried
    assert all("the rows want stribeck.excess_n below 0" in each.rejection_reason for each in tried)


def test_a_test_recording_is_judged_and_never_fitted() -> None:
    trained, other = [bench(5e4, 1), bench(2e5, 2)], bench(1e5, 3)
    spoilt = Recording({**other.columns, "load_n": other.columns["load_n"] + 300.0})
    rows = (rows_of([*trained, each], VALVE.valve) for each in (other, spoilt))
    found, off = (Balance(each, VALVE.valve, tested=True).fit_model(ForceModel()) for each in rows)
    assert found.parameters == off.parameters
    assert off.test_rms_n > 10.0 * found.test_rms_n


def test_an_axis_that_counts_the_other_way_is_turned() -> None:
    turned = [
        Recording({**each.columns, "position_m": -each.columns["position_m"]})
        for each in (bench(5e4, 1, mu=1e-4), bench(1e5, 2, mu=1e-4), bench(2e5, 3, mu=1e-4))
    ]
    found = diagnose_forces(turned, VALVE)
    assert found.missing == ("pressure_friction",)
    assert any("turned" in note for note in found.rows.notes)
    assert found.best.parameters["coulomb_n"] == pytest.approx(COULOMB_N, rel=0.1)


def test_json_has_the_verdict_and_the_numbers() -> None:
    said = as_json(diagnosed(mu=1e-4))
    assert said["missing"] == ["pressure_friction"]
    assert said["best"]["test_rmse_n"] < said["base"]["test_rmse_n"]
    assert said["experiment"] is None
    assert any(each["accepted"] for each in said["candidates"])


def one_way(columns: dict[str, Column]) -> dict[str, Column]:
    return columns | {"position_m": np.linspace(0.0, 0.1, len(columns["time_s"]))}


BAD = {
    "one direction": (one_way, "the stem only opens"),
    "no motion": (lambda c: c | {"position_m": np.full(len(c["time_s"]), 0.05)}, "the stem does not move"),
    "per cent": (lambda c: c | {"position_m": 1e3 * c["position_m"]}, "it looks like per cent (%) or mm"),
    "bar": (lambda c: c | {"pressure_pa": 1e-5 * c["pressure_pa"]}, "it looks like bar"),
    "psi": (lambda c: c | {"pressure_pa": c["pressure_pa"] / 6894.757}, "it looks like psi"),
    "disordered": (lambda c: c | {"time_s": c["time_s"][::-1]}, "time_s must increase"),
    "short": (lambda c: {name: column[:8] for name, column in c.items()}, "8 samples, at least 12 are needed"),
    "no pressure": (lambda c: {name: c[name] for name in c if name != "pressure_pa"}, "column pressure_pa is missing"),
}


UNMADE = ("disordered", "no pressure")
"""Such a recording is none, and no file of ours holds it."""


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line(case: str, tmp_path: Path, capsys: Capture) -> None:
    spoil, said = BAD[case]
    with pytest.raises(InputError) as caught:
        diagnose_forces(spoilt := Recording(spoil(dict(bench(1e5, 1).columns))), VALVE)
    assert said in str(caught.value)
    if case in UNMADE:
        return
    path = tmp_path / "rec.csv"
    write_recording(path, spoilt)
    (tmp_path / "valve.toml").write_text(valve_toml(VALVE), encoding="utf-8")
    assert main(["diagnose", str(path), "--valve", str(tmp_path / "valve.toml")]) == 2
    printed = capsys.readouterr().err
    assert said in printed
    assert printed.count("\n") == 1
    assert printed.startswith(f"positioner diagnose: {path}: ")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("branch,pressure_pa,position_m\nup,1,2\n", "reading 1: branch 'up'; allowed: rising, falling"),
        ("branch,pressure_pa,position_m\nrising,one,2\n", "reading 1: pressure_pa 'one' is not a number"),
        ("branch,pressure_pa\nrising,1\n", "column position_m is missing"),
        ("branch,pressure_pa,position_m\n", "0 rows with a known direction"),
        ("branch,pressure_pa,position_m\nrising,1\n", "reading 1: position_m '' is not a number"),
    ],
)
def test_a_bad_static_curve_is_one_line(text: str, said: str, tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "curve.csv"
    path.write_text(text)
    assert main(["diagnose", str(path), "--valve", "seed"]) == 2
    printed = capsys.readouterr().err
    assert said in printed
    assert printed.count("\n") == 1


def test_a_parquet_file_of_a_bench_is_read(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    written = bench(1e5, 1)
    write_recording(tmp_path / "rec.parquet", written)
    assert is_imposed(tmp_path / "rec.parquet")
    np.testing.assert_array_equal(read_imposed(tmp_path / "rec.parquet").columns["load_n"], written.columns["load_n"])


def test_a_simulation_of_a_bench_recording_is_refused_with_the_way_out() -> None:
    with pytest.raises(InputError, match=r"column command_pa is missing.*workbench\.diagnose_forces"):
        diagnose(bench(1e5, 1), VALVE)


def test_a_recording_with_a_command_is_none_of_a_bench(tmp_path: Path) -> None:
    path = tmp_path / "rec.csv"
    path.write_text("time_s,command_pa,position_m,load_n\n0,1,2,3\n")
    assert not is_imposed(path)
    path.write_text("# a bench\ntime_s,pressure_pa,position_m,load_n\n0,1,2,3\n")
    assert is_imposed(path)
    assert len(read_imposed(path)) == 1
    path.write_bytes(bytes(LONGEST_LINE))
    assert not is_imposed(path)
    with pytest.raises(InputError, match="line 1 is longer than"):
        read_imposed(path)
