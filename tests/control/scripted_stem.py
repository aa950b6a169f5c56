"""A stem of a few equations under the law of slides, in virtual time: thousands of moves a second.

A slide lands where spring and Coulomb friction balance, give or take a scatter; it begins where the balance lies
farther ahead than the break-away distance, of going on or of turning. Until then its packing gives way in proportion.
Nothing else of a valve is in it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import nan

import numpy as np

from config.codes import InhibitReason
from positioner.control.laws.slides.now import Now
from positioner.control.laws.slides.slide_law import SlideSettings, let_go, stepped
from positioner.control.laws.slides.slide_memory import SlideMemory
from positioner.control.laws.slides.slide_pressure import Balance
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.breakaway_distance import BreakawayDistance, Interval
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.stem_at_rest import Rest

STROKE_M = 0.1
SLOPE_PA_PER_M = 800e3
STEP_S = 0.5


@dataclass
class ScriptedStem:
    """A valve and its law."""

    settings: SlideSettings
    up_pa: float
    down_pa: float
    """φ_up, φ_down."""
    onward_m: float
    turning_m: float
    scatter_m: float
    rng: np.random.Generator
    gives_m_per_pa: float = 0.0
    """How far the packing of the stuck stem gives way."""
    known_off: float = 0.0
    """By which share the law knows friction amiss."""
    position_m: float = 0.5 * STROKE_M
    direction: int = 1
    now_s: float = 0.0
    landings: list[SlideOutcome] = field(default_factory=list)
    held: list[SlideOutcome] = field(default_factory=list)
    stuck_m: float = field(init=False)
    """Where it stuck last."""
    memory: SlideMemory = field(init=False)
    states: list[tuple[type, type]] = field(default_factory=list)
    commands_pa: list[float] = field(default_factory=list)
    answered_pa: float = 0.0
    stuck: bool = False

    def __post_init__(self) -> None:
        held_pa = SLOPE_PA_PER_M * self.position_m + 0.5 * (self.up_pa - self.down_pa)
        long = Interval(broke_m=3.0 * self.onward_m, seen=True)  # as a staircase leaves it
        begun = self.settings.begin(held_pa).memory
        self.memory, self.commands_pa = replace(begun, distances=BreakawayDistance(long, long)), [held_pa]
        self.answered_pa, self.stuck_m = held_pa, self.position_m

    @property
    def balance(self) -> Balance:
        up_pa, down_pa = ((1.0 + self.known_off) * each for each in (self.up_pa, self.down_pa))
        ratios = Ratios(-SLOPE_PA_PER_M, -0.5 * (up_pa + down_pa), 0.5 * (up_pa - down_pa))
        return Balance(
            ratios=ratios,
            landings=tuple(self.landings[:20]),
            held=tuple(self.held[:20]),
            stroke_m=STROKE_M,
            now_s=self.now_s,
        )

    def scattered_m(self) -> float:
        """Return how far a slide lands off its balance, m."""
        return float(self.rng.normal(0.0, self.scatter_m))

    def lands_m(self, command_pa: float, direction: int) -> float:
        """Return where slides in a direction land under a command, m, but for their scatter."""
        return (command_pa - direction * (self.up_pa if direction > 0 else self.down_pa)) / SLOPE_PA_PER_M

    def needs_m(self, direction: int) -> float:
        """Return how far a slide must be sent from where the stem stuck, m, to break loose."""
        return self.onward_m if direction == self.direction else self.turning_m

    def answer(self) -> SlideOutcome | None:
        """Let the stem answer the command in force; return what it did, None where it has answered that."""
        command_pa, answered_pa, before_m = self.commands_pa[-1], self.answered_pa, self.position_m
        if command_pa == answered_pa:
            return None
        self.answered_pa = command_pa
        for s in (1, -1):
            lands_m = self.lands_m(command_pa, s)
            if not self.stuck and s * (lands_m - self.stuck_m) >= self.needs_m(s):
                self.position_m = min(max(lands_m + self.scattered_m(), 0.0), STROKE_M)
                self.direction, self.stuck_m = s, self.position_m
                break
        else:
            self.position_m += 0.0 if self.stuck else self.gives_m_per_pa * (command_pa - answered_pa)
        s = 1 if command_pa > answered_pa else -1
        moved = self.stuck_m == self.position_m and abs(self.position_m - before_m) > 5e-3 * STROKE_M
        free = 0.01 * STROKE_M < self.position_m < 0.99 * STROKE_M
        went = self.direction if moved else s
        outcome = SlideOutcome(
            time_s=self.now_s,
            direction=went,
            from_m=before_m,
            command_pa=command_pa,
            position_m=self.position_m,
            std_m=1e-7,
            moved=moved,
            landing=moved and free,
            from_pa=answered_pa,
        )
        if not moved:
            self.held.insert(0, outcome)
        return outcome

    def come_free(self) -> None:
        """Let a stuck stem answer the command in force."""
        self.stuck, self.answered_pa = False, nan

    def now(
        self,
        reference_m: float,
        position_m: float,
        *,
        rest: Rest | None = None,
        outcome: SlideOutcome | None = None,
        waits_for: InhibitReason = InhibitReason.NOTHING,
    ) -> Now:
        """Return what a step is decided from, of a stem that is seen somewhere, m."""
        return Now(
            now_s=self.now_s,
            position_m=position_m,
            rest=rest,
            quantum_m=0.0,
            reference_m=reference_m,
            balance=self.balance,
            bounds=self.settings,
            outcome=outcome,
            waits_for=waits_for,
        )

    def once(self, reference_m: float) -> None:
        """Let one step at rest go by, with what the last change of the command did."""
        self.now_s += STEP_S
        before, outcome = self.memory, self.answer()
        if outcome is not None and outcome.landing:
            self.landings.insert(0, outcome)
        rest = Rest(self.position_m, 1e-7, 1e-7, 100, 0.1)
        self.memory = stepped(self.memory, self.now(reference_m, self.position_m, rest=rest, outcome=outcome))
        self.states.append((type(before.state), type(self.memory.state)))
        self.commands_pa.append(self.memory.command_pa)

    def moving(self, reference_m: float, position_m: float, waits_for: InhibitReason = InhibitReason.NOTHING) -> None:
        """Let one step go by in which the stem is seen somewhere, on its way."""
        self.now_s += STEP_S
        before = self.memory
        self.memory = stepped(self.memory, self.now(reference_m, position_m, waits_for=waits_for))
        self.states.append((type(before.state), type(self.memory.state)))

    def moved_to(self, reference_m: float, steps: int = 60) -> int:
        """Ask for a reference, m; return how often the command changed until it had stood for long."""
        changes, still = 0, 0
        for _ in range(steps):
            before_pa = self.memory.command_pa
            self.once(reference_m)
            changed = self.memory.command_pa != before_pa
            changes, still = changes + changed, 0 if changed else still + 1
            if still > 4:
                break
        return changes

    def interrupted(self, command_pa: float) -> None:
        """Let another state command for a step."""
        before = self.memory
        self.answer()
        self.memory = let_go(self.memory, command_pa, self.settings)
        self.states.append((type(before.state), type(self.memory.state)))
        self.commands_pa.append(command_pa)
        self.answer()


SETTINGS = SlideSettings(
    stroke_m=STROKE_M, dead_band_m=5e-5, minimum_pa=0.0, maximum_pa=200e3, excursion_limit_m=0.5 * STROKE_M
)


def drawn_stems(count: int, seed: int = 0) -> Iterator[ScriptedStem]:
    """Yield stems with friction, asymmetry, preload, packings and knowledge drawn at random."""
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        friction_pa = SLOPE_PA_PER_M * STROKE_M * float(np.exp(rng.uniform(np.log(0.02), np.log(0.12))))
        asymmetry, preload_pa = rng.uniform(-0.3, 0.3), rng.uniform(0.0, 20e3)
        onward_m = friction_pa / SLOPE_PA_PER_M * rng.uniform(0.05, 0.4)
        yield ScriptedStem(
            SETTINGS,
            up_pa=float((1 + asymmetry) * friction_pa + preload_pa),
            down_pa=float((1 - asymmetry) * friction_pa - preload_pa),
            onward_m=float(onward_m),
            turning_m=float(onward_m + rng.choice((0.0, 1.0)) * rng.uniform(0.0, 0.02) * STROKE_M),
            scatter_m=float(rng.uniform(0.0, 2e-4)) * STROKE_M,
            known_off=float(rng.uniform(-0.01, 0.01)),
            rng=rng,
        )
