"""When a condition is more than chance: a test that may be looked at for ever, with a promise about false alarms.

    M_n = mean over k of M_n^k,      M_n^k = L_n^k (M_(n-1)^k + w_n),      M_0 = 0
    an alarm is raised when M_n >= Y, and M begins at 0 again

w_n is the time since the observation before, in years of a valve; Y is in years too. L_n^k is an e-value: while nothing
is wrong, its mean given all that was before is at most 1, for each bet k.

**The promise.** While nothing is wrong, E[alarms up to T] <= E[T] / Y, for every time T, also one that is chosen by
looking. Proof: let A_n be the number of alarms and t_n = w_1 + ... + w_n. Given the past,

    E[M_n + Y (new alarms)] <= E[L_n (M_(n-1) + w_n)] <= M_(n-1) + w_n

(an alarm takes away M >= Y and counts Y). So M_n + Y A_n - t_n is a supermartingale that begins at 0, and is at least
-t_n: for any stopping time with a finite mean, Y E[A_T] <= E[t_T]. No independence and no number of looks goes into it,
only that w_n is known before L_n is. (Shin, Ramdas, Rinaldo: E-detectors, 2022; there per observation, here per year.)

Several tests with one promise: each has Y times their number.
"""

from collections.abc import Sequence
from math import exp, log, log1p

SECONDS_A_YEAR = 365.25 * 86_400.0
LARGEST = 600.0
"""Of ln M, beyond which more evidence changes nothing."""


class EDetector:
    """M of one test.

    Args:
        threshold_years: Y.
        bets: how many.
    """

    def __init__(self, threshold_years: float, bets: int) -> None:
        self._threshold_years = threshold_years
        self._years = [0.0] * bets

    @property
    def evidence(self) -> float:
        """M as a share of Y; an alarm at 1."""
        return sum(self._years) / len(self._years) / self._threshold_years

    def enter(self, log_e_values: Sequence[float], lasted_s: float) -> bool:
        """Take an observation, ln L of each bet, a time after the last one, s; return whether an alarm is raised."""
        years = lasted_s / SECONDS_A_YEAR
        self._years = [
            exp(min(log_e + log(before + years), LARGEST)) if before + years > 0.0 else 0.0
            for before, log_e in zip(self._years, log_e_values, strict=True)
        ]
        if self.evidence < 1.0:
            return False
        self.restart()
        return True

    def restart(self) -> None:
        """Forget what was seen."""
        self._years = [0.0] * len(self._years)


def of_a_share(bad: int, good: int, at_most: float, bets: Sequence[float]) -> list[float]:
    """Return ln L of bets on a share, after trials of which each is bad with a chance of at most p_0 while all is well.

        L = (p / p_0)^bad ((1 - p) / (1 - p_0))^good          p > p_0 the bet

    Its mean grows with the chance of a bad one, and is 1 at p_0.
    """
    return [bad * log(bet / at_most) + good * (log1p(-bet) - log1p(-at_most)) for bet in bets]


def of_a_mean(excess: float, std: float, bets: Sequence[float]) -> list[float]:
    """Return ln L of bets on an excess whose mean is at most 0 while all is well, and whose error has a deviation.

        L = exp(l z - l^2 / 2),  z = excess / std             l > 0 the bet

    Its mean is at most 1 where the error is normal, or lighter in its tails (sub-Gaussian).
    """
    z = excess / std
    return [bet * z - 0.5 * bet * bet for bet in bets]
