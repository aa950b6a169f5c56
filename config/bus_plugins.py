"""Which buses there are: found by name among the installed packages, so that a site adds its own.

A package offers a bus by two entry points of the same name:

    positioner.devices    the schema of table `[device]`, a `config.device.Device` whose `bus` is that name
    positioner.drivers    what makes a driver (`drivers.boundary.Driver`) of such a table

They are two, since reading a file needs no driver, and no driver's libraries. `docs/driver-package.md` has an example.
"""

from importlib.metadata import EntryPoint
from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Tag, model_validator

from config.device import Device
from config.entry_points import find_offers, origin
from config.errors import InputError
from config.loading import choose_by

DEVICES, DRIVERS = "positioner.devices", "positioner.drivers"


def load_entry(entry: EntryPoint) -> Any:
    """Return what an entry point names.

    Raises:
        InputError: it cannot be loaded; says whose it is and why.
    """
    try:
        return entry.load()
    except ModuleNotFoundError as error:
        package = entry.dist.name if entry.dist else "the package"
        raise InputError(
            origin(entry),
            f"bus {entry.name!r} needs {error.name}, which is not installed: pip install '{package}[{entry.name}]'",
        ) from None
    except Exception as error:  # somebody else's module: anything may be wrong in it
        raise InputError(origin(entry), f"{entry.group}: {entry.value} cannot be loaded: {error}") from None


def _schema(entry: EntryPoint) -> type[Device]:
    """Return the schema of a bus; one that cannot be loaded fails where a file uses it, not before."""
    try:
        schema = load_entry(entry)
    except InputError as error:
        reason = str(error)
    else:
        if isinstance(schema, type) and issubclass(schema, Device):
            return schema
        reason = f"{origin(entry)}: {entry.group}: {entry.value} is no config.device.Device"

    class Unusable(Device):
        @model_validator(mode="before")
        @classmethod
        def _fail(cls, _table: Any) -> Any:
            raise ValueError(reason)

    return Unusable


if TYPE_CHECKING:
    AnyDevice = Device
else:
    AnyDevice = Annotated[
        Union[tuple(Annotated[_schema(entry), Tag(name)] for name, entry in find_offers(DEVICES, "bus").items())],  # noqa: UP007
        choose_by("bus", "modbus"),
    ]
"""A device on any bus; `bus` says which."""
