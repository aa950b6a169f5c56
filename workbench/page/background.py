"""Long work in a process of its own: it tells how far it is, and can be stopped at any moment.

A process and not a thread: a search on all processors leaves the page its own, and what is stopped is gone at once.
"""

import multiprocessing
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from math import inf
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Protocol

from config.errors import CommandFailed, InputError
from config.recording import Recording
from config.valve_file import ValveFile
from sim.effect import written_here
from sim.own_effect import check_effect
from workbench.diagnosis.diagnosis import Diagnosis, diagnose
from workbench.diagnosis.extension import Extension, extend
from workbench.discover.discovery import Discovery, discover
from workbench.fit.breaking_off import BrokenOff
from workbench.select.tangent_preview import TangentScore

FRESH = multiprocessing.get_context("spawn")
"""A fork of a process with threads would hold their locks."""
END_WITHIN_S = 5.0


@dataclass(frozen=True, slots=True)
class Progressed:
    """What is being done, and the fraction of it done."""

    what: str
    done: float


@dataclass(frozen=True, slots=True)
class Previewed:
    """The tangent preview: no verdict."""

    scores: tuple[TangentScore, ...]


@dataclass(frozen=True, slots=True)
class Raced:
    """A candidate of a step, and the rms error, m, that its search has come to so far."""

    step: int
    name: str
    rms_m: float


@dataclass(frozen=True, slots=True)
class Finished:
    """The result."""

    result: Any


@dataclass(frozen=True, slots=True)
class Failed:
    """Why there is none."""

    said: str


News = Progressed | Previewed | Raced | Finished | Failed
Tell = Callable[[News], None]


class Task(Protocol):
    """What is done; it tells how far it is."""

    def __call__(self, tell: Tell, /, *arguments: Any) -> Any:
        """Do it, and return the result."""


class Work:
    """A task under way in a process of its own; its arguments and its result must pass between processes."""

    def __init__(self, task: Task, *arguments: Any, own_effects: Path | None = None) -> None:
        """Begin; `own_effects`: the folder whose effects may be run, written by this page."""
        self._heard, said = FRESH.Pipe(duplex=False)
        self._process = FRESH.Process(target=_work, args=(said, own_effects, task, arguments), daemon=True)
        self._process.start()
        said.close()
        self.is_over = False

    @property
    def is_alive(self) -> bool:
        """Whether its process is there."""
        return self._process.is_alive()

    def news(self) -> list[News]:
        """Return what it has told since it was asked last; the last of all is Finished or Failed."""
        told: list[News] = []
        with suppress(EOFError):
            while not self.is_over and self._heard.poll():
                told.append(self._heard.recv())
                self.is_over = isinstance(told[-1], Finished | Failed)
            if self.is_over:
                self._process.join(END_WITHIN_S)
            return told
        self.is_over = True
        self._process.join(END_WITHIN_S)
        return [*told, Failed(f"the work ended by itself, exit status {self._process.exitcode}")]

    def cancel(self) -> None:
        """Stop it, if it is not over."""
        self.is_over = True
        if self.is_alive:
            self._process.kill()
            self._process.join(END_WITHIN_S)
        self._heard.close()


def _work(said: Connection, own_effects: Path | None, task: Task, arguments: Sequence[Any]) -> None:
    try:
        with written_here(own_effects) if own_effects else nullcontext():
            end: News = Finished(task(said.send, *arguments))
    except (InputError, CommandFailed) as error:
        end = Failed(str(error))
    except Exception as error:  # whatever it is, the page must say that there is no result
        end = Failed(f"{type(error).__name__}: {error}")
    said.send(end)


@dataclass(frozen=True, slots=True)
class Limits:
    """What a search is held to: a recording held out, else the last third of the one; and a time, s."""

    test: Recording | None = None
    budget_s: float = inf


def run_diagnosis(
    tell: Tell, recording: Recording, valve: ValveFile, limits: Limits, effects: Sequence[str] | None
) -> Diagnosis:
    """Diagnose.

    Args:
        tell: is told preview, race and progress.
        recording: of the valve.
        valve: where the search begins.
        limits: after whose time it says what is known then.
        effects: that are tried; None: all that come with the package.

    Raises:
        InputError: as `diagnose`.
        CommandFailed: the time was over before anything was known.
    """
    end_s = time.monotonic() + limits.budget_s
    try:
        return diagnose(
            recording,
            valve,
            test=limits.test,
            effects=effects,
            on_preview=lambda scores: tell(Previewed(scores)),
            progress=lambda what, done: tell(Progressed(what, done)),
            race=lambda step, name, rms_m: tell(Raced(step, name, rms_m)),
            over=lambda: time.monotonic() > end_s,
        )
    except BrokenOff:
        raise CommandFailed("the time was over before the given valve was fitted: nothing is known") from None


def run_extension(
    tell: Tell,
    recording: Recording,
    valve: ValveFile,
    limits: Limits,
    effects: Sequence[str],
    diagnosis: Diagnosis | None,
) -> Extension:
    """Add effects, or none, and refit.

    Args:
        tell: is told the progress.
        recording: of the valve.
        valve: that is extended.
        limits: of which the held-out recording counts.
        effects: that are added together.
        diagnosis: of the same recording and valve, if there is one.

    Raises:
        InputError: as `extend`.
    """

    def tell_progress(what: str, done: float) -> None:
        tell(Progressed(what, done))

    return extend(recording, valve, effects, test=limits.test, diagnosis=diagnosis, progress=tell_progress)


def run_discovery(tell: Tell, recording: Recording, valve: ValveFile, limits: Limits) -> Discovery:
    """Look for the form of what no effect of the library explains.

    Args:
        tell: is told the progress.
        recording: of the valve.
        valve: where the search begins.
        limits: of which the held-out recording counts.

    Raises:
        InputError: as `discover`.
    """
    return discover(recording, valve, test=limits.test, progress=lambda what, done: tell(Progressed(what, done)))


def effect_checked(tell: Tell, valve: ValveFile, path: Path) -> None:
    """See whether an effect of a person's own may be tried.

    Args:
        tell: is told what is being done.
        valve: to which it is added.
        path: of its file.

    Raises:
        InputError: as `checked`.
    """
    tell(Progressed("compiling", 0.0))
    check_effect(path, valve.valve)
