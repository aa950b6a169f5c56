"""What a site sets for the law of slides, and its thresholds: each with its unit and why it is so large."""

from dataclasses import dataclass

from positioner.control.pressure_clamp import clamped
from positioner.estimation.landings.static_identification import LONGEST_WAY

DAY_S = 86400.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SlideThresholds:
    """The law's numbers. "Of the way" is of how far a slide is sent; "of the stroke" of the full travel."""

    return_margin: float = 1.02
    """Break-away distances that the second of two slides is given: the stem must not stay where the first took it."""
    missed: float = 0.05
    """Of the way, by which a slide may miss its aim: slides on drawn valves miss by a third of that."""
    missed_deviations: float = 2.0
    """Deviations of landings, by which it may, too: what scatters teaches nothing of break-away."""
    gave_way: float = 0.5
    """Of the way: a stem that went no farther was not broken loose, its packing gave way."""
    sent_alike: float = 0.15
    """Of the way: slides that were sent so nearly as far show the same of break-away."""
    far_short: float = 0.25
    """Of the way: no balance is so far off, so that a slide which falls so short has only begun to break loose."""
    longest_giving: float = LONGEST_WAY
    """Of the stroke: no packing gives way farther."""
    gone_on: float = 2.0
    """Of the way: a stem that went farther crept there, or was pushed."""
    first_distance: float = 0.1
    """Of F_c/k_s: the first guess of a break-away distance, where neither a slide nor F_s has told one."""
    rounded_quanta: float = 0.5
    """Quanta by which a position may be rounded."""
    other_side: float = 1.05
    """Factor on how far an excursion by the other side leaves the way between: it takes longer."""
    no_farther: float = 2e-3
    """Of the stroke: a first slide that will go on by less has done its work ..."""
    watched_s: float = 0.02
    """... by the speed seen in this time, s: a quantum of 12 bits in it is 1.2 % of stroke a second."""
    tried: int = 2
    """Landings of a move after which a slide goes as far as has surely broken loose: what may do is tried once."""
    far: float = 2.0
    """Break-away distances from a stem that moves, beyond which a new reference is followed at once."""
    noise_deviations: float = 2.5
    """Deviations of the mean position of a rest within which an error is none."""
    noise_quanta: float = 0.6
    """Quanta within which an error is none: half by rounding, and a tenth for the mean."""
    presliding: float = 0.9
    """Of the longest way that held, by which a packing is loaded beyond sliding friction: what gives way may creep."""
    preslid_within: float = 0.5
    """Of the error, which a packing must be known to leave, lest a slide be better."""
    most_preslid: int = 4
    """Direct moves for one reference: each leaves a fraction of the error before it."""
    widening: float = 1.5
    """Factor on the dead band for every two landings beyond the free ones: why the moves come to an end."""
    free_landings: int = 2
    """Landings of a move after which what slides scatter by counts."""
    most_slides: int = 14
    """Slides for one reference; on drawn valves 99 % of the moves take six or fewer."""
    refill_s: float = 60.0
    """s, in which two slides come back to a move that has used them up."""
    stuck_after: int = 3
    """Slides in a row that hold, each as long as has broken loose: one may be luck, and friction grows."""
    middle: float = 0.5
    """Of the stroke: where break-away distances are kept."""
    slope_reach: float = 0.1
    """Of the stroke, to either side: by what is between, a slope is known; by less, a landing amiss would bend it."""
    flattest: float = 0.25
    """Of the slope of the straight law, and of its friction: no valve has less of it anywhere."""
    scan_s: float = 1.2
    """s: a DCS writes at least so often, or it writes steps."""
    references_kept: int = 6
    """Changes of the reference: of these its course is told."""
    overdue: float = 1.5
    """Of the longest of their intervals: then no further one comes."""
    taken_back: float = 3.0
    """Mean changes, D: a stem so far off is not met by chance."""
    coming: int = 8
    """References to come, N, that a ramp is counted on for."""
    a_trend: int = 3
    """Changes in one direction: fewer are chance."""
    steps_alike: int = 4
    """Steps that are a slow ramp ..."""
    alike_step_factor: float = 2.0
    """... the factor by which they and their intervals may differ: steps of a hand hardly do so ..."""
    ramp_step_s: float = 60.0
    """... and s, by which they may be apart: a reference that stands for longer rests, and is to be met."""


THRESHOLDS = SlideThresholds()
"""Of the law as it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlideBounds:
    """What the site sets: m, Pa, s."""

    stroke_m: float
    dead_band_m: float
    minimum_pa: float
    maximum_pa: float
    breakaway_pa: float | None = None
    """F_s/A where it is known."""
    excursion_limit_m: float
    excursion_interval_s: float = 0.0
    """Least time between two excursions."""
    budget_m_per_s: float = 0.0
    """Travel that they may cost, of which a day's may be spent at once; 0: no limit."""
    command_step_pa: float = 0.0
    """The least difference of two commands that the device is told."""
    thresholds: SlideThresholds = THRESHOLDS

    @property
    def longest_giving_m(self) -> float:
        """How far a packing gives way at the most, m: a stem that has gone farther has slid."""
        return self.thresholds.longest_giving * self.stroke_m

    def allowed_pa(self, pressure_pa: float) -> float:
        """Return the allowed pressure, Pa, that is nearest to one; NaN of one that is not finite."""
        return clamped(pressure_pa, self.minimum_pa, self.maximum_pa)

    def allows(self, pressure_pa: float) -> bool:
        """Whether a pressure, Pa, is within the limits."""
        return self.minimum_pa <= pressure_pa <= self.maximum_pa
