"""Response figures by their trade names, from any recording: what `positioner response` prints.

`respond(recording)` finds the steps and gives `ResponseFigures`: dead time, T63, T86, overshoot, travel and static gain
of each step, dead band and resolution of the recording. A figure that cannot be determined says why. Needs numpy alone.
"""

from positioner.response.figure import Figure
from positioner.response.response_figures import ResponseFigures, as_json, respond
from positioner.response.step_figures import StepFigures

__all__ = ["Figure", "ResponseFigures", "StepFigures", "as_json", "respond"]
