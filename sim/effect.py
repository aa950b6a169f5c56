"""An effect: one file that puts a piece of physics into its place on the path from command to indication.

    command -> pressure -> force -> friction -> motion -> sensor

The file is plain Python; its name is the effect's name, the first line of its docstring says what the effect is.
It defines

    class Parameters(NamedTuple)    each field an Annotated[float, Parameter(text, least, most)], unit in its name
    MEMORY = n                      number of its state variables, if it has any
    STEP_S = h                      longest step over which its memory comes out well, s; FINE_STEP_S if not given, and
                                    any step without a memory; what `straight` cuts it by comes on top of that
    LOOKS = text                    what it looks like in a record
    COMPLAINT = text                what an engineer who meets it calls it, as "sticks"
    AFTER = name                    effect that a search tries first: this one only where that has evidence and leaves
                                    something to explain
    INPUT = "setpoint"              what enters its pressure path is a set point, m, and not a pressure: a positioner
    CONFOUNDED = {name: text}       effects and parameters of the bare valve that look alike, and what record tells
                                    them apart; an empty text: none of pressure and position does

and a function for its place. The places and what each returns:

    pressure   the pressure that leaves it, Pa, from the pressure u that enters it
    force      an extra force on the stem, N, positive in the direction in which pressure drives it, called opening
    friction   the levels (F_c, F_s), N, from those that enter it; direction is the sign of (impending) motion
    motion     the stem's (x, v) at the end of a step; F_e is the external force, N, stiffness its -dF_e/dx, N/m
    sensor     the position that leaves it, m, from the position y that enters it

An effect sits in the pressure path, or in the sensor, or at the stem (force, friction and motion in any mixture).
With a memory it also defines

    start      sets the memory for a valve long at rest, signal being what enters it (at the stem: x, and F_e, N, too)
    advance    carries the memory over a step h, s, during which the signal goes from before to after

In the pressure path it may also define

    straight   for how long, at most h, s, what leaves it goes straight from t on, while u enters it: a step ends there

What undoes it stands beside its equation, for a daemon that is given the extended valve (`sim.static_inverse`); an
effect without it is refused there. An effect of the library must have it. It is one of

    INVERSE = "balance"        its functions at a long rest are all of it: the balance is solved for the pressure, which
                               must rise with x (a force: dF/dx < k_s)
    inverse(q) -> Inverse      it acts in time, or no pressure solves for it: what must be known of it instead, as
                               Inverse(lag_s=q.time_constant_s) of `config.extended_valve`

A function names among its arguments only what it needs of: t (s), x (m), v (m/s), p (actuator pressure, Pa), q (the
parameters), z (the memory, an array), and what its place adds. The pressure path sees the stem of the start of the
step, all others that of its end; t is the time of the call, and middle, in the pressure path, that of the middle of the
step: what jumps there chooses its side by it. It may use what numba compiles: floats, math, numpy, functions of its
own file and of `sim.first_order_lag`.
"""

import inspect
import logging
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from itertools import product, zip_longest
from math import inf
from pathlib import Path
from textwrap import dedent
from traceback import extract_tb
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt

from config.errors import InputError
from config.extended_valve import Inverse
from config.valve_file import ValveParameters

Memory = npt.NDArray[np.float64]
Guess = Literal["", "lowest", "swept", "quantum", "delay", "lag"]

EVERYWHERE = ("t", "x", "v", "p", "q", "z")
PLACES: Mapping[str, tuple[str, ...]] = {
    "pressure": ("u", "middle", *EVERYWHERE),
    "force": EVERYWHERE,
    "friction": ("F_c", "F_s", "direction", *EVERYWHERE),
    "motion": ("F_e", "stiffness", *EVERYWHERE),
    "sensor": ("y", *EVERYWHERE),
}
"""The places on the path and the arguments a function there may name."""
UPKEEP: Mapping[str, tuple[str, ...]] = {
    "start": ("signal", *EVERYWHERE),
    "advance": ("before", "after", "h", *EVERYWHERE),
}
"""What keeps a memory, and the arguments it may name."""
CUTS: Mapping[str, tuple[str, ...]] = {"straight": ("u", "h", *EVERYWHERE)}
"""What cuts a step, and the arguments it may name."""
AT_STEM = ("force", "friction", "motion")
MOST_MEMORY = 100_000
"""State variables of one effect."""
FINE_STEP_S = 2.5e-4
"""For a memory of which nothing is known."""
log = logging.getLogger(__name__)

FOLDERS_ALLOWED = "POSITIONER_EFFECTS"
"""Of the environment: folders from which effects may be run by their paths, in place of the working folder."""
SHIPPED = Path(__file__).parent / "effects"
BALANCE = "balance"
SETPOINT = "setpoint"
UNKNOWN_COMPLAINT = "something new"
"""Of an effect that says none."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """What a parameter means, the range, both ends included, in which it is physical, and where a fit may start."""

    text: str
    least: float
    most: float
    off: float | None = None
    """The value at which the effect vanishes; None where another parameter's does it."""
    starts: tuple[float, ...] = ()
    """From barely visible to strong, in units of `scale`."""
    scale: str = ""
    """Parameters of the bare valve, multiplied and divided, such as "spring_n_per_m * stroke_m"; empty: 1."""
    given: bool = False
    """Read from a drawing or a data sheet: a fit leaves it at its start."""
    guess: Guess = ""
    """What a record suggests for it, "lowest", "swept", "quantum", "delay" or "lag": a fit begins there too. Searches
    that begin elsewhere would not find it."""

    def starts_for(self, valve: ValveParameters) -> tuple[float, ...]:
        """Return where a fit may start on this valve; what lies beyond the range stands at its end."""
        unit = scale_of(self.scale, valve)
        return tuple(dict.fromkeys(min(max(start * unit, self.least), self.most) for start in self.starts))


def scale_of(text: str, valve: ValveParameters) -> float:
    """Return a product and quotient of a valve's parameters; 1 for an empty text.

    A drive without a spring has the rate at which its stroke would take the force of its friction.

    Raises:
        ValueError: a name that is none of its numbers, or a joint other than * and /.
    """
    words = ["*", *text.split()] if text else []
    unit = 1.0
    for joint, name in zip_longest(words[::2], words[1::2], fillvalue=""):
        value = getattr(valve, name, None)
        if value == 0.0 and name == "spring_n_per_m":
            value = valve.coulomb_n / valve.stroke_m
        if joint not in {"*", "/"} or not isinstance(value, float):
            raise ValueError(repr(text))
        unit = unit * value if joint == "*" else unit / value
    return unit


@dataclass(frozen=True, slots=True)
class Effect:
    """An effect's file, read: what it declares, and its text for the compiler."""

    name: str
    text: str
    parameters: Mapping[str, Parameter]
    memory: int
    step_s: float
    """Longest step of the integration that it bears, s; infinite if any."""
    functions: Mapping[str, tuple[str, ...]]
    """Its functions on the path and the arguments each names."""
    equation: str
    """The first indented lines of its docstring."""
    looks: str
    complaint: str
    """What an engineer who meets it calls it."""
    confounded: Mapping[str, str]
    after: str
    """The effect that a search tries before it; empty: it is tried from the first."""
    by_setpoint: bool
    """Whether what enters is a set point, m: it must be the first of the pressure path."""
    in_balance: bool
    """Whether solving the balance at rest undoes it ..."""
    inverse: Callable[[Sequence[float]], Inverse] | None
    """... or else this does, of its parameters in their order; None: nothing is declared."""
    path: Path
    source: str

    @property
    def places(self) -> tuple[str, ...]:
        """Where it acts."""
        return tuple(place for place in PLACES if place in self.functions)

    @property
    def only_in_motion(self) -> bool:
        """Whether it is a force or friction of the velocity alone: where the stem rests and lands it does not show."""
        named = {argument for place in AT_STEM for argument in self.functions.get(place, ())}
        return "v" in named and not self.memory and not named & {"t", "x", "p"}

    @property
    def in_time(self) -> bool:
        """Whether its memory is carried on by time: it follows what enters it, late."""
        return "h" in self.functions.get("advance", ())

    @property
    def hides_motion(self) -> bool:
        """Whether the sensor may stay while the stem moves: its memory is of where the stem was, not of when."""
        return "sensor" in self.functions and self.memory > 0 and not self.in_time

    @property
    def written(self) -> str:
        """How a valve file names it: an own effect by its path."""
        return self.name if self.path.parent == SHIPPED else str(self.path)

    def off(self, valve: ValveParameters) -> tuple[float, ...]:
        """Return the parameters with which it vanishes from the valve.

        Raises:
            InputError: a parameter declares neither its off value nor a start.
        """
        return tuple(
            self._starts(key, valve)[0] if parameter.off is None else parameter.off
            for key, parameter in self.parameters.items()
        )

    def strengths(self, valve: ValveParameters) -> list[tuple[float, ...]]:
        """Return the grid of parameters from which a fit may start; the last parameter varies fastest.

        Raises:
            InputError: a parameter declares no starts, or a scale that is none.
        """
        return list(product(*(self._starts(key, valve) for key in self.parameters)))

    def _starts(self, key: str, valve: ValveParameters) -> tuple[float, ...]:
        try:
            starts = self.parameters[key].starts_for(valve)
        except ValueError as error:
            problem = f"Parameters.{key}: scale must be a product of the [valve] table's numbers, got {error}"
            raise InputError(str(self.path), problem) from None
        if not starts:
            raise InputError(str(self.path), f"Parameters.{key}: declares no starts, from which a fit could begin")
        return starts

    def values(self, written: Mapping[str, Any], source: str) -> tuple[float, ...]:
        """Hold the parameters of an `[[effect]]` table against the declaration; return them in its order.

        Raises:
            InputError: unknown, missing, not a number, or out of its range.
        """
        for key in written:
            if key not in self.parameters:
                allowed = ", ".join(self.parameters) or "none"
                raise InputError(source, f"{key}: unknown parameter of {self.name}; allowed: {allowed}")
        return tuple(self._value(key, written, source) for key in self.parameters)

    def declared(self, key: str) -> str:
        """Return the name under which a drive's parameter is declared, its command being a force as well."""
        in_pa = (each for each in self.parameters if each.replace("_pa", "_n") == key)
        return key if key in self.parameters else next(in_pa, key)

    def _value(self, key: str, written: Mapping[str, Any], source: str) -> float:
        parameter = self.parameters[key]
        allowed = f"a number from {parameter.least:g} to {parameter.most:g} ({parameter.text})"
        if key not in written:
            raise InputError(source, f"{key}: is required by {self.name} and missing; it is {allowed}")
        value = written[key]
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not parameter.least <= value <= parameter.most:
            raise InputError(source, f"{key}: must be {allowed}, got {value!r}")
        return float(value)


def shipped_effects() -> list[str]:
    """Return the names of the effects that come with the package."""
    return list(_names_in(SHIPPED))


def tried_effects() -> list[str]:
    """Return the names of those of them that may be missing in a valve file: a positioner is there or not."""
    return [name for name in shipped_effects() if not _shipped(name).by_setpoint]


def first_effects() -> list[str]:
    """Return the names of those of these that a search tries from the first."""
    return [name for name in tried_effects() if not _shipped(name).after]


def shipped_effect(name: str, source: str) -> Effect:
    """Return an effect that comes with the package.

    Raises:
        InputError: there is none of that name; names those there are.
    """
    if name not in shipped_effects():
        raise InputError(source, f"no effect named {name!r}; there are: {', '.join(shipped_effects())}")
    return _shipped(name)


def _shipped(name: str) -> Effect:
    return _read_once(SHIPPED / f"{name}.py")


@cache
def _names_in(folder: Path) -> tuple[str, ...]:
    """Return the names of the effects in a folder of the package, which stays as it is while a process runs."""
    return tuple(sorted(each[:-3] for each in os.listdir(folder) if each.endswith(".py") and each[0] != "_"))


@cache
def _read_once(path: Path) -> Effect:
    return read_effect(path)


def find_effects(names: Sequence[str], source: str) -> list[Effect]:
    """Return the effects that a person named.

    Raises:
        InputError: as `find_effect`.
    """
    return [find_effect(each, source) for each in names]


def find_effect(text: str, source: str) -> Effect:
    """Return the effect that a person named: the path of its file, which ends in .py, or a shipped one's name.

    Such a file is a program that runs as whoever reads it: only from folders that are allowed, and said the first time.

    Raises:
        InputError: there is no such file or name, its folder is not allowed, or the file is not an effect's.
    """
    if not text.endswith(".py"):
        return shipped_effect(text, source)
    path = Path(text)
    if not path.is_file():
        raise InputError(source, f"no effect's file {text}")
    if path.resolve().parent in _WRITTEN_HERE:
        return read_effect(path)
    if not any(path.resolve().is_relative_to(folder) for folder in allowed_folders()):
        said = f"names {text}, a program, which lies in no folder allowed: put it beside your work, or allow its folder"
        raise InputError(source, f"{said}, {FOLDERS_ALLOWED}={path.resolve().parent}")
    shown = path.resolve()
    if shown not in _SAID:
        _SAID.add(shown)
        _say_aloud(shown, source)
    return read_effect(path)


_WRITTEN_HERE: set[Path] = set()


@contextmanager
def written_here(folder: Path) -> Iterator[None]:
    """Let effects be run from a folder whose files this process writes itself, as long as it does."""
    own = folder.resolve()
    _WRITTEN_HERE.add(own)
    try:
        yield
    finally:
        _WRITTEN_HERE.discard(own)


def allowed_folders() -> list[Path]:
    """Return the folders from which effects may be run by path: those of the environment, else the working one."""
    said = os.environ.get(FOLDERS_ALLOWED, "")
    return [Path(each).resolve() for each in (said.split(os.pathsep) if said else ["."])]


_SAID: set[Path] = set()
"""Of which it was said that they are run, whoever named them."""


def _say_aloud(path: Path, source: str) -> None:
    here = Path.cwd()
    shown = path.relative_to(here) if path.is_relative_to(here) else path
    log.warning("%s names an effect by its path: %s is run as a program", source, shown)


def read_effect(path: Path) -> Effect:
    """Read an effect's file.

    Raises:
        InputError: it cannot be read, is not Python, or does not keep to what stands at the head of this module.
    """
    try:
        source = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise InputError(str(path), f"line {line}: is not UTF-8 text, as Python is") from None
    return _declared(path, source)


@cache
def _declared(path: Path, source: str) -> Effect:
    namespace: dict[str, Any] = {"__name__": path.stem}
    execute(source, path, namespace)
    allowed = {**PLACES, **UPKEEP, **CUTS}
    if any(place in namespace for place in AT_STEM):
        allowed["start"] = ("F_e", *UPKEEP["start"])
    functions = {name: tuple(inspect.signature(namespace[name]).parameters) for name in allowed if name in namespace}
    said = namespace.get("__doc__") or ""
    effect = Effect(
        name=path.stem,
        text=said.partition("\n")[0],
        parameters=_parameters(path, namespace),
        memory=namespace.get("MEMORY", 0),
        step_s=namespace.get("STEP_S", FINE_STEP_S if namespace.get("MEMORY", 0) else inf),
        functions=functions,
        equation=_equation(said),
        looks=namespace.get("LOOKS", ""),
        complaint=namespace.get("COMPLAINT", UNKNOWN_COMPLAINT),
        confounded=namespace.get("CONFOUNDED", {}),
        after=namespace.get("AFTER", ""),
        by_setpoint=_by_setpoint(path, namespace),
        in_balance="INVERSE" in namespace,
        inverse=_inverse(path, namespace),
        path=path,
        source=source,
    )
    for name, arguments in functions.items():
        for argument in arguments:
            if argument not in allowed[name]:
                raise InputError(str(path), f"{name}: unknown argument {argument}; allowed: {', '.join(allowed[name])}")
    _check_memory(effect)
    _check_places(effect)
    _check_step(effect)
    _check_words(effect)
    return effect


def execute(source: str, path: Path, namespace: dict[str, Any]) -> None:
    """Run an effect's text in a namespace.

    Raises:
        InputError: it is not Python, or fails on the way.
    """
    try:
        exec(compile(source, path, "exec", dont_inherit=True), namespace)
    except SyntaxError as error:
        raise InputError(str(path), f"line {error.lineno}: {error.msg}") from None
    except (Exception, SystemExit) as error:  # an exit would be that of the command, with its status
        lines = [each.lineno for each in extract_tb(error.__traceback__) if each.filename == str(path)]
        where = f"line {lines[-1]}: " if lines else ""
        raise InputError(str(path), f"{where}{type(error).__name__}: {error}") from None


def _equation(said: str) -> str:
    """Return the first indented lines of a docstring, without their indentation."""
    indented = re.search(r"(?:^ {4}.*\n|^\n(?= {4}))+", said, re.MULTILINE)
    return dedent(indented[0]).strip("\n") if indented else ""


def _parameters(path: Path, namespace: dict[str, Any]) -> dict[str, Parameter]:
    if "Parameters" not in namespace:
        return {}
    declared = {}
    for name, hint in get_type_hints(namespace["Parameters"], namespace, include_extras=True).items():
        parameter = get_args(hint)[-1] if get_origin(hint) is Annotated else None
        if not isinstance(parameter, Parameter):
            raise InputError(str(path), f"Parameters.{name}: must be Annotated[float, Parameter(...)]")
        if parameter.guess not in get_args(Guess):
            allowed = ", ".join(each for each in get_args(Guess) if each)
            raise InputError(str(path), f"Parameters.{name}: guess must be one of {allowed}, got {parameter.guess!r}")
        declared[name] = parameter
    return declared


def _by_setpoint(path: Path, namespace: dict[str, Any]) -> bool:
    entering = namespace.get("INPUT", "")
    if entering not in {"", SETPOINT} or (entering and "pressure" not in namespace):
        problem = f'INPUT: allowed is "{SETPOINT}", of an effect of the pressure path, got {entering!r}'
        raise InputError(str(path), problem)
    return bool(entering)


def _inverse(path: Path, namespace: dict[str, Any]) -> Callable[[Sequence[float]], Inverse] | None:
    """Return what undoes an effect that the balance does not, as a function of its parameters in their order."""
    if namespace.get("INVERSE", BALANCE) != BALANCE:
        raise InputError(str(path), f'INVERSE: allowed is "{BALANCE}", got {namespace["INVERSE"]!r}')
    if "inverse" not in namespace:
        return None
    if "INVERSE" in namespace:
        raise InputError(str(path), f'either INVERSE = "{BALANCE}" or the function inverse undoes it, not both')
    inverse, parameters = namespace["inverse"], namespace["Parameters"]
    return lambda values: inverse(parameters(*values))


def _check_places(effect: Effect) -> None:
    places = [name for name in PLACES if name in effect.functions]
    alone = {"pressure", "sensor"}.intersection(places)
    if not places:
        raise InputError(str(effect.path), f"defines none of the places {', '.join(PLACES)}")
    if alone and len(places) > 1:
        raise InputError(str(effect.path), f"{alone.pop()} must be an effect's only place, got {', '.join(places)}")
    if any((name in effect.functions) != (effect.memory > 0) for name in UPKEEP):
        raise InputError(str(effect.path), "start and advance belong with MEMORY = 1 or more: all three or none")
    if "straight" in effect.functions and "pressure" not in places:
        raise InputError(str(effect.path), f"straight belongs in the pressure path, got {', '.join(places)}")


def _check_memory(effect: Effect) -> None:
    if type(effect.memory) is not int or not 0 <= effect.memory <= MOST_MEMORY:
        raise InputError(
            str(effect.path), f"MEMORY: must be a whole number from 0 to {MOST_MEMORY}, got {effect.memory!r}"
        )


def _check_step(effect: Effect) -> None:
    if not isinstance(effect.step_s, float) or not effect.step_s > 0.0:
        raise InputError(str(effect.path), f"STEP_S: must be a time in seconds above 0.0, got {effect.step_s!r}")


def _check_words(effect: Effect) -> None:
    for key, text in (("LOOKS", effect.looks), ("COMPLAINT", effect.complaint), ("AFTER", effect.after)):
        if not isinstance(text, str):
            raise InputError(str(effect.path), f"{key}: must be a text, got {text!r}")
    is_table = isinstance(effect.confounded, dict)
    if not is_table or not all(isinstance(text, str) for pair in effect.confounded.items() for text in pair):
        raise InputError(str(effect.path), f"CONFOUNDED: must give a text for each name, got {effect.confounded!r}")
