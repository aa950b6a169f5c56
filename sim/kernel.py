"""Compiles the bare valve with a set of effects in their places into one kernel, cached across processes.

The kernel's text is `karnopp.py` with its empty places filled: each effect's functions called in the order in which
the effects are listed. The text is written to a cache folder under its own SHA-256; its head holds the digests of the
effects' texts, of the elements they share and of this file, and the numba version. numba keeps the machine code beside
it. A change in any of them is another name, so that an old kernel is never taken for a new one; what is compiled is the
very text that was hashed. (numba's own cache does not see a change in a callee's file.) No fast-math: the order of
operations is the text's.

Of several processes that need a kernel at once, one compiles and the others wait: the file is locked meanwhile.

numba is untyped: its types stop here.
"""

import atexit
import fcntl
import hashlib
import os
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, Protocol

import numba

from config.errors import InputError
from sim import first_order_lag, karnopp, quasi_static
from sim.effect import Effect, execute
from sim.karnopp import MEMORY, Vector
from sim.kernel_source import kernel_source

BASE = Path(karnopp.__file__)
SLOW = Path(quasi_static.__file__)
WRITABLE_BY_OTHERS = 0o022
KARNOPP_IMPORT = re.compile(r"^from sim\.karnopp import \([^)]*\)\n", re.MULTILINE)
"""What stands in one text with `karnopp.py` need not be imported from it."""
SHARED = (first_order_lag,)
"""Elements that effects may import; compiled with them."""
OPTIONS: Mapping[str, Any] = {"error_model": "numpy", "fastmath": False}
"""numpy's error model: a division by zero gives infinity, as in the field's own tools, and costs no branch."""
INNER: Mapping[str, Any] = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Of functions that only compiled ones call: to make them callable from Python would take a third of the time."""
NOT_INLINED = ("bogacki_shampine", "push", "balanced", "breaks", "landed", "passed")
"""Left to the compiler to inline: large, and called from several places."""
NESTED = re.compile(r"Failed in nopython mode pipeline \(step: [^)]*\)")
VECTOR, MATRIX, NUMBER = "f8[::1]", "f8[:,::1]", "f8"
REST = (VECTOR, VECTOR, NUMBER, NUMBER, NUMBER)
ENTRIES: Mapping[str, tuple[str, ...]] = {
    "rest": REST,
    "respond": (VECTOR, VECTOR, VECTOR, VECTOR, NUMBER, NUMBER, MATRIX),
}
SLOW_ENTRIES: Mapping[str, tuple[str, ...]] = {
    "rest": REST,
    "glide": (VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, NUMBER, MATRIX),
}


class _Rest(Protocol):
    def __call__(self, theta: Vector, state: Vector, time: float, position: float, command: float, /) -> None: ...


class _Respond(Protocol):
    def __call__(
        self,
        theta: Vector,
        state: Vector,
        commands: Vector,
        periods: Vector,
        longest_step: float,
        tolerance: float,
        path: Vector,
        /,
    ) -> None: ...


class _Glide(Protocol):
    def __call__(
        self,
        theta: Vector,
        state: Vector,
        commands: Vector,
        periods: Vector,
        told: Vector,
        longest_step: float,
        path: Vector,
        /,
    ) -> None: ...


@dataclass(frozen=True, slots=True)
class Kernel:
    """`rest` and `respond` of `karnopp.py`, compiled with the effects in their places."""

    digest: str
    state_size: int
    rest: _Rest
    respond: _Respond


@dataclass(frozen=True, slots=True)
class QuasiStaticKernel:
    """`rest` of `karnopp.py` and `glide` of `quasi_static.py`, compiled with the effects in their places."""

    digest: str
    state_size: int
    rest: _Rest
    glide: _Glide


def kernel(effects: Sequence[Effect]) -> Kernel:
    """Return the kernel of the bare valve with these effects, compiled or from the cache.

    Raises:
        InputError: an effect's function is not what numba can compile; names its file.
    """
    text = _text(effects, BASE.read_text(encoding="utf-8"))
    digest, compiled = _compiled(text, _sources(effects), tuple(ENTRIES.items()))
    return Kernel(digest, _state_size(effects), **compiled)


def quasi_static_kernel(effects: Sequence[Effect]) -> QuasiStaticKernel:
    """Return the same without inertia, for samples farther apart than a slide lasts.

    Raises:
        InputError: as `kernel`.
    """
    slow = KARNOPP_IMPORT.sub("", SLOW.read_text(encoding="utf-8"))
    text = _text(effects, "\n".join([BASE.read_text(encoding="utf-8"), slow]))
    digest, compiled = _compiled(text, _sources(effects), tuple(SLOW_ENTRIES.items()))
    return QuasiStaticKernel(digest, _state_size(effects), **compiled)


def _sources(effects: Sequence[Effect]) -> tuple[tuple[Path, str], ...]:
    return tuple((each.path, each.source) for each in effects)


def _state_size(effects: Sequence[Effect]) -> int:
    return MEMORY + sum(each.memory for each in effects)


@cache
def _compiled(
    text: str, sources: tuple[tuple[Path, str], ...], signatures: tuple[tuple[str, tuple[str, ...]], ...]
) -> tuple[str, dict[str, Any]]:
    """Return the text's digest and its compiled entries by name."""
    digest = hashlib.sha256(text.encode()).hexdigest()
    module = _module(f"valve_kernel_{digest}")
    file = kernel_file(digest, text)
    exec(compile(text, file, "exec", dont_inherit=True), module.__dict__)
    for i, (path, source) in enumerate(sources):
        part = _module(f"{module.__name__}_{i}")
        execute(source, path, part.__dict__)
        _inlined(part.__dict__)
        module.__dict__.update({f"{name}_{i}": value for name, value in part.__dict__.items() if name[0] != "_"})
    entries = {name: getattr(module, name) for name, _ in signatures}
    _inlined(module.__dict__)
    try:
        with _locked(file):
            return digest, {
                name: numba.njit(f"void({','.join(signature)})", cache=True, nogil=True, **OPTIONS)(entries[name])
                for name, signature in signatures
            }
    except Exception as error:
        if not sources:
            raise
        where = ", ".join(str(path) for path, _ in sources)
        raise InputError(where, f"cannot be compiled: {_reason(error)}") from None


def _reason(error: Exception) -> str:
    """Return what numba says first: the cause and its line, without the callers that follow."""
    return " ".join(NESTED.sub("", str(error).partition("During: ")[0]).split())


def _module(name: str) -> ModuleType:
    """Return a new module where numba finds it when it reads a cached function."""
    sys.modules[name] = ModuleType(name)
    return sys.modules[name]


def _inlined(namespace: dict[str, Any]) -> None:
    """Make the functions of a namespace compiled ones; inlining them triples the speed."""
    for name, value in list(namespace.items()):
        if isinstance(value, FunctionType) and (value.__globals__ is namespace or _is_shared(value)):
            namespace[name] = numba.njit(forceinline=name not in NOT_INLINED, **INNER)(value)


def _is_shared(function: FunctionType) -> bool:
    return any(function.__globals__ is each.__dict__ for each in SHARED)


def kernel_file(digest: str, text: str) -> Path:
    """Return the file that holds the text, in the cache folder or, where that cannot be written, a temporary one."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    try:
        return _write(Path(home) / "positioner" / "kernels" / f"{digest}.py", text)
    except OSError:
        return _write(_temporary_folder() / f"{digest}.py", text)


def _write(path: Path, text: str) -> Path:
    (path.parent / "__pycache__").mkdir(parents=True, exist_ok=True)
    _make_private(path.parent)
    if not os.access(path.parent / "__pycache__", os.W_OK):
        raise PermissionError
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=path.parent, delete=False) as file:
            file.write(text)
        Path(file.name).replace(path)
    return path


def _make_private(folder: Path) -> None:
    """See that nobody else may put a kernel there, which would run as this user.

    Raises:
        PermissionError: it is somebody else's.
    """
    found = folder.stat()
    if found.st_uid != os.getuid():
        raise PermissionError
    if found.st_mode & WRITABLE_BY_OTHERS:
        folder.chmod(0o700)


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Keep other processes from compiling the file meanwhile: numba's index of the cache is not safe against them.

    Where the file system has no locks each compiles for itself.
    """
    with path.open() as file:
        with suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


@cache
def _temporary_folder() -> Path:
    folder = tempfile.TemporaryDirectory(prefix="positioner-")
    atexit.register(folder.cleanup)
    return Path(folder.name)


def _text(effects: Sequence[Effect], laws: str) -> str:
    """Return a kernel's text: the laws, and their places filled."""
    digests = {each.name: hashlib.sha256(each.source.encode()).hexdigest() for each in effects}
    files = (__file__, *(str(each.__file__) for each in SHARED))
    parts = {Path(each).name: hashlib.sha256(Path(each).read_bytes()).hexdigest() for each in files}
    head = f"# numba {numba.__version__}, {parts}, effects {digests}"
    return "\n".join([head, laws, kernel_source(effects) if effects else "", ""])
