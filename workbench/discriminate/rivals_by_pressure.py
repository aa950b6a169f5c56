"""Rivals by the measured pressure, where the recordings have it: then a supply's noise drives no stem unseen.

A rival is refitted, and weighed, from the pressure in the actuator on (`pressure_between_samples`), not from the
command. Not where one of them acts on the pressure path, which is not seen then. Nor where samples lie too far apart
for it, nor where the best of them by the pressure leaves more than the best by the command: then the sensor of the
pressure is the worse witness.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from config.recording import Recording
from sim.effect import Effect
from workbench.data.held_out import join_recordings
from workbench.data.record import ready
from workbench.fit.fit_problem import Problem
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import base_fit
from workbench.fit.threads import on_threads
from workbench.model.told_run import told_moves

MOSTLY = 0.9
"""Of the samples."""


def race_by_pressure(
    fits: Mapping[str, Fit], recordings: Sequence[Recording], library: Mapping[str, Effect], workers: int | None
) -> Mapping[str, Fit]:
    """Return the rivals from the measured pressure on; as they are where that tells nothing more.

    Args:
        fits: by the name of the effect in which they differ.
        recordings: to which they are fitted.
        library: the effects by name.
        workers: threads, by default one a core.
    """
    on_path = {name for name, each in library.items() if "pressure" in each.functions}
    if on_path & fits.keys() or any(each.by.slow for each in fits.values()) or not all(map(_is_measured, recordings)):
        return fits
    record = ready(join_recordings(recordings))

    def refit_rival(found: Fit) -> Fit:
        free = [name for name in found.parameters if name.partition(".")[0] not in on_path]
        driven = Problem(record, told_moves(record), found.by, from_pressure=True, load_n=found.load_n)
        return base_fit(driven, found.valve, free=free)

    found = dict(zip(fits, on_threads(refit_rival, list(fits.values()), workers), strict=True))
    least_m, before_m = (min(fit.rms_m for fit in each.values()) for each in (found, fits))
    return found if least_m < before_m else fits


def _is_measured(recording: Recording) -> bool:
    """Whether a recording has the pressure beside the command, and mostly numbers: a device may not measure it."""
    if not {"pressure_pa", "command_pa"} <= recording.columns.keys():
        return False
    return float(np.mean(np.isfinite(recording.columns["pressure_pa"]))) > MOSTLY
