"""An effect of one's own: an editor that begins with the example; what is saved is read, compiled, and joins the race.

Such a file is a program that runs as whoever started the command. Only the session that wrote it runs it, and only
where the page listens to this machine alone is there an editor at all.
"""

import re
from collections.abc import Callable

from nicegui import ui

from sim.own_effect import EXAMPLE
from webpage.messages import errors_told, is_looked_at
from webpage.theme import Theme
from workbench.page.background import Failed, Progressed
from workbench.page.desk import Desk

PANEL_LOOK_S = 0.2
NAME = EXAMPLE.stem.removeprefix("_")


class EffectPanel:
    """The editor; `joined` is called when an effect has joined the race."""

    def __init__(self, desk: Desk, theme: Theme, joined: Callable[[], None]) -> None:
        self._desk = desk
        self._theme = theme
        self._joined = joined
        self._name = ui.input("its name", value=NAME).props('dense data-testid="effect-name"')
        self._editor = ui.codemirror(EXAMPLE.read_text(encoding="utf-8"), language="Python", line_wrapping=True)
        self._editor.classes("w-full").style("height: 420px").props('data-testid="effect-text"')
        self._dress()
        theme.listen(self._dress)
        with ui.row().classes("items-center"):
            self._save = ui.button("Save and check", icon="save", on_click=self._save_effect)
            self._save.props('no-caps data-testid="effect-save"')
            ui.button("Save and export", icon="download", on_click=self._download).props("outline no-caps")
        self._said = ui.label().props('aria-live="polite" data-testid="effect-said"').style("white-space: pre-wrap")
        self._kept = ui.row().classes("items-center")
        self._list()
        ui.timer(PANEL_LOOK_S, self._look)

    def _dress(self) -> None:
        if not self._editor.is_deleted:
            self._editor.set_theme("vscodeDark" if self._theme.is_dark else "vscodeLight")

    def _save_effect(self) -> None:
        with errors_told():
            path = self._desk.write_effect(str(self._name.value or ""), self._editor.value)
            self._desk.check_effect(path)
            self._save.set_enabled(False)
            self._editor.decorations.clear()
            self._said.set_text("compiling ...")

    def _look(self) -> None:
        """See whether the check has come to an end."""
        if self._desk.checking is None or not is_looked_at():
            return
        for each in self._desk.checking.news():
            if isinstance(each, Progressed):
                continue
            name, self._desk.checking = str(self._name.value), None
            self._save.set_enabled(True)
            if isinstance(each, Failed):
                self._blame(self._desk.plain(each.said), name)
            else:
                self._desk.keep_effect(name)
                self._said.set_text(f"{name} compiles, and joins the race")
                self._list()
                self._joined()
            return

    def _blame(self, said: str, name: str) -> None:
        self._said.set_text(said)
        if lines := re.findall(rf'{re.escape(name)}\.py(?:", |: )line (\d+)', said):
            line = int(lines[-1])
            self._editor.decorations.append({"kind": "line", "line": line, "class": "blamed"})
            self._editor.reveal_line(line)

    def _list(self) -> None:
        self._kept.clear()
        with self._kept:
            for name in self._desk.effects:
                ui.button(name, on_click=lambda name=name: self._open(name)).props("flat dense no-caps")

    def _open(self, name: str) -> None:
        self._name.set_value(name)
        self._editor.set_value(self._desk.effect_path(name).read_text(encoding="utf-8"))

    def _download(self) -> None:
        ui.download.content(self._editor.value, f"{self._name.value or NAME}.py")


def effect_section(desk: Desk, theme: Theme, joined: Callable[[], None]) -> None:
    """Show the editor, folded; where strangers may come in, say why there is none."""
    with ui.expansion("an effect of your own", icon="edit_note").classes("w-full").props('data-testid="own-effect"'):
        if desk.may_write_effects:
            EffectPanel(desk, theme, joined)
        else:
            ui.label("An effect is a program: it is written here only where the page listens to this machine alone.")
