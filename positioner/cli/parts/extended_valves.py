"""The extended valves that a daemon's file names in `[law] valve`, worked out by the model."""

from typing import TYPE_CHECKING

from config.errors import InputError

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile
    from config.extended_valve import ExtendedValve


def load_extended_valve(file: "DaemonFile", source: str) -> "ExtendedValve | None":
    """Return what `[law] valve` of a daemon's file names; None where it names none.

    Args:
        file: of one valve.
        source: what errors call it.

    Raises:
        InputError: the valve file is not there or faulty, an effect in it has no inverse, or it is another valve's.
    """
    if file.law is None or file.law.valve is None:
        return None
    from config.valve_file import load_valve
    from sim.static_inverse import extended_valve

    path = file.law.valve
    valve = extended_valve(load_valve(path), str(path))
    problem = valve.unlike(
        file.valve.stroke_m, file.pressure.minimum_pa, file.pressure.maximum_pa, file.valve.breakaway_pa
    )
    if problem is not None:
        raise InputError(source, f"law.valve: {path}: {problem}")
    return valve
