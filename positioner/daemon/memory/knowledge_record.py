"""What is known of a valve as JSON, and back. Nothing is taken that could not be true."""

import math
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from config.loading import Schema
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.estimation.acceptance import Ratios
from positioner.estimation.estimates import Directions
from positioner.estimation.landings.breakaway_distance import BreakawayDistance, Interval
from positioner.estimation.landings.landing_detector import Answers, SlideOutcome

MOST_LANDINGS = 40
"""Landings, and changes that held."""
Row = tuple[float, float, float]
Place = Annotated[float, Field(ge=-1e3, le=1e3)]
"""m; like the other limits far beyond any valve, and near enough that no formula overflows by it."""
Length = Annotated[float, Field(ge=0.0, le=1e3)]
"""m."""
Pressure = Annotated[float, Field(ge=-1e9, le=1e9)]
"""Pa."""
Figure = Annotated[float, Field(ge=-1e30, le=1e30)]


class _Slide(Schema):
    time_s: float = Field(le=0.0)
    direction: int
    from_m: Place
    command_pa: Pressure
    position_m: Place
    std_m: Length
    moved: bool
    landing: bool
    short_m: Length = 0.0
    from_pa: Pressure | None = None


class _Interval(Schema):
    held_m: Length
    broke_m: Length | None
    """None: nothing has broken loose."""
    seen: bool


class KnowledgeRecord(Schema):
    """What is kept of a valve; SI units."""

    b_over_c_pa_per_m: float = Field(ge=-1e12, le=-1.0)
    k_over_c_pa: float = Field(ge=-1e9, lt=-1e-6)
    offset_pa: Pressure
    directions: Literal["UP", "DOWN", "BOTH"] = "BOTH"
    """In which friction is known; what was kept before it was said counted as both."""
    covariance: list[list[Figure]] = Field(min_length=3, max_length=3)
    residual_m: Length
    landings: list[_Slide] = Field(max_length=MOST_LANDINGS)
    held: list[_Slide] = Field(max_length=MOST_LANDINGS)
    answers: list[Annotated[float, Field(ge=0.0, le=1e9)]] = Field(min_length=3, max_length=3)
    distances: list[_Interval] | None = Field(min_length=4, max_length=4)
    tracked: dict[str, Figure]


def record_of(knowledge: ValveKnowledge) -> dict[str, Any]:
    """Return what is known as it is written."""
    ratios = knowledge.ratios
    return {
        "b_over_c_pa_per_m": ratios.b_over_c,
        "k_over_c_pa": ratios.k_over_c,
        "offset_pa": ratios.offset_pa,
        "directions": ratios.directions.name,
        "covariance": [list(row) for row in knowledge.covariance],
        "residual_m": knowledge.residual_m,
        "landings": [each._asdict() for each in knowledge.landings[:MOST_LANDINGS] if _finite(each)],
        "held": [each._asdict() for each in knowledge.held[:MOST_LANDINGS] if _finite(each)],
        "answers": list(knowledge.answers),
        "distances": None if knowledge.distances is None else [_kept(each) for each in knowledge.distances],
        "tracked": dict(knowledge.tracked),
    }


def knowledge_in(content: object) -> ValveKnowledge:
    """Return what was written.

    Raises:
        ValueError: it cannot be true; one line names the key.
    """
    try:
        record = KnowledgeRecord.model_validate(content)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        where = ".".join(str(each) for each in fault["loc"])
        raise ValueError(f"{where}: {fault['msg']}") from None
    a, b, c = (_row(row) for row in record.covariance)
    return ValveKnowledge(
        ratios=Ratios(record.b_over_c_pa_per_m, record.k_over_c_pa, record.offset_pa, Directions[record.directions]),
        covariance=(a, b, c),
        residual_m=record.residual_m,
        landings=_outcomes(record.landings),
        held=_outcomes(record.held),
        answers=Answers(*record.answers),
        distances=_distances(record.distances),
        tracked=record.tracked,
    )


def _kept(each: Interval) -> dict[str, Any]:
    return {"held_m": each.held_m, "broke_m": each.broke_m if each.broke_m < math.inf else None, "seen": each.seen}


def _distances(four: list[_Interval] | None) -> BreakawayDistance | None:
    if four is None:
        return None
    intervals = (Interval(each.held_m, math.inf if each.broke_m is None else each.broke_m, each.seen) for each in four)
    return BreakawayDistance(*intervals)


def _row(row: list[float]) -> Row:
    if len(row) != 3:
        raise ValueError("covariance: must be three rows of three numbers")
    return row[0], row[1], row[2]


def _outcomes(slides: list[_Slide]) -> tuple[SlideOutcome, ...]:
    if any(each.direction not in (1, -1) for each in slides):
        raise ValueError("direction: must be 1 or -1")
    return tuple(SlideOutcome(**each.model_dump()) for each in slides)


def _finite(each: SlideOutcome) -> bool:
    return all(math.isfinite(value) for value in (each.from_m, each.command_pa, each.position_m, each.std_m))
