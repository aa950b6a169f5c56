"""The texts of a kernel to LLVM bitcode, by numba: the laws once, with their places open, and what fills these.

The entries of the laws take arrays; what is compiled of them takes addresses and shapes, so that neither numba nor its
run time is needed to call it. The laws hand on, as q and z, where the parameters and the state begin; a place reads its
effects' from there. What is empty is a weak symbol: what fills it takes its place when the two are linked, and is then
inlined wherever a law calls it. No fast-math: the order of operations is the text's.

numba is untyped: its types stop here.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from inspect import signature
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, get_type_hints

import numba
from llvmlite import binding, ir
from numba.extending import intrinsic

from config.errors import InputError
from sim import karnopp, quasi_static
from sim.effect import execute
from sim.karnopp import MEMORY, Stem
from sim.kernel_source import SHARED
from sim.machine_code import MATRIX, NUMBER, VECTOR, features, nothing, target_machine

OPTIONS: Mapping[str, Any] = {"error_model": "numpy", "fastmath": False}
"""numpy's error model: a division by zero gives infinity, as in the field's own tools, and costs no branch."""
INNER: Mapping[str, Any] = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Of functions that only compiled ones call: to make them callable from Python would take a third of the time."""
NOT_INLINED = ("bogacki_shampine", "respond", "rest", "push", "balanced", "breaks", "landed", "passed")
"""Left to the compiler to inline: large, and called from several places."""
NESTED = re.compile(r"Failed in nopython mode pipeline \(step: [^)]*\)")
PLACES: Mapping[str, Callable[..., Any]] = {
    "start_pressure": karnopp.start_pressure,
    "start_stem": karnopp.start_stem,
    "straight": karnopp.straight,
    "pressure": karnopp.pressure,
    "pressure_ends": quasi_static.pressure_ends,
    "force": karnopp.force,
    "friction": karnopp.friction,
    "motion": karnopp.motion,
    "remember": karnopp.remember,
    "sensor": karnopp.sensor,
}
"""Empty, as the laws' texts have them."""
types: Any = numba.types
SYMBOL = "place_{}"
ADDRESS = types.CPointer(types.float64)
IN_PLACES: Mapping[Any, Any] = {
    float: types.float64,
    Stem: types.NamedTuple((types.float64,) * len(Stem._fields), Stem),
    tuple[float, float]: types.UniTuple(types.float64, 2),
    type(None): types.none,
    Any: ADDRESS,
}
ARGUMENTS: Mapping[int, str] = {
    NUMBER: "a{0}",
    VECTOR: "a{0}, rows{0}",
    MATRIX: "a{0}, rows{0}, columns{0}",
}
PASSED_ON: Mapping[int, str] = {
    NUMBER: "a{0}",
    VECTOR: "carray(a{0}, rows{0})",
    MATRIX: "carray(a{0}, (rows{0}, columns{0}))",
}
TYPES: Mapping[int, tuple[Any, ...]] = {
    NUMBER: (types.float64,),
    VECTOR: (ADDRESS, types.intp),
    MATRIX: (ADDRESS, types.intp, types.intp),
}
HANDED_ON = ("theta", "state")
"""Whose addresses the places get."""
DEFINITION = re.compile(r"^define .*", re.MULTILINE)
POINTER = re.compile(r"\bptr(?= ((readonly|writeonly|captures\(\w+\)) )*%arg\.)")


def laws(text: str, file: Path, entries: Mapping[str, Sequence[int]]) -> bytes:
    """Compile the laws of a text, which stands in a file; the places that they call stay open."""
    module = ModuleType(f"valve_laws_{file.stem}")
    exec(compile(text, file, "exec", dont_inherit=True), module.__dict__)
    called = [name for name in PLACES if name in module.__dict__]
    _inlined(module)
    places = [_place(module, name, MEMORY) for name in called]
    same = numba.njit(_same)
    module.__dict__.update({name: _called(name) for name in called}, parameters=same, memories=same)
    whole = _linked([_entry(module, name, kinds) for name, kinds in entries.items()])
    for each in places:
        whole.link_in(binding.parse_assembly(each))
    for name in called:
        whole.get_function(SYMBOL.format(name)).linkage = "weak_any"
    return bytes(whole.as_bitcode())


def filled(
    laws: bytes,
    text: str,
    file: Path,
    sources: Sequence[tuple[Path, str]],
    state_size: int,
    entries: Mapping[str, Sequence[int]],
) -> bytes:
    """Fill the places of compiled laws by a text that calls the effects' own; each stands in its file.

    Raises:
        InputError: an effect's function is not what numba can compile; names its file.
    """
    module = ModuleType(f"valve_kernel_{file.stem}")
    exec(compile(text, file, "exec", dont_inherit=True), module.__dict__)
    for i, (path, source) in enumerate(sources):
        part = _part(path, source)
        module.__dict__.update({f"{name}_{i}": value for name, value in part.__dict__.items() if name[0] != "_"})
    _inlined(module)
    whole = binding.parse_bitcode(laws)
    called = {each.name for each in whole.functions}
    names = [name for name in PLACES if name in module.__dict__ and SYMBOL.format(name) in called]
    try:
        places = [_place(module, name, state_size) for name in names]
    except Exception as error:
        where = ", ".join(str(path) for path, _ in sources)
        raise InputError(where, f"cannot be compiled: {_reason(error)}") from None
    for each in places:
        whole.link_in(binding.parse_assembly(each))
    return _optimized(whole, entries)


@cache
def _part(path: Path, source: str) -> ModuleType:
    """Return an effect's functions, compiled ones: as often as a kernel has it among others, they are the same."""
    part = ModuleType(f"valve_effect_{path.stem}")
    execute(source, path, part.__dict__)
    _inlined(part)
    return part


def _optimized(whole: Any, entries: Mapping[str, Sequence[int]]) -> bytes:
    """Inline what fills the places, and optimize what comes of it."""
    for each in whole.functions:
        if each.name in entries or each.is_declaration:
            continue
        each.linkage = "internal"
        if each.name in map(SYMBOL.format, PLACES):
            each.add_function_attribute("alwaysinline")
    options = binding.create_pipeline_tuning_options(speed_level=3)
    builder = binding.create_pass_builder(target_machine(*features()), options)
    builder.getModulePassManager().run(whole, builder)
    return bytes(whole.as_bitcode())


def _entry(module: ModuleType, name: str, kinds: Sequence[int]) -> str:
    """Return the LLVM text of an entry, under its own name, of addresses and shapes."""
    given = signature(getattr(module, name).py_func).parameters
    arguments = ", ".join(ARGUMENTS[kind].format(i) for i, kind in enumerate(kinds))
    passed_on = [
        f"a{i}" if each in HANDED_ON else PASSED_ON[kind].format(i)
        for i, (each, kind) in enumerate(zip(given, kinds, strict=True))
    ]
    of = types.void(*(each for kind in kinds for each in TYPES[kind]))
    return _llvm(module, f"{name}({', '.join(passed_on)})", arguments, of, name)


def _place(module: ModuleType, name: str, state_size: int) -> str:
    """Return the LLVM text of what fills a place, as `_called` calls it."""
    given = signature(PLACES[name]).parameters
    read = {"q": "parameters(q)", "z": f"memories(carray(z, {state_size}))"}
    passed_on = ", ".join(read.get(each, each) for each in given)
    return _llvm(module, f"{name}({passed_on})", ", ".join(given), _signature(name), SYMBOL.format(name))


def _llvm(module: ModuleType, call: str, arguments: str, of: Any, symbol: str) -> str:
    """Return the LLVM text of a function that makes this call. No two of the arrays that it is given overlap."""
    there = {**module.__dict__, "carray": numba.carray}  # type: ignore[attr-defined]
    exec(f"def pointed({arguments}):\n    return {call}", there)
    dispatcher: Any = numba.njit(of, **INNER)(there["pointed"])
    (compiled,) = dispatcher.overloads.values()
    llvm: str = compiled.library.get_llvm_str().replace(compiled.fndesc.llvm_func_name, symbol)
    return DEFINITION.sub(lambda found: POINTER.sub("ptr noalias", found[0]), llvm)


def _called(name: str) -> Any:
    """Return what a law calls for a place: a function of numba's convention, linked to it later."""
    symbol = SYMBOL.format(name)

    def call(context: Any, builder: Any, of: Any, values: Sequence[Any]) -> Any:
        convention = context.call_conv
        kind = convention.get_function_type(of.return_type, of.args)
        function = builder.module.globals.get(symbol) or ir.Function(builder.module, kind, symbol)
        status, result = convention.call_function(builder, function, of.return_type, of.args, values)
        with builder.if_then(status.is_error, likely=False):
            convention.return_status_propagate(builder, status)
        return result

    binding.add_symbol(symbol, nothing())  # numba loads what it compiles, even where only its text is asked for
    arguments = ", ".join(signature(PLACES[name]).parameters)
    there = {"result": _signature(name).return_type, "call": call}  # the laws have a Stem of their own
    exec(f"def {name}(typing, {arguments}):\n    return result({arguments}), call", there)
    return intrinsic(there[name])


def _signature(name: str) -> Any:
    """Return numba's types of a place."""
    hints = get_type_hints(PLACES[name])
    result = hints.pop("return")
    return IN_PLACES[result](*(IN_PLACES[each] for each in hints.values()))


def _same(value: Any) -> Any:
    return value


def _linked(texts: Sequence[str]) -> Any:
    whole, *others = (binding.parse_assembly(each) for each in texts)
    for each in others:
        whole.link_in(each)
    return whole


def _reason(error: Exception) -> str:
    """Return what numba says first: the cause and its line, without the callers that follow."""
    return " ".join(NESTED.sub("", str(error).partition("During: ")[0]).split())


def _inlined(module: ModuleType) -> None:
    """Make the functions of a module compiled ones; inlining them triples the speed."""
    namespace = module.__dict__
    for name, value in list(namespace.items()):
        if isinstance(value, FunctionType) and (value.__globals__ is namespace or _is_shared(value)):
            namespace[name] = numba.njit(forceinline=name not in NOT_INLINED, **INNER)(value)


def _is_shared(function: FunctionType) -> bool:
    return any(function.__globals__ is each.__dict__ for each in SHARED)
