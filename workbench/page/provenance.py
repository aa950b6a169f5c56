"""How a valve on the desk came to be: a link to the valve before it, back to one that was opened.

Command lines, notebook and journal are read off this chain, so what goes home is what was on the page. Each link is a
command of its own that ends at the same file, bit by bit:

    Hidden           positioner hide --seed N -o blind-N
    DataSheetMade    positioner valve --area-cm2 ... -o FILE
    SetByHand        positioner valve --of BEFORE --set NAME=VALUE ... --without EFFECT ... -o FILE
    Extended         positioner extend BEFORE --effect NAME ... --fit REC -o FILE
                     of a form: positioner discover REC --valve BEFORE -o FORM.py before that
                     after a diagnosis: positioner diagnose REC --valve BEFORE ... --add NAME ... -o FILE
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Optional

from config.data_sheet import DataSheet
from config.valve_file import ValveFile
from workbench.diagnosis.extension import Extension
from workbench.page.recording_opening import Opened


@dataclass(frozen=True, slots=True)
class Hidden:
    """What is known of a blind case's valve, and what the case was drawn from."""

    seed: int


@dataclass(frozen=True, slots=True)
class DataSheetMade:
    """Made of a data sheet's numbers."""

    sheet: DataSheet


@dataclass(frozen=True, slots=True, eq=False)
class SetByHand:
    """Another with parameters, SI by name, that sliders moved, and without effects that were switched off."""

    before: "NamedValve"
    values: Mapping[str, float]
    without: tuple[str, ...]

    @property
    def is_any(self) -> bool:
        """Whether anything was touched."""
        return bool(self.values or self.without)

    def is_as(self, other: "Made | None") -> bool:
        """Whether the same was set of the same valve."""
        if not isinstance(other, SetByHand) or self.before is not other.before:
            return False
        return (self.values, self.without) == (other.values, other.without)


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """The diagnosis that an extension went on from: what it tried, and whether what is added is its own verdict."""

    tried: tuple[str, ...]
    is_verdict: bool


@dataclass(frozen=True, slots=True, eq=False)
class Extended:
    """Another, refitted to a recording with effects added, or with none."""

    before: "NamedValve"
    extension: Extension
    recording: Opened
    held_out: Opened | None
    """None: the last third of the recording."""
    diagnosed: Diagnosed | None = None
    form: str = ""
    """The file of the form that it adds, found by `discover` in the same recording."""


Made = Hidden | DataSheetMade | SetByHand | Extended


@dataclass(frozen=True, slots=True, eq=False)
class NamedValve:
    """A valve file: what it is called on the page, where it lies, and how it was made; None: it was opened."""

    name: str
    path: Path
    file: ValveFile
    made: Made | None = None

    @property
    def before(self) -> Optional["NamedValve"]:
        """The valve that it was made of."""
        return self.made.before if isinstance(self.made, SetByHand | Extended) else None

    @property
    def chain(self) -> tuple["NamedValve", ...]:
        """All on the way, from the one that was opened to itself."""
        return (*(self.before.chain if self.before else ()), self)


def blind_folder(seed: int) -> str:
    """Return the folder of a blind case."""
    return f"blind-{seed}"


def steps_on(valve: NamedValve | None, recording: Opened | None) -> tuple[NamedValve, ...]:
    """Return the valves on the way that were refitted to a recording, after the last that was to another one."""
    steps: list[NamedValve] = []
    for each in reversed(valve.chain if valve else ()):
        if isinstance(each.made, Extended):
            if each.made.recording is not recording:
                break
            steps.append(each)
    return tuple(reversed(steps))


def refitting(valve: NamedValve) -> Extended:
    """Return how a valve of `steps_on` was refitted."""
    assert isinstance(valve.made, Extended)
    return valve.made
