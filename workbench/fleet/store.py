"""Examinations kept in a folder, one file each, named by the content of what was examined: none is made twice.

A file is written whole or not at all, so that whoever is killed loses only what was under way. The folder says which
form its files have; another form is refused, never half-read.
"""

import json
from collections.abc import Sequence
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from config.errors import InputError
from config.valve_file import ValveFile
from config.whole_file import replace_whole
from config.writing import valve_toml
from sim.effect import find_effect
from workbench.fleet.examination import RULES, Examination

FORM = 1
"""Of the folder; to be raised when it is laid out differently."""


class Store:
    """The folder.

    Raises:
        InputError: it cannot be written, or has another form.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        marker = folder / "fleet.json"
        try:
            (folder / "examinations").mkdir(parents=True, exist_ok=True)
            if not marker.exists():
                replace_whole(marker, json.dumps({"form": FORM}) + "\n")
        except OSError as error:
            raise InputError(str(folder), f"cannot be written: {error.strerror}") from None
        _require_form(marker)

    def get(self, key: str) -> Examination | None:
        """Return what was kept; None if nothing is, or what is there cannot be read."""
        try:
            return Examination.model_validate_json(self._path(key).read_bytes())
        except (OSError, ValueError):
            return None

    def put(self, key: str, found: Examination) -> None:
        """Keep an examination.

        Raises:
            InputError: the disk is full, or the folder is gone.
        """
        path = self._path(key)
        try:
            path.parent.mkdir(exist_ok=True)
            replace_whole(path, found.model_dump_json() + "\n")
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


def request_key(recording: Path, model: ValveFile, known_by: str) -> str:
    """Return the name of an examination: of the bytes of the recording and of all that judges it.

    Args:
        recording: the file.
        model: what it is held against.
        known_by: the name of the examination by which the model was accepted; empty for a drawing.

    Raises:
        OSError: the recording cannot be read.
    """
    own = [find_effect(each.name, str(recording)) for each in model.effect if each.name.endswith(".py")]
    judges: Sequence[object] = [
        RULES,
        version("positioner"),
        known_by,
        valve_toml(model),
        *(each.source for each in own),
    ]
    digest = sha256(recording.read_bytes())
    digest.update(json.dumps(judges).encode())
    return digest.hexdigest()
