"""What a pulse does to a stem at rest: how far it goes, which pulse takes it where, and what its outcome teaches.

Distances count from where the stem rests, positive in the direction of the push. Once broken loose it obeys

    x'' = a x' + b (x - z),    a = -2 zeta omega,  b = -omega^2

z the distance at which the pressure balances spring and Coulomb friction: a pressure e above the balance at the start
(Pa) puts z at e / abs(b/c) (m). A pulse is two levels: z = z_p, the push, for a time T; then z = z_h, the hold. With
y = x - z, p = zeta omega, q^2 = p^2 - omega^2 the motion is, exactly (cos, sin for q^2 < 0),

    y(t) = exp(-p t) (y_0 cosh q t + (v_0 + p y_0) sinh(q t) / q)
    v(t) = exp(-p t) (v_0 cosh q t - (p v_0 + omega^2 y_0) sinh(q t) / q)

and ends where v first comes to zero, tanh(q t) / q = v_0 / (p v_0 + omega^2 y_0), or, if it never does, at z: static
friction then keeps it. So with z_h far ahead of it the stem slides to z_h, which is the seed's law; with z_h behind it
the stem is braked, and goes less far than any slide from break-away could. A push that lasts until v comes to zero, at
t = pi/q of a stem that swings, has brought it to its end, which the hold does not change.

A slow I/P (lag T_p) does not give a pressure that steps: after the push z falls to z_h as z_h + (z_p - z_h) e^(-t/T_p),
which adds to y the particular solution G (z_p - z_h) e^(-t/T_p), G = omega^2 / (omega^2 - 2 p / T_p + 1 / T_p^2). The
time of v = 0 is then looked for, in growing steps.

The end d(z_p, z_h, T) depends on theta = (ln omega, ln zeta, beta_up, beta_down), beta the error of the balance in
that direction: the stem obeys z + beta. Each pulse that moved it is a measurement of d, and theta follows by an
extended Kalman filter: a braked end informs on omega and zeta, a slide on beta. For S = J P J' + R,

    theta' = theta + P J' (d_measured - d) / S,     P' = P - P J' J P / S + Q

R the variance of d_measured with what the model leaves out, Q what may change from one pulse to the next.
"""

from dataclasses import dataclass, replace
from math import atan2, atanh, cos, exp, inf, log, pi, sin, sqrt
from typing import NamedTuple

Theta = tuple[float, float, float, float]
Covariance = tuple[tuple[float, float, float, float], ...]

UNKNOWN_OMEGA_RAD_PER_S, UNKNOWN_ZETA = 100.0, 1.5
"""Of a valve of which nothing is known: stems of some kg on stiff springs."""
UNKNOWN_LOG_STD = (1.0, 0.5)
WALK_LOG = 0.01
"""Q: standard deviation by which ln omega and ln zeta may change from pulse to pulse."""
MODEL_SHARE = 0.05
"""R: share of d that the model leaves out."""
LONGEST_STEP_LOG = 0.7
DIFFERENCE = 1e-3
REFINEMENTS = 12
NEAR_CRITICAL, ALMOST_ONE = 1e-3, 1 - 1e-12
LOG_OMEGA, LOG_ZETA = (0.0, 9.0), (-3.0, 3.0)
"""No stem lies beyond."""
LONGEST_SEARCH = 8.0


class Pulse(NamedTuple):
    """Push and hold as distances of balance, m, time of the push, s, direction, +1 or -1, lag of the pressure, s."""

    push_m: float
    hold_m: float
    duration_s: float
    direction: int
    lag_s: float = 0.0


class PulseEnd(NamedTuple):
    """Where a pulse ends, m, and after what time it has come so near that the rest does not matter, s."""

    travel_m: float
    time_s: float


@dataclass(frozen=True, slots=True)
class PulseResponse:
    """The stem's response to pulses as known by now: theta and its covariance; see the head of this module."""

    theta: Theta
    covariance: Covariance

    def end(self, pulse: Pulse, near_m: float) -> PulseEnd:
        """Return where the stem comes to rest, and when it is nearer to it than near_m, m."""
        return _end(self.theta, pulse, near_m)

    def slide_s(self, way_m: float, near_m: float) -> float:
        """Return after what time a stem that slides a way, m, is nearer than near_m, m, to its end."""
        omega, zeta = exp(self.theta[0]), exp(self.theta[1])
        slow = omega * (zeta - sqrt(zeta * zeta - 1) if zeta > 1 else zeta)
        return log(max(1.0, way_m / near_m)) / slow

    def reaching(self, travel_m: float, push: Pulse, deepest_m: float) -> Pulse:
        """Return a push with the hold that takes the stem a distance, m, or the shortest: not below deepest_m, m."""

        def with_hold(hold_m: float) -> Pulse:
            return push._replace(push_m=max(push.push_m, hold_m), hold_m=hold_m)

        def miss(hold_m: float) -> float:
            return _end(self.theta, with_hold(hold_m), inf).travel_m - travel_m

        low_m, high_m = deepest_m, travel_m - self.bias_m(push.direction)
        low, high = miss(low_m), miss(high_m)
        hold_m = low_m if low > 0 else high_m
        if low < 0 < high:
            for _ in range(REFINEMENTS):  # regula falsi, Illinois: an end that stays has its value halved
                hold_m = low_m - low * (high_m - low_m) / (high - low)
                if abs(found := miss(hold_m)) < DIFFERENCE * travel_m:
                    break
                if found < 0:
                    low_m, low, high = hold_m, found, 0.5 * high
                else:
                    high_m, high, low = hold_m, found, 0.5 * low
        return with_hold(hold_m)

    def std_m(self, pulse: Pulse) -> float:
        """Return the standard deviation of where a pulse ends, m."""
        travel_m = _end(self.theta, pulse, inf).travel_m
        slope = _slope(self.theta, pulse, travel_m)
        return sqrt(max(0.0, _quadratic(self.covariance, slope)) + (MODEL_SHARE * travel_m) ** 2 * _braked(slope))

    def updated(self, pulse: Pulse, measured_m: float, variance_m2: float, walk_m: float) -> "PulseResponse":
        """Return what is known after a pulse that moved the stem by seen_m, known with variance_m2.

        walk_m is how far the balance may change from pulse to pulse.
        """
        travel_m = _end(self.theta, pulse, inf).travel_m
        slope = _slope(self.theta, pulse, travel_m)
        gain = [sum(row[j] * slope[j] for j in range(4)) for row in self.covariance]
        spread = sum(gain[i] * slope[i] for i in range(4)) + variance_m2
        spread += (MODEL_SHARE * travel_m) ** 2 * _braked(slope)
        innovation = (measured_m - travel_m) / spread
        step = [each * innovation for each in gain]
        # Far from the truth the slopes mislead: no step is longer than one that could be meant.
        innovation_m = abs(measured_m - travel_m)
        logs, biases = max(abs(step[0]), abs(step[1])), max(abs(step[2]), abs(step[3]))
        shrink = min(1.0, LONGEST_STEP_LOG / max(logs, 1e-9), innovation_m / max(biases, 1e-12))
        w, z, up, down = self.theta
        walk = (WALK_LOG**2, WALK_LOG**2, walk_m**2, walk_m**2)
        covariance = tuple(
            _row(*(row[j] - gain[i] * gain[j] / spread + (walk[i] if i == j else 0.0) for j in range(4)))
            for i, row in enumerate(self.covariance)
        )
        theta = (
            _within(w + shrink * step[0], LOG_OMEGA),
            _within(z + shrink * step[1], LOG_ZETA),
            up + shrink * step[2],
            down + shrink * step[3],
        )
        return PulseResponse(theta, covariance)

    def with_new_balance(self, std_m: float) -> "PulseResponse":
        """Return what is known when the balance was identified anew, with a standard deviation in m.

        beta stays: what it holds of the difference between the directions the new balance has as well.
        """
        added = (0.0, 0.0, std_m**2, std_m**2)
        rows = enumerate(self.covariance)
        covariance = tuple(_row(*(row[j] + (added[i] if i == j else 0.0) for j in range(4))) for i, row in rows)
        return replace(self, covariance=covariance)

    def with_poles(self, a: float, b: float, log_std: float) -> "PulseResponse":
        """Return what is known when a, 1/s, and b, 1/s^2, were identified, both with a relative standard deviation."""
        omega = sqrt(-b)
        p = self.covariance
        covariance = (_row(log_std**2, 0.0, 0.0, 0.0), _row(0.0, log_std**2, 0.0, 0.0), p[2], p[3])
        theta = (_within(log(omega), LOG_OMEGA), _within(log(-a / (2 * omega)), LOG_ZETA), self.theta[2], self.theta[3])
        return replace(self, theta=theta, covariance=covariance)

    def bias_m(self, direction: int) -> float:
        """Return beta of a direction, m."""
        return self.theta[2 if direction > 0 else 3]


def unidentified_response(std_m: float) -> PulseResponse:
    """Return what is known of a valve that has never been pushed; the balance is known to std_m, m."""
    theta = (log(UNKNOWN_OMEGA_RAD_PER_S), log(UNKNOWN_ZETA), 0.0, 0.0)
    w, z = UNKNOWN_LOG_STD
    nothing = _row(0.0, 0.0, 0.0, 0.0)
    return PulseResponse(
        theta, (_row(w * w, 0.0, 0.0, 0.0), _row(0.0, z * z, 0.0, 0.0), nothing, nothing)
    ).with_new_balance(std_m)


def _end(theta: Theta, pulse: Pulse, near_m: float) -> PulseEnd:
    omega, p = exp(theta[0]), exp(theta[0] + theta[1])
    bias_m = theta[2 if pulse.direction > 0 else 3]
    push_m, hold_m = pulse.push_m + bias_m, pulse.hold_m + bias_m
    # The critical case has no formula of its own: just beside it the result is the same to rounding.
    overdamped, q = p > omega, max(sqrt(abs(p * p - omega * omega)), NEAR_CRITICAL * omega)
    if push_m <= 0.0:
        return PulseEnd(0.0, pulse.duration_s)
    y, v = _after(omega, p, q, overdamped, -push_m, 0.0, pulse.duration_s)
    if not overdamped and q * pulse.duration_s >= pi:
        return PulseEnd(push_m * (1.0 + exp(-p * pi / q)), pulse.duration_s)
    if v <= 0.0:
        return PulseEnd(push_m, pulse.duration_s)
    y += push_m - hold_m
    if pulse.lag_s > 0.0:
        return _lagged_end(theta, pulse, hold_m, y, v, near_m)
    force = p * v + omega * omega * y
    if overdamped and not 0.0 < q * v < force:
        slow = p - q
        time_s = log(max(1.0, abs(y) / near_m)) / slow
        return PulseEnd(hold_m, pulse.duration_s + time_s)
    time_s = (atanh(min(q * v / force, ALMOST_ONE)) if overdamped else atan2(q * v, force)) / q
    y, _ = _after(omega, p, q, overdamped, y, v, time_s)
    return PulseEnd(hold_m + y, pulse.duration_s + time_s)


def _lagged_end(theta: Theta, pulse: Pulse, hold_m: float, y: float, v: float, near_m: float) -> PulseEnd:
    """Return the end from y and v at the end of the push, the pressure falling slowly."""
    omega, p, T = exp(theta[0]), exp(theta[0] + theta[1]), pulse.lag_s
    overdamped, q = p > omega, max(sqrt(abs(p * p - omega * omega)), NEAR_CRITICAL * omega)
    divisor = omega * omega - 2 * p / T + 1 / (T * T)
    if abs(divisor) < NEAR_CRITICAL * omega * omega:  # a pole of the stem at 1/T: take it just beside
        divisor = NEAR_CRITICAL * omega * omega
    driven = omega * omega / divisor * (pulse.push_m - pulse.hold_m)

    def at(time_s: float) -> tuple[float, float]:
        decay = exp(-time_s / T)
        y_free, v_free = _after(omega, p, q, overdamped, y - driven, v + driven / T, time_s)
        return y_free + driven * decay, v_free - driven / T * decay

    slow = p - q if overdamped else p
    last_s = log(max(1.0, (abs(pulse.push_m) + abs(pulse.hold_m)) / near_m)) * (T + 1 / slow)
    early_s, late_s = 0.0, 0.25 / omega
    while at(late_s)[1] > 0.0:
        if late_s > LONGEST_SEARCH * (T + 1 / slow):
            return PulseEnd(hold_m, pulse.duration_s + last_s)
        early_s, late_s = late_s, 1.3 * late_s
    for _ in range(REFINEMENTS):
        middle_s = 0.5 * (early_s + late_s)
        early_s, late_s = (middle_s, late_s) if at(middle_s)[1] > 0.0 else (early_s, middle_s)
    return PulseEnd(hold_m + at(early_s)[0], pulse.duration_s + late_s)


def _after(
    omega: float, p: float, q: float, overdamped: bool, y: float, v: float, time_s: float
) -> tuple[float, float]:
    """Return y and v a time later."""
    if overdamped:  # q < p: written so that nothing overflows
        slow, fast = exp((q - p) * time_s), exp(-(q + p) * time_s)
        even, odd = 0.5 * (slow + fast), 0.5 * (slow - fast) / q
    else:
        decay = exp(-p * time_s)
        even, odd = decay * cos(q * time_s), decay * sin(q * time_s) / q
    return y * even + (v + p * y) * odd, v * even - (p * v + omega * omega * y) * odd


def _slope(theta: Theta, pulse: Pulse, travel_m: float) -> list[float]:
    """Return J: the derivatives of the end by theta."""
    w, z, up, down = theta
    slope = [
        (_end((w + DIFFERENCE, z, up, down), pulse, inf).travel_m - travel_m) / DIFFERENCE,
        (_end((w, z + DIFFERENCE, up, down), pulse, inf).travel_m - travel_m) / DIFFERENCE,
        0.0,
        0.0,
    ]
    shift_m = DIFFERENCE * max(abs(pulse.push_m), 1e-9)
    moved = (w, z, up + shift_m, down) if pulse.direction > 0 else (w, z, up, down + shift_m)
    slope[2 if pulse.direction > 0 else 3] = (_end(moved, pulse, inf).travel_m - travel_m) / shift_m
    return slope


def _braked(slope: list[float]) -> bool:
    return slope[0] != 0.0


def _quadratic(covariance: Covariance, slope: list[float]) -> float:
    return sum(slope[i] * sum(row[j] * slope[j] for j in range(4)) for i, row in enumerate(covariance))


def _within(value: float, bounds: tuple[float, float]) -> float:
    return min(max(value, bounds[0]), bounds[1])


def _row(*values: float) -> tuple[float, float, float, float]:
    one, two, three, four = values
    return one, two, three, four
