"""Table `[travel]`: which opening the DCS's signal asks for, and how fast the reference goes there."""

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from config.loading import Fraction, Many, NonNegative, Pair, Schema, wide

MOST_POLYGON_POINTS = 20
"""Of a polygon."""
NARROWEST_SPLIT = 0.05
"""Of the signal: of less, a DCS of 12 bits would have fewer than 200 steps for the whole travel."""

CharacteristicName = Literal["linear", "equal_percentage", "quick_opening", "polygon"]


class TravelTable(Schema):
    """Table `[travel]`. Signals and openings are 0 to 1, openings from the closed end."""

    characteristic: CharacteristicName = "linear"
    rangeability: Annotated[float, Field(ge=5, le=200)] = 50.0
    """Of equal percentage and of quick opening."""
    polygon: Many[Pair[Fraction]] = ()
    """Points (signal, opening) of `characteristic = "polygon"`, from signal 0 to 1."""
    split_range: Annotated[Pair[Fraction], wide(NARROWEST_SPLIT, either_way=True)] = (0.0, 1.0)
    """The signals at which the valve is closed and open; the second lower: it opens as the signal falls."""
    ramp_opening_s: NonNegative = 0.0
    """Time in which the reference opens the valve all the way, at the least; 0: at once."""
    ramp_closing_s: NonNegative = 0.0
    low_pass_s: NonNegative = 0.0
    """Time constant of the reference; 0: none."""

    @field_validator("polygon")
    @classmethod
    def _points_rise(cls, points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        if not points:
            return points
        if not 2 <= len(points) <= MOST_POLYGON_POINTS:
            raise ValueError(f"must have 2 to {MOST_POLYGON_POINTS} points, got {len(points)}")
        if (points[0][0], points[-1][0]) != (0.0, 1.0):
            raise ValueError(f"must go from signal 0 to 1, got {points[0][0]:g} to {points[-1][0]:g}")
        for before, after in pairwise(points):
            if not (before[0] < after[0] and before[1] < after[1]):
                raise ValueError(
                    f"must rise in signal and opening from point to point, got {list(before)} before {list(after)}"
                )
        return points

    @model_validator(mode="after")
    def _polygon_has_points(self) -> Self:
        if (self.characteristic == "polygon") != bool(self.polygon):
            raise ValueError('polygon: its points belong with characteristic = "polygon", and with no other')
        return self
