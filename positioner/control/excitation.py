"""The excitation under way in S3: which one, and when it ends.

Its pressures are those of `sine_excitation`, as the DCS asks for them, or of `staircase_excitation`.

S3 lasts while eta_1 = 0 in automatic. An excitation that has had its time, or that is not permitted any more
(`permissives`), or a staircase that came to nothing, has ended: S3 is left, and only eta_1 = 1 makes room for another.
So it is with one that a fault or another mode has ended, and with one that was asked for while there was a fault: who
acknowledges and chooses automatic again wants the law back, and eta_1 = 0 from before does not excite the valve. Asked
for in another mode without a fault it begins with automatic: a DCS may write its registers in any order.
After a staircase whose steps the stem did not answer, or answered by going the other way, the law has to wait for that,
too: where the stem is nobody knows, so the command before S3 is held until somebody asks for something else.
"""

from dataclasses import dataclass, replace

from config.codes import AUTOMATIC, InhibitReason, Mode
from positioner.control.permissives import MEASURED, TIME, ExcitationLimits, missing
from positioner.control.reference import Reference
from positioner.control.requests import Requests
from positioner.control.settings import Settings
from positioner.control.sine_excitation import SineExcitation
from positioner.control.staircase_excitation import Staircase
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.static_identification import StaticIdentification

NOTHING = InhibitReason.NOTHING


@dataclass(frozen=True, slots=True)
class ActiveExcitation:
    """An excitation under way, or one that has ended and waits for eta_1 = 1; `inhibit_reason` then says why."""

    signal: SineExcitation | Staircase
    start_s: float
    inhibit_reason: InhibitReason = NOTHING

    @property
    def ended(self) -> bool:
        """Whether S3 is over."""
        return self.inhibit_reason is not NOTHING

    @property
    def unanswered(self) -> bool:
        """Whether it has ended because the stem did not answer, or went the other way."""
        return self.inhibit_reason in (InhibitReason.STAIRCASE_UNANSWERED, InhibitReason.STAIRCASE_REVERSED)

    @property
    def broken_off(self) -> bool:
        """Whether a fault or another mode has ended it, or a fault was there when it was asked for."""
        return self.inhibit_reason is InhibitReason.EXCITATION_FROM_BEFORE

    @property
    def by_slides(self) -> bool:
        """Whether it is a staircase."""
        return isinstance(self.signal, Staircase)

    def waits_for(self, statics: StaticIdentification) -> InhibitReason:
        """Return why the next step of a staircase waits longer than any stem takes that comes to rest."""
        return statics.detector.waits_for if self.by_slides and not self.ended else NOTHING

    def pressure_pa(self, now_s: float) -> float:
        """Return the pressure at a time, Pa."""
        if isinstance(self.signal, Staircase):
            return self.signal.level_pa
        return self.signal.pressure_pa(now_s - self.start_s)


def excitation_after(
    excitation: ActiveExcitation | None,
    mode: Mode,
    now_s: float,
    position_m: float | None,
    requests: Requests,
    settings: Settings,
    held_pa: float,
    reference: Reference,
    ratios: Ratios | None,
    *,
    faulty: bool,
) -> tuple[ActiveExcitation | None, InhibitReason]:
    """Return the excitation under way, and what inhibits one that was asked for.

    Args:
        excitation: before.
        mode: in force.
        now_s: of the sample.
        position_m: None without a good measurement.
        requests: of the DCS.
        settings: limits, and which excitation.
        held_pa: the last command, from which a staircase begins.
        reference: about whose balance a sine swings where nobody says alpha (seed, 4.1) ...
        ratios: ... by these; about what is held where there are none.
        faulty: a fault is latched.
    """
    if mode is not AUTOMATIC or requests.eta[0] != 0:
        from_before = requests.eta[0] == 0 and (excitation is not None or faulty)
        return (_ended(excitation or ActiveExcitation(Staircase(held_pa), now_s)) if from_before else None), NOTHING
    lacking = _lacking(requests, position_m, settings.excitation)
    if excitation is not None:
        if not excitation.ended:
            too_long = now_s - excitation.start_s > settings.excitation.longest_s
            ended_by = TIME.why if too_long else lacking
            if ended_by is not NOTHING:
                excitation = replace(excitation, inhibit_reason=ended_by)
        return excitation, excitation.inhibit_reason
    if position_m is None:
        return None, MEASURED.why
    if settings.staircase is not None or lacking is not NOTHING:  # one that is refused never commands
        return ActiveExcitation(Staircase(held_pa), now_s, lacking), lacking
    alpha_pa = requests.alpha_pa
    if alpha_pa <= 0:
        direction = -1 if reference.delta_m < 0 else 1
        alpha_pa = held_pa if ratios is None else ratios.balance_pa(reference.value_m, direction)
    sine = SineExcitation(alpha_pa, requests.beta_pa, requests.omega_rad_per_s)
    inhibit_reason = sine.problem(settings.minimum_pa, settings.maximum_pa, settings.breakaway_pa)
    if inhibit_reason is not NOTHING:
        return None, inhibit_reason
    return ActiveExcitation(sine, now_s), inhibit_reason


def _ended(excitation: ActiveExcitation) -> ActiveExcitation:
    """Return an excitation that another mode, or a fault, has ended; one that had ended has its reason."""
    if excitation.ended:
        return excitation
    return replace(excitation, inhibit_reason=InhibitReason.EXCITATION_FROM_BEFORE)


def _lacking(requests: Requests, position_m: float | None, limits: ExcitationLimits) -> InhibitReason:
    asked = requests.experiment
    lacking = missing(
        consented=asked.consented or not limits.by_consent,
        vetoed=asked.vetoed,
        position_m=position_m,
        window_m=(limits.low_m, limits.high_m),
    )
    return NOTHING if lacking is None else lacking.why


def climbed(
    excitation: ActiveExcitation, outcome: SlideOutcome | None, statics: StaticIdentification, settings: Settings
) -> ActiveExcitation:
    """Return a staircase with its next step, if the stem rests; any other excitation as it is.

    Only for a fresh sample: before the last step has been answered, the rest is that of the step before.
    """
    stairs, rest = excitation.signal, statics.detector.rest
    if not isinstance(stairs, Staircase) or settings.staircase is None or excitation.ended or rest is None:
        return excitation
    stairs, law_valid = stairs.counted(outcome, settings.staircase), statics.law.valid
    if stairs.over(law_valid):
        if law_valid:
            return excitation if stairs.complete else replace(excitation, signal=replace(stairs, complete=True))
        return replace(excitation, inhibit_reason=stairs.in_vain)
    if outcome is not None and stairs.unanswered(settings.staircase):
        return replace(excitation, inhibit_reason=InhibitReason.STAIRCASE_UNANSWERED)
    if stairs.is_reversed:
        return replace(excitation, inhibit_reason=InhibitReason.STAIRCASE_REVERSED)
    if stairs.enough(law_valid, settings.staircase):
        stairs = stairs.turned_to_close()
    return replace(excitation, signal=stairs.stepped(rest.position_m, settings.staircase))
