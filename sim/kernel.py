"""Compiles the bare valve with a set of effects in their places into one kernel, cached across processes.

The kernel's text is `karnopp.py` with its empty places filled: each effect's functions called in the order in which
the effects are listed. The text is written to a cache folder under its own SHA-256; its head holds the digests of the
effects' texts, of the elements they share, of this file and of those that compile, and the numba version. A change in
any of them is another name, so that an old kernel is never taken for a new one; what is compiled is the very text that
was hashed. Beside it are kept what `kernel_compiler` makes of it and what `machine_code` makes of that for a
processor, so that numba is started, and LLVM translates, only where a kernel is new.

Of several processes that need a kernel at once, one compiles and the others wait: the file is locked meanwhile.
"""

import atexit
import fcntl
import hashlib
import os
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from sim import karnopp, machine_code, quasi_static
from sim.effect import Effect
from sim.karnopp import MEMORY, Vector
from sim.kernel_source import SHARED, kernel_source
from sim.machine_code import MATRIX, NUMBER, VECTOR, Entry, loaded, processor, translated

BASE = Path(karnopp.__file__)
SLOW = Path(quasi_static.__file__)
COMPILER = Path(__file__).with_name("kernel_compiler.py")
WRITABLE_BY_OTHERS = 0o022
KARNOPP_IMPORT = re.compile(r"^from sim\.karnopp import \([^)]*\)\n", re.MULTILINE)
"""What stands in one text with `karnopp.py` need not be imported from it."""
BITCODE = ".bc"
REST = (VECTOR, VECTOR, NUMBER, NUMBER, NUMBER)
ENTRIES: Mapping[str, tuple[int, ...]] = {
    "rest": REST,
    "respond": (VECTOR, VECTOR, VECTOR, VECTOR, NUMBER, NUMBER, MATRIX),
}
SLOW_ENTRIES: Mapping[str, tuple[int, ...]] = {
    "rest": REST,
    "glide": (VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, NUMBER, MATRIX),
}


@dataclass(frozen=True, slots=True)
class Kernel:
    """`rest` and `respond` of `karnopp.py`, compiled with the effects in their places."""

    digest: str
    bitcode: bytes = field(repr=False)
    """LLVM's, of the functions as `sim.machine_code` calls them."""
    state_size: int
    rest: Entry[Vector, Vector, float, float, float]
    respond: Entry[Vector, Vector, Vector, Vector, float, float, Vector]


@dataclass(frozen=True, slots=True)
class QuasiStaticKernel:
    """`rest` of `karnopp.py` and `glide` of `quasi_static.py`, compiled with the effects in their places."""

    digest: str
    state_size: int
    rest: Entry[Vector, Vector, float, float, float]
    glide: Entry[Vector, Vector, Vector, Vector, Vector, float, Vector]


def kernel(effects: Sequence[Effect]) -> Kernel:
    """Return the kernel of the bare valve with these effects, compiled or from the cache.

    Raises:
        InputError: an effect's function is not what numba can compile; names its file.
    """
    text = _text(effects, BASE.read_text(encoding="utf-8"))
    digest, bitcode, compiled = _compiled(text, _sources(effects), tuple(ENTRIES.items()))
    return Kernel(digest, bitcode, _state_size(effects), **compiled)


def quasi_static_kernel(effects: Sequence[Effect]) -> QuasiStaticKernel:
    """Return the same without inertia, for samples farther apart than a slide lasts.

    Raises:
        InputError: as `kernel`.
    """
    slow = KARNOPP_IMPORT.sub("", SLOW.read_text(encoding="utf-8"))
    text = _text(effects, "\n".join([BASE.read_text(encoding="utf-8"), slow]))
    digest, _, compiled = _compiled(text, _sources(effects), tuple(SLOW_ENTRIES.items()))
    return QuasiStaticKernel(digest, _state_size(effects), **compiled)


def _sources(effects: Sequence[Effect]) -> tuple[tuple[Path, str], ...]:
    return tuple((each.path, each.source) for each in effects)


def _state_size(effects: Sequence[Effect]) -> int:
    return MEMORY + sum(each.memory for each in effects)


@cache
def _compiled(
    text: str, sources: tuple[tuple[Path, str], ...], entries: tuple[tuple[str, tuple[int, ...]], ...]
) -> tuple[str, bytes, dict[str, Any]]:
    """Return the text's digest, its bitcode and its entries by name."""
    digest = hashlib.sha256(text.encode()).hexdigest()
    file = kernel_file(digest, text)
    kept, code = file.with_suffix(BITCODE), file.with_suffix(f".{processor()}.o")
    with _locked(file):
        with suppress(OSError, RuntimeError):  # not there, or torn by a machine that went down
            return digest, kept.read_bytes(), loaded(code.read_bytes(), dict(entries))
        from sim.kernel_compiler import bitcode  # numba takes half a second to begin

        made = bitcode(text, file, sources, dict(entries))
        machine_code = translated(made)
        with suppress(OSError):  # a full disk
            _replace(kept, made)
            _replace(code, machine_code)
    return digest, made, loaded(machine_code, dict(entries))


def kernel_file(digest: str, text: str) -> Path:
    """Return the file that holds the text, in the cache folder or, where that cannot be written, a temporary one."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    try:
        return _write(Path(home) / "positioner" / "kernels" / f"{digest}.py", text)
    except OSError:
        return _write(_temporary_folder() / f"{digest}.py", text)


def _write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    _make_private(path.parent)
    if not os.access(path.parent, os.W_OK):
        raise PermissionError
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        _replace(path, text.encode())
    return path


def _replace(path: Path, content: bytes) -> None:
    """Write a file so that nobody ever sees a part of it."""
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
        file.write(content)
    Path(file.name).replace(path)


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
    """Keep other processes from compiling the file meanwhile.

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
    files = (__file__, str(COMPILER), machine_code.__file__, *(str(each.__file__) for each in SHARED))
    parts = {Path(each).name: hashlib.sha256(Path(each).read_bytes()).hexdigest() for each in files}
    head = f"# numba {version('numba')}, {parts}, effects {digests}"
    return "\n".join([head, laws, kernel_source(effects) if effects else "", ""])
