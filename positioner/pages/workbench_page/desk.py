"""What lies on the desk of one tab: a recording, a valve, and all that was found out about the two.

A desk knows no browser. It stays while its tab is there, so a page that is loaded again finds it as it was.
"""

import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from config.errors import InputError
from config.recording import Column, Recording
from config.valve_file import ValveFile, find_valve, load_valve
from positioner.pages.workbench_page.live_model import LiveModel
from positioner.pages.workbench_page.opening import Export, Opened
from workbench.blind.hiding import hide
from workbench.blind.sealing import seal
from workbench.compare.comparison import Comparison
from workbench.fit.fitted_parameter import Fitted


@dataclass(frozen=True, slots=True)
class NamedValve:
    """A valve file, by the name that a command line would give it."""

    name: str
    path: Path
    file: ValveFile


@dataclass(slots=True)
class Desk:
    """The desk; `folder` is its own, for what was dropped on it and what is written for it."""

    folder: Path = field(default_factory=lambda: Path(tempfile.mkdtemp(prefix="positioner-workbench-")))
    opened: Opened | None = None
    export: Export | None = None
    """A file whose columns are not confirmed yet."""
    valve: NamedValve | None = None
    live: LiveModel | None = None
    compared: Comparison | None = None
    fitted: Mapping[str, Fitted] = field(default_factory=dict)
    """Values and intervals of the last fit, by the parameter's name."""
    variants: dict[str, Column] = field(default_factory=dict)
    """Positions, m, of other variants that are laid over, by the line's name."""
    sealed: Path | None = None
    """The folder of a blind case."""

    def take_recording(self, opened: Opened) -> None:
        """Put a recording on the desk.

        Raises:
            InputError: it cannot be simulated, or not with this valve.
        """
        self._held(opened, self.valve)

    def take_valve(self, valve: NamedValve) -> None:
        """Put a valve on the desk.

        Raises:
            InputError: it cannot be simulated with this recording.
        """
        self._held(self.opened, valve)

    def _held(self, opened: Opened | None, valve: NamedValve | None) -> None:
        """Hold a recording and a valve against each other; nothing changes where that fails."""
        live = LiveModel(opened.recording, valve.file) if opened and valve else None
        compared = live.comparison() if live else None
        self.opened, self.valve, self.live, self.compared = opened, valve, live, compared
        self.fitted = {}
        self.variants = {"as opened": live.curve().simulated_m} if live else {}

    def blind(self, seed: int) -> None:
        """Put a sealed case on the desk: a recording with a hidden effect, and what is known of the valve.

        Raises:
            InputError: the folder cannot be written.
        """
        folder = self.folder / f"blind-{seed}"
        if not folder.exists():
            seal(folder, hide(seed))
        opened = Opened(f"blind case {seed}", folder / "fit.csv", Recording.read(folder / "fit.csv"))
        self._held(opened, named_valve(str(folder / "valve.toml")))
        self.sealed = folder

    def compare(self) -> Comparison:
        """Compare the valve as it is set.

        Raises:
            InputError: there is none, or as `compare`.
        """
        if self.live is None:
            raise InputError("workbench", "open a recording and choose a valve first")
        self.compared = self.live.comparison()
        return self.compared

    def clear(self) -> None:
        """Remove what was written for it."""
        shutil.rmtree(self.folder, ignore_errors=True)


def named_valve(text: str) -> NamedValve:
    """Return the valve that a person named: a path, or a shipped one's name.

    Raises:
        InputError: there is none, or it is wrong.
    """
    path = find_valve(text)
    return NamedValve(text, path, load_valve(path))
