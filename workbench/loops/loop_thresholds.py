"""Every number by which something of a loop is decided, with its unit and its reason.

`python -m benchmarks.loops` prints what they lead to.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Of the whole room; each reason stands under its number."""

    fewest_samples: int = 100
    """Below it a lag, a dead time and a disturbance have less than 20 samples each."""
    fewest_cycles: float = 4.0
    """Cycles: a regular oscillation shows from some four on (Thornhill 2003 asks for ten half periods)."""
    fewest_a_cycle: float = 8.0
    """Samples: below it rest and slip of one half cycle share a sample."""
    fewest_turns: int = 2
    """Turns of OP by a quarter of its span: stiction is what it must go after one, and shows at no other place."""
    turn_share: float = 0.25
    """Of OP's span that it must come back to have turned."""
    gap_periods: float = 5.0
    """Sampling periods without a sample that part a record."""
    most_missing: float = 0.05
    """Share of samples without a value, beyond which what is filled in would count."""
    most_manual: float = 0.2
    """Share of the record in manual: OP is then no answer to PV."""
    most_saturated: float = 0.2
    """Share of samples at a limit of OP: the controller is then not in charge."""
    saturation_pct: float = 0.1
    """% of OP from 0 or 100: the resolution of a controller's limit."""
    most_straight: float = 0.5
    """Share of moving samples exactly on a straight line, from which on a historian drew them."""
    straight_tolerance: float = 1e-6
    """Of the signal's span: what counts as exactly straight; stored numbers have six to seven digits."""
    fewest_levels: int = 10
    """Distinct values over the span of a signal: stiction is told from rounding only when it is several of them."""
    setpoint_moves: float = 0.25
    """Of the variance of PV, from which on the set point is said to move."""
    regular: float = 1.0
    """Mean over three standard deviations of the zero crossings' distance: Thornhill's limit of an oscillation."""
    rows_a_cycle: float = 24.0
    """Rows a cycle in which causes are compared: a third of one is then a dead time of eight rows."""
    stem_rows_a_cycle: float = 120.0
    """Rows a cycle in which the stem is told its output: a slip is found to 3 degrees."""
    most_rows: int = 4000
    """Of the comparison, 170 cycles: seconds of a processor."""
    law_is_seen: float = 0.5
    """Share of OP's changes that a PI law explains, from which on the law is taken as seen."""
    sticks_probability: float = 0.92
    """From which on a loop is called sticking: of 284 held-out drawn loops that are, three are wrong; one more would be
    4.7 % in a plant of which one loop in five sticks."""
    other_probability: float = 0.2
    """Below which another cause is named: 6 of 103 such held-out drawn loops stick, where half of all do."""
    interval_cost: float = 1.92
    """Nats by which the likelihood may fall inside a 95 % interval: half the chi-square of one parameter."""
    size_within: float = 0.2
    """Of S, to which it is told: what a maintenance plan asks. Where the likelihood leaves more open, S is not told;
    where it leaves less, the model of the stem is no better: 95 % of the drawn loops it is told of lie within."""
    together_period: float = 0.05
    """Relative difference of periods below which loops oscillate together."""


LIMITS = Thresholds()
