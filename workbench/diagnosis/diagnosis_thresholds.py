"""Every number by which something of a diagnosis is decided after its search, with its unit and its reason.

`python -m benchmarks.thresholds` prints how kept cases move when each is changed by 30 %. What the search itself
decides by stands in its own rooms, `workbench/fit` and `workbench/select`. Where a test or a benchmark holds a number's
reason, it is named; of the others reason alone speaks.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class DiagnosisThresholds:
    """Of the whole room; each reason stands under its number."""

    # Landings alone (`judged_landings`)
    landings_a_parameter: int = 2
    """Fitted, to be exceeded: so many are met whatever the valve is. Half as many held out could be met by chance.
    `python -m benchmarks.slow_sampling` prints what is said of a closed loop."""

    # A mass that is kept (`kept_mass`)
    light_mass: float = 0.2
    """Of the valve file's mass, where a second search begins: one that is too heavy hides that a light one does
    better."""
    most_left: float = 0.5
    """Of the squares beyond the floor, with another mass: of what a valve scatters a mass imitates some, not most
    (`tests/workbench/test_kept_mass.py`)."""

    # A measured pressure beside the model's (`measured_pressure`)
    pressure_off: float = 0.03
    """Of F_c, that the pressures' difference is on the diaphragm: beyond it, it stands in for friction and spring. An
    I/P with 1.5 kPa of hysteresis made 294 N of 260 N of friction."""
    another_value: float = 0.02
    """Of a parameter by the command: beyond it the measured pressure is said to make it another."""

    # A measured pressure beside its command (`pressure_scale`)
    scale_off: float = 0.2
    """Of the span, by which a zero or a span is off. Another unit or an absolute pressure is off by more; a transmitter
    that shows 5 % too much is one as it is (`tests/workbench/test_pressure_scale.py`, as for the next ones)."""
    pressure_unfollowed: float = 1.0 / 3.0
    """Of the pressure's own changes, that the command leaves of them: beyond it there is no scale to speak of."""
    shortest_lag: float = 0.01
    """Sampling periods: as far as samples show it, the pressure is the command."""
    longest_lag: float = 1000.0
    """Sampling periods: a lag of 50 s seen at 20 Hz."""
    lags: int = 41
    """Eight a decade, each a third longer than the one before."""
    scale_rounds: int = 10
    """Of weighted least squares, which come to the least mean error."""
    pressure_none: float = 1e-3
    """Pa: no error at all, in those weights. Nobody reads a pressure so finely."""
    units_alike: float = 0.03
    """Of the ratio of two units, or of an atmosphere, within which it is named: a span behind a lag of 60 s is found to
    that. No two ratios lie nearer than 40 %."""

    # What a file says of its own effects (`moved_parameters`)
    moved: float = 0.01
    """Of the file's value: a smaller shift is no news, however narrow the interval."""

    # Positioner or packing (`positioner_or_packing`)
    other_cause: float = 0.5
    """Of what is needed, that must be excluded of the other where that is not needed: less would add little."""
    play_of_error: float = 4.0
    """Times what is left, that friction found from a measured pressure must be worth: noise of that pressure looks
    like a little friction."""
    friction_left: float = 1e-3
    """Of the fitted friction, in the valve without it: by it a stem comes to rest."""

    # What the sentence adds (`verdict_sentence`)
    static_at_least: float = 1.01
    """Static over sliding friction, up to which it came out at the least it can be."""
    scatter_of_noise: float = 3.0
    """Floor over the sensor's noise, from which on the valve itself scatters."""


DIAGNOSIS = DiagnosisThresholds()
