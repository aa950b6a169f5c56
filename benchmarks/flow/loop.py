"""A flow loop round a valve: the process, and the DCS's controller, which writes the valve's reference.

    process      τ q' = K x / stroke + d - q,   d = D sin(2 π t / P)
    controller   r_n = k_c e_n + i_n,   i_n = i_(n-1) + k_c T e_n / T_i,   e = q_set - q         every T
                 k_c = τ / (K λ),  T_i = τ: then τ q' + q = K r becomes λ q' + q = q_set         (lambda tuning)

Neither is a part of the positioner: to it, there is only a DCS that writes references. Nor is the process a part of the
valve, which the simulator knows. They stand here with what else stands in for a plant round a daemon, and know neither.
Flows are shares of what the open valve passes. A step of the process is exact for a stem that stands still meanwhile.
"""

from dataclasses import dataclass
from math import cos, exp, pi, sin

ROUNDING_S = 1e-9
"""What a sum of periods may fall short of a time by rounding."""


@dataclass(frozen=True, slots=True)
class FlowProcess:
    """A first-order lag from stem to flow, with a disturbance at its input."""

    time_constant_s: float = 2.0
    gain: float = 1.0
    """Flow over stem position, both as shares."""
    disturbance: float = 0.02
    """Its amplitude."""
    disturbance_period_s: float = 90.0

    def after(self, flow: float, stem_pu: float, time_s: float, step_s: float) -> float:
        """Return the flow a step after a time, s, at which it was `flow`; the stem stands at `stem_pu`."""
        forced = self._forced(stem_pu, time_s + step_s)
        return forced + (flow - self._forced(stem_pu, time_s)) * exp(-step_s / self.time_constant_s)

    def _forced(self, stem_pu: float, time_s: float) -> float:
        """Return the flow once every beginning is forgotten, had the stem always stood there."""
        omega = 2 * pi / self.disturbance_period_s
        lag = omega * self.time_constant_s
        wave = (sin(omega * time_s) - lag * cos(omega * time_s)) / (1 + lag**2)
        return self.gain * stem_pu + self.disturbance * wave


@dataclass(frozen=True, slots=True)
class FlowController:
    """The DCS's PI controller; its output is a reference, p.u., kept within the travel."""

    setpoint: float = 0.6
    gain: float = 1 / 3
    integral_time_s: float = 2.0
    period_s: float = 0.5

    @classmethod
    def tuned(cls, process: FlowProcess, closed_s: float, setpoint: float = 0.6) -> "FlowController":
        """Return the controller that gives the closed loop a time constant, s (λ), usually 3 τ."""
        gain = process.time_constant_s / (process.gain * closed_s)
        return cls(setpoint, gain, process.time_constant_s)

    def after(self, integral: float, flow: float) -> tuple[float, float]:
        """Return the reference, p.u., for a flow, and the integral after it; it stops at the travel's ends."""
        proportional = self.gain * (self.setpoint - flow)
        after = integral + proportional * self.period_s / self.integral_time_s
        reference = min(max(proportional + after, 0.0), 1.0)
        return reference, after if reference == proportional + after else integral


class FlowLoop:
    """Process and controller from a time on, s, when the flow is at its setpoint.

    Attributes:
        flow: as a share.
        reference_pu: what the controller asked for last.
    """

    def __init__(self, process: FlowProcess, controller: FlowController, begin_s: float = 0.0) -> None:
        self._process, self._controller = process, controller
        self._begin_s = self._time_s = begin_s
        self._acts = 0
        self.flow = controller.setpoint
        self.reference_pu = self._integral = controller.setpoint / process.gain

    def advance(self, time_s: float, stem_pu: float) -> bool:
        """Let the flow go on to a time, s, under a stem; return whether the controller has acted on it."""
        step_s = time_s - self._time_s
        self.flow = self._process.after(self.flow, stem_pu, self._time_s - self._begin_s, step_s)
        self._time_s = time_s
        if time_s - self._begin_s < self._acts * self._controller.period_s - ROUNDING_S:
            return False
        self._acts += 1
        self.reference_pu, self._integral = self._controller.after(self._integral, self.flow)
        return True
