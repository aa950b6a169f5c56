"""Results kept in a folder, one file each, named by the content of what they are of: none is worked out twice.

A file is written whole or not at all, so that whoever is killed loses only what was under way. The folder says which
form its files have; another form is refused, never half-read. A fleet's examinations and a plant's loops share one.
"""

import json
from collections.abc import Sequence
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Generic, TypeVar

from pydantic import TypeAdapter

from config.errors import InputError, explain_failure
from config.whole_file import replace_whole

FORM = 1
"""Of the folder; to be raised when it is laid out differently."""
Kept = TypeVar("Kept")


class KeptResults(Generic[Kept]):
    """The folder, for results of one type.

    Raises:
        InputError: it cannot be written, or has another form.
    """

    def __init__(self, folder: Path, kind: type[Kept]) -> None:
        self.folder = folder
        self._form: TypeAdapter[Kept] = TypeAdapter(kind)
        marker = folder / "fleet.json"
        with explain_failure(folder, "cannot be written"):
            (folder / "examinations").mkdir(parents=True, exist_ok=True)
            if not marker.exists():
                replace_whole(marker, json.dumps({"form": FORM}) + "\n")
        _require_form(marker)

    def get(self, key: str) -> Kept | None:
        """Return what was kept; None if nothing is, or what is there cannot be read."""
        try:
            return self._form.validate_json(self._path(key).read_bytes())
        except (OSError, ValueError):
            return None

    def put(self, key: str, found: Kept) -> None:
        """Keep a result.

        Raises:
            InputError: the disk is full, or the folder is gone.
        """
        path = self._path(key)
        try:
            path.parent.mkdir(exist_ok=True)
            replace_whole(path, self._form.dump_json(found).decode() + "\n")
        except OSError as error:
            raise InputError(str(path), f"cannot be written: {error.strerror}; what is kept stays") from None

    def _path(self, key: str) -> Path:
        return self.folder / "examinations" / key[:2] / f"{key}.json"


def _require_form(marker: Path) -> None:
    try:
        form = json.loads(marker.read_text(encoding="utf-8"))["form"]
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(str(marker), "is none of a fleet's: choose another folder") from None
    if form != FORM:
        raise InputError(str(marker), f"form: is {form}, allowed is {FORM}: choose another folder, or remove this one")


def key_of(file: Path, judges: Sequence[object]) -> str:
    """Return the name of a result: of the bytes of a file, of this version, and of all else that judges it.

    Raises:
        OSError: the file cannot be read.
    """
    digest = sha256(file.read_bytes())
    digest.update(json.dumps([version("positioner"), *judges]).encode())
    return digest.hexdigest()
