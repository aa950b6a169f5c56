"""One step of the controller: supervise, follow the reference, identify, choose the state, command.

`step` is a function of the memory, the sample and the requests; what it remembers is in the frozen `Memory` and in
the running integrals of the identification. It reads no clock.
"""

from dataclasses import dataclass, replace

from config.registers import Fault, Mode, Why
from positioner.control.excitation import Swing
from positioner.control.law import balance_pa
from positioner.control.reference import Reference
from positioner.control.requests import Requests
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.control.states import Situation, State, state_in, why_not_the_law
from positioner.control.supervision import Limits, Watch, supervise, usable
from positioner.estimation.applied import Applied, accept
from positioner.estimation.estimate import Estimates
from positioner.estimation.identification import Identification


@dataclass(frozen=True, slots=True)
class Running:
    """An excitation under way, or one that ended by its time limit and waits for eta_1 = 1."""

    swing: Swing
    start_s: float
    ended: bool = False


@dataclass(frozen=True, slots=True)
class Memory:
    """What the controller remembers from one step to the next."""

    command_pa: float
    """The last command given."""
    held_pa: float
    """What S0 holds, and what it gets back after S3."""
    applied: Applied
    watch: Watch
    reference: Reference
    state: State = State.S0_START
    running: Running | None = None
    identifying: bool = False
    reference_writes: int = 0
    manual_writes: int = 0


@dataclass(frozen=True, slots=True)
class Decision:
    """What one step decided, for the wire, the registers and the recorder."""

    command_pa: float
    state: State
    mode: Mode
    fault: Fault
    why: Why
    reference_m: float
    delta_r_m: float
    sample_age_s: float
    estimates: Estimates
    applied: Applied


class Controller:
    """The control core with its memory. `held_pa` is the command the device has at the start: it is held."""

    def __init__(self, settings: Settings, held_pa: float) -> None:
        self._settings = settings
        self._identification = Identification(settings.identification)
        self._memory = Memory(
            command_pa=held_pa,
            held_pa=held_pa,
            applied=settings.applied,
            watch=Watch(),
            reference=Reference(0.0),
        )

    @property
    def command_pa(self) -> float:
        """The last command given."""
        return self._memory.command_pa

    def step(self, sample: Sample, requests: Requests) -> Decision:
        """Decide on one sample."""
        self._memory, decision = step(self._memory, sample, requests, self._settings, self._identification)
        return decision


def step(
    memory: Memory, sample: Sample, requests: Requests, settings: Settings, identification: Identification
) -> tuple[Memory, Decision]:
    """Return what is remembered and what is decided after one sample."""
    watch = supervise(memory.watch, sample, memory.command_pa, requests, settings.limits)
    memory = _changed_mode(memory, watch, sample, requests, settings.limits)
    automatic = watch.mode is Mode.AUTOMATIC
    if automatic and requests.reference_writes != memory.reference_writes:
        memory = replace(memory, reference=memory.reference.follow(requests.reference_m))

    running, refusal = _excitation(memory, sample, requests, settings, automatic)
    identifying, applied, estimates = _identify(memory, running, sample, requests, settings, identification)
    situation = Situation(
        automatic=automatic,
        exciting=running is not None and not running.ended,
        law_ready=applied.ratios is not None,
        delta_r_m=memory.reference.delta_m,
    )
    state = state_in(situation)
    held_pa = memory.held_pa if State.S3_IDENTIFY in (memory.state, state) else memory.command_pa
    memory = replace(
        memory,
        watch=watch,
        running=running,
        identifying=identifying,
        applied=applied,
        state=state,
        held_pa=_adopted(held_pa, watch, sample),
    )
    wanted_pa = _wanted_pa(memory, sample, requests, settings)
    command_pa = min(max(wanted_pa, settings.minimum_pa), settings.maximum_pa)
    why = refusal if refusal is not Why.NOTHING else why_not_the_law(situation)
    if why is Why.NOTHING and command_pa != wanted_pa:
        why = Why.LAW_BEYOND_LIMITS
    decision = Decision(
        command_pa=command_pa,
        state=state,
        mode=watch.mode,
        fault=watch.fault,
        why=why,
        reference_m=memory.reference.value_m,
        delta_r_m=memory.reference.delta_m,
        sample_age_s=sample.now_s - watch.good_s,
        estimates=estimates,
        applied=applied,
    )
    return replace(memory, command_pa=command_pa), decision


def _changed_mode(memory: Memory, watch: Watch, sample: Sample, requests: Requests, limits: Limits) -> Memory:
    """Make every change of mode bumpless.

    Outside automatic the reference follows the stem, so that delta r is counted from where the stem is. A reference
    or a manual pressure written in another mode waits for its mode; one that was in force when its mode was left
    does not come back by itself.
    """
    before, now = memory.watch.mode, watch.mode
    if now is not Mode.AUTOMATIC and usable(sample, limits):
        memory = replace(memory, reference=Reference(sample.position_m))
    if before is Mode.AUTOMATIC and now is not Mode.AUTOMATIC:
        memory = replace(memory, reference_writes=requests.reference_writes)
    if before is Mode.MANUAL and now is not Mode.MANUAL:
        memory = replace(memory, manual_writes=requests.manual_writes)
    return memory


def _adopted(held_pa: float, watch: Watch, sample: Sample) -> float:
    """Return what to hold: what a device has that came back, when a fault says that it is not ours to command."""
    if sample.held_pa is not None and watch.fault is not Fault.NONE:
        return sample.held_pa
    return held_pa


def _excitation(
    memory: Memory, sample: Sample, requests: Requests, settings: Settings, automatic: bool
) -> tuple[Running | None, Why]:
    """Return the excitation under way, and why none is when one was asked for."""
    if not automatic or requests.eta[0] != 0:
        return None, Why.NOTHING
    running = memory.running
    if running is not None:
        ended = running.ended or sample.now_s - running.start_s > settings.excitation_limit_s
        return replace(running, ended=ended), Why.EXCITATION_TOO_LONG if ended else Why.NOTHING
    swing = Swing(
        requests.alpha_pa if requests.alpha_pa > 0 else _educated_guess_pa(memory),
        requests.beta_pa,
        requests.omega_rad_per_s,
    )
    refusal = swing.problem(settings.minimum_pa, settings.maximum_pa, settings.breakaway_pa)
    return (Running(swing, sample.now_s) if refusal is Why.NOTHING else None), refusal


def _educated_guess_pa(memory: Memory) -> float:
    """Return the constant pressure that keeps the stem near its reference (seed, 4.1)."""
    ratios = memory.applied.ratios
    if ratios is None:
        return memory.command_pa
    direction = -1 if memory.reference.delta_m < 0 else 1
    return balance_pa(memory.reference.value_m, direction, ratios)


def _identify(
    memory: Memory,
    running: Running | None,
    sample: Sample,
    requests: Requests,
    settings: Settings,
    identification: Identification,
) -> tuple[bool, Applied, Estimates]:
    """Run the estimators while eta_2 or eta_3 asks for it; what they find is applied when they are switched off."""
    parameters, friction = requests.eta[1] == 0, requests.eta[2] == 0
    ended = running is not None and running.ended
    wanted = (parameters or friction) and not ended
    begins = wanted and (not memory.identifying or (running is not None and memory.running is None))
    if begins:
        identification.restart()
    if wanted and usable(sample, settings.limits):
        identification.update(
            sample.time_s, sample.position_m, sample.pressure_pa, parameters=parameters, friction=friction
        )
    applied = memory.applied
    if memory.identifying and not wanted:
        applied = accept(applied, identification.estimates)
    return wanted, applied, identification.estimates


def _wanted_pa(memory: Memory, sample: Sample, requests: Requests, settings: Settings) -> float:
    """Return the pressure that fault, mode or state asks for, Pa."""
    fault = memory.watch.fault
    if fault is not Fault.NONE:
        return settings.safe_pa(settings.limits.action_on(fault), memory.held_pa)
    if memory.watch.mode is Mode.MANUAL and requests.manual_writes != memory.manual_writes:
        return requests.manual_pa
    if memory.state is State.S0_START:
        return memory.held_pa
    if memory.state is State.S3_IDENTIFY and memory.running is not None:
        return memory.running.swing.pressure_pa(sample.now_s - memory.running.start_s)
    ratios = memory.applied.ratios
    assert ratios is not None  # S1 and S2 exist only with estimates
    return balance_pa(memory.reference.value_m, 1 if memory.state is State.S1_UP else -1, ratios)
