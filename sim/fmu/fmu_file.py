"""A valve file as one file that other simulators load: `modelDescription.xml` and a library for Linux, zipped."""

import os
import platform
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Sequence
from hashlib import sha256
from importlib.metadata import version
from io import BytesIO
from math import inf
from pathlib import Path
from uuid import UUID

from config.errors import CommandFailed, InputError, explain_failure
from sim.composition import BASE, Composition
from sim.fmu.kernel_object import kernel_object
from sim.fmu.model_description import ABOVE_ZERO, IDENTIFIER, Variable, model_description, variables
from sim.karnopp import TOLERANCE
from sim.open_loop import STEP_S

PLATFORM = "linux64"
"""FMI 2.0's word for Linux on x86-64, the one that a library is made for."""
SLAVE = Path(__file__).with_name("slave.c")
LONG_AGO = (1980, 1, 1, 0, 0, 0)
"""The date of the zipped files: the same valve, the same bytes."""
EXPORTED = "{ global: fmi2*; local: *; };"
"""For the linker: nothing else of the library is seen from outside."""
PARAMETERS_FROM = 7
BIGGEST = "1.7976931348623157e308"


def export_fmu(composition: Composition, path: Path) -> None:
    """Write the valve as an FMU.

    Raises:
        InputError: this machine is none for which a library can be made, it has no C compiler, or `path` cannot be
            written.
        CommandFailed: the compiler refuses.
    """
    if (platform.system(), platform.machine()) != ("Linux", "x86_64"):
        there = f"{platform.system()} on {platform.machine()}"
        raise InputError(str(path), f"an FMU is made on Linux on x86_64 and for it, this machine is {there}")
    tool = f"positioner {version('positioner')}"
    plain = model_description(composition, "", tool)
    guid = f"{{{UUID(bytes=sha256(composition.kernel.digest.encode() + plain).digest()[:16])}}}"
    library = _library(composition, guid)
    whole = BytesIO()
    with zipfile.ZipFile(whole, "w") as unit:
        _put(unit, "modelDescription.xml", model_description(composition, guid, tool))
        _put(unit, f"binaries/{PLATFORM}/{IDENTIFIER}.so", library)
    with explain_failure(path, "cannot be written"):
        path.write_bytes(whole.getvalue())


def _put(unit: zipfile.ZipFile, name: str, content: bytes) -> None:
    unit.writestr(zipfile.ZipInfo(name, LONG_AGO), content, zipfile.ZIP_DEFLATED)


def _library(composition: Composition, guid: str) -> bytes:
    compiler = shutil.which(os.environ.get("CC", "cc"))
    if compiler is None:
        raise InputError("positioner export fmu", "needs a C compiler: apt install gcc, or name one in CC")
    with tempfile.TemporaryDirectory() as there:
        folder = Path(there)
        (folder / "valve.o").write_bytes(kernel_object(composition))
        (folder / "valve.h").write_text(header(composition, guid), encoding="utf-8")
        (folder / "exported").write_text(EXPORTED, encoding="utf-8")
        words = [compiler, "-shared", "-fPIC", "-O2", "-fvisibility=hidden", "-std=c11", "-ffp-contract=off"]
        words += [
            "-Wl,--no-undefined,--version-script=exported",
            "-s",
            "-I.",
            "-o",
            "valve.so",
            str(SLAVE),
            "valve.o",
            "-lm",
        ]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise CommandFailed(f"{compiler}: {done.stderr.strip().splitlines()[-1] if done.stderr else 'failed'}")
        return (folder / "valve.so").read_bytes()


def header(composition: Composition, guid: str) -> str:
    """Return `valve.h`: the sizes, the starts and the ranges that `slave.c` asks for."""
    theta = variables(composition)[PARAMETERS_FROM:]
    return "\n".join(
        [
            f'#define GUID "{guid}"',
            f"#define PARAMETERS {len(theta)}",
            f"#define STATE {composition.state_size}",
            f"#define STEP_S {STEP_S!r}",
            f"#define TOLERANCE {TOLERANCE!r}",
            f"#define COULOMB {BASE.index('coulomb_n')}",
            f"#define STATIC {BASE.index('static_n')}",
            _table("double START", [_number(each.start or 0.0) for each in theta]),
            _table("double LEAST", [_number(each.least) for each in theta]),
            _table("double MOST", [_number(each.most) for each in theta]),
            _table("char ABOVE_ZERO", [str(int(each.name in ABOVE_ZERO)) for each in theta]),
            _table("char *const NAMES", [_refusal(each) for each in theta]),
            "",
        ]
    )


def _table(head: str, values: Sequence[str]) -> str:
    return f"static const {head}[] = {{{', '.join(values)}}};"


def _number(value: float) -> str:
    return BIGGEST if value == inf else f"-{BIGGEST}" if value == -inf else repr(value)


def _refusal(each: Variable) -> str:
    """Return what is logged of a value that is not physical; %g is the value."""
    least = f"above {each.least:g}" if each.name in ABOVE_ZERO else f"from {each.least:g}"
    return f'"{each.name}: must be {least} to {each.most:g}, got %g"'
