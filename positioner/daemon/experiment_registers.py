"""The registers by which the DCS has an experiment played: what a write of them asks for, what they serve."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from pymodbus.constants import ExcCodes

from positioner.control.requests import ExperimentRequest, Requests
from positioner.daemon.snapshot import Snapshot


class WriteRejected(Exception):
    """A write that is not taken: the Modbus exception that answers it, and the reason for the log."""

    def __init__(self, reason: str, code: ExcCodes = ExcCodes.ILLEGAL_VALUE) -> None:
        self.reason, self.code = reason, code


def experiment_asked(before: ExperimentRequest, values: Mapping[str, float], stroke_m: float) -> ExperimentRequest:
    """Return what is asked for after writes to the experiment's registers; travels there are shares of the stroke."""
    after = replace(
        before,
        consented=bool(values.get("experiment_consent", before.consented)),
        vetoed=bool(values.get("experiment_veto", before.vetoed)),
        turn_m=stroke_m * values.get("experiment_turn", before.turn_m / stroke_m),
        band_m=stroke_m * values.get("experiment_band", before.band_m / stroke_m),
    )
    point = [values.get(f"experiment_{what}") for what in ("point", "time", "pressure")]
    if any(each is not None for each in point):
        number, time_s, pressure_pa = point
        if number is None or time_s is None or pressure_pa is None:
            raise WriteRejected("experiment_point: point, time and pressure go in one request")
        if number not in (0, len(after.points)):
            raise WriteRejected(f"experiment_point: the next is {len(after.points)}, or 0, got {number:g}")
        after = replace(after, points=(*after.points[: int(number)], (time_s, pressure_pa)))
        if number == 0:  # another sequence, which has a turn and a band of its own, or none
            after = replace(after, turn_m=0.0, band_m=0.0)
    if "experiment_start" in values:
        if values["experiment_start"] != len(after.points):
            raise WriteRejected(
                f"experiment_start: there are {len(after.points)} points, not {values['experiment_start']:g}",
            )
        after = replace(after, starts=after.starts + 1)
    return after


def experiment_getters(stroke_m: float) -> dict[str, Callable[[Snapshot, Requests], float]]:
    """Return, by register, what it serves of a snapshot."""

    def last(request: Requests, which: int) -> float:
        points = request.experiment.points
        return points[-1][which] if points else 0.0

    return {
        "experiment_consent": lambda _, r: r.experiment.consented,
        "experiment_veto": lambda _, r: r.experiment.vetoed,
        "experiment_point": lambda _, r: max(0, len(r.experiment.points) - 1),
        "experiment_time": lambda _, r: last(r, 0),
        "experiment_pressure": lambda _, r: last(r, 1),
        "experiment_start": lambda _s, _r: 0,
        "experiment_points": lambda _, r: len(r.experiment.points),
        "experiment_state": lambda s, _: s.decision.experiment.state,
        "experiment_turn": lambda _, r: r.experiment.turn_m / stroke_m,
        "experiment_band": lambda _, r: r.experiment.band_m / stroke_m,
        "experiment_elapsed": lambda s, _: s.decision.experiment.elapsed_s(s.sample.now_s),
    }
