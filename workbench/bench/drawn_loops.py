"""Control loops drawn at random, with truth: what the benchmark and the tests of the loops are held against.

Nothing here is what diagnoses: the stems are the literature's data-driven models, written from their papers, and one of
forces; the processes are stepped ten times a sample.

    SP ---(-)--> PI ---OP---> stem ---x---> f(x) ---> process, dead time ---(+)---> PV
           ^                                                   disturbance --^       |
           +------------------------ noise, quantum, sampling -----------------------+

    choudhury   where the output turns the stem stops; it goes on after J the same way or S back, and follows (2005)
    kano        the same, and it also stops where the output stands still (2004)
    he          rests while |OP - x| <= f_s, then lands at OP -+ f_d; S = f_s + f_d, J = f_s - f_d (2007)
    forces      mass, spring, Coulomb and static friction; S and J as the forces imply
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import exp, log, pi

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
STEPS = 10
"""Steps of the process a sample."""
STEMS = ("none", "choudhury", "kano", "he", "forces")
CAUSES = ("sticks", "tight tuning", "external sine", "external noise", "nonlinear process", "quiet")


@dataclass(frozen=True, slots=True)
class Truth:
    """What a drawn loop is.

    Attributes:
        cause: one of `CAUSES`.
        stem: one of `STEMS`.
        stiction_pct, slip_jump_pct: S and J, % of the output.
        integrating: whether the process is.
        period_s: of the samples.
        seed: by which it was drawn.
    """

    cause: str
    stem: str
    stiction_pct: float
    slip_jump_pct: float
    integrating: bool
    period_s: float
    seed: int


@dataclass(frozen=True, slots=True)
class DrawnLoop:
    """A loop's record, (n,) each, and its truth."""

    truth: Truth
    time_s: Array
    op_pct: Array
    pv: Array
    sp: Array


def simulate(  # noqa: C901, PLR0912, PLR0915  one compiled function
    samples: int,
    stem: int,
    stiction: float,
    jump: float,
    gain: float,
    lag: float,
    lag2: float,
    delay: int,
    integrating: bool,
    kc: float,
    ti: float,
    rangeability: float,
    dist: Array,
    noise: Array,
    sp: Array,
    op_quantum: float,
    pv_quantum: float,
) -> tuple[Array, Array, Array]:
    """Return OP, PV and the stem, (samples,); times in samples, the stem's and output's unit %."""
    dt = 1.0 / STEPS
    op = np.zeros(samples)
    pv = np.zeros(samples)
    stems = np.zeros(samples)
    line = np.zeros(delay + 1)
    at = 0
    u = 50.0
    x = 50.0
    y1 = 0.0
    y2 = 0.0
    integral = 50.0
    # of the stems
    stop = 50.0
    way = 1.0
    moving = False
    last = 50.0
    speed = 0.0
    f_s = 0.5 * (stiction + jump)
    f_d = 0.5 * (stiction - jump)
    for n in range(samples):
        measured = y1 if integrating else y2
        measured = measured + dist[n] + noise[n]
        if pv_quantum > 0.0:
            measured = round(measured / pv_quantum) * pv_quantum
        error = sp[n] - measured
        integral += kc * error / ti
        integral = min(max(integral, 0.0), 100.0)
        u = min(max(kc * error + integral, 0.0), 100.0)
        if op_quantum > 0.0:
            u = round(u / op_quantum) * op_quantum
        op[n] = u
        pv[n] = measured
        for step in range(STEPS):
            if stem == 0:
                x = u
            elif stem in (1, 2):
                # Kano's stem also stops where the output stands still, Choudhury's only where it turns.
                onward = way * (u - last)
                if moving and (onward < 0.0 or (stem == 2 and onward == 0.0)) and step == 0:
                    moving = False
                    stop = last
                if not moving and way * (u - stop) > jump:
                    moving = True
                elif not moving and way * (u - stop) < -stiction:
                    moving = True
                    way = -way
                if moving:
                    x = u - way * f_d
                last = u
            elif stem == 3:
                if u - x > f_s:
                    x = u - f_d
                elif u - x < -f_s:
                    x = u + f_d
            else:
                # forces in % of the output; the stem's own time constant is a fifth of a sample
                force = u - x
                for _ in range(4):
                    force = u - x
                    if speed == 0.0 and abs(force) <= f_s:
                        break
                    sliding = (1.0 if speed > 0.0 else -1.0) if speed != 0.0 else (1.0 if force > 0.0 else -1.0)
                    friction = max(f_d, 0.0) * sliding
                    rate = (force - friction) / 0.05
                    if speed != 0.0 and rate * speed <= 0.0:
                        speed = 0.0
                        break
                    speed = rate
                    x += speed * dt * 0.25
            flow = x - 50.0
            if rangeability > 1.0:
                flow = 50.0 * (exp(log(rangeability) * (x - 50.0) / 100.0) - 1.0) / log(rangeability) * 2.0
            line[at % (delay + 1)] = flow
            late = line[(at + 1) % (delay + 1)]
            at += 1
            if integrating:
                y2 += dt / max(lag2, dt) * (late - y2)
                y1 += dt * gain * y2
            else:
                y1 += dt / max(lag, dt) * (gain * late - y1)
                y2 += dt / max(lag2, dt) * (y1 - y2)
        stems[n] = x
    return op, pv, stems


Simulate = Callable[..., tuple[Array, Array, Array]]


def draw_loop(seed: int, cause: str, run: Simulate = simulate) -> DrawnLoop:
    """Draw a loop of a cause; `run` is `simulate`, as it is or compiled."""
    rng = np.random.default_rng([72, seed, CAUSES.index(cause)])
    period_s = float(rng.choice([1.0, 2.0, 5.0, 10.0]))
    samples = int(rng.integers(700, 2500))
    integrating = bool(rng.random() < 0.35)
    lag, second = float(np.exp(rng.uniform(log(1.5), log(20.0)))), float(rng.choice([0.0, 0.3]))
    dead = float(rng.uniform(0.3, 1.0)) * (lag if not integrating else rng.uniform(2.0, 6.0))
    gain = float(rng.uniform(0.4, 2.0)) * (1.0 if not integrating else 0.02)
    tau = float(rng.uniform(1.0, 3.0)) * dead
    if integrating:
        kc, ti = 1.0 / (gain * (tau + dead)), 4.0 * (tau + dead)
    else:
        kc, ti = lag / (gain * (tau + dead)), min(lag * 1.0, 4.0 * (tau + dead))
    kc *= float(rng.uniform(0.6, 1.2))
    lag2 = second * lag
    if cause == "tight tuning":
        kc = _ultimate(gain, lag, lag2, dead, integrating, kc, ti) * float(rng.uniform(0.88, 1.0))
    stem, stiction, jump = 0, 0.0, 0.0
    if cause == "sticks":
        stem = int(rng.integers(1, 5))
        stiction = float(np.exp(rng.uniform(log(1.0), log(10.0))))
        jump = stiction * float(rng.uniform(0.1, 1.0))
    swing = max(stiction, 2.0) * (gain if not integrating else gain * 4.0 * (tau + dead))
    noise: Array = rng.standard_normal(samples) * swing * float(np.exp(rng.uniform(log(0.01), log(0.12))))
    # Every plant drifts a little: an AR(1) disturbance behind the process.
    dist: Array = _drift(rng, samples, 3.0 * (tau + dead)) * swing * float(rng.uniform(0.0, 0.25))
    if cause == "external sine":
        cycle = float(rng.uniform(4.0, 15.0)) * (tau + dead)
        wave = np.sin(2.0 * pi * np.arange(samples) / cycle + rng.uniform(0, 6))
        if rng.random() < 0.4:
            wave = np.tanh(2.0 * wave)
        dist += wave * swing * float(rng.uniform(0.5, 2.0))
    if cause == "external noise":
        dist += _drift(rng, samples, float(rng.uniform(1.0, 8.0)) * (tau + dead)) * swing * float(rng.uniform(0.5, 2.0))
    rangeability = 1.0
    if cause == "nonlinear process":
        rangeability = float(rng.uniform(20.0, 50.0))
        cycle = float(rng.uniform(5.0, 15.0)) * (tau + dead)
        dist += np.sin(2.0 * pi * np.arange(samples) / cycle) * 8.0 * swing
        kc *= float(rng.uniform(0.4, 0.8))
    sp = np.zeros(samples)
    if rng.random() < 0.25:
        for start in rng.integers(50, samples, 3):
            sp[start:] += swing * float(rng.normal())
    op_quantum = float(rng.choice([0.0, 0.01, 0.1]))
    pv_quantum = swing * float(rng.choice([0.0, 0.01, 0.05]))
    op, pv, _ = run(
        samples, stem, stiction, jump, gain, lag, lag2, max(1, round(dead * STEPS)), integrating, kc, ti, rangeability,
        dist, noise, sp, op_quantum, pv_quantum,
    )  # fmt: skip
    begin = samples // 10
    offset = float(rng.uniform(20.0, 200.0))
    truth = Truth(cause, STEMS[stem], stiction, jump, integrating, period_s, seed)
    time_s = np.asarray(period_s * np.arange(samples - begin), np.float64)
    return DrawnLoop(truth, time_s, op[begin:], pv[begin:] + offset, sp[begin:] + offset)


def draw_loops(count: int, run: Simulate = simulate, sticking: float = 0.5, first_seed: int = 0) -> Iterator[DrawnLoop]:
    """Yield loops in turn: this share of them sticks, the others are of the other causes."""
    others = CAUSES[1:]
    for seed in range(first_seed, first_seed + count):
        rng = np.random.default_rng([72, seed])
        yield draw_loop(seed, "sticks" if rng.random() < sticking else others[seed % len(others)], run)


def _drift(rng: np.random.Generator, samples: int, scale: float) -> Array:
    """Return an AR(2) of unit variance with a correlation time in samples."""
    pole = exp(-1.0 / max(scale, 1.0))
    out = np.zeros(samples)
    shocks = rng.standard_normal(samples)
    first = second = 0.0
    for n in range(samples):
        first = pole * first + (1.0 - pole) * shocks[n]
        second = pole * second + (1.0 - pole) * first
        out[n] = second
    return out / max(float(out.std()), 1e-12)


def _ultimate(gain: float, lag: float, lag2: float, dead: float, integrating: bool, kc: float, ti: float) -> float:
    """Return the gain at which the loop with this reset time just oscillates; half a sample of delay is sampling."""
    w = np.exp(np.linspace(log(1e-4), log(pi), 20_000))
    s = 1j * w
    process = gain / s if integrating else gain / (1.0 + lag * s)
    open_loop = process / (1.0 + lag2 * s) * np.exp(-s * (dead + 0.5)) * (1.0 + 1.0 / (ti * s))
    phase = np.unwrap(np.angle(open_loop))
    below = np.flatnonzero(phase < -pi)
    below = below[below > 0]
    if not below.size or phase[0] < -pi:
        start = np.flatnonzero(phase > -pi)
        below = below[below > start[0]] if start.size else below
    return float(1.0 / abs(open_loop[below[0]])) if below.size else kc
