"""What the tests on the valve are judged and paced by: every number of this room, with its unit and its reason."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Shares are of the stroke where nothing else is said; times in s, pressures in Pa."""

    sigmas: float = 2.0
    """Of every +-: 19 of 20 lie inside."""
    changed_sigmas: float = 4.0
    """Deviations: of twenty figures one in a thousand comparisons is off by so much without a change."""
    worth: float = 0.02
    """Of a figure: less than this is no change that anybody acts on, however certain."""
    worth_of_span: float = 0.01
    """Of the travel, or of the bench set's span: the same of an end, which has no zero of its own. A reading at the
    closed end that is farther from 0 is off."""
    off: float = 0.05
    """Of what is recommended: a figure that is farther from it, for certain, is marked."""

    fewest_at_rest: int = 8
    """Samples of a rest: a slope and its scatter need some."""
    fewest_in_bin: int = 5
    """Samples at an end, in a bin, or of one way: of fewer no level is taken."""
    fewest_moving: int = 12
    """Samples between 10 and 90 %: of fewer no line is taken."""
    counted: int = 5
    """Samples whose median is where the stem is: as the daemon's, which breaks a test off by it."""

    rest_s: float = 2.0
    """At rest before and after a test that breaks a stem loose."""
    in_a_row: int = 3
    """Samples beyond the tolerance that are a motion: two are noise more often than a stem."""
    command_changed: float = 1e-4
    """Of the command: a change below it is none."""

    leg_span: float = 0.6
    """Of what the command spans in the record: what goes one way for less is no leg."""
    inner: tuple[float, float] = (0.1, 0.9)
    """Of the travel, where the spring rate is taken: the trade's."""
    beyond: float = 0.03
    """Of the commands that move the stem: so far beyond the bend it lies at its end."""
    end_quantiles: tuple[float, float] = (0.02, 0.98)
    """Of a leg's positions, where its ends are first looked for."""
    end_agrees: float = 0.1
    """Of the travel: a level farther from where the end was looked for is none."""
    bins: int = 40
    """Of a leg, in which the position is averaged for the first guess."""
    passes: int = 6
    """Of the choice of rows: each takes them by the line before; the fourth changes nothing any more."""
    scatter_by_chance: float = 5.2
    """Share of the noise's variance, over the root of its samples, by which a line's scatter is more: 3 sqrt(3)."""
    parallel_sigmas: float = 3.0
    """Deviations of a line's slope within which it is the spring's: of six lines of one slope, one in 60 times one lies
    beyond; at two deviations, one time in four."""
    same_rate: float = 0.1
    """Rates that differ by less are one."""
    held: float = 0.1
    """Of how far the command goes from sample to sample: no line is better, for it is held between them."""
    moved_sigmas: float = 5.0
    """Deviations of the noise beyond which a stem has moved; no tolerance is below."""

    rate_ratio: float = 6.0
    """Of the fast rate to the slow one, q. A stem that sticks at the slow rate shows friction F_m, one that slides at
    the fast one F_c: at no rate that is (F_m - F_c) / (q - 1) too much. The slow ramp's error grows by q / (q - 1)."""
    least_rate_ratio: float = 3.0
    """The same where the time limit leaves no more: with less the slow ramp's error grows by more than half."""
    end_held_s: float = 1.0
    """At each end of a ramp, for the stem to come to rest."""
    slowest_leg_s: float = 60.0
    """Slower than this a ramp adds time and no precision: the stem sticks and slips."""
    shortest_leg_s: float = 5.0
    """Faster than this no ramp is slow."""
    of_time_limit: float = 0.95
    """Of the time limit of the experiments, that a program takes: the way to its first command is in it, too."""
    band_edge: float = 0.05
    """Of the travel at each end, where no error band is taken: in one direction the stem lies on a stop there."""
    stroke_wrong: float = 0.05
    """A travel farther from the file's is another stroke than the file says."""
    springless: float = 0.5
    """Of the commands between the ramps up and down: a stem that crosses its travel within less has no spring."""
    supply_lacking: float = 0.05
    """Of the commands' span: a measured pressure farther from the command at its extremes is no supply, or no I/P."""

    slow: float = 1.5
    """Of the reference's time to the travel, above which a partial stroke is slow."""
    at_an_end: float = 0.02
    """A stem so near an end is pressed onto it, and has to be back there after a partial stroke."""
    same_command: float = 0.02
    """Of it: commands before two tests that differ by more are not the same."""

    one_way: float = 0.45
    """Of the time limit, of a continuous stroke: forth, and once it has moved, back."""
    shortest_way_s: float = 1.0
    """Of a continuous stroke, however short the time limit."""

    back_parts: int = 10
    """Steps that a dead band as expected takes, back,"""
    onward_parts: int = 50
    """and onward, where less moves the stem."""
    leap: float = 1.3
    """Of the dead band: what moves the stem for sure."""
    onward_steps: int = 14
    """Steps onward, and"""
    back_steps: int = 15
    """back: half as much again as a dead band as expected."""

    watched_s: float = 3.0
    """Before anything moves, for noise, digit and creep."""
    creep_s: float = 30.0
    """From the least command to the most, while the direction is sought."""
    stroke_held_s: float = 6.0
    """At each end, for a stroke to be over."""
    leak_s: float = 12.0
    """Under the command held, for a leak to show;"""
    settling_s: float = 3.0
    """of these, after which the stem rests."""
    seen_sigmas: float = 10.0
    """How far the reading must go to have moved: deviations of its noise,"""
    seen_digits: float = 20.0
    """its digits,"""
    seen_m: float = 1e-4
    """m, or rad."""
    arrived: float = 0.98
    """Of the travel: a stroke is over,"""
    arrived_sigmas: float = 3.0
    """or so many deviations of the noise before it."""
    inner_air: tuple[float, float] = (0.2, 0.8)
    """Of what the pressure spans, where its rate is taken: its ends are rounded by the I/P."""
    as_commanded: float = 0.9
    """Of the command's rate: a pressure that is as fast shows the command and no limit of its own."""
    pressed: float = 0.15
    """Of the bench set's span, above the command that takes the stem to its upper end: what presses it there."""
    supply_margin: float = 0.05
    """Of the same: with less the supply is hardly enough."""
    rounded_pa: float = 1000.0
    """A limit of the pressure is given in whole kPa."""


THRESHOLDS = Thresholds()
