"""One step of the controller: supervise, follow the reference, identify, choose the state, command.

`step` is a function of the memory, the sample and the requests; what it remembers is in the frozen `Memory` and in
the running integrals of the identification. It reads no clock.
"""

from dataclasses import dataclass, replace

from config.codes import Fault, InhibitReason, Mode, State
from positioner.control import breakaway_law as breakaway
from positioner.control.balance_law import balance_pa
from positioner.control.breakaway_law import Breakaway
from positioner.control.reference import Reference
from positioner.control.requests import Requests
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.control.sine_excitation import Swing
from positioner.control.states import Situation, state_in, why_not_the_law
from positioner.control.supervision import Watch, supervise, usable
from positioner.estimation.acceptance import Applied, accept
from positioner.estimation.estimates import Estimates
from positioner.estimation.online import Identification
from positioner.estimation.refiner import Refiner


@dataclass(frozen=True, slots=True)
class Running:
    """An excitation under way, or one that ended by its time limit and waits for eta_1 = 1."""

    swing: Swing
    start_s: float
    ended: bool = False


@dataclass(frozen=True, slots=True)
class Spent:
    """Writes whose mode was left since: a reference or a manual pressure does not come back by itself."""

    reference_writes: int = 0
    manual_writes: int = 0


@dataclass(frozen=True, slots=True)
class Memory:
    """What the controller remembers from one step to the next."""

    command_pa: float
    """The last command given."""
    held_pa: float
    """What S0 holds, and what it gets back after S3."""
    watch: Watch
    reference: Reference
    applied: Applied
    spent: Spent
    state: State
    running: Running | None
    identifying: bool
    breakaway: Breakaway | None
    """Of the law for small moves; None: the seed's law."""


@dataclass(frozen=True, slots=True)
class Decision:
    """What one step decided, for the wire, the registers and the recorder."""

    command_pa: float
    state: State
    mode: Mode
    fault: Fault
    why: InhibitReason
    reference_m: float
    delta_r_m: float
    sample_age_s: float
    estimates: Estimates
    applied: Applied


class Controller:
    """The control core with its memory. `held_pa` is the command the device has at the start: it is held."""

    def __init__(self, settings: Settings, held_pa: float, refiner: Refiner | None = None) -> None:
        self._settings = settings
        self._identification = Identification(settings.identification, refiner)
        self._memory = Memory(
            command_pa=held_pa,
            held_pa=held_pa,
            watch=Watch(),
            reference=Reference(0.0),
            applied=settings.applied,
            spent=Spent(),
            state=State.S0_START,
            running=None,
            identifying=False,
            breakaway=breakaway.at_start(settings.breakaway) if settings.breakaway else None,
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
    spent = _spent(memory, watch.mode, requests)
    reference = _reference(memory, watch.mode, spent, sample, requests, settings)
    running, refusal = _excitation(memory, watch.mode, reference, sample, requests, settings)
    identifying, applied = _identify(memory, running, sample, requests, settings, identification)
    situation = Situation(
        automatic=watch.mode is Mode.AUTOMATIC,
        exciting=running is not None and not running.ended,
        law_ready=applied.ratios is not None,
        delta_r_m=reference.delta_m,
    )
    state = state_in(situation)
    held_pa = _held_pa(memory, state, watch, sample)
    small = _small_moves(memory, state, reference, sample, settings, applied, identification.estimates)

    if watch.fault is not Fault.NONE:
        wanted_pa = settings.safe_pa(settings.limits.action_on(watch.fault), held_pa)
    elif watch.mode is Mode.MANUAL and requests.manual_writes != spent.manual_writes:
        wanted_pa = requests.manual_pa
    else:
        wanted_pa = _pressure_pa(state, held_pa, running, sample.now_s, reference, applied, small)
    command_pa = min(max(wanted_pa, settings.minimum_pa), settings.maximum_pa)

    why = refusal if refusal is not InhibitReason.NOTHING else why_not_the_law(situation)
    if why is InhibitReason.NOTHING and command_pa != wanted_pa:
        why = InhibitReason.LAW_BEYOND_LIMITS
    if why is InhibitReason.NOTHING and small is not None:
        why = small.why
    decision = Decision(
        command_pa=command_pa,
        state=state,
        mode=watch.mode,
        fault=watch.fault,
        why=why,
        reference_m=reference.value_m,
        delta_r_m=reference.delta_m,
        sample_age_s=sample.now_s - watch.good_s,
        estimates=identification.estimates,
        applied=applied,
    )
    return Memory(command_pa, held_pa, watch, reference, applied, spent, state, running, identifying, small), decision


def _spent(memory: Memory, mode: Mode, requests: Requests) -> Spent:
    """Return which writes are used up: those whose mode is left now."""
    before, spent = memory.watch.mode, memory.spent
    if mode is before:
        return spent
    return Spent(
        requests.reference_writes if before is Mode.AUTOMATIC else spent.reference_writes,
        requests.manual_writes if before is Mode.MANUAL else spent.manual_writes,
    )


def _reference(
    memory: Memory, mode: Mode, spent: Spent, sample: Sample, requests: Requests, settings: Settings
) -> Reference:
    """Return the reference in force. Outside automatic it follows the stem: delta r counts from where the stem is."""
    if mode is Mode.AUTOMATIC:
        written = requests.reference_writes != spent.reference_writes
        start = memory.reference if memory.watch.mode is mode else _at_the_stem(memory, sample, settings)
        return start.follow(requests.reference_m) if written else start
    return _at_the_stem(memory, sample, settings)


def _at_the_stem(memory: Memory, sample: Sample, settings: Settings) -> Reference:
    return Reference(sample.position_m if usable(sample, settings.limits) else memory.reference.value_m)


def _excitation(
    memory: Memory, mode: Mode, reference: Reference, sample: Sample, requests: Requests, settings: Settings
) -> tuple[Running | None, InhibitReason]:
    """Return the excitation under way, and why none is when one was asked for."""
    if mode is not Mode.AUTOMATIC or requests.eta[0] != 0:
        return None, InhibitReason.NOTHING
    running = memory.running
    if running is None:
        return _begun(memory, reference, sample, requests, settings)
    if running.ended:
        return running, InhibitReason.EXCITATION_TOO_LONG
    if sample.now_s - running.start_s > settings.excitation_limit_s:
        return replace(running, ended=True), InhibitReason.EXCITATION_TOO_LONG
    return running, InhibitReason.NOTHING


def _begun(
    memory: Memory, reference: Reference, sample: Sample, requests: Requests, settings: Settings
) -> tuple[Running | None, InhibitReason]:
    alpha_pa = requests.alpha_pa if requests.alpha_pa > 0 else _educated_guess_pa(memory, reference)
    swing = Swing(alpha_pa, requests.beta_pa, requests.omega_rad_per_s)
    refusal = swing.problem(settings.minimum_pa, settings.maximum_pa, settings.breakaway_pa)
    return (Running(swing, sample.now_s) if refusal is InhibitReason.NOTHING else None), refusal


def _educated_guess_pa(memory: Memory, reference: Reference) -> float:
    """Return the constant pressure that keeps the stem near its reference (seed, 4.1)."""
    ratios = memory.applied.ratios
    if ratios is None:
        return memory.command_pa
    return balance_pa(reference.value_m, -1 if reference.delta_m < 0 else 1, ratios)


def _identify(
    memory: Memory,
    running: Running | None,
    sample: Sample,
    requests: Requests,
    settings: Settings,
    identification: Identification,
) -> tuple[bool, Applied]:
    """Run the estimators while eta_2 or eta_3 asks for it; what they find is applied when they are switched off."""
    parameters, friction = requests.eta[1] == 0, requests.eta[2] == 0
    wanted = (parameters or friction) and not (running is not None and running.ended)
    if not wanted:
        return False, accept(memory.applied, identification.estimates) if memory.identifying else memory.applied
    if not memory.identifying or (running is not None and memory.running is None):
        identification.restart()
    moves = identification.moves
    if usable(sample, settings.limits):
        identification.update(
            sample.time_s,
            sample.position_m,
            sample.pressure_pa,
            parameters=parameters,
            friction=friction,
            passive=requests.eta[0] == 1,
        )
    # No excitation ends, so what ordinary moves tell is applied move by move.
    told = identification.moves != moves
    return True, accept(memory.applied, identification.estimates) if told else memory.applied


def _held_pa(memory: Memory, state: State, watch: Watch, sample: Sample) -> float:
    """Return what to hold: the last command, for a push what follows it; over S3 the one before it.

    After a fault what a device came back with.
    """
    if sample.held_pa is not None and watch.fault is not Fault.NONE:
        return sample.held_pa
    if State.S3_IDENTIFY in (memory.state, state):
        return memory.held_pa
    return memory.command_pa if memory.breakaway is None else memory.breakaway.held_pa(memory.command_pa)


def _small_moves(
    memory: Memory,
    state: State,
    reference: Reference,
    sample: Sample,
    settings: Settings,
    applied: Applied,
    estimates: Estimates,
) -> Breakaway | None:
    """Return what the law for small moves remembers after this step, if it is the law."""
    if memory.breakaway is None or settings.breakaway is None:
        return None
    seen = breakaway.Seen(sample.now_s, sample.position_m, sample.pressure_pa, usable(sample, settings.limits))
    if state in (State.S1_UP, State.S2_DOWN) and applied.ratios is not None:
        return breakaway.step(memory.breakaway, seen, reference.value_m, applied.ratios, estimates, settings.breakaway)
    return breakaway.watch(memory.breakaway, seen, memory.command_pa)


def _pressure_pa(
    state: State,
    held_pa: float,
    running: Running | None,
    now_s: float,
    reference: Reference,
    applied: Applied,
    small: Breakaway | None,
) -> float:
    """Return the pressure of a state, Pa."""
    if state is State.S3_IDENTIFY and running is not None:
        return running.swing.pressure_pa(now_s - running.start_s)
    if state in (State.S1_UP, State.S2_DOWN) and applied.ratios is not None:
        if small is not None:
            return small.level_pa
        return balance_pa(reference.value_m, 1 if state is State.S1_UP else -1, applied.ratios)
    return held_pa
