"""A search under way, and what it has told so far: the race of the candidates, the preview, the progress."""

from dataclasses import dataclass, field
from typing import Any

from workbench.page.background import Failed, Finished, Previewed, Progressed, Raced, Work
from workbench.page.provenance import Diagnosed, NamedValve
from workbench.page.recording_opening import Opened
from workbench.select.tangent_preview import TangentScore

PREVIEWED = 5  # effects in the line of the preview


@dataclass(slots=True)
class Search:
    """What a search is for, in words, what it begins with, and what it has come to."""

    what: str
    begins: NamedValve
    """The valve as it was set."""
    recording: Opened
    held_out: Opened | None
    """The recording that no fit of it sees."""
    work: Work
    tried: tuple[str, ...] = ()
    """The effects that a diagnosis tries."""
    went_on: Diagnosed | None = None
    """The diagnosis that an extension goes on from."""
    form: str = ""
    """The file of the form that an extension adds, as `discover` wrote it."""
    doing: str = ""
    done: float = 0.0
    step: int = 0
    race: dict[str, float] = field(default_factory=dict)
    """The rms error, m, of each candidate of the step; the least that was told."""
    preview: tuple[TangentScore, ...] = ()
    result: Any = None
    failed: str = ""

    @property
    def is_running(self) -> bool:
        """Whether it goes on."""
        return not self.work.is_over

    @property
    def previewed(self) -> str:
        """The preview in words; empty before. How much of the error each would explain."""
        named = ", ".join(f"{each.name} {each.score:.0%}" for each in self.preview[:PREVIEWED])
        return f"no verdict: {named}" if named else ""

    def look(self) -> bool:
        """Take in what it has told since; whether there was anything."""
        if self.work.is_over:
            return False
        news = self.work.news()
        for each in news:
            match each:
                case Progressed(what, done):
                    self.doing, self.done = what, done
                case Previewed(scores):
                    self.preview = scores
                case Raced(step, name, rms_m):
                    if step != self.step:
                        self.step, self.race = step, {}
                    self.race[name] = min(rms_m, self.race.get(name, rms_m))
                case Finished(result):
                    self.result, self.done = result, 1.0
                case Failed(said):
                    self.failed = said
        return bool(news)

    def cancel(self) -> None:
        """Stop it."""
        if self.is_running:
            self.work.cancel()
            self.failed = "cancelled"
