"""Every number by which a missing effect is sought and accepted, with its unit and its reason.

`python -m benchmarks.thresholds` prints how kept cases move when each is changed by 30 %.
"""

from dataclasses import dataclass
from math import log


@dataclass(frozen=True, slots=True)
class SelectionThresholds:
    """Of the whole room; each reason stands under its number."""

    # Evidence: twice a difference of log-likelihoods
    least_evidence: float = 10.0
    """On what was fitted, odds of 150 to 1: of twenty effects of which none is there, one has so much in one record of
    ten. Models within it are as likely. A residual hangs on the state if its R^2 has so much."""
    least_held_out: float = 6.0
    """On what was held out, odds of 20 to 1, from samples that no parameter was fitted to."""

    # What is left, and whether it is the floor
    at_floor: float = 1.6
    """Floors, a typical event's error at most: friction that is smooth where the model's is not (LuGre's) leaves
    1.5."""
    rarely_off: float = 1.75
    """Floors, the rms error at most: a few events may be worse than the typical one."""
    noise_known_to: float = 1.2
    """Floors or noises: what leaves no more leaves nothing that can be told from them. An rms over a hundred residuals
    scatters by 7 %, 1 / sqrt(2 n)."""
    nothing_left: float = 1.1
    """Floors up to which no other effect need be sought: one that adds half the floor to it, in squares, leaves
    1.12."""
    most_left: float = 0.1
    """Of the position's standard deviation: a model that leaves more explains little, however badly the valve
    repeats."""
    most_structure: float = 0.1
    """R^2 on the state above which a residual is not the noise's: of ten draws of noise none has as much."""
    most_break_away_squares: float = 4.0
    """Mean square of what break-aways are off by, in deviations: models that are right leave 1.0 on 47 of 47 records,
    an asymmetry that is called a preload some 36."""

    # How errors of two models are compared
    most_log_ratio: float = log(2.0)
    """What one event counts at most: one missed slip is not the whole of a comparison."""
    least_standard_error: float = 0.01
    """Of a mean logarithm: no better known, however equal the events."""
    same_standard_errors: float = 2.0
    """Standard deviations within which nothing is told apart, models or values of a parameter: 95 %."""
    negligible_error: float = 0.1
    """Of the noise: an error below it adds half a per cent to that, and does not matter."""
    negligible_pressure: float = 1e-3
    """Of the measured pressure's standard deviation: what an error below it is does not matter."""
    fewest_block_samples: int = 10
    """In a block of time, which is longer than a second where that holds fewer: its rms is then known to 22 %,
    1 / sqrt(2 n)."""
    noise_memory: int = 5
    """Samples over which what is no noise of a pressure transmitter goes on."""
    pressure_draws: int = 4
    """Of a measured pressure's noise, for each part: the floor takes the median over the blocks of all."""

    # What a fit leaves open of its parameters, over what was held out
    most_moved: float = 4.0
    """Deviations of a coordinate that a fit leaves open: farther is one in 16 000, and contradicts it."""
    left_open: float = 0.2
    """Deviation of a coordinate, of a logarithm mostly, from which on a step along the slope may not lead far
    enough."""
    places_tried: int = 10
    """Of such a coordinate on either side, to two deviations: of static friction a fifth of one apart."""

    # The search
    most_added: int = 3
    """Effects added at most: one more than a blind case hides (`python -m benchmarks.blind`)."""
    beam: int = 3
    """Models that a round goes on from, and effects searched to their ends whatever they cost, to fill it: of two
    effects that are missing, the second's best imitation is mostly second."""
    screened: int = 8
    """Effects tried beside a model that has one already: the right one stands in the first three by its tangents in
    seven of eight cases (`python -m benchmarks.first_ranking`)."""
    going_on_cost: float = 10.0
    """Factor on the least cost of the effects tried beside a model, up to which another is searched to its end, if it
    has any evidence; of forms beside what was named, on the cost of that. What is left of a coarse search lowers its
    cost by a tenth, seldom by half, rarely by more."""
    at_end: float = 0.2
    """Of the weakest start of a parameter: nearer to the end of its range it is at it."""

    # Structure: the R^2 of a residual on the state
    folds: int = 5
    """Stretches of a residual, each predicted from the others: four fifths of a record have most of its motions."""
    ridge: float = 0.03
    """Of the number of samples; the regressors have variance 1, and many go together."""
    fewest_rows: int = 100
    """Samples: four fifths of them are three to each of the 27 regressors."""

    # A play that friction stands in for
    detectable: float = 0.3
    """Of the noise: a change of the simulation below it adds a twentieth to it, and does not show."""
    least_play: float = 4.0
    """Noises: a play that narrow is not worth saying."""
    plays_tried: int = 16
    """From the least to the widest that friction can stand in for, each by the same factor wider."""
    slips_before: int = 2
    """After them the play has been taken up from either side, wherever the linkage stood at the start."""
    same_length: float = 1e-12
    """Of the stroke: as far as lengths come out different by the arithmetic alone."""

    @property
    def overwhelming_evidence(self) -> float:
        """Ten times the least, which leaves no doubt though what was held out does not show an effect.

        Needed, too, where a valve repeats itself no better than the model before is off: what scatters so is not
        independent in all that is counted so.
        """
        return 10.0 * self.least_evidence

    @property
    def same_reduction(self) -> float:
        """Part of an error by which it need not fall to be the same: what the least standard error leaves open."""
        return self.same_standard_errors * self.least_standard_error


SELECTION = SelectionThresholds()
