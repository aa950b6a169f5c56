"""The credit that a partial stroke test may claim: the mean probability of failure on demand, with it and without.

Of a single final element (1oo1) with a constant rate lambda of dangerous failures that nothing else shows, a share C_p
of which the partial stroke shows, a share C_f of all the proof test, and the rest nothing before the end of its life:

    PFD_avg = lambda/2 (C_p T_p + (C_f - C_p) T_f + (1 - C_f) T_l)      T_p, T_f, T_l their intervals
    without                                C_p = 0

(IEC 61508-6, annex B, with imperfect tests; for lambda T much less than 1.) A test that did not pass claims nothing.
"""

from dataclasses import dataclass

from positioner.tests_on_the_valve.program import require_within

DAYS_A_YEAR = 365.25  # Julian
HOURS_A_YEAR = 24.0 * DAYS_A_YEAR
LINEAR = 0.1
"""lambda T up to which the formula's linear form holds within 5 %."""
ASSUMPTIONS = (
    "one final element (1oo1), repair at once, dangerous failures at a constant rate",
    "the share of failures that a partial stroke shows is that of an analysis of this valve (FMEDA), not ours",
    "a partial stroke shows neither leakage through the seat nor the last part of the travel",
    "tests are done as often as is said here: the journal shows whether they were",
)


@dataclass(frozen=True, slots=True)
class Credit:
    """Rate per hour, shares, intervals in years."""

    rate_per_h: float
    partial_share: float
    proof_share: float
    partial_y: float
    proof_y: float
    life_y: float

    def require_possible(self) -> None:
        """Refuse what cannot be; InputError as `require_within`."""
        require_within(
            (
                ("--failure-rate-per-h", self.rate_per_h, 1e-12, 1e-3),
                ("--partial-coverage", self.partial_share, 0.0, self.proof_share),
                ("--proof-coverage", self.proof_share, 0.0, 1.0),
                ("--every-days", DAYS_A_YEAR * self.partial_y, 0.0, DAYS_A_YEAR * self.proof_y),
                ("--proof-every-years", self.proof_y, 0.0, self.life_y),
            ),
        )

    def pfd_avg(self, *, tested: bool) -> float:
        """Return the mean probability of failure on demand, with or without the partial stroke test.

        >>> round(Credit(1e-6, 0.6, 0.9, 1 / 12, 5.0, 20.0).pfd_avg(tested=False), 4)
        0.0285
        """
        partial = self.partial_share if tested else 0.0
        years = (
            partial * self.partial_y
            + (self.proof_share - partial) * self.proof_y
            + (1.0 - self.proof_share) * self.life_y
        )
        return 0.5 * self.rate_per_h * HOURS_A_YEAR * years

    def lines(self) -> list[str]:
        """Return what may be claimed, by which formula and under which assumptions."""
        with_it, without = self.pfd_avg(tested=True), self.pfd_avg(tested=False)
        limits = "" if self.rate_per_h * HOURS_A_YEAR * self.life_y < LINEAR else " (upper bound: the rate is high)"
        return [
            f"PFD_avg {with_it:.3g} with this test every {DAYS_A_YEAR * self.partial_y:.0f} days, "
            f"{without:.3g} without it{limits}",
            "by lambda/2 (C_p T_p + (C_f - C_p) T_f + (1 - C_f) T_l), "
            f"lambda {self.rate_per_h:g}/h, C_p {self.partial_share:g}, C_f {self.proof_share:g}, "
            f"T_f {self.proof_y:g} a, T_l {self.life_y:g} a",
            *(f"assumed: {each}" for each in ASSUMPTIONS),
        ]
