"""What lies on the desk of one tab: a recording, a valve, and all that was found out about the two.

A desk knows no browser. It stays while its tab is there, so a page that is loaded again finds it as it was.
"""

import os
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from config.errors import InputError
from config.recording import Column, Recording
from config.valve_changes import changes_in_words
from config.valve_file import find_valve, load_valve, valve_alone
from config.valve_file_writer import valve_toml, write_valve
from sim.effect import written_here
from webpage.units import NO_NUMBER, Units
from workbench.blind.hiding import hide
from workbench.blind.sealing import seal
from workbench.compare.comparison import Comparison
from workbench.diagnosis.diagnosis import Diagnosis
from workbench.diagnosis.extension import Extension, extension_of
from workbench.diagnosis.extension_journal import Journal, write_extended
from workbench.fit.parameter_estimate import Fitted
from workbench.page.background import (
    Limits,
    Task,
    Work,
    effect_checked,
    run_diagnosis,
    run_discovery,
    run_extension,
)
from workbench.page.live_model import LiveModel
from workbench.page.provenance import (
    Diagnosed,
    Extended,
    Hidden,
    NamedValve,
    SetByHand,
    blind_folder,
    refitting,
    steps_on,
)
from workbench.page.recording_opening import Export, Opened
from workbench.page.search import Search
from workbench.report.display_units import Quantity, Shown

SAVED = "saved"
"""The line of a variant that a person keeps."""
UNDONE = ("opened", "held_out", "export", "valve", "live", "compared", "fitted", "found", "sealed")
"""What a step back brings again."""
MOST_UNDONE = 20  # steps that can be taken back
EFFECTS, EFFECT_NAME = "effects", "[a-z][a-z0-9_]{0,39}"
"""The folder of effects of one's own; what one may be called."""


@dataclass(slots=True)
class Desk:
    """The desk; `folder` is its own, for what was dropped on it and what is written for it."""

    folder: Path = field(default_factory=lambda: Path(tempfile.mkdtemp(prefix="positioner-workbench-")))
    pages: int = 0
    """How many pages show it: a page that is loaded anew is there before the old one is gone."""
    opened: Opened | None = None
    held_out: Opened | None = None
    """Another recording of the same valve, that no fit sees."""
    budget_s: float = inf
    """After which a diagnosis says what is known then."""
    export: Export | None = None
    """A file whose columns are not confirmed yet."""
    valve: NamedValve | None = None
    live: LiveModel | None = None
    compared: Comparison | None = None
    fitted: Mapping[str, Fitted] = field(default_factory=dict)
    """Values and intervals of the last fit, by the parameter's name."""
    variants: dict[str, Column] = field(default_factory=dict)
    """Positions, m, of other variants that are laid over, by the line's name."""
    search: Search | None = None
    """A search under way, or what the last one has come to."""
    found: Search | None = None
    """The last diagnosis that has come to its end."""
    sealed: Path | None = None
    """The folder of a blind case."""
    may_write_effects: bool = False
    """Whether only this machine's user comes here: an effect is a program."""
    effects: dict[str, Path] = field(default_factory=dict)
    """Effects of one's own that compile, by name."""
    checking: Work | None = None
    """One that is being checked."""
    _running: ExitStack = field(default_factory=ExitStack)
    """What lets them be run, as long as this desk is there."""
    units: Units = field(default_factory=lambda: Units(position="mm"))
    """That a person reads it in."""
    _before: list[dict[str, Any]] = field(default_factory=list)
    """What lay here before each of the last steps."""
    _written: int = 0
    _set: NamedValve | None = None
    """The valve as sliders and switches were set last."""

    @property
    def journal(self) -> tuple[NamedValve, ...]:
        """The valves that were refitted to the recording here, with effects added or without, in order."""
        return steps_on(self.valve, self.opened)

    def as_set(self) -> NamedValve:
        """Return the valve as sliders and switches are set, written down; itself where none was touched.

        Raises:
            InputError: there is none, or it cannot be written.
        """
        live, before = self._model(), self.valve
        assert before is not None
        made = SetByHand(before, live.moved, live.switched_off)
        if not made.is_any:
            return before
        if self._set is None or not made.is_as(self._set.made):
            path = self._path("set")
            write_valve(path, live.valve)
            self._set = NamedValve(path.name, path, live.valve, made)
        return self._set

    @property
    def errors(self) -> Quantity:
        """What errors of a position are of, in the unit that was chosen."""
        unit = self.units.length_unit()

        def show_length(value_m: float | None) -> Shown:
            text = NO_NUMBER if value_m is None else unit.fine_number(value_m)
            return Shown(text, "" if value_m is None else f"{value_m:.6g} m")

        return Quantity(show_length, unit.per_si, unit.name, "m")

    def take_recording(self, opened: Opened) -> None:
        """Put a recording on the desk.

        Raises:
            InputError: it cannot be simulated, or not with this valve.
        """
        self._hold_together(opened, self.valve)
        self.export = self.sealed = self.held_out = None

    def hold_out(self, opened: Opened | None) -> None:
        """Take another recording of the same valve, that no fit sees; None: the last third of the one is held out.

        Raises:
            InputError: it cannot be simulated with the valve.
        """
        if opened is not None:
            LiveModel(opened.record, self._model().valve)
            if self.opened is not None and _same(opened.recording, self.opened.recording):
                raise InputError(opened.name, "is the recording itself, so it would judge nothing; allowed is another")
        self.held_out = opened

    def keep_variant(self) -> None:
        """Lay the curve as it is set over what is to come.

        Raises:
            InputError: there is none.
        """
        self.variants[SAVED] = self._model().curve().simulated_m

    def take_valve(self, valve: NamedValve) -> None:
        """Put a valve on the desk.

        Raises:
            InputError: it cannot be simulated with this recording.
        """
        self._hold_together(self.opened, valve)

    def blind_practice(self, seed: int) -> None:
        """Put a sealed case on the desk whose effect shows in the recording: the first from a seed on.

        Raises:
            InputError: the folder cannot be written.
        """
        while not all(each["is_visible"] for each in hide(seed).answer["visible"].values()):
            seed += 1
        self.blind(seed)

    def blind(self, seed: int) -> None:
        """Put a sealed case on the desk: a recording with a hidden effect, and what is known of the valve.

        Raises:
            InputError: the folder cannot be written.
        """
        folder = self.folder / blind_folder(seed)
        if not folder.exists():
            seal(folder, hide(seed))
        opened = Opened.of(f"{folder.name}/fit.csv", folder / "fit.csv", Recording.read(folder / "fit.csv"), seed=seed)
        known = name_valve(str(folder / "valve.toml"), f"{folder.name}/valve.toml")
        self._hold_together(opened, replace(known, made=Hidden(seed)))
        self.export, self.held_out, self.sealed = None, None, folder

    def compare(self) -> Comparison:
        """Compare the valve as it is set.

        Raises:
            InputError: there is none, or as `compare`.
        """
        self.compared = self._model().comparison()
        return self.compared

    def effect_path(self, name: str) -> Path:
        """Return where an effect of one's own lies.

        Raises:
            InputError: no name of an effect.
        """
        if not re.fullmatch(EFFECT_NAME, name):
            raise InputError("its name", f"must be small letters, digits and _, got {name!r}")
        return self.folder / EFFECTS / f"{name}.py"

    def write_effect(self, name: str, text: str) -> Path:
        """Write an effect of one's own; it is not run before it is checked, and not tried before it is kept.

        Raises:
            InputError: no name of an effect, or nobody may write one here.
        """
        if not self.may_write_effects:
            raise InputError(name, "is a program: it is written only where the page listens to this machine alone")
        path = self.effect_path(name)
        path.parent.mkdir(mode=0o700, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        self.effects.pop(name, None)
        return path

    def check_effect(self, path: Path) -> None:
        """Begin to see whether an effect may be tried.

        Raises:
            InputError: there is no valve.
        """
        valve = self._model().valve
        self.stop_checking()
        self.checking = Work(effect_checked, valve, path, own_effects=path.parent)

    def stop_checking(self) -> None:
        """Stop to check, if one is checked."""
        if self.checking is not None:
            self.checking.cancel()
        self.checking = None

    def plain(self, said: str) -> str:
        """Return what is said with effects of one's own as they are named where they are taken home."""
        return said.replace(f"{self.folder / EFFECTS}{os.sep}", "./")

    def keep_effect(self, name: str) -> None:
        """Have an effect that was checked tried with the others."""
        if not self.effects:
            self._running.enter_context(written_here(self.folder / EFFECTS))
        self.effects[name] = self.effect_path(name)

    def begin(self, what: str, task: Task, *arguments: Any) -> Search:
        """Begin a search on the recording with the valve as it is set; one that is under way is stopped.

        Args:
            what: it is for, in words.
            task: that is done in a process of its own.
            arguments: of the task after recording, valve and limits.

        Raises:
            InputError: there is no recording or no valve.
        """
        begins = self.as_set()
        self.stop()
        assert self.opened is not None
        own = self.folder / EFFECTS
        limits = Limits(self.held_out.recording if self.held_out else None, self.budget_s)
        work = Work(task, self.opened.recording, begins.file, limits, *arguments, own_effects=own)
        self.search = Search(what, begins, self.opened, self.held_out, work)
        return self.search

    def diagnose(self, effects: Sequence[str]) -> None:
        """Begin to look for what is missing, of these effects.

        Raises:
            InputError: as `begin`.
        """
        self.begin("diagnose", run_diagnosis, tuple(effects)).tried = tuple(effects)

    def extend(self, effects: Sequence[str]) -> None:
        """Begin to add effects, or to refit the valve as it is; a diagnosis of what lies here is gone on from.

        Raises:
            InputError: as `begin`.
        """
        found = self.diagnosed if effects else None
        search = self.begin("extend", run_extension, tuple(effects), found and found.result)
        search.went_on = Diagnosed(found.tried, is_verdict=False) if found else None

    def discover(self) -> None:
        """Begin to look for the form of what no effect explains.

        Raises:
            InputError: as `begin`.
        """
        self.begin("discover", run_discovery)

    def extend_by_form(self, search: Search) -> None:
        """Begin to add the form that a search has found, as an effect of one's own.

        Raises:
            InputError: nobody may write an effect here, or as `begin`.
        """
        name = f"found_{sum(each.startswith('found_') for each in self.effects) + 1}"
        path = self.write_effect(name, search.result.found[0].text(search.recording.name))
        self.keep_effect(name)
        self.begin("extend", run_extension, (str(path),), None).form = f"{name}.py"

    def take(self, search: Search) -> None:
        """Go on with what a search has come to: a diagnosis is kept, a refitted valve is the next; a form is shown.

        Raises:
            InputError: as `add`.
        """
        if isinstance(search.result, Extension):
            self.add(search.result, search, search.went_on)
        elif isinstance(search.result, Diagnosis):
            self.found = search

    def add_verdict(self, search: Search) -> None:
        """Go on with what a diagnosis is sure of; nothing is fitted again.

        Raises:
            InputError: as `add`.
        """
        self.add(extension_of(search.result), search, Diagnosed(search.tried, is_verdict=True))

    @property
    def diagnosed(self) -> Search | None:
        """The last diagnosis, if it is of what lies here now."""
        found, live = self.found, self.live
        same = found is not None and live is not None and found.begins.file == live.valve
        if found is None or not same or found.recording is not self.opened or found.held_out is not self.held_out:
            return None
        return found

    def stop(self) -> None:
        """Stop what is under way."""
        self.stop_checking()
        if self.search is not None:
            self.search.cancel()

    def add(self, extension: Extension, search: Search, went_on: Diagnosed | None = None) -> None:
        """Go on with a valve that was refitted, with effects added or none; the step joins the journal.

        Args:
            extension: what was found or asked for.
            search: that it came of, with the valve that it begins with.
            went_on: the diagnosis that it goes on from.

        Raises:
            InputError: the valve file cannot be written.
        """
        path = self._path("better")
        write_extended(extension, search.begins.path, path)
        made = Extended(search.begins, extension, search.recording, search.held_out, went_on, search.form)
        self.go_on(NamedValve(path.name, path, extension.valve, made), extension.extended.parameters)

    def undo(self) -> bool:
        """Take back what was done last, a move of a slider or another recording or valve; whether there was anything.

        Raises:
            InputError: as `compare`.
        """
        if self.live is not None and self.live.undo():
            self.compare()
            return True
        if not self._before:
            return False
        self.stop()
        self.search = None
        for name, value in self._before.pop().items():
            setattr(self, name, value)
        return True

    def walk_back(self) -> None:
        """Take the last step of the journal back.

        Raises:
            InputError: the journal is empty.
        """
        if not self.journal:
            raise InputError("journal", "is empty")
        found = self.found
        self._hold_together(self.opened, refitting(self.journal[-1]).before)
        self.found = found

    @property
    def toml(self) -> str:
        """The valve file as it is set, with a remark for each step of the journal and for what was set after them.

        Raises:
            InputError: there is none.
        """
        valve = self.as_set()
        beside = [each.path for each in valve.chain if isinstance(each.made, Extended)]
        remarks = list(Journal.beside(beside[-1]).remarks(valve.file.valve.own.length)) if beside else []
        if isinstance(made := valve.made, SetByHand):
            remarks += [f"{made.before.name} with {each}" for each in changes_in_words(made.values, made.without)]
        return self.plain("".join(f"# {each}\n" for each in remarks) + valve_toml(valve.file))

    def clear(self) -> None:
        """Stop what is under way, and remove what was written for it."""
        self.stop()
        self._running.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _model(self) -> LiveModel:
        if self.live is None:
            raise InputError("workbench", "open a recording and choose a valve first")
        return self.live

    def _hold_together(self, opened: Opened | None, valve: NamedValve | None) -> None:
        """Hold a recording and a valve against each other, all found out before forgotten; if that fails, as it was."""
        live = LiveModel(opened.record, valve.file) if opened and valve else None
        compared = live.comparison() if live else None
        self.stop()
        self._before.append({name: getattr(self, name) for name in UNDONE} | {"variants": dict(self.variants)})
        del self._before[:-MOST_UNDONE]
        self.opened, self.valve, self.live, self.compared = opened, valve, live, compared
        self.fitted, self.search, self.found = {}, None, None
        self.variants = {"as opened": live.curve().simulated_m} if live else {}

    def go_on(self, valve: NamedValve, fitted: Mapping[str, Fitted]) -> None:
        """Take a valve that was found here: the one before stays laid over it."""
        kept, before = (self.search, self.found), self._model().curve().simulated_m
        saved = {name: each for name, each in self.variants.items() if name == SAVED}
        self._hold_together(self.opened, valve)
        self.search, self.found = kept
        self.fitted = fitted
        self.variants = saved | {"as opened": before, "fitted": self._model().curve().simulated_m}

    def _path(self, name: str) -> Path:
        self._written += 1
        return self.folder / f"{name}-{self._written}.toml"


def _same(one: Recording, other: Recording) -> bool:
    """Whether two recordings have the same samples."""
    same_names = one.columns.keys() == other.columns.keys()
    return same_names and all(np.array_equal(each, other.columns[name], True) for name, each in one.columns.items())


def name_valve(text: str, name: str = "") -> NamedValve:
    """Return the valve that a person named: a path, or a shipped one's name.

    Raises:
        InputError: there is none, or it is wrong.
    """
    path = find_valve(text)
    file = valve_alone(load_valve(path), name or text, "this page reads mm and kPa; positioner diagnose reads it")
    own = [Path(each.name) for each in file.effect if each.name.endswith(".py")]
    left_behind = [each.name for each in own if not each.is_file()]
    if name and left_behind:
        raise InputError(
            name,
            f"names {' and '.join(left_behind)}, an effect of your own; a dropped valve file does not bring it: start "
            "positioner workbench --valve FILE in the folder of both",
        )
    return NamedValve(name or text, path, file)
