"""Fleet: the valves of a manifest, ranked by what their recordings say (`valve_complaints`, `ValveCourse.order`)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from config.arguments import kinds_held
from config.errors import InputError
from config.results.block import Block, Table
from config.results.result import Result
from config.valve_file import find_valve, load_valve, valve_alone
from workbench.data.kept_results import KeptResults
from workbench.fleet.engine import TIME_LIMIT_S, cluster, work
from workbench.fleet.examination import AS_BEFORE, UNREADABLE, Examination, Request, request_key, unreadable
from workbench.fleet.manifest import Entry, Manifest, read_manifest
from workbench.fleet.model_changes import ModelChanges, changed_since
from workbench.fleet.valve_complaints import ValveCourse, valve_in

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUMMARY_LINES = 30  # of a summary: a screen
Told = Callable[[str, Entry, Examination], None]


@dataclass(frozen=True, slots=True, repr=False)
class Fleet(Result):
    """The valves, the gravest first."""

    courses: tuple[ValveCourse, ...]
    examined: int
    """Recordings examined in this run; all others were kept from before."""
    count: int
    folder: Path
    """From which the recordings' paths count."""

    @property
    def complaining(self) -> tuple[ValveCourse, ...]:
        """The valves of which something is wrong."""
        return tuple(each for each in self.courses if each.gravest)

    @property
    def bad(self) -> list[tuple[str, Entry, str]]:
        """The recordings that could not be examined, with valve and reason."""
        return [
            (course.name, entry, found.sentence)
            for course in self.courses
            for entry, found in course.examined
            if found.outcome == UNREADABLE
        ]

    def changed_since(self, time: datetime) -> ModelChanges:
        """Return what changed of the valves since a time; with an offset if the manifest's times have one.

        Raises:
            InputError: it has an offset and they have none, or the other way round.
        """
        entries = [entry for course in self.courses for entry, _ in course.examined]
        if entries and (entries[0].time.tzinfo is None) != (time.tzinfo is None):
            wanted = (
                "no offset, as the manifest's times" if time.tzinfo else "an offset, as the manifest's times: +00:00"
            )
            raise InputError(time.isoformat(), f"must have {wanted}")
        return changed_since(self.courses, time)

    @property
    def unknown(self) -> tuple[ValveCourse, ...]:
        """The valves of which no recording could be examined."""
        return tuple(each for each in self.courses if not each.readable)

    def blocks(self) -> list[Block]:
        """Say how many valves deserve a look, which, and which recordings could not be read."""
        head = ("rank", "valve", "what", "since", "off by, % of stroke", "sure", "")
        rows = [
            (str(rank), each.name, each.kind, since_day(each), f"{100 * each.cost_share:.2f}", each.sure, _say(each))
            for rank, each in enumerate(self.complaining, start=1)
        ]
        unknown = f", {len(self.unknown)} could not be judged" if self.unknown else ""
        said: list[Block] = [
            f"{len(self.complaining)} of {len(self.courses)} valves need attention{unknown}; {self.count} recordings, "
            f"{self.examined} of them examined now, {len(self.bad)} unreadable"
        ]
        if rows:
            said.append(Table(head, rows[:SUMMARY_LINES]))
        if len(rows) > SUMMARY_LINES:
            said.append(f"and {len(rows) - SUMMARY_LINES} more")
        said += [f"{name}: {entry.recording}: {reason}" for name, entry, reason in self.bad]
        return said

    def frame_columns(self) -> Mapping[str, list[object]]:
        """Return a row a valve, in the order of the ranking; docs/fleet.md says what each column is."""
        from workbench.fleet.tables import valve_columns

        return valve_columns(self.courses)

    def plot(self) -> "Figure":
        """Draw how far each complaining valve is off, in the order of the ranking."""
        from config.results.drawing import MEASURED, line, panels

        figure, (axes,) = panels({"off by, % of stroke": 3.2}, "rank")
        shares = [100.0 * each.cost_share for each in self.complaining]
        line(axes, list(range(1, len(shares) + 1)), shares, MEASURED)
        return figure


@kinds_held
def fleet(
    manifest: Path | str,
    out: Path | str,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    time_limit_s: float = TIME_LIMIT_S,
    told: Told | None = None,
) -> Fleet:
    """Rank the valves of a manifest; what was examined before is not examined again.

    Args:
        manifest: CSV or TOML, see `workbench.fleet.manifest`.
        out: the folder where examinations are kept.
        scheduler: address of a Dask scheduler, whose workers see the recordings under the same paths; without one,
            workers of this machine.
        workers: how many of these, by default one a core.
        time_limit_s: for one recording; one that takes longer is listed as unreadable, and tried again next time.
        told: called with valve, recording and what came of it, as it comes.

    Raises:
        InputError: a fault in the manifest, a folder of another form, no scheduler there.
        CommandFailed: the scheduler is gone.
    """
    read = read_manifest(Path(manifest))
    store = KeptResults(Path(out), Examination)
    running = [_Running(name, entries, read, store, told) for name, entries in read.valves.items()]
    waiting = [each for each in running if not each.is_through()]
    if waiting:
        with cluster(scheduler, workers) as client:
            work(client, waiting, time_limit_s)
    courses = tuple(sorted((each.course for each in running), key=ValveCourse.order))
    return Fleet(courses, sum(each.examined for each in running), read.count, read.folder)


class _Running:
    """A valve's course under way."""

    def __init__(
        self,
        name: str,
        entries: Sequence[Entry],
        manifest: Manifest,
        store: KeptResults[Examination],
        told: Told | None,
    ) -> None:
        self._entries, self._folder, self._store, self._told = entries, manifest.folder, store, told
        self._asked: Request | None = None
        self._known: tuple[str, str, float | None] | None = None
        """Key, recording and floor of the examination by which the model was accepted, or the drawing confirmed."""
        self.examined = 0
        self.course = ValveCourse(name)
        try:
            written = entries[0].file
            path = manifest.folder / written if written.endswith(".toml") else find_valve(written)
            self._model = self.course.given = valve_alone(load_valve(path), str(path), "a fleet is of valves")
        except InputError as error:
            for entry in entries:
                self._tell(entry, unreadable(f"valve file {entry.file}: {error.problem}"))

    def is_through(self) -> bool:
        """Take all that is kept; return whether that was all."""
        self._asked = self._next()
        return self._asked is None

    def following(self) -> Request | None:
        """Return what has to be examined next; None: all is."""
        self._asked = self._asked or self._next()
        return self._asked

    def take(self, found: Examination) -> None:
        """Keep what came of it."""
        assert self._asked
        asked, self._asked = self._asked, None
        self.examined += 1
        entry = self._entries[len(self.course.examined)]
        # As the manifest writes it: where the folder lies is no part of what came of it.
        found = found.model_copy(update={"sentence": found.sentence.replace(asked.recording, entry.recording)})
        if found.outcome != UNREADABLE:  # what could not be read, or killed its worker, is tried again
            self._store.put(asked.key, found)
        self._go_on(asked.key, entry, found)

    def _next(self) -> Request | None:
        """Return the next recording that was not examined before; what was, is taken as it was kept."""
        while len(self.course.examined) < len(self._entries):
            entry = self._entries[len(self.course.examined)]
            path = self._folder / entry.recording
            try:
                key = request_key(path, self._model, self._known[0] if self._known else "")
            except OSError as error:
                self._tell(entry, unreadable(f"cannot be read: {error.strerror}"))
                continue
            except InputError as error:  # an effect of one's own that is not there, or in no folder that is allowed
                self._tell(entry, unreadable(str(error)))
                continue
            kept = self._store.get(key)
            if kept is None:
                _, known_by, floor_m = self._known or ("", None, None)
                return Request(key, str(path.resolve()), self._model, known_by, floor_m)
            self._go_on(key, entry, kept)
        return None

    def _go_on(self, key: str, entry: Entry, found: Examination) -> None:
        if found.model is not None:
            self._model = valve_in(found.model)
        if found.model is not None or (self._known is None and found.outcome == AS_BEFORE):
            self._known = key, str((self._folder / entry.recording).resolve()), found.floor_m
        self._tell(entry, found)

    def _tell(self, entry: Entry, found: Examination) -> None:
        self.course.take(entry, found)
        if self._told:
            self._told(self.course.name, entry, found)


def since_day(course: ValveCourse) -> str:
    """Return the day since which a valve complains; empty where it does not."""
    return f"{course.since:%Y-%m-%d}" if course.since else ""


def _say(course: ValveCourse) -> str:
    return course.gravest[1].sentence if course.gravest else ""


def at(text: str, key: str) -> datetime:
    """Read a date or time that a person gave under that key.

    Raises:
        InputError: it is none.
    """
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise InputError(key, f"must be a date YYYY-MM-DD, or with a time, got {text!r}") from None
