"""Margins: the shortest slides that break a stem loose, as slides teach them.

    m = (F_s - F_c)/k_s               of a slide that goes on in the direction of the last
      + (F_s + F_c)/k_p - w           of one that turns round: a packing of stiffness k_p gives way, play w is taken up

F_s, F_c of the direction. So there are four: up and down, going on and turning round. None of what stands above is
known; what is, are the longest way that held the stem and the shortest that broke it loose:

    held < m <= broke                 tried next: sqrt(held broke), at most 2 held, until broke is within 10 % of held;
                                      then broke

Behind a slow I/P a slide may break loose though it is sent less far than m, for there stems stick short of where they
are sent: it jumps by m. Then the way asked is no way to go, as if it had held, and m is at most where it jumped to.

A way that holds though it has broken loose before is believed for the move: the next is longer by `RAISE`. When that
has broken loose, `held` is what it was, so that a margin that luck has made too long comes back within a few moves.
A margin of which little is known is taken for its next of kin, or what held that one, less a fifth, says what holds it.
"""

from dataclasses import dataclass, replace
from math import sqrt

LOWER, RAISE = 0.5, 1.3
"""Factors on a margin as long as no slide has held, and as long as none has broken loose."""
GROWS = 2.0
"""Factor, at most, from what held to what is tried next: what broke loose may have been far longer than needed."""
ALIKE = 1.25
"""Factor by which margins of kin may differ."""
CLOSE = 1.1
"""Broke over held: near enough."""
BESIDE = 1.05
"""Factor to a bound that an outcome has contradicted."""
FADES = 0.999
"""Factor on the longest way that held, with each short slide that breaks loose: friction changes, so in time a shorter
one is tried again."""
SHORT = 2.0
"""Margins: a slide longer than this says nothing."""


@dataclass(frozen=True, slots=True)
class Margin:
    """The longest way that held the stem and the shortest that broke it loose, m; 0: none has."""

    held_m: float = 0.0
    broke_m: float = 0.0
    held_before_m: float | None = None
    """The former before a way held that had broken loose, None if none has: one such may be luck, or a slow I/P's."""
    guessed: bool = False
    """Whether no slide has shown `broke_m`: it says what to try first, and nothing of a stem that such a way holds."""

    @property
    def way_m(self) -> float:
        """The way to give, m; 0: nothing is known."""
        if not self.held_m:
            return LOWER * self.broke_m
        if not self.broke_m:
            return RAISE * self.held_m
        between_m = min(sqrt(self.held_m * self.broke_m), GROWS * self.held_m)
        return between_m if self.broke_m > CLOSE * self.held_m else self.broke_m

    @property
    def sure_m(self) -> float:
        """The way that has broken loose, m; where none has, the way to give."""
        return self.broke_m or self.way_m

    @property
    def seen_m(self) -> float:
        """The shortest way that has been seen to break loose and has not held since, m; 0: none."""
        return 0.0 if self.guessed or self.held_before_m is not None else self.broke_m

    @property
    def _believed_m(self) -> float:
        """The longest way that held and had not broken loose before, m."""
        return self.held_m if self.held_before_m is None else self.held_before_m

    def after_breaking(self, way_m: float) -> "Margin":
        """Return the margin after a slide of a way, m, that broke loose."""
        if self.broke_m and way_m > SHORT * self.broke_m:
            return self
        held_m = FADES * self._believed_m if way_m > self._believed_m else way_m / BESIDE
        if not self.broke_m:
            return Margin(held_m, way_m)
        return Margin(held_m, min(self.broke_m, way_m), guessed=self.guessed and way_m > self.broke_m)

    def after_jumping(self, way_m: float, went_m: float) -> "Margin":
        """Return the margin after a slide meant to go a way, m, that jumped farther: none is so short, though it broke.

        Where one as short, or shorter, has landed, that is believed for the move, as of a way that holds.
        """
        if 0.0 < self.seen_m <= way_m:
            return Margin(max(self.held_m, way_m), went_m, self._believed_m, self.guessed)
        return Margin(max(self._believed_m, way_m), min(self.broke_m or went_m, went_m))

    def after_holding(self, way_m: float) -> "Margin":
        """Return the margin after a slide meant to go a way, m, that did not break loose."""
        if way_m <= 0.0:
            return self
        if 0.0 < self.broke_m <= BESIDE * way_m:
            return Margin(max(self.held_m, way_m), RAISE * way_m, self._believed_m, self.guessed)
        return Margin(max(self.held_m, way_m), self.broke_m, guessed=self.guessed)

    def times(self, factor: float) -> "Margin":
        """Return it so much longer."""
        before_m = None if self.held_before_m is None else factor * self.held_before_m
        return Margin(factor * self.held_m, factor * self.broke_m, before_m, self.guessed)


UNTRIED = Margin()


@dataclass(frozen=True, slots=True)
class Margins:
    """The four margins: of slides that go on in the direction of the last, and of slides that turn round."""

    onward_up: Margin = UNTRIED
    onward_down: Margin = UNTRIED
    turning_up: Margin = UNTRIED
    turning_down: Margin = UNTRIED

    def own(self, direction: int, *, turning: bool) -> Margin:
        """Return a margin as it was learnt."""
        if turning:
            return self.turning_up if direction > 0 else self.turning_down
        return self.onward_up if direction > 0 else self.onward_down

    def of(self, direction: int, *, turning: bool) -> Margin:
        """Return a margin; of one that is known from one side only, the next of kin that agrees says the other."""
        own = self.own(direction, turning=turning)
        if own.held_m and own.broke_m:
            return own
        kin = [
            self.own(s, turning=t)
            for s, t in ((direction, not turning), (-direction, turning), (-direction, not turning))
        ]
        for like in kin:
            shorter = CLOSE * (like.way_m if like.held_m else like.broke_m) < own.broke_m
            if like.broke_m > own.held_m and (shorter or not own.broke_m):
                return Margin(max(like.held_m, own.held_m), like.broke_m, guessed=like.guessed)
        for like in kin:
            if own.held_m < like.held_m < own.broke_m:
                return replace(own, held_m=like.held_m / ALIKE)
        return own

    def replaced(self, direction: int, margin: Margin, *, turning: bool) -> "Margins":
        """Return them with another in place of one."""
        if turning:
            return replace(self, turning_up=margin) if direction > 0 else replace(self, turning_down=margin)
        return replace(self, onward_up=margin) if direction > 0 else replace(self, onward_down=margin)

    @property
    def all(self) -> tuple[Margin, Margin, Margin, Margin]:
        """In the order of the fields."""
        return self.onward_up, self.onward_down, self.turning_up, self.turning_down


NO_MARGINS = Margins()
