"""The valve file: the Karnopp model's parameters and the effects added to it. SI units, in the names.

    m x'' = A u - k_s x - F_v x' - (F_c + (F_s - F_c) exp(-(x'/v_s)^2)) sign(x')      while it moves
    at rest it stays until |A u - k_s x| > F_s

The same file drives the simulated slave, the offline simulation and the workbench. In place of `[valve]` there may be a
table `[drive]`, with the names and units of its kind (`config.drive`). `config.data_sheet` makes one of a data sheet.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from config.actuators import Actuator
from config.arguments import kinds_held
from config.drive import KINDS, ROTARY, VALVE, Kind, KindName
from config.errors import InputError
from config.file_kinds import require_kind
from config.loading import SHIPPED, Many, Schema, Stroke, between, read_toml, validate

Strength = Annotated[float, between(1e-12, 1e12, or_zero=True)]
"""Of a spring or a friction, N/m, N s/m, N, or what a drive has in their place."""


class ValveParameters(Schema):
    """Table `[valve]`: the base model.

    Its ranges hold whatever is a valve or a drive, and no number with which the equations overflow or never end.
    """

    name: str
    mass_kg: Annotated[float, between(1e-9, 1e9)]
    diaphragm_area_m2: Annotated[float, between(1e-9, 1e6)]
    spring_n_per_m: Strength
    """0: a drive without a spring, which the workbench fits and no daemon commands."""
    viscous_ns_per_m: Strength
    coulomb_n: Strength
    static_n: Strength
    stribeck_velocity_m_per_s: Annotated[float, between(1e-12, 1e6)]
    deadzone_ratio: Annotated[float, between(1e-9, 1e6)]
    stroke_m: Stroke
    kind: KindName = "valve"
    actuator: Annotated[Actuator, Field(exclude=True)] = "spring_return"

    @property
    def own(self) -> Kind:
        """Its names and units."""
        return KINDS[self.kind]

    @model_validator(mode="after")
    def _static_friction_is_at_least_coulomb_friction(self) -> Self:
        if self.static_n < self.coulomb_n:
            coulomb, static = (self.own.force.read.said(each, "g") for each in (self.coulomb_n, self.static_n))
            raise ValueError(f"static_n must be at least coulomb_n ({coulomb}), it is {static}")
        return self


class EffectTable(BaseModel):
    """One `[[effect]]` table: its name and that effect's own parameters, which the model side checks.

    A name that ends in `.py` is the path of an engineer's own effect, as seen from the valve file's folder.
    """

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False, strict=True)

    name: str

    @property
    def parameters(self) -> dict[str, Any]:
        """The effect's parameters as written, without its name."""
        return dict(self.model_extra or {})

    def seen_from(self, folder: Path) -> Self:
        """Return the table with an own effect's path made absolute."""
        if not self.name.endswith(".py"):
            return self
        return self.model_copy(update={"name": str((folder / self.name).resolve())})


class ValveFile(Schema):
    """A whole valve file."""

    valve: ValveParameters
    effect: Many[EffectTable] = ()


def load_valve(path: Path | str) -> ValveFile:
    """Read a valve file; the paths of own effects in it become absolute.

    Raises:
        InputError: names file, key, value and what is allowed.
    """
    path = Path(path)
    tables = read_toml(path)
    require_kind(tables, "valve", str(path))
    file = _drive(tables, str(path)) if "drive" in tables else validate(ValveFile, tables, str(path), path.parent)
    return file.model_copy(update={"effect": tuple(each.seen_from(path.parent) for each in file.effect)})


WITHOUT_DRIVE: Mapping[str, float] = {"diaphragm_area_m2": 1.0, "spring_n_per_m": 0.0, "deadzone_ratio": 0.01}
"""What a drive's table need not say: its command is the force, no spring, a narrow band."""


def _drive(tables: Mapping[str, Any], source: str) -> ValveFile:
    """Return the valve file of a drive's, `[drive]` in the place of `[valve]`.

    Raises:
        InputError: an unknown kind or key, a value missing or out of its range; by the drive's own names.
    """
    table = tables["drive"]
    kinds = [name for name in KINDS if name != VALVE.name]
    if not isinstance(table, dict) or table.get("kind") not in kinds:
        got = repr(table.get("kind")) if isinstance(table, dict) else repr(table)
        raise InputError(source, f"drive.kind: must be {', '.join(kinds[:-1])} or {kinds[-1]}, got {got}")
    kind = KINDS[table["kind"]]
    lacks = {"actuator"} if kind.area else {"actuator", "diaphragm_area_m2"}
    names = {kind.own(name): name for name in ValveParameters.model_fields if name not in lacks}
    for key in table:
        if key not in names:
            raise InputError(source, f"drive.{key}: unknown key; allowed here: {', '.join(names)}")
    if kind.area and kind.area not in table:
        raise InputError(source, f"drive.{kind.area}: is required and missing")
    said = {**WITHOUT_DRIVE, **{names[key]: value for key, value in table.items()}}
    rest = {key: value for key, value in tables.items() if key != "drive"}
    if isinstance(rest.get("effect"), list):
        rest["effect"] = [_of_valve(kind, each, source) for each in rest["effect"]]
    try:
        return validate(ValveFile, {"valve": said, **rest}, source)
    except InputError as error:
        raise InputError(source, re.sub(r"^valve\b", "drive", kind.text(error.problem))) from None


def _of_valve(kind: Kind, table: Any, source: str) -> Any:
    """Return a drive's effect table with a valve's names."""
    if not isinstance(table, dict):
        return table
    for key in table:
        if (own := kind.own(kind.of_valve(key))) != key:
            raise InputError(source, f"effect.{key}: a drive of kind {kind.name} has {own}")
    return {kind.of_valve(key): value for key, value in table.items()}


def require_air(file: ValveFile, source: str, who: str) -> ValveFile:
    """Return the file of a valve, with a stem or one that turns, to one who knows no drive that no pressure moves.

    Raises:
        InputError: it is such a drive's; says who knows none.
    """
    return file if file.valve.own is ROTARY else valve_alone(file, source, who)


def valve_alone(file: ValveFile, source: str, who: str) -> ValveFile:
    """Return a valve file to one who knows no drives.

    Raises:
        InputError: it is a drive's; says who knows none.
    """
    if file.valve.own is not VALVE:
        raise InputError(source, f"is of a drive: {who}")
    return file


@kinds_held
def valve(name: Path | str) -> ValveFile:
    """Read a valve file, or one that comes with the package by its name.

    Raises:
        InputError: there is none of that name; or names file, key, value and what is allowed.
    """
    return load_valve(find_valve(str(name)))


def shipped_valve(name: str) -> Path:
    """Return the path of a valve file that comes with the package.

    Raises:
        InputError: there is none of that name; names those there are.
    """
    path = SHIPPED / "valves" / f"{name}.toml"
    if not path.is_file():
        there = ", ".join(sorted(each.stem for each in path.parent.glob("*.toml")))
        raise InputError(name, f"no shipped valve of that name; there are: {there}")
    return path


def find_valve(text: str) -> Path:
    """Return the valve file that a person named: a path, or the name of a shipped one.

    Raises:
        InputError: neither.
    """
    if not text:
        raise InputError("valve file", "must be its path or the name of a shipped one, got ''")
    path = Path(text)
    return path if path.suffix == ".toml" or path.exists() else shipped_valve(text)
