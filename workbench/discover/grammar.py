"""The grammar of forms: a place on the valve's path, a variable in dimensionless terms, and a shape over it.

    force       F = -c g                                N, against opening
    drag        F = -c g sign v                         c >= 0: it never drives the stem
    one way     F = -|c| g sign v  where c v > 0        c > 0: opening, c < 0: closing
    added       F_c -> F_c + c g,  F_s -> F_s + c g     never below zero
    scaled      F_c -> F_c (1 + c g),  F_s -> F_s (1 + c g)
    static      F_s -> F_s + c g
    pressure    p = u - c g                             Pa
    indication  y -> y + c g                            m

    s = x / L held within 0 and 1       L stroke
    w = |v| / v_1                       v_1 = 1 m/s
    r = max(p, 0) / p_1                 p_1 = 100 kPa
    d, l, t                             rest so far, s; travel since the last reversal, of the stroke; time, s

A shape has one or two parameters of its own. What the bare valve already does stays out: a force in proportion to s is
its spring, a drag in proportion to w its viscous friction, a force in proportion to p its area.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from config.results.result import Brief


@dataclass(frozen=True, slots=True, repr=False)
class Quantity(Brief):
    """A parameter of a form as its file declares it: `sim.effect.Parameter`, with its symbol in the equation."""

    key: str
    symbol: str
    text: str
    least: float
    most: float
    starts: tuple[float, ...]
    scale: str = ""
    off: float | None = None
    given: bool = False


@dataclass(frozen=True, slots=True, repr=False)
class Shape(Brief):
    """What stands for g: its words, its equation and its expression in the variable's symbol, written {0}."""

    name: str
    words: str
    equation: str
    expression: str
    quantities: tuple[Quantity, ...] = ()
    imports: tuple[str, ...] = ()
    functions: str = ""
    """Of the file, which the expression calls."""


@dataclass(frozen=True, slots=True, repr=False)
class Variable(Brief):
    """What a shape goes over."""

    name: str
    words: str
    symbol: str
    equation: str
    """Of the symbol; empty where it stands for itself."""
    code: str
    """Line that works it out; empty where it is an argument."""
    arguments: tuple[str, ...]
    unit: str = "1"
    """In which a reader of a picture sees it."""
    quantities: tuple[Quantity, ...] = ()
    constants: tuple[str, ...] = ()
    memory: int = 0
    step_s: float | None = None
    upkeep: str = ""
    """Functions that keep its memory."""
    shared: tuple[str, ...] = ()
    """What it imports of `sim.first_order_lag`."""


@dataclass(frozen=True, slots=True, repr=False)
class Place(Brief):
    """Where a form acts, and its strength c."""

    name: str
    words: str
    function: str
    arguments: tuple[str, ...]
    returns: str
    equation: str
    result: str
    """Expression of g, in which {c} is the strength."""
    strength: Quantity
    inverse: bool
    """Whether the balance at rest is all of it, so that a daemon undoes it by solving for the pressure."""
    imports: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, repr=False)
class Form(Brief):
    """One sentence of the grammar."""

    place: Place
    variable: Variable
    shape: Shape

    @property
    def name(self) -> str:
        """Its name, which is that of its file."""
        over = f"_over_{self.variable.name}" if self.variable.name else ""
        return f"{self.place.name}{over}_{self.shape.name}"

    @property
    def words(self) -> str:
        """What it is, in words."""
        over = f" {self.variable.words}" if self.variable.words else ""
        return f"{self.place.words} that {self.shape.words}{over}"

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Its parameters, the strength first."""
        return (self.place.strength, *self.shape.quantities, *self.variable.quantities)

    @property
    def equations(self) -> tuple[str, ...]:
        """Its equation, line by line."""
        shape = self.shape.equation.format(self.variable.symbol)
        return tuple(each for each in (self.place.equation, shape, self.variable.equation) if each)

    @property
    def is_static(self) -> bool:
        """Whether it acts where the stem rests, without a memory: the landings show it."""
        return (
            self.place.name in {"force", "added", "scaled"} and not self.variable.memory and "v" not in self.arguments
        )

    @property
    def arguments(self) -> tuple[str, ...]:
        """What its function needs to know, in the order of the house."""
        parameters = ("q", "z") if self.variable.memory else ("q",)
        return tuple(dict.fromkeys((*self.place.arguments, *self.variable.arguments, *parameters)))


LENGTH = Quantity("travel_m", "L", "stroke", 1e-4, 100.0, (1.0,), "stroke_m", given=True)
STEP_S = 2e-3

POSITION = Variable(
    "position", "the position", "s", "s = x / L held within 0 and 1", "s = min(max(x / q.travel_m, 0.0), 1.0)", ("x",),
    quantities=(LENGTH,),
)  # fmt: skip
INDICATED = replace(POSITION, code="s = min(max(y / q.travel_m, 0.0), 1.0)", arguments=("y",),
                    equation="s = y / L held within 0 and 1")  # fmt: skip
SPEED = Variable(
    "speed", "the speed", "w", "w = |v| / v_1,   v_1 = 1 m/s", "w = abs(v) / V_1_M_PER_S", ("v",),
    constants=("V_1_M_PER_S = 1.0",),
)  # fmt: skip
PRESSURE = Variable(
    "pressure", "the pressure", "r", "r = max(p, 0) / p_1,   p_1 = 100 kPa", "r = max(p, 0.0) / P_1_PA", ("p",),
    constants=("P_1_PA = 1e5",),
)  # fmt: skip
BOTH = Variable(
    "position_and_pressure", "the position, times the pressure", "s",
    "s = x / L held within 0 and 1,   r = p / p_1,   p_1 = 100 kPa", "s = min(max(x / q.travel_m, 0.0), 1.0)",
    ("x", "p"), quantities=(LENGTH,), constants=("P_1_PA = 1e5",),
)  # fmt: skip
NOTHING = Variable("", "", "", "", "", ())
DIRECTION = Variable("direction", "the direction of motion", "direction", "", "", ("direction",))
TIME = Variable("time", "time", "t", "t time, s", "", ("t",), unit="s")
COMMAND = Variable("command", "the pressure that enters", "u", "u pressure that enters, Pa", "", ("u",), unit="Pa")
REST = Variable(
    "rest", "the rest before", "d", "d time since the stem last moved, s", "d = t - z[0]", ("t",), unit="s", memory=1,
    step_s=5e-4, constants=("LONG_AGO_S = -1e9",),
    upkeep='''def start(t: float, z: Memory) -> None:
    """Rested long."""
    z[0] = t + LONG_AGO_S


def advance(t: float, v: float, z: Memory) -> None:
    """Note when it last moved."""
    if v != 0.0:
        z[0] = t
''',
)  # fmt: skip
TRAVEL = Variable(
    "travel", "the travel since the last reversal", "l", "l = |x - x_r| / L,   x_r where the stem last turned",
    "l = abs(x - z[0]) / q.travel_m if direction == z[1] else 0.0", ("direction", "x"), quantities=(LENGTH,), memory=2,
    step_s=STEP_S,
    upkeep='''def start(x: float, z: Memory) -> None:
    """Turned where it stands."""
    z[0], z[1] = x, 0.0


def advance(before: float, after: float, z: Memory) -> None:
    """Note where it turned, and which way it goes."""
    if after != before:
        way = 1.0 if after > before else -1.0
        if way != z[1]:
            z[0], z[1] = before, way
''',
)  # fmt: skip


def _past(symbol: str, words: str) -> Variable:
    return Variable(
        "past", words, symbol, f"T z' = {symbol} - z", "", (symbol,), memory=1, step_s=5e-4,
        upkeep='''def start(signal: float, z: Memory) -> None:
    """Settled."""
    z[0] = signal


def advance(before: float, after: float, h: float, q: Parameters, z: Memory) -> None:
    """Let the past fade."""
    z[0] = lagged(z[0], before, after, h, q.time_constant_s)
''',
        shared=("lagged",),
    )  # fmt: skip


def _exponent(*starts: float) -> Quantity:
    return Quantity("exponent", "n", "exponent", 0.25, 6.0, starts)


def _place(*starts: float) -> Quantity:
    return Quantity("place", "a", "where, of the stroke", 1e-3, 1.0, starts)


def _width(least: float, most: float, text: str, *starts: float) -> Quantity:
    return Quantity("width", "b", text, least, most, starts)


def power(*starts: float) -> Shape:
    """A power, its exponent free."""
    return Shape("power", "goes with a power of", "g = {0}^n", "{0} ** q.exponent", (_exponent(*starts),))


def growing(*starts: float) -> Shape:
    """A power of the speed. A steeper one than the root is friction at the speeds that a recording tells apart."""
    shape = power(*starts)
    return replace(shape, quantities=(replace(shape.quantities[0], least=0.5, most=4.0),))


CONSTANT = Shape("constant", "is constant", "g = 1", "1.0")
SIGN = Shape("sign", "differs by", "g = 1 opening, -1 closing", "{0}")
KINK = Shape(
    "kink", "sets in at a place of", "g = max(0, {0} - a)", "max(0.0, {0} - q.place)", (_place(0.2, 0.4, 0.6, 0.8),)
)
STEP = Shape(
    "step", "changes at a place of", "g = (1 + tanh(({0} - a) / b)) / 2", "0.5 + 0.5 * tanh(({0} - q.place) / q.width)",
    (_place(0.15, 0.3, 0.45, 0.6, 0.75, 0.9), _width(1e-3, 0.5, "half-width, of the stroke", 0.02)), ("tanh",),
)  # fmt: skip
BUMP = Shape(
    "bump", "has a bump at a place of", "g = exp(-(({0} - a) / b)^2)",
    "exp(-(({0} - q.place) / q.width) * (({0} - q.place) / q.width))",
    (_place(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9), _width(1e-3, 0.5, "half-width, of the stroke", 0.025, 0.1)),
    ("exp",),
)  # fmt: skip
WAVES = (1.0, 1.5, 2.0, 2.6, 3.3, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0)
"""To a stroke."""
WAVE = Shape(
    "wave", "is wavy over", "g = sin(2 pi ({0} / b - a))", "sin(2.0 * pi * ({0} / q.width - q.place))",
    (
        Quantity("place", "a", "phase, of a wave", -1.0, 1.0, (0.0, 0.25)),
        _width(0.03, 2.0, "length of a wave, of the stroke", *(1.0 / k for k in WAVES)),
    ),
    ("pi", "sin"),
)  # fmt: skip
RISE = Shape(
    "rise", "grows to an end with", "g = 1 - exp(-{0} / T)", "1.0 - exp(-{0} / q.time_constant_s)",
    (Quantity("time_constant_s", "T", "time constant", 1e-3, 1e6, (0.1, 1.0, 10.0, 100.0)),), ("exp",),
)  # fmt: skip
LOGARITHM = Shape(
    "logarithm", "grows with the logarithm of", "g = log(1 + {0} / T)", "log(1.0 + min({0}, 1e6) / q.time_constant_s)",
    (Quantity("time_constant_s", "T", "time constant", 1e-3, 1e6, (0.1, 1.0)),), ("log",),
)  # fmt: skip
DECAY = Shape(
    "decay", "dies away over", "g = exp(-{0} / b)", "exp(-min({0} / q.width, 700.0))",
    (_width(1e-3, 2.0, "over how much of the stroke", 0.01, 0.05, 0.2),), ("exp",),
)  # fmt: skip
SLOW = replace(
    DECAY, quantities=(_width(1e-6, 10.0, "over which speed, of 1 m/s", 1e-3, 1e-2, 1e-1),),
)  # fmt: skip
SPAN = "spring_n_per_m * stroke_m / diaphragm_area_m2"
ABOVE = Shape(
    "above", "changes beyond a place of", "g = max(0, {0} - u_1)", "max(0.0, {0} - q.edge_pa)",
    (Quantity("edge_pa", "u_1", "where", 0.0, 1e7, (0.3, 0.5, 0.7, 0.9, 1.1), SPAN),),
)  # fmt: skip
BELOW = replace(ABOVE, name="below", equation="g = -max(0, u_1 - {0})", expression="-max(0.0, q.edge_pa - {0})")
FADING = Shape(
    "fading", "remembers, and forgets,", "g = {0} - z", "{0} - z[0]",
    (Quantity("time_constant_s", "T", "time constant", 1e-3, 60.0, (0.02, 0.1, 1.0)),),
)  # fmt: skip


def _strength(
    key: str, symbol: str, text: str, least: float, most: float, starts: Iterable[float], scale: str
) -> Quantity:
    return Quantity(key, symbol, text, least, most, tuple(starts), scale, off=0.0)


FORCES = (-0.1, 0.1, -0.5, 0.5)  # starts, of the scale
FORCE = Place(
    "force", "a force", "force", (), "float", "F = -F_1 g", "-{c} * ({g})",
    _strength("force_n", "F_1", "force, against opening", -1e6, 1e6, FORCES, "coulomb_n"), inverse=True,
)  # fmt: skip
PUSH = replace(FORCE, equation="F = -F_1 g r", result="-{c} * ({g}) * p / P_1_PA")
FEW = replace(FORCE, strength=replace(FORCE.strength, starts=(-0.3, 0.3)))
DRAG = Place(
    "drag", "a drag", "force", ("v",), "float", "F = -F_1 g sign v", "-{c} * copysign({g}, v)",
    _strength("force_n", "F_1", "drag at 1 m/s", 0.0, 1e8, (0.05, 0.3, 1.0, 3.0), "viscous_ns_per_m"),
    inverse=True, imports=("copysign",),
)  # fmt: skip
BOTH_WAYS = (-0.1, 0.1, -0.4, 0.4, -1.5, 1.5)  # starts, of the scale
ONE_WAY = Place(
    "one_way_drag", "a drag one way", "force", ("v",), "float", "F = -|F_1| g sign v where F_1 v > 0",
    "-abs({c}) * copysign({g}, v) if {c} * v > 0.0 else 0.0",
    _strength("force_n", "F_1", "drag at 1 m/s, > 0: opening", -1e8, 1e8, BOTH_WAYS, "viscous_ns_per_m"),
    inverse=True, imports=("copysign",),
)  # fmt: skip
LEVELS, PAIR = ("F_c", "F_s"), "tuple[float, float]"
ADDED = Place(
    "added", "friction", "friction", LEVELS, PAIR, "F_c -> max(0, F_c + F_1 g),  F_s -> max(0, F_s + F_1 g)",
    "max(F_c + {c} * ({g}), 0.0), max(F_s + {c} * ({g}), 0.0)",
    _strength("growth_n", "F_1", "growth of both levels", -1e6, 1e6, FORCES, "coulomb_n"), inverse=True,
)  # fmt: skip
SCALED = Place(
    "scaled", "friction, both levels in proportion,", "friction", LEVELS, PAIR,
    "F_c -> F_c max(0, 1 + k g),  F_s -> F_s max(0, 1 + k g)",
    "F_c * max(1.0 + {c} * ({g}), 0.0), F_s * max(1.0 + {c} * ({g}), 0.0)",
    _strength("growth", "k", "growth of both levels, of themselves", -20.0, 20.0, FORCES, ""), inverse=True,
)  # fmt: skip
STATIC = Place(
    "static", "static friction", "friction", LEVELS, PAIR, "F_s -> F_s + F_1 g", "F_c, F_s + {c} * ({g})",
    _strength("growth_n", "F_1", "growth", 0.0, 1e6, (0.02, 0.1, 0.5), "coulomb_n"), inverse=True,
)  # fmt: skip
INDICATION = Place(
    "indication", "an indication", "sensor", ("y",), "float", "y -> y + b_1 g", "y + {c} * ({g})",
    _strength("shift_m", "b_1", "shift", -1.0, 1.0, (-0.003, 0.003, -0.03, 0.03), "stroke_m"), inverse=False,
)  # fmt: skip
# At a share of 1 nothing comes through any more, as at a supply's limit: that lies inside the range, not at its end.
ENTERING = Place(
    "path", "the pressure", "pressure", ("u",), "float", "p = u - k g", "u - {c} * ({g})",
    _strength("share", "k", "share", -2.0, 2.0, (0.3, 1.0), ""), inverse=False,
)  # fmt: skip
SHOWN = replace(
    ENTERING, name="indication", words="an indication", function="sensor", arguments=("y",), equation="y -> y - k g",
    result="y - {c} * ({g})",
)  # fmt: skip


def _few(place: Place) -> Place:
    """Return a place with one strength each way, for shapes that begin at many places."""
    weakest = place.strength.starts[2:4]
    return replace(place, strength=replace(place.strength, starts=weakest))


FORMS: tuple[Form, ...] = (
    Form(FORCE, NOTHING, CONSTANT),
    Form(FORCE, POSITION, power(0.5, 2.0, 4.0)),
    *(Form(_few(FORCE), POSITION, shape) for shape in (KINK, STEP, BUMP)),
    Form(FEW, POSITION, WAVE),
    Form(FORCE, PRESSURE, power(0.5, 2.0)),
    Form(PUSH, BOTH, power(1.0, 2.0)),
    Form(DRAG, SPEED, growing(0.6, 2.0)),
    Form(ONE_WAY, SPEED, growing(1.0, 2.0)),
    Form(ADDED, POSITION, power(0.5, 1.0, 2.0)),
    *(Form(_few(ADDED), POSITION, shape) for shape in (KINK, BUMP, WAVE)),
    Form(ADDED, PRESSURE, power(0.5, 1.0, 2.0)),
    Form(replace(ADDED, strength=replace(ADDED.strength, least=0.0, starts=(0.05, 0.15, 0.5))), SPEED, SLOW),
    Form(SCALED, POSITION, power(0.5, 1.0, 2.0)),
    *(Form(_few(SCALED), POSITION, shape) for shape in (KINK, STEP, BUMP, WAVE)),
    Form(replace(SCALED, strength=replace(SCALED.strength, least=-0.9, most=0.9)), DIRECTION, SIGN),
    Form(SCALED, TRAVEL, DECAY),
    Form(SCALED, TIME, RISE),
    *(Form(STATIC, REST, shape) for shape in (RISE, LOGARITHM)),
    Form(INDICATION, INDICATED, power(0.5, 2.0, 4.0)),
    *(Form(_few(INDICATION), INDICATED, shape) for shape in (KINK, BUMP, WAVE)),
    *(Form(ENTERING, COMMAND, shape) for shape in (ABOVE, BELOW)),
    Form(ENTERING, _past("u", "the pressure that entered"), FADING),
    Form(SHOWN, _past("y", "the position that was indicated"), FADING),
)
"""All of them; what was found best stands where it was looked for."""
