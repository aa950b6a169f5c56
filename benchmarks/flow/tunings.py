"""The flow loop under other tunings: is the comparison fair, and what does it hang on?

`--rivals`: one table of our laws and of the compensators of `rival_laws`, each with the best of a grid of the tunings
that its paper gives, then with the best of those that move the stem, and what each costs the valve. The dead band of
the two-move method is ours.

`--tunings`: the conventional positioner, K and R over a grid, gain margin 2 at the least. What ours is compared with
is the pair that leaves the least deviation, summed over both periods, among those that wore the valve no more than ours
when ours made two to three times today's strokes; it wears the valve more than ours now. Then ours with other dead
bands, with a least time between excursions, and under a faster controller. Takes two minutes.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

from benchmarks.flow.cases import PERIODS_S, POSITIONERS, FlowCase, virtual_outcome
from benchmarks.flow.course import FlowFigures
from benchmarks.flow.rival_laws import ADDED, RivalSettings
from positioner.control.laws.conventional.conventional_law import ConventionalSettings
from positioner.control.settings import Settings

GAINS = (0.1, 0.25, 0.4)
RATES_PER_S = (1.0, 2.0, 4.0, 8.0, 16.0, 50.0)
FAST_S = 2.0
"""λ of a controller as fast as the process itself."""
SLIDES, CONVENTIONAL = (FlowCase(law, PERIODS_S[0]) for law in ("slides", "conventional"))
VARIANTS = {
    "conventional": {
        "dead band 1 %": replace(CONVENTIONAL, dead_band=1e-2),
        "lambda 2 s": replace(CONVENTIONAL, closed_s=FAST_S),
    },
    "slides": {
        "dead band 0.1 %": replace(SLIDES, dead_band=1e-3),
        "dead band 0.3 %": SLIDES,
        "dead band 1 %": replace(SLIDES, dead_band=1e-2),
        "5 s between excursions": replace(SLIDES, interval_s=5.0),
        "lambda 2 s": replace(SLIDES, closed_s=FAST_S),
        "lambda 2 s, 5 s between": replace(SLIDES, closed_s=FAST_S, interval_s=5.0),
    },
}


def figures_of_conventional(period_s: float, gain: float, rate_per_s: float) -> FlowFigures:
    """Return the figures of a conventional positioner so tuned."""

    def tuned(settings: Settings) -> Settings:
        law = settings.law
        assert isinstance(law, ConventionalSettings)
        return replace(settings, law=replace(law, gain=gain, integral_rate_per_s=rate_per_s))

    return virtual_outcome(FlowCase("conventional", period_s), tuned).figures


def tunings() -> Iterator[str]:
    """Yield the tables line by line."""
    yield f"{'conventional':28}" + _heads("added, %", "strokes/min", "reversals/min")
    for gain, rate_per_s in product(GAINS, RATES_PER_S):
        found = [figures_of_conventional(period_s, gain, rate_per_s) for period_s in PERIODS_S]
        yield _line(f"K = {gain:g}, R = {rate_per_s:g} /s", found)
    for law, variants in VARIANTS.items():
        yield law
        for name, case in variants.items():
            yield _line(name, [virtual_outcome(replace(case, period_s=each)).figures for each in PERIODS_S])


AMPLITUDES = (0.015, 0.03, 0.045, 0.06)
"""p.u.: a quarter of the stick band to all of it."""
SCANS = {"knocker": ((1, 2), (2, 5)), "constant reinforcement": ((1,), (1,)), "two moves": ((1, 2), (1,))}
SCAN_S = 0.5
STANDS = 0.05
"""Strokes a minute: a tuning that moves the stem less leaves it alone."""
RIVAL_HEADS = ("std, %", "peak, %", "strokes/min", "reversals/min", "vented/min")


def figures_of_rival(kind: str, period_s: float, amplitude: float, lasts: int, every: int) -> FlowFigures:
    """Return the figures of a compensator so tuned, scans of the DCS."""

    def tuned(settings: Settings) -> Settings:
        law = settings.law
        assert isinstance(law, ConventionalSettings)
        rival = RivalSettings(
            kind=kind,
            amplitude=amplitude,
            lasts_s=lasts * SCAN_S,
            every_s=every * SCAN_S,
            stroke_m=settings.limits.stroke_m,
            minimum_pa=law.minimum_pa,
            maximum_pa=law.maximum_pa,
        )
        return replace(settings, law=rival)

    return virtual_outcome(FlowCase("conventional", period_s), tuned).figures


def rivals(period_s: float) -> Iterator[str]:
    """Yield the table of our laws and the published compensators."""
    yield f"{'':48}" + "".join(f"{each:>15}" for each in RIVAL_HEADS)
    for law in POSITIONERS:
        yield _rival_row(POSITIONERS[law], virtual_outcome(FlowCase(law, period_s)).figures)
    for kind in ADDED:
        lasts, every = SCANS.get(kind, SCANS["knocker"])
        tried = {each: figures_of_rival(kind, period_s, *each) for each in product(AMPLITUDES, lasts, every)}
        moving = {each: found for each, found in tried.items() if found.strokes_per_minute > STANDS}
        for some in (tried, moving):
            if some:
                (amplitude, last, often), best = min(some.items(), key=lambda each: each[1].deviation_std)
                yield _rival_row(f"{kind}, {100 * amplitude:g} %, {last} of {often} scans", best)


def _rival_row(name: str, found: FlowFigures) -> str:
    return (
        f"{name:48}{100 * found.deviation_std:15.2f}{100 * found.peak_to_peak:15.1f}{found.strokes_per_minute:15.2f}"
        f"{found.reversals_per_minute:15.1f}{found.vented_per_minute:15.2f}"
    )


def _heads(*names: str) -> str:
    return "".join(f"{f'{1e3 * each:g} ms: std, %':>20}" + "".join(f"{n:>15}" for n in names) for each in PERIODS_S)


def _line(name: str, found: list[FlowFigures]) -> str:
    return f"{name:28}" + "".join(
        f"{100 * each.deviation_std:20.2f}{100 * each.added_std:15.2f}"
        f"{each.strokes_per_minute:15.2f}{each.reversals_per_minute:15.1f}"
        for each in found
    )
