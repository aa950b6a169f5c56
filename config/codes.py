"""Every code that a register serves: modes, states, faults, and why something was not done. Texts are said here only.

The numbers go over the wire: never renumber. A member is written `NAME = number, text`; the register table and the
documents list the texts by `texts`, so that none of them says otherwise.
"""

from enum import IntEnum
from typing import Self


class Code(IntEnum):
    """A number that is served, and what it says in plain words."""

    text: str

    def __new__(cls, number: int, text: str = "") -> Self:
        """Make a member of its number and its text."""
        member = int.__new__(cls, number)
        member._value_ = number
        member.text = text
        return member


def texts(codes: type[Code]) -> str:
    """Return `number text, number text, ...` of all members."""
    return ", ".join(f"{int(each)} {each.text}" for each in codes)


class Mode(Code):
    """Who commands the pressure."""

    HOLD = 0, "hold"
    MANUAL = 1, "manual"
    AUTOMATIC = 2, "automatic"


HOLD, MANUAL, AUTOMATIC = Mode
"""By these names for the control core: in Python 3.11 `Mode.HOLD` costs a call, and a cycle asks for dozens."""


class ServiceState(Code):
    """What the service does for a valve, beside the law's own states."""

    STARTING = 0, "starting: no good measurement yet; the device's pressure is held"
    SHADOW = 1, "shadow: reads and never writes"
    STANDBY = 2, "standby: the pressure is held, nobody commands"
    ACTIVE = 3, "active: an operator or the law commands"
    FAULT_HOLD = 4, "fault, and the pressure is held"
    FAULT_SAFE = 5, "fault, and the pressure is the safe one"
    STOPPED = 6, "stopped: the valve is left as configured, nobody is served"
    FAULT_MANUAL = 7, "fault, and an operator commands in manual"


class State(Code):
    """The states of the paper's control logic (4.1)."""

    S0_START = 0, "S0 start"
    S1_UP = 1, "S1 up"
    S2_DOWN = 2, "S2 down"
    S3_IDENTIFY = 3, "S3 identify"


S0, S1, S2, S3 = State
"""As the seed calls them."""


class Fault(Code):
    """Why the positioner has let go of the valve; latched until acknowledged."""

    NONE = 0, "none"
    NO_REPLY = 1, "no reply"
    STALE = 2, "the measurement has stood still"
    IMPLAUSIBLE = 3, "the measurement is impossible"
    DEVICE = 4, "the device reports that it is unfit"
    RESTARTED = 5, "the device restarted or missed commands: it holds another command than the last one"
    DCS_SILENT = 6, "DCS silent"
    STALLED = 7, "the daemon stood still"
    OTHER_MASTER = 8, "another master wrote the set point"
    TRAVEL_DEVIATION = 9, "the stem is away from its reference for too long"
    FROZEN_SENSOR = 10, "the position stands still while the pressure changes"
    POSITION_RATE = 11, "the position changes faster than the valve can"
    SATURATED = 12, "the command is at its limit for too long"
    OVERRUN = 13, "cycles or replies take longer than their period"
    COMMAND_RATE = 14, "the command changes faster than it may"
    COMMAND_NOT_FINITE = (
        15,
        "the daemon itself: its command was no finite number and was not given",
    )
    COMMUNICATION_LOST = 16, "the device heard no command for its own time-out, and acted by itself"


class Quality(Code):
    """What the last measurement is worth."""

    GOOD = 0, "good"
    REPEATED = 1, "repeated"
    LOST = 2, "lost"
    NO_NUMBER = 3, "no number"


GOOD, REPEATED, LOST, NO_NUMBER = Quality


class InhibitReason(Code):
    """Why the law, or the excitation, is not doing what was asked; served as register `why`."""

    NOTHING = 0, "as asked"
    NOT_AUTOMATIC = 1, "not automatic"
    NO_ESTIMATES = 2, "no estimates"
    NO_MOVE_ASKED = 3, "no move is asked for"
    ALPHA_BELOW_BREAKAWAY = 4, "alpha below break-away"
    EXCITATION_BEYOND_LIMITS = 5, "excitation beyond pressure limits"
    EXCITATION_TOO_LONG = 6, "excitation too long"
    AMPLITUDE_ZERO = 7, "amplitude is zero"
    LAW_BEYOND_LIMITS = 8, "the law asks for a pressure beyond the limits"
    STUCK = 9, "stuck: the longest slide allowed does not move the stem"
    TRIM_ENDED = 10, "the move ended outside the dead band"
    EXCURSION_BEYOND_LIMIT = 11, "a small move needs an excursion beyond [control] excursion_limit"
    EXCURSION_WAITS = 12, "a small move waits: the last excursion was too recent"
    STAIRCASE_IN_VAIN = 13, "the staircase of slides gave no static law (see its reason)"
    EXCURSION_BUDGET_SPENT = 14, "a small move waits: the day's excursions are spent"
    REFERENCE_COMES = 15, "a small move waits: the reference keeps changing"
    RESTORED_WAITS = 17, "a reference waits until the stem rests: what was restored is provisional"
    RESTORED_CONTRADICTED = 18, "the first landings contradict what was restored: identify the valve"
    EXCITATION_OUTSIDE_WINDOW = 19, "excitation: the stem is outside the travel window"
    EXCITATION_NO_CONSENT = 20, "excitation: no consent of the DCS"
    EXCITATION_VETOED = 21, "excitation: vetoed"
    EXCITATION_UNMEASURED = 22, "excitation waits for a good measurement"
    STAIRCASE_UNANSWERED = 23, "the staircase of slides: the stem does not answer; it is stuck, or its sensor is frozen"
    NOT_AT_REST = 24, "a slide waits: the stem creeps, or something else moves it"
    EXCITATION_FROM_BEFORE = (
        25,
        "excitation: eta_1 = 0 is older than the last fault or mode; write 1, then 0",
    )
    STAIRCASE_REVERSED = (
        26,
        "the staircase of slides: the position falls as the pressure rises; check wiring, scales and [valve] action",
    )
    CUT_OFF = 27, "the reference is beyond a cut-off: the stem is pressed onto its stop"
    PRESSURE_ELSEWHERE = 28, "a slide waits: the measured pressure differs from the command; the supply may be low"
    ONE_DIRECTION = (
        29,
        "one direction is identified: the first move the other way goes by steps until the stem has landed",
    )
    PRESLIDING = 30, "the packing gives way: the stem is moved directly, without a slide"
    STAIRCASE_LIMITED = (
        31,
        "the staircase of slides: within [pressure] the stem does not slide often enough both ways; friction is high",
    )


class Restored(Code):
    """What has become of what the daemon knew of the valve before it was started anew."""

    NOTHING = 0, "nothing was restored"
    PROVISIONAL = 1, "provisional: the first landings must agree"
    CONFIRMED = 2, "confirmed by the first landings"
    DROPPED = 3, "dropped: a landing contradicts it"
    REPLACED = 4, "replaced by an identification"


DROPPED, PROVISIONAL = Restored.DROPPED, Restored.PROVISIONAL


class ExperimentState(Code):
    """What a played experiment does, or what became of the last one; why one did not begin."""

    NONE = 0, "none since the start"
    UNDER_WAY = 1, "under way"
    RETURNING = 2, "on its way back to the command before"
    COMPLETE = 3, "complete"
    NOT_AUTOMATIC = 4, "not automatic"
    NO_CONSENT = 5, "no consent of the DCS"
    VETOED = 6, "vetoed"
    EXCITED = 7, "eta_1 is 0: S3 is asked for"
    NO_MEASUREMENT = 8, "no good measurement"
    OUTSIDE_WINDOW = 9, "the stem is outside the travel window"
    NO_SEQUENCE = 10, "no sequence: at least two points, times from 0 up"
    BEYOND_PRESSURE = 11, "pressures beyond the limits"
    TOO_FAST = 12, "faster than the rate limit"
    TOO_LONG = 13, "longer than the time limit"
    FAULT = 14, "fault (see there)"
    TURNED = 15, "complete: it turned at its travel and came back"
    BEYOND_BAND = 16, "the stem went beyond the band of the experiment"

    @property
    def played(self) -> bool:
        """Whether it came to its end, and was not broken off."""
        return self in (ExperimentState.COMPLETE, ExperimentState.TURNED)


class ValveTestVerdict(Code):
    """What a test on the valve comes to."""

    PASSED = 0, "passed"
    FRICTION_HIGH = 1, "friction high"
    FRICTION_LOW = 2, "friction low"
    TRAVEL_NOT_REACHED = 3, "the least travel was not reached"
    TRAVEL_EXCEEDED = 4, "the stem went too far"
    NOT_SEATED = 5, "the stem is not back where it was"
    DEVIATION = 6, "the stem does not rest before the test: something else moves it"
    PRESSURE_THRESHOLD = 7, "the pressure threshold was reached before the travel"
    NOT_MOVED = 8, "the stem did not move"
    NO_SUPPLY = 9, "the pressure does not follow the command: no supply, or no I/P"
    STROKE_DIFFERS = 10, "the travel is not that of the file"
    BROKEN_OFF = 11, "broken off"
    UNDETERMINED = 12, "undecided"
    CHANGED = 13, "figures have changed since the record it is compared with"
    SLOW = 14, "slower than the reference"
    NO_SPRING = 15, "no spring is seen: the stem goes from end to end at one command"


class Refusal(Code):
    """Why an estimate is not valid; 0 when it is."""

    VALID = 0, "valid"
    NOT_STARTED = 1, "identification has not been started"
    NOT_ASKED = 2, "this estimate was not asked for"
    WAITING_FOR_MOTION = 3, "the stem has not been seen to move yet"
    WINDOW_TOO_SHORT = 4, "the stem moves, but not for long enough yet"
    MOTION_ENDED = 5, "the stem stopped or turned too early"
    RECORD_BROKEN = 6, "the samples had a gap, or their clock jumped back; waits for a new motion"
    ILL_CONDITIONED = 7, "pressure or position varied too little to separate a, b and c"
    NOISE_DOMINATES = (
        8,
        "noise hides a, b and c, or the samples are too far apart",
    )
    TOO_UNCERTAIN = 9, "the standard deviation is larger than allowed"
    PARAMETERS_MISSING = 10, "friction needs a, b and c, which are not identified yet"
    A_POSITIVE = 11, "a came out positive: viscous friction would drive the stem"
    B_NOT_NEGATIVE = 12, "b did not come out negative: the spring would push the stem away from rest"
    C_NOT_POSITIVE = 13, "c did not come out positive: pressure would pull the stem back"
    K_NOT_NEGATIVE = 14, "k did not come out negative: Coulomb friction would drive the stem"
    B_OVER_C_NOT_NEGATIVE = 15, "b/c did not come out negative: more pressure would hold the stem lower"
    K_OVER_C_NOT_NEGATIVE = 16, "k/c did not come out negative: friction would drive the stem"
    IMPLAUSIBLE_CHANGE = 17, "the value is too far from the one in use"
    COMMANDS_MISSED = 18, "commands were missed in a gap of the samples: a, b and c cannot be separated"
    MASS_NOT_IDENTIFIABLE = (
        19,
        "the mass cannot be separated: pressure changes, or samples, are too slow; only b/c and k/c can be known",
    )
    MODEL_DOES_NOT_FIT = (
        20,
        "the motion does not fit the model: check the sensor for a jump, device.sampling, and "
        "identification.pressure_held",
    )
    LANDINGS_TOO_FEW = 21, "too few slides have ended in rest, or all in one direction"
    LANDINGS_NOT_STRAIGHT = 22, "the landings lie on no straight line: spring or friction change over the travel"
    CONTRADICTED_BY_LANDINGS = (
        23,
        "slides land elsewhere: there is a preload, or friction differs up and down",
    )
    LANDINGS_SHIFTED = (
        27,
        "the landings shifted at one moment: the sensor jumped, or the stem was moved; try again",
    )
    PRELOAD_EXPLAINS_AS_WELL = 28, "a preload would explain the motion as well, with another b/c"
    DRIFT_EXPLAINS_AS_WELL = 32, "a sensor that drifts would explain the motion as well, with another b/c or k/c"
    TOO_SLOW = 30, "the stem moves too slowly to show its inertia: excite it by steps"
    NO_BREAKAWAY = 31, "the stem has not been seen to break away from a rest"
    BROKEN_OFF = 29, "S3 was broken off: by a fault, another mode, or a stem that did not answer"


class Sampling(Code):
    """When a device samples, as an identification has found it out (`[device] sampling`)."""

    UNKNOWN = 0, "not found out, or neither: a device on its own clock"
    BEFORE = 1, "before: a reply shows the pressure that has acted until then"
    AFTER = 2, "after: a reply shows the pressure that acts from then on"


class Ne107Status(Code):
    """Status of a device by NAMUR NE 107, best first."""

    GOOD = 0, "good"
    MAINTENANCE_REQUIRED = 1, "M maintenance"
    OUT_OF_SPECIFICATION = 2, "S specification"
    FUNCTION_CHECK = 3, "C check"
    FAILURE = 4, "F failure"


class Ne107Cause(Code):
    """What a valve's NE 107 status rests on."""

    NONE = 0, "nothing"
    FAULT = 1, "fault"
    NOT_AUTOMATIC = 2, "not automatic"
    EXCITED = 3, "excited"
    NOT_IDENTIFIED = 4, "not identified"
    DCS_SILENT = 5, "DCS silent"
    BEYOND_LIMITS = 6, "the law asks for a pressure beyond the limits"
    STUCK = 7, "stuck"
    FRICTION_HIGH = 8, "friction high: packing tight"
    FRICTION_LOW = 9, "friction low: packing leaks"
    STICTION = 10, "stiction"
    TRAVEL = 11, "travel"
    REVERSALS = 12, "reversals"
    TRAVEL_DEVIATION = 13, "away from the reference"
    FROZEN_SENSOR = 14, "position stands still while the pressure changes"
    POSITION_RATE = 15, "position changes faster than the valve can"
    SATURATED = 16, "command at its limit"
    OVERRUN = 17, "cycles or replies too slow"
    COMMAND_RATE = 18, "command changes too fast"
    NOT_AT_REST = 19, "the stem does not come to rest"
    PRESSURE_ELSEWHERE = 20, "the measured pressure is not the one commanded"
    ONE_DIRECTION = 21, "one direction is identified; the other is not known"
    HIGH_HIGH = 22, "opening above its highest limit"
    HIGH = 23, "opening above its high limit"
    LOW = 24, "opening below its low limit"
    LOW_LOW = 25, "opening below its lowest limit"
    TEST_OVERDUE = 26, "a test on the valve is overdue"
    MODEL_CHANGED = 27, "the spring differs from the one identified first"


class EndTrend(Code):
    """What the closed end position has done over the last days."""

    NOT_KNOWN = 0, "not known: shut on too few days"
    STEADY = 1, "steady"
    RISING = 2, "rising: the plug seats ever higher; there is something on the seat"
    FALLING = 3, "falling: the plug seats ever lower, the seat wears"
    JUMPED = 4, "jumped: the zero has shifted"
    SCATTERED = 5, "scattered: the plug seats elsewhere each time"


class AlarmState(Code):
    """What becomes of an alarm (ISA-18.2)."""

    NORMAL = 0, "normal"
    UNACKNOWLEDGED = 1, "active, unacknowledged"
    ACKNOWLEDGED = 2, "active, acknowledged"
    RETURNED = 3, "returned to normal, unacknowledged"
    SHELVED = 4, "shelved"


class EventKind(Code):
    """What an event is; what `event_cause` numbers depends on it (`config.codes.CAUSES`)."""

    NONE = 0, "nothing has happened yet"
    STARTED = 1, "the daemon started"
    STOPPED = 2, "the daemon ended"
    FAULT = 3, "a fault is latched"
    FAULT_GONE = 4, "a fault is acknowledged and gone"
    ALARM = 5, "an alarm"
    ALARM_GONE = 6, "an alarm is over"
    MODE = 7, "the mode has changed"
    HEALTH = 8, "the NE 107 status has changed"
    EXCITED = 9, "the valve is excited"
    EXCITATION_ENDED = 10, "the excitation has ended"
    IDENTIFIED = 11, "an identification was applied"
    NOT_IDENTIFIED = 12, "an identification was refused"
    RESTORED = 13, "what was known before a restart is judged anew"
    EXPERIMENT = 14, "a played experiment"
    CONFIGURATION = 15, "the configuration has changed since the last start"
    HISTORY_GAP = 16, "the history has a gap"
    HISTORY_ANEW = 17, "the history was unreadable: it is set aside, and a new one begins"
    CLOCK_SET = 18, "the gateway's clock was set"
    LOCKED_OUT = 19, "the local switch locks out remote writes"
    LET_IN = 20, "the local switch permits remote writes again"
    ALARM_RAISED = 21, "an alarm is raised"
    ALARM_RETURNED = 22, "an alarm has returned to normal"
    ALARM_ACKNOWLEDGED = 23, "an alarm is acknowledged"
    ALARM_SHELVED = 24, "an alarm is shelved"
    ALARM_UNSHELVED = 25, "an alarm is unshelved"


CAUSES: dict[EventKind, type[Code]] = {
    EventKind.FAULT: Fault,
    EventKind.FAULT_GONE: Fault,
    EventKind.ALARM: Fault,
    EventKind.ALARM_GONE: Fault,
    EventKind.MODE: Mode,
    EventKind.HEALTH: Ne107Cause,
    EventKind.EXCITATION_ENDED: InhibitReason,
    EventKind.NOT_IDENTIFIED: Refusal,
    EventKind.RESTORED: Restored,
    EventKind.EXPERIMENT: ExperimentState,
    EventKind.ALARM_RAISED: Ne107Cause,
    EventKind.ALARM_RETURNED: Ne107Cause,
    EventKind.ALARM_ACKNOWLEDGED: Ne107Cause,
    EventKind.ALARM_SHELVED: Ne107Cause,
    EventKind.ALARM_UNSHELVED: Ne107Cause,
}
"""The code of an event's cause; of a kind that is not here the cause is 0, and a text says it."""
NO_CAUSE = (InhibitReason.NOTHING, Ne107Cause.NONE)
"""Such a cause is none, and nothing is said of it."""


def cause_text(kind: EventKind, cause: int) -> str:
    """Return what the number of an event's cause says; empty where there is none, or none that this version knows."""
    code = CAUSES.get(kind)
    if code is None or cause not in list(code):
        return ""
    found = code(cause)
    return "" if any(found is each for each in NO_CAUSE) else found.text
