"""Reads a TOML file into a schema; each fault is one line: file, key, value and what is allowed."""

import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from config.errors import InputError

SHIPPED = Path(str(resources.files("config")))
"""Where the shipped valve files and profiles lie."""


class Schema(BaseModel):
    """A table a person writes: immutable, no unknown keys, finite numbers only."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Port = Annotated[int, Field(ge=1, le=65535)]

S = TypeVar("S", bound=Schema)


def read_toml(path: Path) -> dict[str, Any]:
    """Read the tables of a TOML file.

    Raises:
        InputError: the file is not there, cannot be read, or is not TOML (names the line).
    """
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except tomllib.TOMLDecodeError as error:
        raise InputError(str(path), f"is not valid TOML: {error}") from None
    except UnicodeDecodeError:
        raise InputError(str(path), "is not valid TOML: it is not UTF-8 text") from None
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from None


def validated(schema: type[S], tables: dict[str, Any], source: str) -> S:
    """Hold tables against a schema.

    Raises:
        InputError: the first fault, by key, value and what is allowed; how many more there are.
    """
    try:
        return schema.model_validate(tables)
    except ValidationError as error:
        raise InputError(source, _one_line(schema, error)) from None


def load(schema: type[S], path: Path) -> S:
    """Read a TOML file into a schema.

    Raises:
        InputError: as `read_toml` and `validated`.
    """
    return validated(schema, read_toml(path), str(path))


def _one_line(schema: type[BaseModel], error: ValidationError) -> str:
    faults = error.errors(include_url=False, include_context=False)
    # An unknown key is most often the cause of the missing one beside it: name it first.
    fault = min(faults, key=lambda each: each["type"] != "extra_forbidden")
    key = ".".join(str(part) for part in fault["loc"]) or "file"
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    if fault["type"] == "extra_forbidden":
        allowed = ", ".join(_keys_beside(schema, fault["loc"]))
        return f"{key}: unknown key; allowed here: {allowed}{more}"
    if fault["type"] == "missing":
        return f"{key}: is required and missing{more}"
    message = fault["msg"].removeprefix("Value error, ")
    # A fault of a whole table says itself what is wrong in it.
    got = "" if isinstance(fault["input"], dict) else f", got {fault['input']!r}"
    return f"{key}: {message}{got}{more}"


def _keys_beside(schema: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """Return the keys allowed in the table in which an unknown key stands."""
    here: Any = schema
    for part in location[:-1]:
        fields = getattr(here, "model_fields", {})
        if isinstance(part, str) and part in fields:
            here = _table_type(fields[part].annotation)
    return sorted(getattr(here, "model_fields", {}))


def _table_type(annotation: Any) -> Any:
    """Return the schema inside an annotation such as `Table | None` or `tuple[Table, ...]`."""
    for candidate in (annotation, *getattr(annotation, "__args__", ())):
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            return candidate
    return annotation
