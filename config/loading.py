"""Reads a TOML file into a schema; each fault is one line: file, key, value and what is allowed."""

import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Strict,
    Tag,
    ValidationError,
    ValidationInfo,
)

from config.errors import InputError
from config.plain_file import read_plain

SHIPPED = Path(str(resources.files("config")))
"""Where the shipped valve files and profiles lie."""


class Schema(BaseModel):
    """A table a person writes: immutable, no unknown keys, finite numbers only, and nothing taken for a number.

    Arrays (`Many`, `Pair`) and paths (`NearFile`) alone are made of what TOML has in their place.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Port = Annotated[int, Field(ge=1, le=65535)]


def between(least: float, most: float, *, or_zero: bool = False) -> AfterValidator:
    """Let a number be in a range, both ends included, or 0 where that means none; what is allowed is said at once."""

    def check(value: float) -> float:
        if not (least <= value <= most or (or_zero and value == 0)):
            raise ValueError(f"allowed is {'0, or ' if or_zero else ''}{least:g} to {most:g}")
        return value

    return AfterValidator(check)


Stroke = Annotated[float, between(1e-9, 1e6)]
"""Of a valve, m, or of a drive, rad: generous, but what is beyond it was no length."""
Pressure = Annotated[float, between(1e-3, 1e9)]
"""Pa: generous, but what is beyond it overflows a register, or was no pressure."""


def _label(name: str) -> str:
    if not name or name != name.strip() or not name.isprintable():
        raise ValueError("must be printable characters, none of them a space at its ends")
    return name


Label = Annotated[str, AfterValidator(_label)]
"""A name by which people, files and logs call something."""


def _named(path: str) -> str:
    if "\0" in path or not path:
        raise ValueError("must be the name of a file or a folder")
    if path.startswith("~"):
        raise ValueError("~ is not read as a home folder: write it in full")
    return path


def wide(least: float, *, either_way: bool = False) -> AfterValidator:
    """Let two ends be so far apart, the lower one first unless `either_way`."""

    def check(ends: tuple[float, float]) -> tuple[float, float]:
        if (abs(ends[1] - ends[0]) if either_way else ends[1] - ends[0]) < least:
            raise ValueError(f"must be at least {least:g} wide{'' if either_way else ', the lower end first'}")
        return ends

    return AfterValidator(check)


T = TypeVar("T")
Many = Annotated[tuple[T, ...], Strict(False)]
"""An array, of any length or"""
Pair = Annotated[tuple[T, T], Strict(False)]
"""of two."""

FolderName = Annotated[str, AfterValidator(_named)]
"""A folder, from that of the file it is written in."""


def _beside(path: Path, info: ValidationInfo) -> Path:
    _named(str(path))
    return Path((info.context or {}).get("folder", ""), path)


NearFile = Annotated[Path, Strict(False), AfterValidator(_beside)]
"""A path that counts from the folder of the file it is written in."""
NearFileName = Annotated[str, AfterValidator(lambda path, info: str(_beside(Path(_named(path)), info)))]
"""The same as text."""

ARRAYS = ("tuple_type", "list_type")
"""What is wrong where an array is wanted, as pydantic calls it."""
SAID = {"path_type": "must be a path", "model_type": "must be a table"}
"""What is said in place of pydantic's words, which name classes."""

S = TypeVar("S", bound=Schema)


def choose_by(key: str, default: str) -> Discriminator:
    """Let a key of a table choose among schemas, each annotated with its `Tag`; without the key, the default."""

    def choose_tag(table: Any) -> Any:
        return table.get(key, default) if isinstance(table, dict) else getattr(table, key, default)

    choose_tag.__name__ = key
    return Discriminator(choose_tag)


def read_toml(path: Path) -> dict[str, Any]:
    """Read the tables of a TOML file.

    Raises:
        InputError: the file is not there, cannot be read, or is not TOML (names the line).
    """
    text = read_plain(path, "valid TOML")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(str(path), "is not valid TOML: it is nested too deeply") from None
    except ValueError as error:  # no TOML; or a number of too many digits
        raise InputError(str(path), f"is not valid TOML: {str(error).partition(';')[0]}") from None


def validate(schema: type[S], tables: dict[str, Any], source: str, folder: Path | None = None) -> S:
    """Hold tables against a schema; paths in them count from the folder, if one is given.

    Raises:
        InputError: the first fault, by key, value and what is allowed; how many more there are.
    """
    try:
        return schema.model_validate(tables, context={"folder": folder} if folder else None)
    except ValidationError as error:
        raise InputError(source, _one_line(schema, error)) from None


def load(schema: type[S], path: Path) -> S:
    """Read a TOML file into a schema.

    Raises:
        InputError: as `read_toml` and `validate`.
    """
    return validate(schema, read_toml(path), str(path), path.parent)


def _one_line(schema: type[BaseModel], error: ValidationError) -> str:
    faults = error.errors(include_url=False, include_context=False)
    # An unknown key is most often the cause of the missing one beside it: name it first.
    fault = min(faults, key=lambda each: each["type"] != "extra_forbidden")
    path = _keys(schema, fault["loc"])
    key = ".".join(path) or "file"
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    if fault["type"] == "extra_forbidden":
        allowed = ", ".join(_keys_beside(schema, fault["loc"]))
        return f"{key}: unknown key; allowed here: {allowed}{more}"
    if fault["type"] == "missing":
        return f"{key}: is required and missing{more}"
    if fault["type"] == "union_tag_invalid":
        return f"{key}.{_choice(error, fault['loc'])}{more}"
    if fault["type"] in ARRAYS:
        tables = isinstance(fault["input"], dict)
        message = f"must be an array of tables, [[{key}]]" if tables else f"must be an array, got {fault['input']!r}"
        return f"{key}: {message}{more}"
    message = SAID.get(fault["type"], fault["msg"].removeprefix("Value error, "))
    # A fault of a whole table says itself what is wrong in it.
    got = "" if isinstance(fault["input"], dict) else f", got {fault['input']!r}"
    return f"{key}: {message}{got}{more}"


def _choice(error: ValidationError, location: tuple[int | str, ...]) -> str:
    """Say which key chose a schema that is none, and what is allowed."""
    context = next(each["ctx"] for each in error.errors(include_url=False) if each["loc"] == location)
    return f"{context['discriminator'].rstrip('()')}: allowed are {context['expected_tags']}, got {context['tag']!r}"


def _keys(schema: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """Return a location as the keys in the file: without the tags that say which of several schemas was chosen."""
    here: Any = schema
    keys = []
    for part in location:
        if part in (choices := _choices(here)):
            here = choices[part]
            continue
        keys.append(str(part))
        if isinstance(part, str):
            here = _within(here, part)
    return keys


def _keys_beside(schema: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """Return the keys allowed in the table in which an unknown key stands."""
    here: Any = schema
    for part in location[:-1]:
        if part in (choices := _choices(here)):
            here = choices[part]
        elif isinstance(part, str):
            here = _within(here, part)
    return sorted(getattr(here, "model_fields", {}))


def _within(here: Any, key: str) -> Any:
    """Return what stands at a key of a schema: a schema, several to choose from, or something else."""
    field = getattr(here, "model_fields", {}).get(key)
    if field is None:
        return None
    return field.annotation if _choices(field.annotation) else _table_type(field.annotation)


def _choices(annotation: Any) -> dict[Any, Any]:
    """Return the schemas to choose from, by tag; none where there is no choice."""
    return {
        tag.tag: each.__origin__
        for each in getattr(annotation, "__args__", ())
        for tag in getattr(each, "__metadata__", ())
        if isinstance(tag, Tag)
    }


def _table_type(annotation: Any) -> Any:
    """Return the schema inside an annotation such as `Table | None` or `tuple[Table, ...]`."""
    for candidate in (annotation, *getattr(annotation, "__args__", ())):
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            return candidate
    return annotation
