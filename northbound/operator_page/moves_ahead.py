"""What a command is going to do to the stem, said before it is given: from where to where, by what, how long.

Registers as read last, and the daemon's file where the page was given it, say so; what neither says is said to be
unknown. Pure: no browser, no clock.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from config.daemon_file import DaemonFile
from config.travel import Travel
from northbound.observer.valve_view import ValvePicture
from northbound.observer.waiting_reference import Writer, waiting_reference
from positioner.response import ResponseFigures
from webpage.units import Units

BY_LAW = {
    "seed": "in one step of the pressure, as fast as the valve goes",
    "slides": "in slides, each after the stem has come to rest",
    "conventional": "gradually, as a PI controller does",
}
"""How a `[control] law` takes the stem to a reference; of another its name is said."""
UNKNOWN_FILE = "not known without the daemon's file (start the page with --config)"
NOBODY_KNOWS = "its writer is not known: the daemon keeps no history that this page can read"


@dataclass(frozen=True, slots=True)
class Ahead:
    """What is known of one valve when somebody is about to move it."""

    picture: ValvePicture
    stroke_m: float
    units: Units
    settings: DaemonFile | None = None
    writer: Writer | None = None
    """Of the reference."""
    response: ResponseFigures | None = None
    """Of the last moves."""

    @property
    def stands(self) -> str:
        """Where the stem stands."""
        return self._position(self.picture.value("position"))

    @property
    def waits_pu(self) -> float | None:
        """The opening that waits; None where none does."""
        return waiting_reference(self.picture.values)

    @property
    def waits(self) -> str:
        """The same in words; empty where none does."""
        return "" if self.waits_pu is None else self._position(self.waits_pu)

    def automatic(self) -> list[str]:
        """Say what automatic is going to do."""
        waiting = self.waits_pu
        if waiting is None:
            return [f"The stem stands at {self.stands}. No other reference waits: it stays there until one is written."]
        way = waiting - self.picture.value("position")
        wrote = f"written by {self.writer.words}" if self.writer else NOBODY_KNOWS
        return [
            f"The stem stands at {self.stands}. The reference is {self.waits}: {wrote}.",
            f"To go there moves the stem by {way:+.1%} of its stroke{self._length(way)}.",
            f"How long: {self._how_long()}.",
            "To stay writes the stem's present position as the reference.",
        ]

    def manual(self, pressure_pa: float) -> list[str]:
        """Say what a pressure by hand is going to do."""
        now_pa, shown = self.picture.value("command"), self.units.pressure.text
        lines = [f"The command goes from {shown(now_pa)} to {shown(pressure_pa)} at once, and stays there."]
        if math.isfinite(self._balance()[0]):
            there = self._rests(pressure_pa)
            lines.append(f"The spring balances it at about {self._position(there)}; friction may stop the stem before.")
        else:
            lines.append("How far the stem goes is not known before the valve is identified.")
        return lines

    def identification(self) -> list[str]:
        """Say what an identification is going to do."""
        return [
            *self._excitation(),
            "Then the law commands again. The stem may stay where it is until the next reference.",
        ]

    def _excitation(self) -> Iterator[str]:
        if self.settings is None:
            yield f"What moves the stem, a sine or a staircase, how far and how long: {UNKNOWN_FILE}."
            return
        table = self.settings.excitation
        if self.settings.by_slides:
            low, high = map(self._position, table.travel_window)
            yield f"From {self.stands} a staircase of pressures takes the stem up and down between {low} and {high}."
            yield "The first steps are small. They grow until the stem slides."
            yield f"How long: until slides in both directions agree, at most {table.staircase_limit_s:g} s."
        else:
            yield from self._sine(table.limit_s)
        if table.permitted_travel is not None:
            low, high = map(self._position, table.permitted_travel)
            yield f"It is broken off outside {low} to {high}."

    def _sine(self, limit_s: float) -> Iterator[str]:
        alpha_pa, beta_pa, omega = (self.picture.value(name) for name in ("alpha", "beta", "omega"))
        shown = self.units.pressure.text
        about = shown(alpha_pa) if alpha_pa > 0 else "the pressure that holds the stem"
        yield f"The pressure swings by ±{shown(beta_pa)} about {about}, with a period of {2 * math.pi / omega:.3g} s."
        slope, _ = self._balance()
        if not math.isfinite(slope):
            yield "How far the stem goes is not known before the valve is identified."
        elif alpha_pa > 0:
            ends = sorted(self._rests(alpha_pa + sign * beta_pa) for sign in (-1, 1))
            low, high = map(self._position, ends)
            yield f"The stem stands at {self.stands}, and will move between {low} and {high}."
        else:
            most = beta_pa / slope / self.stroke_m
            yield f"The stem goes at most ±{most:.1%} of its stroke{self._length(most)} about {self.stands}."
        yield f"How long: until friction and spring are identified, at most {limit_s:g} s."

    def _rests(self, pressure_pa: float) -> float:
        """Return the opening at which spring and pressure balance."""
        slope, offset_pa = self._balance()
        closes = self.settings is not None and self.settings.valve.travel.closes
        opening = Travel(self.stroke_m, closes).opening((pressure_pa - offset_pa) / slope)
        return min(max(opening, 0.0), 1.0)

    def _balance(self) -> tuple[float, float]:
        """Return the pressure that balances the spring, Pa/m, and its offset, Pa; NaN before they are identified."""
        offset_pa = self.picture.value("offset_applied")
        return abs(self.picture.value("b_over_c_applied")), 0.0 if math.isnan(offset_pa) else offset_pa

    def _how_long(self) -> str:
        law = "" if self.settings is None else self.settings.control.law
        how = BY_LAW.get(law, f"by law {law}") if law else UNKNOWN_FILE
        return f"{how}; {self._last_move()}"

    def _last_move(self) -> str:
        """Say what the last move that was seen took."""
        for step in reversed(self.response.steps if self.response else ()):
            if step.t86_s.value is not None and step.travel_m.value is not None:
                went = abs(step.travel_m.value / self.stroke_m)
                return f"the last move seen, of {went:.0%}, took {step.t86_s.value:.2g} s (T86)"
        return "no move was seen lately"

    def _position(self, position_pu: float) -> str:
        return self.units.position_unit(self.stroke_m, turns=self.picture.turns).text(position_pu * self.stroke_m)

    def _length(self, part: float) -> str:
        """Return a part of the stroke as a length, in brackets; empty where the stroke is not known."""
        if not math.isfinite(self.stroke_m):
            return ""
        return f" ({self.units.length_unit(turns=self.picture.turns).text(abs(part) * self.stroke_m)})"
