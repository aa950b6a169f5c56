"""What permits a commanded test, be it the excitation of S3 or a played experiment: one table for both.

What is missing at the start refuses the test; what goes away later ends it. Neither comes back by itself: a test that
was refused or broken off begins when it is asked for anew. After it the law has the command that it had before.
`docs/reliability.md` shows the table. Consent, veto and travel are judged here, for both; the rest by whom it concerns:
`excitation` for S3, `played_experiment` (`_refusal`) for an experiment.
"""

from dataclasses import dataclass

from config.codes import ExperimentState, InhibitReason

AT_ONCE, WAY_BACK, GOES_ON = "at once, the law", "the way back, then the law", "nothing"


@dataclass(frozen=True, slots=True)
class Permissive:
    """A condition of a test.

    Attributes:
        condition: in words.
        key: of the daemon's file, or the register, that it hangs on.
        why: said of S3 where it is missing.
        experiment: said of a played experiment.
        excitation_later, experiment_later: what its end does to a test under way.
    """

    condition: str
    key: str
    why: InhibitReason
    experiment: ExperimentState
    excitation_later: str
    experiment_later: str


NO_FAULT = Permissive(
    "no fault is latched",
    "register `fault`",
    InhibitReason.NOT_AUTOMATIC,
    ExperimentState.FAULT,
    "at once, the fault's action",
    "at once, the fault's action",
)
AUTOMATIC = Permissive(
    "mode automatic",
    "register `mode`",
    InhibitReason.NOT_AUTOMATIC,
    ExperimentState.NOT_AUTOMATIC,
    "at once, the pressure before is held",
    "at once, the pressure before is held",
)
ASKED = Permissive(
    "the DCS asks: eta_1 = 0 for S3; eta_1 = 1 and a start for an experiment",
    "registers `eta_1`, `experiment_start`",
    InhibitReason.NOTHING,
    ExperimentState.EXCITED,
    AT_ONCE,
    "at once, S3",
)
CONSENT = Permissive(
    "the DCS consents; S3 only where the file asks for it",
    "register `experiment_consent`, `[excitation] consent`",
    InhibitReason.EXCITATION_NO_CONSENT,
    ExperimentState.NO_CONSENT,
    AT_ONCE,
    WAY_BACK,
)
NO_VETO = Permissive(
    "no operator's veto",
    "register `experiment_veto`",
    InhibitReason.EXCITATION_VETOED,
    ExperimentState.VETOED,
    AT_ONCE,
    WAY_BACK,
)
MEASURED = Permissive(
    "a good measurement to begin with: S3 waits for a new one, an experiment takes the last",
    "register `quality`",
    InhibitReason.EXCITATION_UNMEASURED,
    ExperimentState.NO_MEASUREMENT,
    GOES_ON,
    GOES_ON,
)
TRAVEL_WINDOW = Permissive(
    "the stem is inside the travel window",
    "`[excitation] permitted_travel`, `[experiment] travel_window`",
    InhibitReason.EXCITATION_OUTSIDE_WINDOW,
    ExperimentState.OUTSIDE_WINDOW,
    AT_ONCE,
    WAY_BACK,
)
PRESSURES = Permissive(
    "its pressures are inside the limits",
    "`[pressure]`, `[experiment] minimum_pa`, `maximum_pa`",
    InhibitReason.EXCITATION_BEYOND_LIMITS,
    ExperimentState.BEYOND_PRESSURE,
    "never beyond",
    "never beyond",
)
TIME = Permissive(
    "it is inside the time limit",
    "`[excitation] limit_s`, `staircase_limit_s`, `[experiment] limit_s`",
    InhibitReason.EXCITATION_TOO_LONG,
    ExperimentState.TOO_LONG,
    AT_ONCE,
    "is refused before it begins",
)
PERMISSIVES = (NO_FAULT, AUTOMATIC, ASKED, MEASURED, NO_VETO, CONSENT, TRAVEL_WINDOW, PRESSURES, TIME)


@dataclass(frozen=True, slots=True)
class ExcitationLimits:
    """What permits S3: s, m, and whether the DCS must consent beside asking for it."""

    longest_s: float
    low_m: float
    high_m: float
    by_consent: bool


def missing(
    *, consented: bool, vetoed: bool, position_m: float | None, window_m: tuple[float, float]
) -> Permissive | None:
    """Return what of consent, veto and travel does not permit a test; None if nothing.

    Where nothing was measured, position None, the stem does not count as outside.
    """
    if vetoed:
        return NO_VETO
    if not consented:
        return CONSENT
    low_m, high_m = window_m
    return TRAVEL_WINDOW if position_m is not None and not low_m <= position_m <= high_m else None
