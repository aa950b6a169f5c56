"""What `compare` says: each sentence goes to the stretches that it speaks of, each kind of slip to its slips."""

from collections.abc import Callable, Sequence

import numpy as np
from nicegui import ui

from webpage.page_words import in_page_words
from webpage.units import Units
from workbench.compare.comparison import Comparison
from workbench.compare.comparison_sentences import Stretch, slip_sentences
from workbench.page.explained_words import word
from workbench.report.comparison_report import headline
from workbench.report.display_units import of_stroke

Look = Callable[[Stretch | None], None]
"""Goes to a stretch; None: to the whole recording."""


class FindingsPanel:
    """The sentences, and the buttons of the slips.

    Args:
        look: goes there.
        stroke_m: of the valve.
        units: that it is read in.
    """

    def __init__(self, look: Look, stroke_m: float, units: Units) -> None:
        self._look = look
        self._stroke_m = stroke_m
        self._units = units
        self.jumps = ui.row().classes("items-center")
        # As high whatever is said: the sliders below must not move away from the hand.
        with ui.column().classes("steady"):
            self._sentences = ui.column().classes("w-full").style("gap: 4px")
            self._where = ui.label().classes("quiet").props('aria-live="polite" data-testid="where"')

    def show(self, compared: Comparison) -> None:
        """Show what is said of a comparison."""
        self._where.set_text("")
        self._sentences.clear()
        with self._sentences:
            kind, first = headline(compared)
            ui.label(in_page_words(first)).classes("text-weight-medium").props(
                f'data-testid="verdict" data-kind="{kind}"'
            )
            with ui.element("ul").classes("said").props('data-testid="sentences"'):
                for text, stretches in zip(compared.sentences, compared.stretches, strict=True):
                    with ui.element("li"):
                        self._jump(in_page_words(text), stretches, [text] * len(stretches))
            error = self._units.length_unit().fine(compared.rms_m)
            ui.label(f"error: {error}, {of_stroke(compared.rms_m, self._stroke_m)}").classes("quiet")
        self.jumps.clear()
        slips, said = compared.slips, slip_sentences(compared.slips, compared.own.length)
        times = (slips.missed_s, slips.spurious_s, tuple(each.time_s for each in slips.matched))
        with self.jumps:
            for (kind, texts), times_s in zip(said.items(), times, strict=True):
                if times_s:
                    self._jump(f"{len(times_s)} {kind}", [Stretch(each, each) for each in times_s], texts)
                else:
                    ui.label(f"0 {kind}").classes("quiet")
            word("slips")
            at_s = _largest_s(compared)
            self._jump("largest error", [Stretch(at_s, at_s)], [f"at {at_s:.2f} s"])

    def tell(self, said: str) -> None:
        """Say what is looked at."""
        self._where.set_text(said)

    def _jump(self, label: str, stretches: Sequence[Stretch], said: Sequence[str]) -> None:
        """Show a button that goes from one of these stretches to the next; with none it shows all of the recording."""
        at = 0

        def go() -> None:
            nonlocal at
            if not stretches:
                self.tell(f"{label}: of the whole recording")
                self._look(None)
                return
            self.tell(f"{at + 1} of {len(stretches)}: {said[at]}")
            self._look(stretches[at])
            at = (at + 1) % len(stretches)

        button = ui.element("button").classes("jump").on("click", go).props('type="button"')
        with button:
            ui.label(label)


def _largest_s(compared: Comparison) -> float:
    row = int(np.nanargmax(np.abs(compared.residual_m)))
    return float(compared.time_s[row] - compared.time_s[0])
