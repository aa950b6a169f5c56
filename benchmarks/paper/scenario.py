"""The seed's scenario (its section 5) in one process and virtual time, under a noise of one's choice.

    S3  0   to 0.8 s   from rest at x = 0,  u = (6.4 + 1.92 sin t) psi
    S1  0.8 to 1.8 s   the law, up to a reference
    S2  1.8 to 2.8 s   the law, down to a reference

Cycle, controller and simulated device are the daemon's and the slave's own. Only the sines are added here, between
the device and the driver, so that neither model nor controller knows of them. The seed does not print its
references; these two it could have had: without pressure this valve falls to F_c / k_s = 0.27 p.u. and no further.
"""

from dataclasses import dataclass, replace
from math import pi, sin
from typing import TYPE_CHECKING

import numpy as np

from config.codes import Mode
from config.daemon_file import DaemonFile
from config.loading import validate
from config.slave_file import SlaveFile
from config.valve_file import ValveFile
from positioner.control.requests import QUIET, Requests
from positioner.estimation import Applied, Estimates
from positioner.virtual.virtual_cycle import play_script, virtual_cycle
from sim.slave.simulated_device import Device
from sim.valve import Valve

if TYPE_CHECKING:
    from positioner.daemon.snapshot import Snapshot
    from positioner.estimation.array import Array

PSI = 6894.757
ALPHA_PA, BETA_PA, OMEGA_RAD_PER_S = 6.4 * PSI, 1.92 * PSI, 1.0
S1_FROM_S, S2_FROM_S, UNTIL_S = 0.8, 1.8, 4.8
"""The paper ends at 2.8 s: the way down, which its sine has not seen, goes by steps here, and takes longer."""
UP_PU, DOWN_PU = 0.6, 0.4
SEED_PERIOD_S = 1e-5
DERIVATIVE_WINDOW_S = 500 * SEED_PERIOD_S
"""Of the derivative filters, the seed's 500 samples; longer where that were fewer samples than those below."""
SAMPLES_AT_LEAST = 50
AMPLITUDE_PU = 0.01


@dataclass(frozen=True, slots=True)
class Noise:
    """What the position transmitter adds: a sine, or white noise; p.u. of stroke."""

    name: str
    amplitude_pu: float = 0.0
    omega_rad_per_s: float = 0.0
    white_std_pu: float = 0.0

    def sine_pu(self, time_s: float) -> float:
        """Return the sine at a time."""
        return self.amplitude_pu * sin(self.omega_rad_per_s * time_s)


NONE = Noise("none")
LITERAL = Noise("sine of 1e5 Hz", AMPLITUDE_PU, 2 * pi * 1e5)
HONEST_SINE = Noise("sine of 1e5 rad/s", AMPLITUDE_PU, 1e5)
WHITE = Noise("white, 1e-4 p.u.", white_std_pu=1e-4)


@dataclass(frozen=True, slots=True)
class ScenarioRun:
    """One run of the scenario, columns (samples,), SI units; what is true is known to the simulator alone.

    Attributes:
        noise: of the position transmitter.
        period_s: of the loop.
        time_s, measured_m, pressure_pa, command_pa, reference_m: what the controller knows and does.
        true_m, true_m_per_s: where the stem is, and how fast.
        readings: estimates of the daemon during S3, as they were published.
        applied: what the law used in S1 and S2.
    """

    noise: Noise
    period_s: float
    time_s: "Array"
    measured_m: "Array"
    pressure_pa: "Array"
    command_pa: "Array"
    reference_m: "Array"
    true_m: "Array"
    true_m_per_s: "Array"
    readings: tuple[Estimates, ...]
    applied: Applied

    @property
    def identifying(self) -> slice:
        """The rows of S3."""
        return slice(0, self.row_at(S1_FROM_S) + 1)

    def row_at(self, time_s: float) -> int:
        """Return the row of the sample at a time; row 0 is one period after the start."""
        return round(time_s / self.period_s) - 1


class NoisyTransmitter:
    """A device between valve and driver: its transmitter adds the sine, and the truth beside it is noted."""

    def __init__(self, device: Device, valve: Valve, noise: Noise, stroke_m: float) -> None:
        self._device, self._valve, self._noise, self._stroke_m = device, valve, noise, stroke_m
        self.command_pa = device.command_pa
        self.rows: list[tuple[float, float, float, float, float]] = []
        self._transmit()

    @property
    def sample_counter(self) -> int:
        """The number of the sample."""
        return self._device.sample_counter

    @property
    def device_time_us(self) -> int:
        """The device's clock at the sample."""
        return self._device.device_time_us

    @property
    def status(self) -> int:
        """The status word."""
        return self._device.status

    def tick(self, command_pa: float) -> None:
        """Obey a pressure for one period, then measure.

        Raises:
            ValueError: the device refuses the command.
        """
        self._device.tick(command_pa)
        self.command_pa = command_pa
        self._transmit()
        valve = self._valve
        self.rows.append(
            (self.device_time_us / 1e6, self.position_m, self.pressure_pa, valve.position_m, valve.velocity_m_per_s)
        )

    def _transmit(self) -> None:
        sine_m = self._noise.sine_pu(self.device_time_us / 1e6) * self._stroke_m
        self.position_m = self._device.position_m + sine_m
        self.pressure_pa = self._device.pressure_pa


def run_scenario(file: ValveFile, noise: Noise, period_s: float) -> ScenarioRun:
    """Run the scenario on a valve."""
    parameters = file.valve
    stroke_m = parameters.stroke_m
    slave = _slave(noise, period_s, stroke_m)
    valve = Valve.from_file(file)
    plant = NoisyTransmitter(
        Device(valve, slave, parameters.model_dump(exclude={"name", "kind"})), valve, noise, stroke_m
    )
    first, *then = _phases(stroke_m)
    cycle = virtual_cycle(_daemon(period_s, stroke_m), plant, first[1])

    def ask(snapshot: "Snapshot", requests: Requests) -> Requests:
        if then and snapshot.sample.time_s > then[0][0] - period_s / 2:
            return then.pop(0)[1]
        return requests

    decided: list[tuple[float, float]] = []
    readings: list[Estimates] = []
    for snapshot in play_script(cycle, ask, UNTIL_S - period_s / 2):
        decision = snapshot.decision
        decided.append((decision.command_pa, decision.reference_m))
        if not readings or decision.estimates is not readings[-1]:
            readings.append(decision.estimates)
    columns = np.hstack((np.array(plant.rows), np.array(decided))).T
    time_s, measured_m, pressure_pa, true_m, true_m_per_s, command_pa, reference_m = columns
    return ScenarioRun(
        noise=noise,
        period_s=period_s,
        time_s=time_s,
        measured_m=measured_m,
        pressure_pa=pressure_pa,
        command_pa=command_pa,
        reference_m=reference_m,
        true_m=true_m,
        true_m_per_s=true_m_per_s,
        readings=tuple(readings),
        applied=cycle.snapshot.decision.applied,
    )


def _phases(stroke_m: float) -> list[tuple[float, Requests]]:
    """Return what the DCS asks for, and from when on."""
    identify = Requests(
        mode=Mode.AUTOMATIC,
        mode_writes=1,
        eta=(0, 0, 0),
        alpha_pa=ALPHA_PA,
        beta_pa=BETA_PA,
        omega_rad_per_s=OMEGA_RAD_PER_S,
    )
    up = replace(identify, eta=QUIET, reference_m=UP_PU * stroke_m, reference_writes=1)
    down = replace(up, reference_m=DOWN_PU * stroke_m, reference_writes=2)
    return [(0.0, identify), (S1_FROM_S, up), (S2_FROM_S, down)]


def derivative_window_s(period_s: float) -> float:
    """Return the length of the derivative filters."""
    return max(DERIVATIVE_WINDOW_S, SAMPLES_AT_LEAST * period_s)


def _daemon(period_s: float, stroke_m: float) -> DaemonFile:
    tables = {
        "valve": {"name": "seed", "stroke_m": stroke_m},
        "cycle": {"pace": "device"},
        "control": {"law": "seed"},
        "identification": {"derivative_window_s": derivative_window_s(period_s)},
    }
    return validate(DaemonFile, tables, "the seed's scenario")


def _slave(noise: Noise, period_s: float, stroke_m: float) -> SlaveFile:
    tables = {
        "clock": {"mode": "lockstep", "period_s": period_s},
        "sensor": {"noise_std_m": noise.white_std_pu * stroke_m, "seed": 1},
    }
    return validate(SlaveFile, tables, "the seed's scenario")
