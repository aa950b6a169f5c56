"""Sticking pneumatic control valves: identify, position, simulate, and find what a model of one lacks.

    import positioner as pos

    valve = pos.valve("seed")                             a valve file, or one that comes along by its name
    recording = pos.Recording.read("rec.csv")
    print(pos.compare(recording, valve).summary())

The names below are the library: they stay where rooms behind them move. Each is loaded when it is first asked for, so
that `import positioner` takes no time and a gateway needs no more than it runs; what needs an extra says which.
docs/library.md has an example of each. The rooms:

    estimation   identifies the valve from integrals of its signals
    control      the pure core: supervision, states S0 to S3, the law
    daemon       gives it a bus, a clock and registers
    response     step-response figures of a recording
    observer     a running daemon as a client sees it, never stale
    cli          the roof: one file a command
"""

TYPE_CHECKING = False  # which type checkers take for true: `typing` itself takes longer to load than all this

if TYPE_CHECKING:
    from config.device import Device
    from config.errors import InputError
    from config.loading import Fraction, NonNegative, Port, Positive
    from config.recording import Recording
    from config.valve_file import ValveFile, valve
    from config.valve_file_writer import write_valve
    from drivers.boundary import (
        BadReply,
        Capabilities,
        Driver,
        DriverError,
        NoConnection,
        NoNumber,
        NoReply,
        Reading,
        Refused,
    )
    from positioner.estimation.recording_estimates import RecordingEstimates, estimate
    from positioner.response.response_figures import respond
    from positioner.response.response_result import ResponseFigures
    from sim.simulation import simulate
    from workbench.blind.hiding import Hidden, hide
    from workbench.compare.comparison import Comparison, compare
    from workbench.data.imposed_motion import read_imposed
    from workbench.diagnosis.diagnosis import Diagnosis, diagnose
    from workbench.diagnosis.extension import Extension, extend
    from workbench.discover.discovery import Discovery, discover
    from workbench.fit.fit_result import Fit
    from workbench.fit.fitting import fit
    from workbench.fleet.fleet import Fleet, fleet
    from workbench.forces.force_diagnosis import ForceDiagnosis, diagnose_forces

__version__ = "1.0.0rc1"

_ROOMS = {
    "config.device": ("Device",),
    "config.errors": ("InputError",),
    "config.loading": ("Fraction", "NonNegative", "Port", "Positive"),
    "config.recording": ("Recording",),
    "config.valve_file": ("ValveFile", "valve"),
    "config.valve_file_writer": ("write_valve",),
    "drivers.boundary": (
        "BadReply",
        "Capabilities",
        "Driver",
        "DriverError",
        "NoConnection",
        "NoNumber",
        "NoReply",
        "Reading",
        "Refused",
    ),
    "positioner.estimation.recording_estimates": ("RecordingEstimates", "estimate"),
    "positioner.response.response_figures": ("respond",),
    "positioner.response.response_result": ("ResponseFigures",),
    "sim.simulation": ("simulate",),
    "workbench.blind.hiding": ("Hidden", "hide"),
    "workbench.compare.comparison": ("Comparison", "compare"),
    "workbench.data.imposed_motion": ("read_imposed",),
    "workbench.discover.discovery": ("Discovery", "discover"),
    "workbench.fit.fitting": ("Fit", "fit"),
    "workbench.fleet.fleet": ("Fleet", "fleet"),
    "workbench.forces.force_diagnosis": ("ForceDiagnosis", "diagnose_forces"),
    "workbench.diagnosis.diagnosis": ("Diagnosis", "diagnose"),
    "workbench.diagnosis.extension": ("Extension", "extend"),
}
"""The library's names, by where they live today."""
_LIVES_IN = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = [
    "BadReply",
    "Capabilities",
    "Comparison",
    "Device",
    "Diagnosis",
    "Discovery",
    "Driver",
    "DriverError",
    "Extension",
    "Fit",
    "Fleet",
    "ForceDiagnosis",
    "Fraction",
    "Hidden",
    "InputError",
    "NoConnection",
    "NoNumber",
    "NoReply",
    "NonNegative",
    "Port",
    "Positive",
    "Reading",
    "Recording",
    "RecordingEstimates",
    "Refused",
    "ResponseFigures",
    "ValveFile",
    "compare",
    "diagnose",
    "diagnose_forces",
    "discover",
    "estimate",
    "extend",
    "fit",
    "fleet",
    "hide",
    "read_imposed",
    "respond",
    "simulate",
    "valve",
    "write_valve",
]


def _load_name(name: str) -> object:
    """Load one of the library's names at its first use (PEP 562).

    Raises:
        AttributeError: the library has no such name.
        ImportError: an extra is not installed, or a foreign package hides one of ours; one line says which.
    """
    if name not in _LIVES_IN:
        raise AttributeError(f"module 'positioner' has no attribute {name!r}; it has: {', '.join(__all__)}")
    from importlib import import_module

    from positioner.own_packages import in_the_way

    if said := in_the_way():
        raise ImportError(f"positioner.{name}: {said}")
    from config.extras import name_missing_extra

    try:
        found = getattr(import_module(_LIVES_IN[name]), name)
    except ModuleNotFoundError as error:
        if said := name_missing_extra(f"positioner.{name}", error):
            raise ModuleNotFoundError(said, name=error.name) from None
        raise
    globals()[name] = found
    return found


if not TYPE_CHECKING:  # or a type checker would take any name for one of the library's
    __getattr__ = _load_name


def __dir__() -> list[str]:
    """Return the library's names, for completion."""
    return sorted({*globals(), *__all__})
