"""A folder with hidden recordings and their sealed answer.

    sha256 = SHA-256(JSON of the answer, its salt and the SHA-256 of each file with it)

The seal is published first and binds the answer and the files: neither can be changed afterwards unseen. The answer
itself is only encoded, in base64: that keeps it from being read by accident, not from being read. Nor does it keep
anybody from drawing the same seed again.
"""

import base64
import binascii
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, FiniteFloat, ValidationError, model_validator

from config.errors import CommandFailed, InputError, explain_failure
from config.recording import write_recording
from config.valve_file_writer import valve_toml
from workbench.blind.hiding import Hidden

SEALED = "sealed.json"
FILES = ("fit.csv", "test.csv", "valve.toml")


class _Seen(BaseModel):
    is_visible: bool
    fit_m: FiniteFloat
    test_m: FiniteFloat


class _Floor(BaseModel):
    fit: FiniteFloat
    test: FiniteFloat


class _Answer(BaseModel):
    """What a sealed answer holds: anybody may have written it."""

    model_config = ConfigDict(strict=True)

    effects: list[dict[str, str | float]]
    valve: dict[str, str | float]
    floor_m: _Floor
    visible: dict[str, _Seen]
    files: dict[Literal["fit.csv", "test.csv", "valve.toml"], str]

    @model_validator(mode="after")
    def _check_named(self) -> Self:
        for table in (*self.effects, self.valve):
            if not isinstance(table.get("name"), str) or any(
                isinstance(table[key], str) for key in {*table} - {"name"}
            ):
                raise ValueError("a table has a name and numbers")
        if {str(each["name"]) for each in self.effects} - set(self.visible):
            raise ValueError("of an effect it is not said whether it is visible")
        if set(self.files) != set(FILES):
            raise ValueError("the digest of a file is missing")
        return self


def seal(folder: Path, hidden: Hidden) -> str:
    """Write `fit.csv`, `test.csv`, `valve.toml` and `sealed.json`; return the seal.

    Raises:
        InputError: the folder cannot be written, or holds a sealed answer already.
    """
    if (folder / SEALED).exists():
        raise InputError(str(folder), "holds a sealed answer already; reveal it, or choose another folder")
    with explain_failure(folder, "cannot be written"):
        folder.mkdir(parents=True, exist_ok=True)
        write_recording(folder / "fit.csv", hidden.fit)
        write_recording(folder / "test.csv", hidden.test)
        (folder / "valve.toml").write_text(valve_toml(hidden.base), encoding="utf-8")
        text = json.dumps({**hidden.answer, "files": {name: _sha256((folder / name).read_bytes()) for name in FILES}})
        sealed = {"sha256": _sha256(text.encode()), "answer_base64": base64.b64encode(text.encode()).decode()}
        (folder / SEALED).write_text(json.dumps(sealed, indent=1) + "\n", encoding="utf-8")
    return sealed["sha256"]


def reveal(folder: Path) -> tuple[str, Mapping[str, Any]]:
    """Return the seal and the answer, once both and the files prove to be those of the sealing.

    Raises:
        InputError: there is no sealed answer, or it cannot be read.
        CommandFailed: the answer or a file is not the one that was sealed.
    """
    path = folder / SEALED
    try:
        sealed = json.loads(path.read_text(encoding="utf-8"))
        text = base64.b64decode(sealed["answer_base64"], validate=True)
        digest = str(sealed["sha256"])
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, RecursionError, binascii.Error):
        raise InputError(str(path), "is not a sealed answer: it must hold sha256 and answer_base64") from None
    if _sha256(text) != digest:
        raise CommandFailed(f"{path}: the answer is not the one that was sealed: its SHA-256 is another")
    try:
        answer: dict[str, Any] = _Answer.model_validate_json(text).model_dump()
    except (ValidationError, RecursionError) as error:
        first = error.errors()[0] if isinstance(error, ValidationError) else {"loc": (), "msg": "nested too deep"}
        where = ".".join(map(str, first["loc"])) or "the answer"
        raise InputError(str(path), f"holds no answer that hide has sealed: {where}: {first['msg']}") from None
    for name, expected in answer["files"].items():
        if not (folder / name).is_file() or _sha256((folder / name).read_bytes()) != expected:
            raise CommandFailed(f"{folder / name}: is not the file that was sealed")
    return digest, answer


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
