"""The landings of a whole recording: what the daemon would have seen, sample by sample.

A landing is told by the command, for a measured pressure is never the same twice. The stroke is not in a recording:
the range of the positions stands for it, and the stops are taken to be elsewhere.
"""

from math import inf

import numpy as np

from config.recording import Recording
from positioner.estimation.landings.static_identification import StaticIdentification

NOWHERE = (-inf, inf)


def recording_landings(recording: Recording) -> StaticIdentification:
    """Return the landings and the static law of a recording.

    Args:
        recording: `time_s`, `position_m`, `command_pa`, `pressure_pa`; (n,) each, SI units; the last two if there.
    """
    position_m, nothing = recording.position_m, np.full(len(recording), np.nan)
    usable = np.isfinite(position_m)
    stroke_m = float(np.ptp(position_m[usable])) if usable.any() else 0.0
    statics = StaticIdentification(stroke_m or 1.0, NOWHERE, each=len(recording))
    if "command_pa" not in recording.columns:
        return statics
    measured_pa = recording.columns.get("pressure_pa", nothing)
    command_pa = recording.command_pa
    # A row's command is in force from there on: the sample beside it has not felt it yet.
    ahead_pa = np.append(command_pa[:1], command_pa[:-1])
    rows = zip(
        recording.time_s[usable].tolist(),
        position_m[usable].tolist(),
        ahead_pa[usable].tolist(),
        measured_pa[usable].tolist(),
        strict=True,
    )
    for row in rows:
        statics.update(*row)
    return statics
