"""How far the noise of a measured pressure moves the stem that it drives in a simulation.

    d = x(p + e) - x(p)      e white, of the standard deviation that the pressure shows at rest (`signals.noise`); told
                             when the stem moves, so that it lands elsewhere, and leaves when it left
    typical = median rms of d, block by block of time

x is the valve as it was fitted first: a valve that is known exactly is off by as much. It is part of the floor. Noise
that hangs together from sample to sample does not show at rest: then nothing is added.
"""

from dataclasses import replace

import numpy as np

from config.recording import Column
from signals.noise import position_noise_m
from sim.composition import Composition
from workbench.data.held_out import Part, PressureScatter, Split, residual_m
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import problem_of
from workbench.select.block_errors import block_logs
from workbench.select.selection_thresholds import SELECTION


def with_pressure_scatter(split: Split, fit: Fit) -> Split:
    """Return a split whose floor holds what the noise of the measured pressure does to the stem of a fit.

    As it is where the command drives that, or the noise of the position or of the pressure is unknown.
    """
    if split.floor_m is None or split.by_pressure or not fit.from_pressure:
        return split
    found = [_moved(part, fit, noise_pa) for part in (split.train, split.test) if (noise_pa := _noise_pa(part))]
    if not found:
        return split
    noises_pa, logs = zip(*found, strict=True)
    typical_m = float(np.exp(np.median(np.concatenate(logs))))
    scatter = PressureScatter(max(noises_pa), typical_m)
    return replace(split, floor_m=float(np.hypot(split.floor_m, typical_m)), by_pressure=scatter)


def _noise_pa(part: Part) -> float | None:
    """Return the standard deviation of the measured pressure's noise, Pa; None where it does not tell."""
    record = part.record
    assert record.measured_pa is not None
    return position_noise_m(record.measured_pa, None if record.by_setpoint else record.command_pa)


def _moved(part: Part, fit: Fit, noise_pa: float) -> tuple[float, Column]:
    """Return the noise, Pa, and of what it moves the stem by the log rms a block; all draws."""
    record, generator = part.record, np.random.default_rng(0)
    composition = Composition.from_file(fit.valve)

    def simulated_m(noise_pa: Column | float) -> Column:
        assert record.pressure_pa is not None
        drawn = replace(record, pressure_pa=record.pressure_pa + noise_pa)
        run = problem_of(fit, drawn).likelihood(composition, ()).run
        return residual_m(part, run.run(composition.theta, run.first_onsets_s()).indicated_m)

    bare_m = simulated_m(0.0)
    drawn_pa = (generator.normal(0.0, noise_pa, len(record)) for _ in range(SELECTION.pressure_draws))
    moved_m = [simulated_m(each_pa) - bare_m for each_pa in drawn_pa]
    return noise_pa, np.concatenate([block_logs(record.time_s, each, 0.0, record.period_s) for each in moved_m])
