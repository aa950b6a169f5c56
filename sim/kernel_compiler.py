"""The text of a kernel to LLVM bitcode, by numba.

The entries of the text take arrays; what is compiled of them takes addresses and shapes, so that neither numba nor its
run time is needed to call it. No fast-math: the order of operations is the text's.

numba is untyped: its types stop here.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numba
from llvmlite import binding

from config.errors import InputError
from sim.effect import execute
from sim.kernel_source import SHARED
from sim.machine_code import MATRIX, NUMBER, VECTOR

OPTIONS: Mapping[str, Any] = {"error_model": "numpy", "fastmath": False}
"""numpy's error model: a division by zero gives infinity, as in the field's own tools, and costs no branch."""
INNER: Mapping[str, Any] = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Of functions that only compiled ones call: to make them callable from Python would take a third of the time."""
NOT_INLINED = ("bogacki_shampine", "push", "balanced", "breaks", "landed", "passed")
"""Left to the compiler to inline: large, and called from several places."""
NESTED = re.compile(r"Failed in nopython mode pipeline \(step: [^)]*\)")
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
TYPES: Mapping[int, str] = {NUMBER: "f8", VECTOR: "CPointer(f8),intp", MATRIX: "CPointer(f8),intp,intp"}


def bitcode(text: str, file: Path, sources: Sequence[tuple[Path, str]], entries: Mapping[str, Sequence[int]]) -> bytes:
    """Compile a kernel's text, which stands in a file, with the texts of its effects, which stand in theirs.

    Raises:
        InputError: an effect's function is not what numba can compile; names its file.
    """
    module = ModuleType(f"valve_kernel_{file.stem}")
    exec(compile(text, file, "exec", dont_inherit=True), module.__dict__)
    for i, (path, source) in enumerate(sources):
        part = ModuleType(f"{module.__name__}_{i}")
        execute(source, path, part.__dict__)
        _inlined(part.__dict__)
        module.__dict__.update({f"{name}_{i}": value for name, value in part.__dict__.items() if name[0] != "_"})
    _inlined(module.__dict__)
    try:
        return _linked([_llvm(module, name, kinds) for name, kinds in entries.items()])
    except Exception as error:
        if not sources:
            raise
        where = ", ".join(str(path) for path, _ in sources)
        raise InputError(where, f"cannot be compiled: {_reason(error)}") from None


def _llvm(module: ModuleType, name: str, kinds: Sequence[int]) -> str:
    """Return the LLVM text of an entry, under its own name, of addresses and shapes."""
    arguments, passed_on = (
        ", ".join(forms[kind].format(i) for i, kind in enumerate(kinds)) for forms in (ARGUMENTS, PASSED_ON)
    )
    there = {"carray": numba.carray, "entry": getattr(module, name)}  # type: ignore[attr-defined]
    exec(f"def pointed({arguments}):\n    entry({passed_on})", there)
    signature = ",".join(TYPES[kind] for kind in kinds)
    dispatcher: Any = numba.njit(f"void({signature})", **INNER)(there["pointed"])
    (compiled,) = dispatcher.overloads.values()
    llvm: str = compiled.library.get_llvm_str()
    return llvm.replace(compiled.fndesc.llvm_func_name, name)


def _linked(texts: Sequence[str]) -> bytes:
    whole, *others = (binding.parse_assembly(each) for each in texts)
    for each in others:
        whole.link_in(each)
    return bytes(whole.as_bitcode())


def _reason(error: Exception) -> str:
    """Return what numba says first: the cause and its line, without the callers that follow."""
    return " ".join(NESTED.sub("", str(error).partition("During: ")[0]).split())


def _inlined(namespace: dict[str, Any]) -> None:
    """Make the functions of a namespace compiled ones; inlining them triples the speed."""
    for name, value in list(namespace.items()):
        if isinstance(value, FunctionType) and (value.__globals__ is namespace or _is_shared(value)):
            namespace[name] = numba.njit(forceinline=name not in NOT_INLINED, **INNER)(value)


def _is_shared(function: FunctionType) -> bool:
    return any(function.__globals__ is each.__dict__ for each in SHARED)
