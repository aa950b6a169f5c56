"""Has the measured pressure followed the last change of the command?

    share = (p - p_0)/(u + o - p_0)        p_0 when the command changed to u; o by which it is measured off at rest

It has arrived when the share is within 3 % of one. A device that only repeats what it was told says so at once, so a
measurement is believed when it was once seen on its way, with a share of 10 to 90 %: no repetition is. Then a stem need
not be waited for as long as the slowest answer to any step took, but from the arrival on as long as answers take then:
a small step that a rate limit takes to in no time is judged in no time.
"""

from math import inf, nan

ARRIVED = 0.03
ON_ITS_WAY = (0.1, 0.9)
FORGOTTEN = 0.9
"""Factor from answer to answer, so that one slow answer is not waited for ever."""


class PressureArrival:
    """The measured pressure since the command changed.

    Attributes:
        followed: whether anything is known of the last change.
        awaited: whether it is still to come.
        after_s: from the change until it had arrived, s; infinite: not yet, or it is not measured.
    """

    def __init__(self) -> None:
        self._from_pa = self._to_pa = nan
        self._offset_pa = 0.0
        self._start_s = 0.0
        self._measured = False
        """Whether it was seen on its way."""
        self._answers_s = inf
        """How long answers take from the arrival on; infinite: none was seen."""
        self.followed = self.awaited = False
        self.after_s = inf

    def restart(self, time_s: float, pressure_pa: float, before_pa: float, command_pa: float, *, at_rest: bool) -> None:
        """Begin anew: the command changes now, Pa; a pressure, measured, at a rest has long arrived."""
        if at_rest:
            self._offset_pa = pressure_pa - before_pa
        self._from_pa, self._to_pa = pressure_pa, command_pa + self._offset_pa
        self._start_s, self.after_s = time_s, inf
        self.followed, self.awaited = True, self._from_pa != self._to_pa

    def lost(self) -> None:
        """Forget this change: the command has changed again at once."""
        self.followed, self.awaited, self.after_s = False, False, inf

    def add(self, time_s: float, pressure_pa: float) -> None:
        """Take a sample of the pressure, Pa, while it is awaited; NaN: it is not measured."""
        share = (pressure_pa - self._from_pa) / (self._to_pa - self._from_pa)
        if ON_ITS_WAY[0] < share < ON_ITS_WAY[1]:
            self._measured = True
        elif abs(share - 1.0) < ARRIVED:
            self.after_s, self.awaited = time_s - self._start_s, False

    def learn(self, answer_s: float) -> None:
        """Take how long after the change of the command a stem that moved has come to rest, s."""
        if self._measured and self.after_s < inf:
            before_s = FORGOTTEN * self._answers_s if self._answers_s < inf else 0.0
            self._answers_s = max(answer_s - self.after_s, before_s)

    @property
    def answered_s(self) -> float:
        """After what time, s, since the change a stem has answered; infinite: that is not known."""
        return self.after_s + self._answers_s if self._measured else inf
