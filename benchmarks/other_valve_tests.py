"""Commissioning and signature of a valve that is not ours: LuGre friction, another integrator, an I/P of 40 ms.

    python -m benchmarks.other_valve_tests [--variants plain 12_bit air_to_close rotary] [--seed 0] [--sticking]
    python -m benchmarks.other_valve_tests --wire            ten minutes: the commands, in real time, over Modbus TCP

The plant is that of `tests/other_device.py`, 50 ms a cycle in virtual time, with 1 % noise of the stroke, or 12 bits.
What is commissioned is unknown but for device and supply. Each line says how far figures are off. Friction is to be
within 3 %, spring 1 %, bench set and seat load 2 %. The stem breaks loose at what it slides at; with --sticking at a
third more. Then slow ramps show the mean of where it breaks loose, F_s, and where it stops. Its mass carries it beyond
where the force falls below what its speed needs, so a slip is integrated from F = F_s, v = 0 until v = 0 again:

    m dv/dt = F - g(v) - F_v v,     dF/dt = -k v        g(v) = F_c + (F_s - F_c) exp(-(v/v_s)^2)

With --wire the device is the server of another library (modbus-tk) on a clock of its own, 12 bits and mbar, without
function 23: commissioned by the command, then served by a daemon, whose valve has its signature and partial strokes.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, radians
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.integrate import solve_ivp

from config.codes import Mode
from config.daemon_file import DaemonFile
from config.drive import Kind
from config.recording import Column
from positioner.cli.main import main as cli
from positioner.cli.parts.own_valve import unknown_travel
from positioner.control.requests import ExperimentRequest, Requests
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.history.kept_tests import folder_of
from positioner.tests_on_the_valve.commissioning import commission
from positioner.tests_on_the_valve.kept_records import records
from positioner.tests_on_the_valve.outcome import Outcome
from positioner.tests_on_the_valve.own_cycle import OwnCycle
from positioner.tests_on_the_valve.signature import Nameplate, programmes, signature
from positioner.virtual.virtual_cycle import virtual_cycle
from tests.children import child
from tests.control.other_plant import OtherPlant
from tests.other_device import (
    BITS,
    COMMAND,
    MBAR_PA,
    POSITION,
    PRESSURE,
    UNIT,
    Parameters,
    free_port,
    other_device,
)

PERIOD_S = 0.05
NOISE = 0.01
"""Of the stroke."""
LIMIT_S = 300.0
BROKEN_LOOSE = 1.001
"""Of F_s: with F_s itself it would never go."""
LONGEST_SLIP_S = 10.0
ALLOWED: Mapping[str, float] = {
    "friction_pa": 0.03,
    "spring_pa_per_m": 0.01,
    "bench_low_pa": 0.02,
    "bench_high_pa": 0.02,
    "seat_load_pa": 0.02,
}
"""Of each figure."""
SLIDING = replace(Parameters(), static_n=Parameters().coulomb_n * 1.001)
TURNING = Parameters(
    stroke_m=radians(90.0),
    area_m2=1.8e-3,
    spring_n_per_m=110.0,
    preload_n=45.0,
    mass_kg=0.02,
    viscous_ns_per_m=2.0,
    coulomb_n=6.0,
    static_n=6.006,
    stribeck_m_per_s=0.02,
    bristle_n_per_m=3e4,
    bristle_damping_ns_per_m=10.0,
    stop_n_per_m=1e5,
)
"""A quarter turn: rad, N m, N m/Pa in the places of m, N, m2."""


@dataclass(frozen=True, slots=True)
class Variant:
    """A valve, and how its device shows it."""

    parameters: Parameters = SLIDING
    noise: float = NOISE
    closes: bool = False
    bits: int = 0

    @property
    def valve(self) -> dict[str, object]:
        """Table `[valve]`."""
        if self.parameters is TURNING:
            return {"name": "other", "travel_deg": 90.0}
        return {"name": "other", "stroke_m": self.parameters.stroke_m}

    def shown(self) -> Callable[[float, float], float]:
        """Return what becomes of the stem's place, by its time."""
        stroke_m = self.parameters.stroke_m
        quantum_m = stroke_m / self.bits if self.bits else 0.0

        def shown(_time_s: float, stem_m: float) -> float:
            turned_m = stroke_m - stem_m if self.closes else stem_m
            return round(turned_m / quantum_m) * quantum_m if quantum_m else turned_m

        return shown


VARIANTS: Mapping[str, Variant] = {
    "plain": Variant(),
    "12_bit": Variant(noise=0.0, bits=BITS),
    "air_to_close": Variant(closes=True),
    "rotary": Variant(TURNING),
}


def file_of(variant: Variant) -> DaemonFile:
    """Return the file of a daemon that knows the device and the supply."""
    return DaemonFile.model_validate(
        {
            "valve": variant.valve,
            "cycle": {"pace": "device", "period_s": PERIOD_S},
            "pressure": {"maximum_pa": 140e3},
            "safety": {"stale_after_s": 0.5},
            "experiment": {"travel_window": (0.0, 1.0), "limit_s": LIMIT_S},
        }
    )


def cycle_on(variant: Variant, file: DaemonFile, seed: int) -> tuple[Cycle, Kind]:
    """Return a cycle in automatic, with consent."""
    noise_m = variant.noise * variant.parameters.stroke_m
    plant = OtherPlant(variant.parameters, PERIOD_S, noise_std_m=noise_m, seed=seed, sensed=variant.shown())
    asked = Requests(mode=Mode.AUTOMATIC, mode_writes=1, experiment=ExperimentRequest(consented=True))
    cycle = virtual_cycle(file, plant, asked)
    for _ in range(3):
        cycle.once()
    return cycle, file.valve.kind


def found(variant: Variant, seed: int = 0) -> tuple[Outcome, Outcome]:
    """Return what commissioning and signature come to."""
    file = file_of(variant)
    unknown = unknown_travel(file)
    cycle, kind = cycle_on(variant, unknown, seed)
    commissioned = commission(OwnCycle(cycle, kind=kind), "other", Settings.of(unknown).experiment).outcome
    if variant.closes:
        file = file.model_copy(update={"valve": file.valve.model_copy(update={"action": "air_to_close"})})
    cycle, kind = cycle_on(variant, file, seed + 1)
    valve = OwnCycle(cycle, kind=kind)
    programs = programmes(Settings.of(file).experiment, valve.command_pa())
    recordings = [each.recording for each in map(valve.play, programs) if each.recording is not None]
    return commissioned, signature(recordings, Nameplate("other", file.valve.stroke_m, kind=kind))


def stops_at_n(parameters: Parameters) -> float:
    """Return the force at which a slip ends, N."""
    more_n = parameters.static_n - parameters.coulomb_n

    def slip(_time_s: float, now: Column) -> list[float]:
        force_n, v = now.tolist()
        needed_n = parameters.coulomb_n + more_n * exp(-((v / parameters.stribeck_m_per_s) ** 2))
        needed_n += parameters.viscous_ns_per_m * v
        return [-parameters.spring_n_per_m * v, (force_n - needed_n) / parameters.mass_kg]

    def stopped(_time_s: float, now: Column) -> float:
        return float(now[1])

    stopped.terminal, stopped.direction = True, -1.0  # type: ignore[attr-defined]
    begun = [BROKEN_LOOSE * parameters.static_n, 0.0]
    told = solve_ivp(slip, (0.0, LONGEST_SLIP_S), begun, "LSODA", events=stopped, rtol=1e-8, atol=1e-10)
    return float(told.y[0, -1])


def truth(parameters: Parameters) -> dict[str, float]:
    """Return what slow ramps are to show, SI."""
    friction_n = 0.5 * (stops_at_n(parameters) + parameters.static_n)
    low_pa = parameters.preload_n / parameters.area_m2
    slope = parameters.spring_n_per_m / parameters.area_m2
    return {
        "friction_pa": friction_n / parameters.area_m2,
        "spring_pa_per_m": slope,
        "bench_low_pa": low_pa,
        "bench_high_pa": low_pa + slope * parameters.stroke_m,
        "seat_load_pa": low_pa - friction_n / parameters.area_m2,
    }


def errors(outcome: Outcome, parameters: Parameters) -> dict[str, float]:
    """Return how far each figure is off, of itself; NaN where there is none."""
    return {
        name: (np.nan if (value := outcome.figure(name).value) is None else value / true - 1.0)
        for name, true in truth(parameters).items()
    }


def report(names: Sequence[str], seed: int, *, sticking: bool) -> Iterator[str]:
    """Yield lines: each figure's error, and whether it is allowed."""
    for name in names:
        variant = VARIANTS[name]
        if sticking:
            tighter = replace(variant.parameters, static_n=variant.parameters.coulomb_n * 4.0 / 3.0)
            variant = replace(variant, parameters=tighter)
        commissioned, signed = found(variant, seed)
        yield f"{name}: commissioning {commissioned.said}, signature {signed.said}"
        for test, outcome in (("signature", signed), ("commissioning", commissioned)):
            if outcome.quantities:
                yield f"    {test:14} {_said(errors(outcome, variant.parameters))}"


def _said(off: Mapping[str, float]) -> str:
    return ", ".join(f"{each} {by:+.2%}{'' if abs(by) <= ALLOWED[each] else ' MISSED'}" for each, by in off.items())


SITE = """[valve]
name = "other"
[device]
port = {port}
unit = {unit}
reply_timeout_s = 0.4
[device.map]
position_m = {{ address = {position}, type = "uint16", scale = {digit_m} }}
pressure_pa = {{ address = {pressure}, type = "uint16", scale = {mbar_pa} }}
command_pa = {{ address = {command}, type = "uint16", scale = {mbar_pa} }}
[cycle]
period_s = 0.05
[pressure]
maximum_pa = 140e3
[safety]
stale_after_s = 2.0
[experiment]
travel_window = [0, 1]
limit_s = 90
[recorder]
folder = "recordings"
[history]
folder = "history"
[supervisory]
port = {served}
"""


def over_the_wire(folder: Path, parameters: Parameters) -> Iterator[str]:
    """Yield what each command ends with, and how far its figures are off."""
    site, history = folder / "site.toml", folder_of(folder / "history", "other")
    with other_device(0.5 * parameters.stroke_m, parameters) as device:
        text = SITE.format(
            port=device.port,
            unit=UNIT,
            position=POSITION,
            pressure=PRESSURE,
            command=COMMAND,
            digit_m=parameters.stroke_m / BITS,
            mbar_pa=MBAR_PA,
            served=free_port(),
        )
        site.write_text(text)
        yield f"commission ends with {cli(['commission', str(site), '--yes', '--keep', 'as_found'])}"
        with child("run", site):
            for register, value in (("mode", "automatic"), ("experiment_consent", "1"), ("reference", "0.5")):
                cli(["set", register, value, "--config", str(site)])
            yield f"signature ends with {cli(['signature', str(site), '--keep', 'as_left'])}"
            yield f"pst ends with {cli(['pst', str(site), '--keep', 'as_left'])}"
            yield f"pst against it ends with {cli(['pst', str(site)])}"
    for each in records(history):
        figures = {quantity.name for quantity in each.outcome.quantities}
        told = errors(each.outcome, parameters) if "bench_low_pa" in figures else {}
        yield f"{each.outcome.test}: {each.outcome.said} {_said(told)}"


def main() -> None:
    """Print the report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--variants", nargs="+", choices=VARIANTS, default=list(VARIANTS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--sticking", action="store_true")
    parser.add_argument("--wire", action="store_true")
    arguments = parser.parse_args()
    if arguments.wire:
        with TemporaryDirectory() as folder:
            for line in over_the_wire(Path(folder), SLIDING):
                print(line, flush=True)
        return
    for line in report(arguments.variants, arguments.seed, sticking=arguments.sticking):
        print(line, flush=True)


if __name__ == "__main__":
    main()
