"""Compiles the bare valve with a set of effects in their places into one kernel, cached across processes.

The laws, `karnopp.py` and what goes with it, are compiled once, with their places open, and so is each effect, as what
fills its places; a kernel is these, linked in the order in which the effects are listed. All texts are written to a
cache folder under their own SHA-256. The heads of laws and effects hold the digests of the elements that effects share,
of this file and of those that compile, and the numba version; a kernel's text is the digests of its laws and effects,
and which of them fill which place. A change in any of them is another name, so that an old kernel is never taken for a
new one; what is compiled is the very text that was hashed.
Beside it are kept what `kernel_compiler` or `kernel_linker` make of it and what `machine_code` makes of that for a
processor: numba is started only where laws or effects are new, and LLVM translates only where a kernel is.

Of several processes that need a part at once, one compiles and the others wait: a file beside it is locked meanwhile.
"""

import atexit
import hashlib
import os
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from config.lock_file import lock_descriptor
from sim import karnopp, kernel_linker, machine_code, quasi_static, told
from sim.effect import Effect
from sim.karnopp import MEMORY, Vector
from sim.kernel_source import SHARED, Filling, effect_source, fillings
from sim.machine_code import MATRIX, NUMBER, VECTOR, Entry, is_bitcode, loaded, processor, translated

BASE = Path(karnopp.__file__)
SLOW = Path(quasi_static.__file__)
TOLD = Path(told.__file__)
COMPILER = Path(__file__).with_name("kernel_compiler.py")
WRITABLE_BY_OTHERS = 0o022
KARNOPP_IMPORT = re.compile(r"^from sim\.karnopp import \([^)]*\)\n", re.MULTILINE)
"""What stands in one text with `karnopp.py` need not be imported from it."""
BITCODE = ".bc"
EITHER: Mapping[str, tuple[int, ...]] = {
    "rest": (VECTOR, VECTOR, NUMBER, NUMBER, NUMBER),
    "begin": (VECTOR, VECTOR, NUMBER, NUMBER, NUMBER, NUMBER),
}
"""Entries of every kernel."""
ENTRIES: Mapping[str, tuple[int, ...]] = {
    **EITHER,
    "respond": (VECTOR, VECTOR, VECTOR, VECTOR, NUMBER, NUMBER, MATRIX),
}
SLOW_ENTRIES: Mapping[str, tuple[int, ...]] = {
    **EITHER,
    "glide": (VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, NUMBER, MATRIX),
}


TOLD_ENTRIES: Mapping[str, tuple[int, ...]] = {
    **EITHER,
    "tell": (VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, NUMBER, NUMBER, NUMBER, NUMBER, VECTOR, MATRIX),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class EitherKernel:
    """`rest` and `begin` of `karnopp.py`, with the effects in their places."""

    digest: str
    state_size: int
    rest: Entry[Vector, Vector, float, float, float]
    begin: Entry[Vector, Vector, float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Kernel(EitherKernel):
    """The same and `respond` of `karnopp.py`."""

    bitcode: bytes = field(repr=False)
    """LLVM's, of the functions as `sim.machine_code` calls them."""
    respond: Entry[Vector, Vector, Vector, Vector, float, float, Vector]


@dataclass(frozen=True, slots=True, kw_only=True)
class QuasiStaticKernel(EitherKernel):
    """The same and `glide` of `quasi_static.py`."""

    glide: Entry[Vector, Vector, Vector, Vector, Vector, float, Vector]


@dataclass(frozen=True, slots=True, kw_only=True)
class ToldKernel(EitherKernel):
    """The same and `tell` of `told.py`."""

    tell: Entry[Vector, Vector, Vector, Vector, Vector, Vector, float, float, float, float, Vector, Vector]


def told_kernel(effects: Sequence[Effect]) -> ToldKernel:
    """Return the kernel of a stem that is told when it moves.

    Raises:
        InputError: as `kernel`.
    """
    digest, _, compiled = _of(effects, (BASE, TOLD), TOLD_ENTRIES)
    return ToldKernel(digest=digest, state_size=_state_size(effects), **compiled)


def kernel(effects: Sequence[Effect]) -> Kernel:
    """Return the kernel of the bare valve with these effects, compiled or from the cache.

    Raises:
        InputError: an effect's function is not what numba can compile; names its file.
    """
    digest, bitcode, compiled = _of(effects, (BASE,), ENTRIES)
    return Kernel(digest=digest, bitcode=bitcode, state_size=_state_size(effects), **compiled)


def quasi_static_kernel(effects: Sequence[Effect]) -> QuasiStaticKernel:
    """Return the same without inertia, for samples farther apart than a slide lasts.

    Raises:
        InputError: as `kernel`.
    """
    digest, _, compiled = _of(effects, (BASE, SLOW), SLOW_ENTRIES)
    return QuasiStaticKernel(digest=digest, state_size=_state_size(effects), **compiled)


def _state_size(effects: Sequence[Effect]) -> int:
    return MEMORY + sum(each.memory for each in effects)


def _of(
    effects: Sequence[Effect], files: tuple[Path, ...], entries: Mapping[str, tuple[int, ...]]
) -> tuple[str, bytes, dict[str, Any]]:
    """Return the digest, the bitcode and the entries, by name, of the kernel of these laws and effects.

    The compiled entries are kept by the texts, for an effect that was edited is another one.
    """
    parts = tuple((each.path, each.source, _text(each)) for each in effects)
    filled = tuple((place, tuple(each)) for place, each in fillings(effects).items())
    return _compiled(_text_of_laws(files), parts, filled, tuple(entries.items()))


@cache
def _text_of_laws(files: tuple[Path, ...]) -> str:
    texts = [KARNOPP_IMPORT.sub("", each.read_text(encoding="utf-8")) for each in files]
    return _with_head("\n".join(texts))


@cache
def _compiled(
    laws: str,
    effects: tuple[tuple[Path, str, str], ...],
    filled: tuple[tuple[str, tuple[Filling, ...]], ...],
    entries: tuple[tuple[str, tuple[int, ...]], ...],
) -> tuple[str, bytes, dict[str, Any]]:
    places = {place: [tuple(each) for each in filling] for place, filling in filled if filling}
    text = f"# laws {_digest(laws)}, effects {[_digest(each) for *_, each in effects]}, places {places}\n"
    digest, kinds = _digest(text), dict(entries)
    file = kernel_file(digest, text)
    code = file.with_suffix(f".{processor()}.o")

    def linked() -> bytes:
        return kernel_linker.linked(_laws(laws, kinds), [_effect(*each) for each in effects], dict(filled), kinds)

    with _locked(file):
        bitcode = _bitcode(file, linked)
        with suppress(OSError, RuntimeError):  # not there, or torn by a machine that went down
            return digest, bitcode, loaded(code.read_bytes(), kinds)
        machine_code = translated(bitcode, kinds)
        _keep(code, machine_code)
    return digest, bitcode, loaded(machine_code, kinds)


def _laws(text: str, entries: Mapping[str, tuple[int, ...]]) -> bytes:
    def compiled(file: Path) -> bytes:
        from sim import kernel_compiler  # numba takes half a second to begin

        return kernel_compiler.laws(text, file, entries)

    return _part(text, compiled)


def _effect(path: Path, source: str, text: str) -> bytes:
    def compiled(file: Path) -> bytes:
        from sim import kernel_compiler

        return kernel_compiler.effect(source, path, text, file)

    return _part(text, compiled)


def _part(text: str, compiled: Callable[[Path], bytes]) -> bytes:
    """Return the bitcode of a text that kernels share."""
    file = kernel_file(_digest(text), text)
    with _locked(file):
        return _bitcode(file, lambda: compiled(file))


def _bitcode(file: Path, compiled: Callable[[], bytes]) -> bytes:
    """Return what is kept beside a text, or else compile it and keep it."""
    kept = file.with_suffix(BITCODE)
    with suppress(OSError):
        found = kept.read_bytes()
        if is_bitcode(found):  # or torn by a machine that went down
            return found
    made = compiled()
    _keep(kept, made)
    return made


def _keep(file: Path, content: bytes) -> None:
    with suppress(OSError):  # a full disk
        _replace(file, content)


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
    if not hasattr(os, "getuid"):  # Windows: a person's own folder is theirs alone
        return
    if found.st_uid != os.getuid():
        raise PermissionError
    if found.st_mode & WRITABLE_BY_OTHERS:
        folder.chmod(0o700)


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Keep other processes from compiling the file meanwhile.

    Where the file system has no locks each compiles for itself. The text itself is no lock: of two processes that both
    find it missing the second puts another file in its place.
    """
    with path.with_suffix(".lock").open("a") as file:
        with suppress(OSError):
            lock_descriptor(file.fileno(), waits=True)
        yield


@cache
def _temporary_folder() -> Path:
    folder = tempfile.TemporaryDirectory(prefix="positioner-")
    atexit.register(folder.cleanup)
    return Path(folder.name)


def _text(effect: Effect) -> str:
    """Return the text of the places that an effect fills, after a line of what it is compiled with."""
    return _with_head(f"# {_digest(effect.source)}\n" + "\n\n".join(effect_source(effect).values()))


def _with_head(text: str) -> str:
    """Return a text after a line of what compiles it."""
    return f"# {_compilers()}\n{text}\n"


@cache
def _compilers() -> str:
    """Return numba's version and the digests of the files that compile, and of the elements that effects share."""
    modules = (kernel_linker, machine_code, *SHARED)
    files = (__file__, str(COMPILER), *(str(each.__file__) for each in modules))
    digests = {Path(each).name: hashlib.sha256(Path(each).read_bytes()).hexdigest() for each in files}
    return f"numba {version('numba')}, {digests}"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
