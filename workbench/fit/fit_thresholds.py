"""Every number by which a fit decides something, with its unit and its reason.

`python -m benchmarks.thresholds` prints how kept cases of the blind campaign move when each is changed by 30 %. Where
another command measured one, it stands below its number.
"""

from dataclasses import dataclass

from scipy.special import ndtri


@dataclass(frozen=True, slots=True)
class Effort:
    """How long is searched."""

    simulations: int
    """At most."""
    enough: float = 1e-2
    """Relative fall of the cost in a step that ends the search; by default of one that is gone on with."""


@dataclass(frozen=True, slots=True)
class Weights:
    """How residuals are weighed (`workbench.fit.likelihood`)."""

    block_samples: int = 20
    """Of a block of a rest: at 200 Hz a lag of the sensor shows in blocks of a tenth of a second."""
    landing_noises: float = 0.2
    """tau: two integrations of one law end a slide that far apart, however long its rest is averaged."""
    break_away_noises: float = 2.0
    """Of what the spring makes of them: a break-away tells F_s no better than the record tells where the stem is,"""
    load_of_friction: float = 1e-3
    """nor than this share of F_c: the laws of two integrations differ by as much."""
    soft_noises: float = 5.0
    """Residuals beyond which one counts by its amount alone: a wild sample is no evidence."""
    gone_noises: float = 12.0
    """That a stem goes from its rest that has broken loose: by less a packing yields, or a thread creeps."""
    wild_noises: float = 1e6
    """Residual of a sample where the model has no answer."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """How far a valve may be off its data sheet."""

    off_factor: float = 2.0
    """Of friction, up and down, where the data sheet's leads to no end at the noise; of damping, from which on the data
    sheet's and a fit's are two: what an engineer may be off by."""
    less_damping_factors: tuple[float, ...] = (0.7, 0.5, 0.35, 0.25)
    """Factors from which searches begin where a stem may swing past its balance."""
    spring_deviation: float = 0.15
    """Of a logarithm, as the next: a weak prior while landings lead."""
    coulomb_deviation: float = 0.4
    viscous_deviation: float = 0.7
    static_deviation: float = 0.1
    """Of F_s / F_c."""


@dataclass(frozen=True, slots=True)
class Guesses:
    """What the positions suggest (`workbench.fit.guesses`)."""

    end_quantile: float = 0.002
    """Of the positions: they end there and at the same from above."""
    inside_noises: float = 4.0
    """From the ends, where stops are tried, to the powers 0, 1 and 2."""
    aside_of_swept: float = 0.1
    """Outside of them, where a stop is that none comes to."""
    fewest_samples: int = 8
    """Of a rest that counts: its median is then within half a noise."""
    fewest_rests: int = 6
    """Or delays, that show what they have in common."""
    most_samples: int = 500
    """That stand in for rests: each costs a cosine at every step of S(q)."""
    most_quanta: int = 8
    """Likely ones from which a search may begin."""
    finest_noises: float = 2.0
    """A quantum is sought from so many,"""
    finest_of_rests_noises: float = 0.8
    """in rests, whose noise is less, from so many,"""
    coarsest_of_swept: float = 8.0
    """to the swept positions divided by so many."""
    sure_samples: int = 60
    """Of a rest, from which on it counts no more than another: its noise is no longer what matters."""
    steps_a_lobe: float = 8.0
    """Of S(q), in which its peaks are sought."""


@dataclass(frozen=True, slots=True)
class Onsets:
    """How onsets are sought (`workbench.fit.onsets`)."""

    reach_periods: int = 3
    """About where an onset shows, in which it lies: the first samples in motion are within the noise. So many samples
    before and after a move count one by one: each speaks against one that is early or late."""
    tries: int = 3
    """Rounds of first tries, of the onsets that did not keep in all together what they promised."""
    step_periods: float = 0.5
    """An onset is tried once, twice and four times this about where it shows; then moves by it at most in a round."""
    unseen_step_periods: float = 10.0
    """The same where the stem may move before it is seen to: it has left by as much as its play takes."""
    rounds: int = 6
    """Of parabolas: the bottom takes two, a step that is taken back two more."""
    coarse_rounds: int = 2
    """The same before a coarse search: it moves onsets itself."""
    shorter_factor: float = 0.3
    """Factor on the step where it led higher."""
    shift_periods: float = 0.1
    """For derivatives."""


@dataclass(frozen=True, slots=True)
class Damping:
    """How lambda follows the steps, as usual (Nocedal and Wright, Numerical Optimization, 4.1 and 10.3)."""

    least_lambda: float = 1e-4
    most_lambda: float = 100.0
    """Where no step so short leads lower, none does: what is left is the arithmetic's."""
    poor_share: float = 0.25
    """Share of what a step promised, below which lambda grows, and J is taken anew."""
    good_factor: float = 0.2
    poor_factor: float = 2.0
    failed_factor: float = 10.0
    """On lambda: after a good step, a poor one, and one that led higher."""
    free_lambda: float = 0.1
    """Lambda up to which a small step is small by itself and not by lambda."""
    longest_step: float = 0.3
    """Of a coordinate, a logarithm mostly, in a step without damping: one that hardly matters is not thrown about."""
    share_to_bound: float = 0.8
    """Of the way to a bound that one step takes at most: a coordinate that a first step throws there is lost."""

    @property
    def first_lambda(self) -> float:
        """Lambda at the beginning: a failure above the least."""
        return self.failed_factor * self.least_lambda

    @property
    def good_share(self) -> float:
        """Share of what a step promised, from which on lambda falls: it lacks no more than a poor one gains."""
        return 1.0 - self.poor_share


@dataclass(frozen=True, slots=True)
class Descent:
    """How far and how finely is searched (`workbench.fit.minimiser`)."""

    step: float = 1e-4
    """Of a coordinate, for its derivatives: a simulation is smooth to a hundredth of that."""
    wide_step: float = 3e-3
    """The same where a search stays on an edge, whose slope over so little is that of one side.
    `python -m benchmarks.blind`: without, clean 81003 ended at 6.4 of the noise's cost, with it at 0.88."""
    wide_landings: float = 3.0
    """Deviations of landings that count as one at the beginning, lest one of them decides the valley."""
    glimpse: Effort = Effort(20)
    """Derivatives and a dozen steps: of 22 records of one effect that one is among the first three then."""
    by_landings: Effort = Effort(40)
    """Landings alone: three times as long ends in the same valleys."""
    coarse: Effort = Effort(60)
    """To tell a valley from another."""
    whole: Effort = Effort(400, 1e-4)
    """To its end, a tenth of a nat of a thousand residuals: one that takes more is not to be had."""


@dataclass(frozen=True, slots=True)
class Ends:
    """When two ends are one, and how places about an end are drawn (`workbench.fit.ends`).

    `python -m benchmarks.intervals`: with places, 136 of 151 intervals of clean records held the truth, without 127.
    """

    same_nats: float = 1.0
    """Cost within which two ends are one; half of it is not worth a round for onsets."""
    same_cost: float = 1.01
    """Factor on the cost, and `same_nats` besides, within which two searches have come to the same."""
    same_start_nats: float = 1e-3
    """Within which the record tells no strength from another: the first is taken, a stop that nothing comes to is none.
    """
    at_the_noise: float = 1.3
    """Cost over half the number of residuals, up to which nothing is left that another start might find."""
    near_cost: float = 2.0
    """Factor on the cost of the best valley, within which another is searched to its end, too."""
    settle_rounds: int = 5
    """Of onsets and coordinates at most: two take nearly all."""
    draws: int = 32
    """Places of a round, one simulation each.
    `python -m benchmarks.blind`: 16 left the play of few_slips 1015 in a worse valley."""
    spread_deviations: float = 1.5
    """Of places: the next valley lies beyond what this one leaves open, but not far."""
    vain_rounds: int = 2
    """In a row that come to nothing lower, after which an end is believed."""
    most_rounds: int = 6
    """Of places."""
    gain_nats: float = 0.1
    """By which an end is lower than another: a third of a deviation."""

    @property
    def onset_nats(self) -> float:
        """Cost within which onsets are as good. The later is taken: a stem let go before it is pushed shows not what
        breaks it loose."""
        return 0.5 * self.same_nats


@dataclass(frozen=True, slots=True)
class Intervals:
    """What a record leaves open (`workbench.fit.uncertainty`); `python -m benchmarks.intervals` counts what holds."""

    outside_probability: float = 0.05
    """Of the truth, that an interval of 95 % leaves."""
    fewest_free: float = 2.0
    """Degrees of freedom of Student's t: of one, an interval is three times as wide as of two."""
    moves_together: int = 3
    """That one disturbance may outlast: slips of a ramp follow each other in some tenths of a second."""
    earliest_deviations: float = 2.0
    """By which what breaks a stem loose is above its mean: of six independent values the largest is 2.0 of its own
    above theirs (of two 0.7, of twenty 3.6). A stem that is slowly loaded is broken loose by the largest."""
    farthest_deviation: float = 8.0
    """Deviation of a coordinate, a logarithm mostly, of which a record says nothing."""
    undetermined_deviation: float = 1.0
    """Deviation of a logarithm, a factor of e, from which on the curvature does not determine it."""
    involved_component: float = 0.3
    """Component of a unit vector from which a parameter is named as part of a combination."""
    static_values: int = 13
    """Of static friction tried in its interval: a free run is the same between the break-aways that each brings."""
    bound_of_range: float = 1e-3
    """Of a coordinate, within which it is at the end of it."""
    out_deviations: float = 2.0
    """From the end of a range to where the cost would be least: the record wants the parameter beyond it."""

    @property
    def upper_probability(self) -> float:
        """Probability of what is below the upper end."""
        return 1.0 - 0.5 * self.outside_probability

    @property
    def deviations(self) -> float:
        """Half of a normal quantity's interval, as tables have it."""
        return round(float(ndtri(self.upper_probability)), 2)

    @property
    def rise_nats(self) -> float:
        """Cost above the least at an interval's ends, as tables have it."""
        return round(0.5 * self.deviations**2, 2)


@dataclass(frozen=True, slots=True)
class FitThresholds:
    """Of the whole room; each reason stands under its number."""

    weights: Weights = Weights()
    sheet: Sheet = Sheet()
    guesses: Guesses = Guesses()
    onsets: Onsets = Onsets()
    descent: Descent = Descent()
    damping: Damping = Damping()
    ends: Ends = Ends()
    intervals: Intervals = Intervals()
    nothing: float = 1e-12
    """Of what is scaled to one: what arithmetic leaves of zero."""


FIT = FitThresholds()
