"""The texts of a kernel to LLVM bitcode, by numba: the laws, with their places open, and each effect, once.

The entries of the laws take arrays; what is compiled of them takes addresses and shapes, so that neither numba nor its
run time is needed to call it. The laws hand on, as q and z, where the parameters and the state begin; a place reads its
effect's from there. No fast-math: the order of operations is the text's.

numba is untyped: its types stop here.
"""

import re
from collections.abc import Mapping, Sequence
from inspect import signature
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, get_type_hints

import numba
from llvmlite import binding, ir
from numba.extending import intrinsic

from config.errors import InputError
from sim.effect import execute
from sim.karnopp import Stem
from sim.kernel_linker import SYMBOL, optimized
from sim.kernel_source import OWN, PLACES, SHARED
from sim.machine_code import MATRIX, NUMBER, VECTOR, nothing

OPTIONS: Mapping[str, Any] = {"error_model": "numpy", "fastmath": False}
"""numpy's error model: a division by zero gives infinity, as in the field's own tools, and costs no branch."""
INNER: Mapping[str, Any] = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Of functions that only compiled ones call: to make them callable from Python would take a third of the time."""
NOT_INLINED = ("bogacki_shampine", "respond", "rest", "push", "balanced", "breaks", "landed", "passed")
"""Left to the compiler to inline: large, and called from several places."""
NESTED = re.compile(r"Failed in nopython mode pipeline \(step: [^)]*\)")
types: Any = numba.types
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
    module.__dict__.update({name: _called(name) for name in PLACES if name in module.__dict__})
    _inlined(module)
    return optimized(_linked([_entry(module, name, kinds) for name, kinds in entries.items()]), entries)


def effect(source: str, path: Path, text: str, file: Path) -> bytes:
    """Compile an effect: the source of its file, and the text of the places that it fills, which stands in another.

    Raises:
        InputError: a function is not what numba can compile; names the effect's file.
    """
    own, module = ModuleType(f"valve_effect_{file.stem}"), ModuleType(f"valve_places_{file.stem}")
    execute(source, path, own.__dict__)
    _inlined(own, checked=True)
    module.__dict__.update({OWN.format(name): value for name, value in own.__dict__.items()}, carray=numba.carray)  # type: ignore[attr-defined]
    exec(compile(text, file, "exec", dont_inherit=True), module.__dict__)
    filled = [name for name in PLACES if name in module.__dict__]
    try:
        places = [_llvm(module.__dict__[name], _signature(name), SYMBOL.format(name)) for name in filled]
    except Exception as error:
        raise InputError(str(path), f"cannot be compiled: {_reason(error)}") from None
    return optimized(_linked(places), [SYMBOL.format(name) for name in filled])


def _entry(module: ModuleType, name: str, kinds: Sequence[int]) -> str:
    """Return the LLVM text of an entry, under its own name, of addresses and shapes."""
    given = signature(getattr(module, name).py_func).parameters
    arguments = ", ".join(ARGUMENTS[kind].format(i) for i, kind in enumerate(kinds))
    passed_on = [
        f"a{i}" if each in HANDED_ON else PASSED_ON[kind].format(i)
        for i, (each, kind) in enumerate(zip(given, kinds, strict=True))
    ]
    there = {**module.__dict__, "carray": numba.carray}  # type: ignore[attr-defined]
    exec(f"def pointed({arguments}):\n    return {name}({', '.join(passed_on)})", there)
    return _llvm(there["pointed"], types.void(*(each for kind in kinds for each in TYPES[kind])), name)


def _llvm(function: Any, of: Any, symbol: str) -> str:
    """Return the LLVM text of a function, under this name. No two of the arrays that it is given overlap."""
    dispatcher: Any = numba.njit(of, **INNER)(function)
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


def _linked(texts: Sequence[str]) -> Any:
    whole, *others = (binding.parse_assembly(each) for each in texts)
    for each in others:
        whole.link_in(each)
    return whole


def _reason(error: Exception) -> str:
    """Return what numba says first: the cause and its line, without the callers that follow."""
    return " ".join(NESTED.sub("", str(error).partition("During: ")[0]).split())


def _inlined(module: ModuleType, *, checked: bool = False) -> None:
    """Make the functions of a module compiled ones; inlining them triples the speed."""
    namespace = module.__dict__
    for name, value in list(namespace.items()):
        if isinstance(value, FunctionType) and (value.__globals__ is namespace or _is_shared(value)):
            namespace[name] = numba.njit(forceinline=name not in NOT_INLINED, boundscheck=checked, **INNER)(value)


def _is_shared(function: FunctionType) -> bool:
    return any(function.__globals__ is each.__dict__ for each in SHARED)
