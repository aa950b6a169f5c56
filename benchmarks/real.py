"""The measured recordings of ../shared/data, diagnosed in full: `python -m benchmarks.real`; figures of docs/data.md.

    servo motor   fitted on four of its runs, judged on the fifth, each in turn; every tenth sample
    cylinder      fitted at 1, 3 and 7 bar, judged at 5 bar; and each pressure predicted from the others
    plant valve   positioner, set point to travel at 1 s, without a rest: fitted to its first 15 minutes
    bench curve   each reading predicted from the others; of area 1, so that N are Pa

Held-out rms errors, step by step, and what was refused.
"""

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from config.recording import Recording
from config.valve_file import ValveFile, load_valve, shipped_valve
from workbench.data.imposed_motion import read_imposed
from workbench.diagnosis.diagnosis import diagnose
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import fit
from workbench.forces.force_diagnosis import ForceDiagnosis, diagnose_forces
from workbench.imports.column_mapping import read_mapping
from workbench.imports.historian_export import read_export

DATA = Path(__file__).parents[2] / "shared" / "data"
RUNS = ("J_2", "J_3", "J_5", "J_7", "J_9")
TRIED = ("asymmetric_friction", "presliding", "stribeck")
EVERY = 10
BARS = (1, 3, 5, 7)


def valve(**parameters: float) -> ValveFile:
    """Return a valve file: what is given, and what no fit here depends on."""
    anything = {
        "spring_n_per_m": 1.0,
        "viscous_ns_per_m": 1.0,
        "coulomb_n": 1.0,
        "static_n": 1.0,
        "stribeck_velocity_m_per_s": 1.0,
        "deadzone_ratio": 1e-3,
    }
    return ValveFile.model_validate({"valve": {"name": "measured", **anything, **parameters}})


MOTOR = valve(
    mass_kg=2.0e-4,
    diaphragm_area_m2=1.0,
    spring_n_per_m=1e-6,
    viscous_ns_per_m=2.5e-4,
    coulomb_n=0.0303,
    static_n=0.0303,
    stroke_m=40.0,
)
CYLINDER = valve(mass_kg=0.1, diaphragm_area_m2=4.909e-4, stroke_m=0.04)
PLANT = ValveFile.model_validate(
    {
        "valve": load_valve(shipped_valve("seed")).valve.model_dump()
        | {"stroke_m": 0.1, "coulomb_n": 300.0, "static_n": 330.0},
        "effect": [
            {
                "name": "positioner",
                "gain_pa_per_ms": 5e5,
                "integral_time_s": 1e6,
                "dead_band_m": 0.0,
                "filling_pa_per_s": 3e3,
                "venting_pa_per_s": 3e3,
                "supply_pa": 4e5,
                "shut_below_m": -100.0,
                "open_above_m": 100.0,
            }
        ],
    }
)
SERVOMOTOR = valve(mass_kg=1.0, diaphragm_area_m2=1.0, spring_n_per_m=2e6, stroke_m=0.0381)


def servo_motor(runs: tuple[str, ...]) -> Iterator[str]:
    """Yield the figures of the servo motor, rad."""
    read = {run: Recording.read(DATA / "servo_motor" / f"{run}.csv") for run in RUNS}
    thinned = {run: Recording({k: c[::EVERY] for k, c in each.columns.items()}) for run, each in read.items()}
    yield f"{'judged on':<10}{'as it is':>10}" + "".join(f"{name:>21}" for name in TRIED) + "   rad rms, held out"
    for judged in runs:
        others = [each for run, each in thinned.items() if run != judged]
        found = diagnose(others, MOTOR, test=thinned[judged], effects=TRIED)
        for number, step in enumerate(found.steps, start=1):
            errors = {c.name: c.model.errors.test_rmse_m for c in step.candidates if c.model}
            base = f"{judged if number == 1 else '':<10}{step.before.errors.test_rmse_m:>10.3f}"
            yield base + "".join(f"{errors[name]:>21.3f}" if name in errors else f"{'in':>21}" for name in TRIED)
        yield f"{'':<10}{found.verdict}: {', '.join(found.missing)}"
        for each in found.candidates:
            if not each.accepted:
                yield f"{'':<10}step {each.step}, {each.name}: {each.rejection_reason}"


def first_half_of_plant_valve() -> tuple[Recording, Recording]:
    """Return the recording of the plant valve, and the first 15 minutes of it."""
    words = ["time_s=time_s", "reference_m=setpoint_percent:%", "position_m=position_percent:%"]
    whole = read_export(DATA / "plant_valve" / "half_hour.csv", read_mapping(words), PLANT.valve.stroke_m)
    return whole, Recording({name: column[: len(whole) // 2] for name, column in whole.columns.items()})


def plant_valve_off(whole: Recording, found: Fit) -> tuple[float, float]:
    """Return what a free run is off by in the first half of the recording and in the second, shares of the stroke."""
    off = (found.predict(whole) - whole.columns["position_m"]) / PLANT.valve.stroke_m
    first, second = (float(np.sqrt(np.nanmean(half**2))) for half in np.array_split(off, 2))
    return first, second


def plant_valve() -> Iterator[str]:
    """Yield the figures of the plant valve, % of a stroke taken for 100 mm; spring and area are the shipped valve's."""
    whole, first = first_half_of_plant_valve()
    found = fit(first, PLANT)
    fitted, held_out = plant_valve_off(whole, found)
    yield f"  {100 * fitted:.3g} % rms fitted, {100 * held_out:.3g} % held out, of a free run"
    yield "  " + ", ".join(f"{name} {each.value:.4g}" for name, each in found.parameters.items())


def forces(found: ForceDiagnosis) -> Iterator[str]:
    """Yield the figures of a balance of forces, N."""
    for number, step in enumerate(found.steps, start=1):
        yield f"  step {number}: {step.before.test_rms_n:.3g} N held out, {step.before.train_rms_n:.3g} fitted; " + (
            f"added {' or '.join(each.name for each in step.indistinguishable)}: "
            f"{step.added.fit.test_rms_n:.3g}, {step.added.fit.train_rms_n:.3g}"
            if step.added
            else "nothing accepted"
        )
    yield f"  {found.verdict}: {found.sentence}"
    yield "  " + ", ".join(f"{name} {value:.4g}" for name, value in found.best.parameters.items())


def cylinder() -> Iterator[str]:
    """Yield the figures of both seals."""
    for seal in ("O-ring", "NAPN"):
        read = {bar: read_imposed(DATA / "pneumatic_cylinder" / f"{seal}_{bar}bar.csv") for bar in BARS}
        yield f"{seal}, at a pressure never fitted on, 5 bar"
        yield from forces(diagnose_forces([read[bar] for bar in BARS if bar != 5], CYLINDER, test=read[5]))
        yield f"{seal}, each of 1, 3, 5, 7 bar from the others"
        yield from forces(diagnose_forces(list(read.values()), CYLINDER))


def bench_curve() -> Iterator[str]:
    """Yield the figures of the static curve."""
    yield from forces(diagnose_forces(read_imposed(DATA / "diaphragm_bench" / "static_curve.csv"), SERVOMOTOR))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--runs", nargs="*", choices=RUNS, default=RUNS, help="of the servo motor, judged in turn (all)"
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", help="sets by their names, as 'plant valve' (all)")
    arguments = parser.parse_args()
    if not DATA.is_dir():
        parser.exit(1, f"{DATA}: the measured recordings are not here\n")
    for name, figures in (
        ("bench curve", bench_curve()),
        ("cylinder", cylinder()),
        ("plant valve", plant_valve()),
        ("servo motor", servo_motor(tuple(arguments.runs))),
    ):
        if arguments.only and name not in arguments.only:
            continue
        began_s = time.perf_counter()
        print(f"== {name}", flush=True)
        for line in figures:
            print(line, flush=True)
        print(f"{time.perf_counter() - began_s:.0f} s\n")


if __name__ == "__main__":
    main()
