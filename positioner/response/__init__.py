"""Response figures by their trade names, from any recording: what `positioner response` prints.

`respond(recording)` finds the steps and gives `ResponseFigures`: dead time, T63, T86, overshoot, travel and static gain
of each step, dead band and resolution of the recording. A figure that cannot be determined says why. Needs numpy alone.

    response_figures                the whole recording
    response_result                 what it gives, and how that shows itself: sentences, table, figure, data frame
    step_detection, step_figures    its steps, and the figures of one
    rest_level, level_crossing      where the stem rests, and when it crosses a level
    figure                          a figure with its uncertainty, or why there is none
    measured_dead_band              dead band and resolution, from series of small steps
"""

from positioner.response.figure import Figure
from positioner.response.response_figures import as_json, respond
from positioner.response.response_result import ResponseFigures
from positioner.response.step_figures import StepFigures

__all__ = ["Figure", "ResponseFigures", "StepFigures", "as_json", "respond"]
