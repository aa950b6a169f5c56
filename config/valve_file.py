"""The valve file: the Karnopp model's parameters and the effects added to it. SI units, in the names.

    m x'' = A u - k_s x - F_v x' - (F_c + (F_s - F_c) exp(-(x'/v_s)^2)) sign(x')      while it moves
    at rest it stays until |A u - k_s x| > F_s

The same file drives the simulated slave, the offline simulation and the workbench.
"""

from pathlib import Path
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, model_validator

from config.errors import InputError
from config.loading import SHIPPED, NonNegative, Positive, Schema, load


class ValveParameters(Schema):
    """Table `[valve]`: the base model."""

    name: str
    mass_kg: Positive
    diaphragm_area_m2: Positive
    spring_n_per_m: NonNegative
    """0: a drive without a spring, which the workbench fits and no daemon commands."""
    viscous_ns_per_m: NonNegative
    coulomb_n: NonNegative
    static_n: NonNegative
    stribeck_velocity_m_per_s: Positive
    deadzone_ratio: Positive
    stroke_m: Positive

    @model_validator(mode="after")
    def _static_friction_is_at_least_coulomb_friction(self) -> Self:
        if self.static_n < self.coulomb_n:
            raise ValueError(f"static_n must be at least coulomb_n ({self.coulomb_n:g} N), it is {self.static_n:g} N")
        return self

    @property
    def deadzone_m_per_s(self) -> float:
        """Karnopp's band on velocity, in m/s."""
        return self.deadzone_ratio * self.stribeck_velocity_m_per_s


class EffectTable(BaseModel):
    """One `[[effect]]` table: its name and that effect's own parameters, which the model side checks.

    A name that ends in `.py` is the path of an engineer's own effect, as seen from the valve file's folder.
    """

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

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
    effect: tuple[EffectTable, ...] = ()


def load_valve(path: Path | str) -> ValveFile:
    """Read a valve file; the paths of own effects in it become absolute.

    Raises:
        InputError: names file, key, value and what is allowed.
    """
    path = Path(path)
    file = load(ValveFile, path)
    return file.model_copy(update={"effect": tuple(each.seen_from(path.parent) for each in file.effect)})


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
    path = Path(text)
    return path if path.suffix == ".toml" or path.exists() else shipped_valve(text)
