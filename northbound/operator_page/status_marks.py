"""How the page stresses things: grey is not of now, an NE 107 status has its shape and colour, a fault is red."""

from nicegui import ui

from config.codes import Ne107Status
from northbound.operator_page.valve_facts import NE107_LETTER

NE107_COLOURS = {
    Ne107Status.GOOD: "#1b7f79",
    Ne107Status.MAINTENANCE_REQUIRED: "#2f7fb8",
    Ne107Status.OUT_OF_SPECIFICATION: "#b08900",
    Ne107Status.FUNCTION_CHECK: "#c8641f",
    Ne107Status.FAILURE: "#c62f26",
}
"""Beside the words, which say it without any colour."""

UNHEARD = (
    ".unheard { visibility: hidden; position: fixed; left: 16px; right: 16px; bottom: 16px; z-index: 9; }"
    + "".join(
        f"@keyframes grey-{turn} {{ to {{ opacity: 0.35; filter: grayscale(1); }} }}\n"
        f"@keyframes tell-{turn} {{ to {{ visibility: visible; }} }}\n"
        f".heard-{turn} > .panel {{ animation: grey-{turn} 0.1s 1.4s forwards; }}\n"
        f".heard-{turn} > .unheard {{ animation: tell-{turn} 0.1s 1.4s forwards; width: auto; }}\n"
        for turn in (0, 1)
    )
)
"""The browser greys by itself what it hears nothing about: each sign of life begins the animation anew."""

NE107_MARKS = "".join(
    f".ne107-{NE107_LETTER[status] or 'good'}::before {{ content: ''; display: inline-block; width: .7em;"
    f" height: .7em; margin-right: .4em; background: {colour};"
    f" border-radius: {'50%' if status is Ne107Status.GOOD else '2px'}; }}\n"
    for status, colour in NE107_COLOURS.items()
)

LAYOUT = """
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(150px, 1fr)); gap: 8px; margin-bottom: 16px; }
.tile { padding: 8px 12px; border-radius: 6px; background: rgba(128,136,150,0.12); min-width: 0; }
.figure { overflow-wrap: anywhere; }
.overview { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(270px, 100%), 1fr)); gap: 16px; }
.overview { align-items: start; }
.cards { columns: 340px; column-gap: 16px; margin-top: 16px; } .cards > * { break-inside: avoid; margin-bottom: 16px; }
.wide.column, .side.column { display: flex; flex-flow: column nowrap; gap: 16px; }
.alarm { background: #b3261e; color: #fff; padding: 8px 12px; border-radius: 6px; width: 100%; font-weight: 600; }
.stale { opacity: 0.45; filter: grayscale(1); }
.faulty { color: #b3261e; } .body--dark .faulty { color: #ff8a80; }
.facts { display: grid; grid-template-columns: fit-content(50%) 1fr; gap: 2px 16px; margin: 0; width: 100%; }
.facts dt { opacity: 0.75; } .facts dd { margin: 0; text-align: right; overflow-wrap: anywhere; }
.verbatim { white-space: pre; font: 12px/1.4 monospace; }
.alarm-row { border-top: 1px solid rgba(128,136,150,0.35); padding: 8px 0; } .unseen { font-weight: 700; }
.scrolling { overflow-x: auto; } .scrolling p { margin: 4px 0; }
.scrolling table { border-collapse: collapse; margin: 8px 0; font-variant-numeric: tabular-nums; }
.scrolling table td, .scrolling table th { padding: 2px 12px 2px 0; white-space: nowrap; }
@media (max-width: 599px) {
  .q-header { flex-wrap: nowrap; } .q-header .title { display: none; } .q-header .q-select { min-width: 0; }
}
"""

STYLE = LAYOUT + NE107_MARKS + UNHEARD


class SignOfLife:
    """Around what a tab shows: greys it, and says so, when the server sends nothing for 2 s."""

    def __init__(self) -> None:
        self.around = ui.element("div").classes("heard-0 full-width")
        self._number = 0
        with self.around:
            ui.label("Not live: nothing has come from the page's server for 2 s").classes("alarm unheard").props(
                'role="alert" data-testid="unheard"'
            )

    def give(self) -> None:
        """Give one, twice a second."""
        before, self._number = self._number, 1 - self._number
        self.around.classes(add=f"heard-{self._number}", remove=f"heard-{before}")


def grey(element: ui.element, stale: bool) -> None:
    """Grey what is not of now, or take that back."""
    element.classes(**{"add" if stale else "remove": "stale"})


def mark_ne107(label: ui.label, letter: str) -> None:
    """Mark a status by its letter, empty for good."""
    wanted = f"ne107-{letter or 'good'}"
    others = {f"ne107-{each or 'good'}" for each in (*NE107_LETTER.values(), "?")} - {wanted}
    label.classes(add=wanted, remove=" ".join(sorted(others)))


def mark_fault(label: ui.label, faulty: bool) -> None:
    """Mark a fault, or take that back."""
    label.classes(**{"add" if faulty else "remove": "faulty"})
