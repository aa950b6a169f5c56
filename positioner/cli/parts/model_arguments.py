"""The valve file and the effects that a command line names, found faulty before anything else is read."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from config.valve_file import ValveFile


def read_valve(text: str) -> "ValveFile":
    """Return a valve file, or a shipped one by its name, its effects found and their parameters within their ranges.

    Raises:
        InputError: it is not there, or names file, key, value and what is allowed.
    """
    from config.valve_file import find_valve, load_valve

    path = find_valve(text)
    file = load_valve(path)
    require_parameters(file, str(path))
    return file


def require_parameters(file: "ValveFile", source: str) -> None:
    """Check that a valve's effects are there, and their parameters within their ranges.

    Raises:
        InputError: names source, key, value and what is allowed.
    """
    from sim.composition import parameter_vector
    from sim.effect import find_effect

    parameter_vector(file, [find_effect(each.name, source) for each in file.effect], source)


def require_effects(names: Sequence[str] | None, option: str) -> None:
    """Check that there are the effects that an option names.

    Raises:
        InputError: there is none of a name; names those there are.
    """
    from sim.effect import find_effect

    for name in names or ():
        find_effect(name, option)
