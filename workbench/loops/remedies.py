"""What to do about a sticking valve: each remedy's settings from the estimate, simulated on the identified loop.

    as it is            the PI law that was seen, the stem with S and J, the process with its lag, dead time and gain
    maintenance         the same without friction
    half the gain       the controller's gain halved: an ordinary detuning
    dead band           the integral part rests while |e| < g S / 2, the error that rest positions leave
    knocker             Hagglund (2002): pulses of S / 2 in the direction of the output, 2 samples of every 6
    two moves           Srinivasan and Rengaswamy (2008): one lands the stem where the error asks, one rests it

The noise is that of the record, white, at the size that the fit leaves. Reduction is of the control error's rms, travel
is of the stem; both against the loop as it is, which must swing as the record does, or no figure is given.
"""

from dataclasses import dataclass, replace

import numpy as np

from workbench.loops.causes import Causes
from workbench.loops.controller_law import ControllerLaw

SAMPLES = 3000
BEGIN = 500
"""Of these left out: the loop starts from rest."""
KNOCK_EVERY, KNOCK_FOR = 6, 2
"""Samples; Hägglund: a period of 2 to 5 times the width, a width of 1 to 2 samples."""
LIMIT_PCT = 50.0
"""Of the output about where it works."""
CREDIBLE = 2.0
"""Factor within which the simulated error's size must be the record's."""


@dataclass(frozen=True, slots=True)
class Remedy:
    """One remedy.

    Attributes:
        name: of it.
        settings: what to set, with units.
        error_ratio: rms of the control error, of that of the loop as it is: an offset counts; None where the identified
            loop does not swing as the record does.
        travel_ratio: travel of the stem, likewise.
    """

    name: str
    settings: str
    error_ratio: float | None
    travel_ratio: float | None


@dataclass(frozen=True, slots=True)
class _Loop:
    """The identified loop, in samples: K in %, K T/T_i, f_s and f_d in %, gain of PV a %, pole and dead time, noise."""

    gain: float
    integral: float
    breaks: float
    slides: float
    process_gain: float
    pole: float
    delay: int
    noise: float


def find_remedies(
    record_error: float, law: ControllerLaw, causes: Causes, noise: float, period_s: float
) -> tuple[Remedy, ...]:
    """Return the remedies of a loop.

    Args:
        record_error: rms of the control error on record.
        law: as seen.
        causes: friction and its process as found.
        noise: of PV, standard deviation.
        period_s: of the samples.
    """
    size, jump, gain = causes.friction.size.stiction_pct, causes.friction.slip_jump_pct, causes.gain
    loop = _Loop(
        law.gain,
        law.gain * period_s / law.reset_s,
        0.5 * (size + jump),
        0.5 * (size - jump),
        gain,
        float(np.exp(-period_s / max(causes.lag_s, 1e-6 * period_s))),
        max(1, round(causes.delay_s / period_s)),
        noise,
    )
    detuned = replace(loop, gain=0.5 * loop.gain, integral=0.5 * loop.integral)
    band = abs(gain) * 0.5 * size
    shape = f"{0.5 * size:.2g} %"
    cases: list[tuple[str, str, _Loop, _Policy]] = [
        ("maintenance", "packing and positioner: friction gone", replace(loop, breaks=0.0, slides=0.0), _Policy()),
        ("half the gain", f"gain {0.5 * law.gain:.3g} % a unit of PV", detuned, _Policy()),
        ("dead band", f"integral part rests while |SP - PV| < {band:.3g}", loop, _Policy(dead_band=band)),
        (
            "knocker",
            f"pulses of {shape}, {KNOCK_FOR * period_s:g} s of every {KNOCK_EVERY * period_s:g} s",
            loop,
            _Policy(knock=0.5 * size),
        ),
        (
            "two moves",
            f"moves of {loop.breaks:.2g} % or more and back by {loop.slides:.2g} %, when |SP - PV| > {band:.3g}",
            loop,
            _Policy(two_moves=band),
        ),
    ]
    error, travel = _simulated(loop, _Policy())
    credible = 1.0 / CREDIBLE < error / max(record_error, 1e-12) < CREDIBLE
    found = []
    for name, settings, changed, policy in cases:
        now, way = _simulated(changed, policy)
        ratios = (now / max(error, 1e-12), way / max(travel, 1e-12)) if credible else (None, None)
        found.append(Remedy(name, settings, *ratios))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class _Policy:
    """What stands between the controller and the valve; nothing by itself."""

    dead_band: float = 0.0
    knock: float = 0.0
    two_moves: float = 0.0


def _simulated(loop: _Loop, policy: _Policy) -> tuple[float, float]:
    """Return the rms of the error and the stem's travel a sample, %, of a simulated loop."""
    rng = np.random.default_rng(0)
    shocks = (loop.noise * rng.standard_normal(SAMPLES)).tolist()
    # Half a slip from where it belongs: a stem that begins there, or a whole slip away, may rest there by chance.
    stem = integral = before = 0.5 * (loop.breaks - loop.slides)
    pv, line = loop.process_gain * stem, [stem] * (loop.delay - 1)
    held, wait = 0.0, 0
    errors, stems = np.empty(SAMPLES), np.empty(SAMPLES)
    settles = 4 * (loop.delay + 1) + round(4.0 / max(1e-3, 1.0 - loop.pole))
    for n in range(SAMPLES):
        error = -(pv + shocks[n])
        if abs(error) >= policy.dead_band:
            integral = min(max(integral + loop.integral * error, -LIMIT_PCT), LIMIT_PCT)
        output = loop.gain * error + integral
        command = output
        if policy.knock and n % KNOCK_EVERY < KNOCK_FOR:
            command += policy.knock * float(np.sign(output - before))
        if policy.two_moves:
            wait -= 1
            if wait <= 0 and abs(error) > policy.two_moves:
                goal = stem + error / loop.process_gain
                way = float(np.sign(goal - stem))
                # the first move: beyond the goal by f_d, and past where it breaks loose
                stem = min(max(goal, -LIMIT_PCT), LIMIT_PCT)
                held, wait = goal + loop.slides * way, settles
            command = held
        before = output
        load = min(max(command, -LIMIT_PCT), LIMIT_PCT) - stem
        if abs(load) > loop.breaks:
            stem += load - loop.slides * float(np.sign(load))
        line.append(stem)
        pv = loop.pole * pv + (1.0 - loop.pole) * loop.process_gain * line.pop(0)
        errors[n], stems[n] = error, stem
    return float(np.sqrt((errors[BEGIN:] ** 2).mean())), float(np.abs(np.diff(stems[BEGIN:])).mean())
