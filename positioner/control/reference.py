"""The reference r and its last change.

    delta r = r_new - r_old, kept until the reference changes again        (seed, 4.1)

Its sign says which way the stem moves once the transient is over, and so which law balances it.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Reference:
    """The reference in force, m, and its last change, m."""

    value_m: float
    delta_m: float = 0.0

    def follow(self, asked_m: float) -> "Reference":
        """Return the reference, m, after it was asked for; asking for the same again changes nothing.

        >>> Reference(0.0625).follow(0.03125).follow(0.03125)
        Reference(value_m=0.03125, delta_m=-0.03125)
        """
        if asked_m == self.value_m:
            return self
        return Reference(asked_m, asked_m - self.value_m)
