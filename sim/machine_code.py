"""A kernel's machine code: translated from its bitcode for this processor, loaded, called with numpy's arrays.

Neither takes numba, whose start takes longer than all of this. The functions are of its convention: where a result and
an exception would go, then the arguments, an array as its address and its shape; they return a status, 0 if all is
well. Python hands over one address, where the arguments stand one after the other: ctypes takes as long for each
argument as a valve for some twenty steps. Other threads go on while one runs. No operations are fused: the numbers are
those of the kernel's text.
"""

import hashlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from ctypes import CFUNCTYPE, addressof, c_double, c_int32, c_void_p, cast
from functools import cache
from itertools import count
from struct import Struct
from threading import Lock
from typing import Any, Generic, Self, TypeVarTuple

import llvmlite
import numpy as np
from llvmlite import binding

from config.errors import InputError

NUMBER, VECTOR, MATRIX = range(3)
"""Kinds of arguments, by their dimensions: of float64, arrays contiguous."""
WORDS: Mapping[int, str] = {NUMBER: "d", VECTOR: "Pn", MATRIX: "Pnn"}
"""Of each, where the arguments stand: `struct`'s letters, all of eight bytes."""
IN_LLVM: Mapping[str, str] = {"d": "double", "P": "ptr", "n": "i64"}
CALLED = "{}.called"
"""What is called from Python in place of an entry: the name of the function that reads the arguments."""
FLOAT64 = np.dtype(np.float64)
INTRINSIC = "llvm."
UNREACHED = ("NRT_MemInfo_call_dtor", "NRT_Free")
"""What is named of numba's run time and never comes to: the arrays are numpy's, nothing is freed."""
Arguments = TypeVarTuple("Arguments")
_nothing = CFUNCTYPE(None, c_void_p)(lambda _: None)
_libraries = count()
_one_at_a_time = Lock()


class Entry(Generic[*Arguments]):
    """A compiled function of a kernel, to be called as the function of its text, with arrays that do not overlap.

    Raises when called:
        TypeError: an array that is no contiguous one of float64, or of other dimensions.
        InputError: an effect raised an exception.
    """

    def __init__(self, name: str, kinds: Sequence[int], code: Any) -> None:
        self._name, self._kinds = name, kinds
        self._code = code
        """Kept as long as anybody may call it."""
        self._packed = Struct(_letters(kinds)).pack
        self._function = CFUNCTYPE(c_int32, c_void_p)(code[CALLED.format(name)])

    def __call__(self, *values: *Arguments) -> None:
        """Call it once."""
        if self._function(self._packed(*self._words(values))):
            raise self._failed()

    def bound(self, *values: *Arguments) -> Callable[[], None]:
        """Return the call with these values, to be made many times: of arrays, with what is in them then."""
        given = self._packed(*self._words(values))
        function = self._function

        def call(_kept: object = values) -> None:
            if function(given):
                raise self._failed()

        return call

    def __deepcopy__(self, _: object) -> Self:
        """Return itself: nothing in it changes."""
        return self

    def _words(self, values: Iterable[Any]) -> list[Any]:
        words: list[Any] = []
        for kind, value in zip(self._kinds, values, strict=True):
            if kind == NUMBER:
                words.append(value)
                continue
            try:  # numpy's own way to where an array begins takes five times as long, and a search asks for it often
                begin = addressof(c_double.from_buffer(value))
            except (TypeError, ValueError):  # it is not contiguous, may not be written to, or is empty
                begin = int(value.ctypes.data) if value.flags.c_contiguous else 0
            if not begin or value.dtype != FLOAT64 or value.ndim != kind:
                raise TypeError(f"{self._name} takes contiguous float64, not {value.dtype} of shape {value.shape}")
            words.append(begin)
            words += value.shape
        return words

    def _failed(self) -> InputError:
        problem = f"raised an exception in {self._name}; it must return a number, whatever it is given"
        return InputError("an effect of the valve file", problem)


def processor() -> str:
    """Return what the code is translated for, as a word: whether what is kept fits here."""
    return hashlib.sha256(repr((llvmlite.__version__, *features())).encode()).hexdigest()[:16]


def is_bitcode(content: bytes) -> bool:
    """Return whether it is whole."""
    with _one_at_a_time:
        try:
            binding.parse_bitcode(content)
        except RuntimeError:
            return False
    return True


def translated(bitcode: bytes, entries: Mapping[str, Sequence[int]]) -> bytes:
    """Return the machine code of bitcode: a line of the names that it takes from elsewhere, then an object file.

    Raises:
        RuntimeError: it is no bitcode.
    """
    with _one_at_a_time:
        module = binding.parse_bitcode(bitcode)
        module.link_in(binding.parse_assembly("\n".join(_caller(name, kinds) for name, kinds in entries.items())))
        names = [each.name for each in module.functions if each.is_declaration]
        code = bytes(target_machine(*features()).emit_object(module))
    return " ".join(each for each in names if not each.startswith(INTRINSIC)).encode() + b"\n" + code


def loaded(code: bytes, entries: Mapping[str, Sequence[int]]) -> dict[str, Any]:
    """Return the functions of these names, whose arguments are of these kinds, of translated bitcode.

    Raises:
        RuntimeError: it is no such code, or names what is nowhere to be found.
    """
    names, _, object_file = code.partition(b"\n")
    with _one_at_a_time:
        compiler = _compiler()  # before names are looked up: LLVM then knows this process
        builder = binding.JITLibraryBuilder().add_object_img(object_file)
        for each in names.decode(errors="replace").split():
            builder.import_symbol(each, _address(each))
        for name in entries:
            builder.export_symbol(CALLED.format(name))
        library = builder.add_current_process().link(compiler, f"kernel {next(_libraries)}")
    return {name: Entry(name, kinds, library) for name, kinds in entries.items()}


def _letters(kinds: Iterable[int]) -> str:
    return "".join(WORDS[kind] for kind in kinds)


def _caller(name: str, kinds: Sequence[int]) -> str:
    """Return LLVM's text of the function that calls an entry with the arguments that stand at an address.

    Where a result and an exception go nobody reads.
    """
    types = [IN_LLVM[letter] for letter in _letters(kinds)]
    read = [
        f"%at{i} = getelementptr i64, ptr %words, i64 {i}\n%word{i} = load {kind}, ptr %at{i}"
        for i, kind in enumerate(types)
    ]
    given = ", ".join(["ptr %nowhere", "ptr %nowhere", *(f"{kind} %word{i}" for i, kind in enumerate(types))])
    return "\n".join(
        (
            f"declare i32 @{name}({', '.join(['ptr', 'ptr', *types])})",
            f'define i32 @"{CALLED.format(name)}"(ptr %words) {{',
            "%nowhere = alloca ptr",
            *read,
            f"%status = call i32 @{name}({given})",
            "ret i32 %status }",
        )
    )


def nothing() -> int:
    """Return the address of a function that does nothing, for a name that is never called."""
    return cast(_nothing, c_void_p).value or 0


def _address(name: str) -> int:
    if name in UNREACHED:
        return nothing()
    found = binding.address_of_symbol(name)
    if found is None:  # an effect makes arrays of its own
        from numba.core.registry import cpu_target

        cpu_target.target_context.refresh()
        found = binding.address_of_symbol(name)
    if found is None:
        raise RuntimeError(f"a kernel names {name}, which is nowhere to be found")
    return int(found)


@cache
def _compiler() -> Any:
    target_machine(*features())  # LLVM then knows this machine
    return binding.create_lljit_compiler()


@cache
def target_machine(name: str = "", features: str = "") -> Any:
    """Return what translates for a processor; by default for any of this machine's kind."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    target = binding.Target.from_triple(binding.get_process_triple())
    return target.create_target_machine(cpu=name, features=features, opt=3, reloc="pic", codemodel="default")


def features() -> tuple[str, str]:
    """Return this processor's name and its features, or the name of the one that numba is told of as well."""
    told = os.environ.get("NUMBA_CPU_NAME")
    return (told, "") if told else (binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten())
