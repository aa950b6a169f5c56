"""What must hold before the valve may be identified, which moves it; `positioner identify` asks the same.

The daemon itself refuses by `positioner/control/permissives.py`. Which button a page disables is decided in
`operator_page/valve_controls.py` (by role and these) and `operator_page/test_card.py` (tests).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from config.codes import ExperimentState, Fault, Mode, State
from northbound.observer.freshness import news_within_s
from northbound.observer.register_words import code_text

IDENTIFY_READS = ("mode", "fault", "sample_age", "period", "state", "experiment_state")
"""Registers that decide."""


@dataclass(frozen=True, slots=True)
class Permissive:
    """One thing that must hold, whether it does, and what to do where it does not."""

    text: str
    holds: bool
    remedy: str


def identify_permissives(values: Mapping[str, float]) -> tuple[Permissive, ...]:
    """Return what must hold, from registers by name; what was not read does not hold."""
    plays = (ExperimentState.UNDER_WAY, ExperimentState.RETURNING)
    return (
        Permissive(
            "the mode is automatic",
            values.get("mode") == Mode.AUTOMATIC,
            "the mode is not automatic, so nothing may move the valve: positioner set mode automatic",
        ),
        Permissive(
            "no fault is latched",
            values.get("fault") == Fault.NONE,
            f"a fault is latched ({code_text('fault', values.get('fault', math.nan))}): "
            "positioner set acknowledge 1, once its cause is gone",
        ),
        Permissive(
            "the measurement is of now",
            values.get("sample_age", math.inf) <= news_within_s(values.get("period", 0.0)),
            "the last good measurement is too old (see registers quality and sample_age)",
        ),
        Permissive(
            "nothing else excites the valve",
            "state" in values
            and values["state"] != State.S3_IDENTIFY
            and values.get("experiment_state") not in (None, *plays),
            "an excitation or an experiment is under way",
        ),
    )
