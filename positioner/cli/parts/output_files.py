"""What a command writes because an option asks for it: `--out` a folder, `--json` a file.

A path that cannot be written is bad input: one line that names the option, before the work begins (`writable`) where it
can be known. So is one that the same command reads, whose only copy would be gone, and one that is drawn by a package
which is not installed. `check_outputs` sees to all of them.
"""

import argparse
import errno
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from config.errors import InputError
from config.extras import import_extra
from config.whole_file import beside

OPTIONS: Mapping[str, str] = {"out": "-o", "json": "--json", "report": "--report", "picture": "--picture"}
"""By which files are written, by their names among a command's arguments."""
DRAWN_BY: Mapping[str, str] = {"report": "plotly", "picture": "matplotlib.pyplot"}
"""The package that draws into a file, of those that need one."""


def check_outputs(arguments: argparse.Namespace) -> None:
    """Refuse an output that cannot be written, or is an input or another output of the command; of any command.

    Raises:
        InputError: names the option and the file, and the extra where what draws it is not installed.
    """
    said = vars(arguments)
    written = {name: said[name] for name in OPTIONS if isinstance(said.get(name), Path)}
    read = [path for name, value in said.items() if name not in written for path in _files(value)]
    for name, path in written.items():
        if name in DRAWN_BY:
            _require_drawing(DRAWN_BY[name], f"{OPTIONS[name]} {path}")
        if name != "out":  # which may be a folder, yet to be made
            writable(path, OPTIONS[name])
        if path.is_file() and any(path.samefile(each) for each in read):
            raise InputError(f"{OPTIONS[name]} {path}", "is read by this command as well; allowed is another file")
        alike = next((each for each in written if os.path.realpath(written[each]) == os.path.realpath(path)), name)
        if alike != name and (path.is_file() or not path.exists()):
            problem = f"is written by {OPTIONS[alike]} as well; allowed is another file"
            raise InputError(f"{OPTIONS[name]} {path}", problem)


def _require_drawing(module: str, output: str) -> None:
    try:
        import_extra(module, "it")
    except ModuleNotFoundError as error:
        raise InputError(output, str(error)) from None


def _files(value: object) -> Iterator[Path]:
    """Yield the files that an argument names."""
    for each in value if isinstance(value, list | tuple) else [value]:
        if isinstance(each, str | Path) and os.path.isfile(each):  # a name of a shipped valve may be one, too
            yield Path(each)


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, unless it is there; files can be written there then.

    Raises:
        InputError: it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable("--out", folder, error) from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise _unwritable("--out", folder, OSError(errno.EACCES, os.strerror(errno.EACCES)))


def writable(path: Path | None, option: str) -> None:
    """Check that a file can be written where an option says, without touching it; None is no option.

    Raises:
        InputError: its folder is not there, it is a folder itself, or may not be written.
    """
    if path is None:
        return
    if path.is_dir():
        raise _unwritable(option, path, OSError(errno.EISDIR, os.strerror(errno.EISDIR)))
    if not path.parent.is_dir():
        raise _unwritable(option, path, OSError(errno.ENOENT, f"there is no folder {path.parent}"))
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise _unwritable(option, path, OSError(errno.EACCES, os.strerror(errno.EACCES)))


def recording_writable(path: Path, option: str) -> None:
    """Check that a recording can be written where an option says, as what its name promises.

    Raises:
        InputError: as `writable`, or it is named as another format than a recording is written in.
    """
    from config.recording import require_recording_name

    writable(path, option)
    require_recording_name(path)


def write_json(path: Path | None, values: object, indent: int | None = None) -> None:
    """Write a result, where `--json` names a file, on one line unless indented; null for what is no finite number.

    Raises:
        InputError: it cannot be written.
    """
    from config.json_value import json_value

    if path is not None:
        write_text(path, json.dumps(json_value(values), indent=indent, allow_nan=False) + "\n", "--json")


def write_text(path: Path, text: str, option: str) -> None:
    """Write a file that an option asks for.

    Raises:
        InputError: it cannot be written.
    """
    try:
        with beside(path) as new:
            new.write_text(text, encoding="utf-8")
    except OSError as error:
        raise _unwritable(option, path, error) from None


def _unwritable(option: str, path: Path, error: OSError) -> InputError:
    return InputError(f"{option} {path}", f"cannot be written: {error.strerror}")
