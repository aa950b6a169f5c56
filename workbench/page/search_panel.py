"""Diagnosis in the background: the race of the candidates as it runs, then the verdict, and what may be added."""

from collections.abc import Callable, Sequence
from math import inf, log10

from nicegui import ui

from config.errors import InputError
from sim.effect import tried_effects
from webpage.figure_view import Figure, FigureView
from webpage.messages import aside, errors_told, heading, is_looked_at, look_at, tell_error
from webpage.number_field import NumberField
from webpage.page_words import in_page_words
from webpage.theme import Theme
from workbench.diagnosis.diagnosis import Diagnosis
from workbench.discover.discovery import Discovery
from workbench.page.desk import Desk
from workbench.page.effect_panel import effect_section
from workbench.page.explained_words import ADDING_CELL, EFFECT_CELL, about_effect, word
from workbench.page.search import Search
from workbench.report.charts import EXTENDED, MEASURED, axis, layout, mark_line
from workbench.report.effect_ranking import log_ticks
from workbench.report.effects_table import headline, ranks

PANEL_LOOK_S = 0.2
LEAST_BUDGET_S = 1.0
ROW_PX, FRAME_PX = 18, 70


class SearchPanel:
    """Begins searches; `changed` is called when another valve is on the desk, `told` when something was found."""

    def __init__(
        self, desk: Desk, theme: Theme, changed: Callable[[str], None], told: Callable[[], None] = lambda: None
    ) -> None:
        self._desk = desk
        self._theme = theme
        self._changed = changed
        self._told = told
        heading("Which effect is missing?", "search")
        with ui.row().classes("w-full items-center"):
            self._begin = ui.button("Diagnose", icon="search", on_click=self._diagnose)
            self._begin.props('no-caps data-testid="diagnose"')
            self._fit = ui.button("Fit the valve as it is", icon="tune", on_click=lambda: self._extend(())).props(
                "outline no-caps"
            )
            self._seek = ui.button("Discover a form", icon="functions", on_click=self._discover)
            self._seek.props('outline no-caps data-testid="discover"').tooltip(
                "if no effect of the library explains it: looks for the form of what is missing; takes minutes"
            )
            self._cancel = ui.button("Cancel", icon="close", on_click=self._stop).props(
                "outline no-caps color=negative"
            )
            shown_s = None if desk.budget_s == inf else desk.budget_s
            self._budget = NumberField("at most, s", shown_s, name="at most, s")
            self._budget.props('dense clearable data-testid="budget"').style("width: 110px")
            self._budget.on("blur", self._handle_text).tooltip("time limit; then the results so far are shown")
            names = ui.select(self._list_effects(), label="effects tried (all)", multiple=True, clearable=True)
            self._names = names.props('use-chips dense data-testid="effects"').style("min-width: 260px")
        with ui.column().classes("w-full") as self._progress:
            self._doing = ui.label().props('data-testid="doing" aria-live="polite"')
            self._bar = ui.linear_progress(show_value=False, size="10px").props("rounded")
            with ui.row().classes("items-baseline").style("gap: 6px") as self._previewed:
                word("preview")
                self._preview = ui.label().classes("quiet")
        self._result = ui.column().classes("w-full")
        self._race = ui.column().classes("w-full")
        self._raced: tuple[int, int] = (0, 0)
        self._view: FigureView | None = None
        effect_section(desk, theme, self._update_names)
        ui.timer(PANEL_LOOK_S, self.look)
        self._show()
        self._show_race()
        if desk.found is not None:
            self._tell(desk.found)

    def _handle_text(self) -> None:
        with errors_told():
            self._take_budget()

    def _take_budget(self) -> None:
        """Take how long a search may go on, as it was typed.

        Raises:
            InputError: it is no time.
        """
        budget_s = self._budget.number()
        if budget_s is not None and budget_s < LEAST_BUDGET_S:
            raise InputError(
                "at most, s", f"must be {LEAST_BUDGET_S:g} or more, or nothing, got {self._budget.value!r}"
            )
        self._desk.budget_s = inf if budget_s is None else budget_s

    def _update_names(self) -> None:
        self._names.set_options(self._list_effects(), value=self._names.value)

    def _list_effects(self) -> dict[str, str]:
        """Return what may be tried, and what it is called: one's own effects are named by their paths."""
        own = {str(path): name for name, path in self._desk.effects.items()}
        return own | {name: name for name in tried_effects()}

    def _diagnose(self) -> None:
        with errors_told():
            self._take_budget()
            self._desk.diagnose(self._names.value or list(self._list_effects()))
        self._began()

    def _extend(self, effects: Sequence[str]) -> None:
        """Add effects and refit; with none, refit the valve as it is."""
        with errors_told():
            self._take_budget()
            self._desk.extend(effects)
        self._began()

    def _discover(self) -> None:
        with errors_told():
            self._desk.discover()
        self._began()

    def _began(self) -> None:
        self._result.clear()
        self._show()
        self._show_race()
        with self._result:  # what was pressed may be gone by now
            look_at("search")

    def _stop(self) -> None:
        self._desk.stop()
        self._show()

    async def look(self) -> None:
        """Show what the search has told since."""
        search = self._desk.search
        if search is None or not is_looked_at() or not search.look():
            return
        self._show()
        self._show_race()
        if search.failed:
            tell_error(search.failed)
        elif search.result is not None:
            await self._take(search)

    async def _take(self, search: Search) -> None:
        """Do what the search was for."""
        with errors_told():
            await aside(self._desk.take, search)
            if isinstance(search.result, Discovery):
                self._tell_form(search)
            elif self._desk.found is search:
                self._tell(search)
                self._told()
            else:
                self._changed("journal")

    def _show(self) -> None:
        search = self._desk.search
        running = search is not None and search.is_running
        self._begin.set_enabled(not running)
        self._fit.set_enabled(not running)
        self._seek.set_enabled(not running)
        self._cancel.set_visibility(running)
        self._progress.set_visibility(search is not None)
        if search is not None:
            self._bar.set_value(search.done)
            self._bar.set_visibility(running)
            said = f"{self._desk.plain(search.doing) or 'starting'}: {search.done:.0%}" if running else search.failed
            self._doing.set_text(said)
            self._preview.set_text(self._desk.plain(search.previewed))
            self._previewed.set_visibility(bool(search.preview))

    def _show_race(self) -> None:
        """Draw the bars; a step with other candidates is another figure."""
        search = self._desk.search
        if search is None or not search.race:
            self._race.clear()
            self._view, self._raced = None, (0, 0)
            return
        if self._view is None or self._raced != (search.step, len(search.race)):
            self._raced = (search.step, len(search.race))
            self._race.clear()
            with self._race:
                height_px = FRAME_PX + ROW_PX * len(search.race)
                self._view = FigureView(self._theme, self.draw, height_px, "errors of the candidates")
        else:
            self._view.redraw()

    def draw(self) -> Figure:
        """Return the race of the candidates, the best on top."""
        search, compared = self._desk.search, self._desk.compared
        race = {} if search is None else dict(sorted(search.race.items(), key=lambda each: -each[1]))
        of = self._desk.errors
        errors = [of.factor * each for each in race.values()]
        bars = {
            "type": "bar", "orientation": "h", "x": errors, "y": [self._desk.plain(each) for each in race],
            "marker": {"color": EXTENDED},
            "hovertemplate": f"%{{y}}: %{{x:.4~g}} {of.unit}<extra></extra>",
        }  # fmt: skip
        floors = [] if compared is None or compared.floor_m is None else [of.factor * compared.floor_m]
        step = search.step if search else 1
        return {
            "data": [bars],
            "layout": layout(
                margin={"l": 10, "r": 10, "t": 8, "b": 40},
                xaxis=axis(f"step {step}: fitted error, {of.unit} rms", type="log", **log_ticks([*errors, *floors])),
                yaxis=axis("", tickfont={"size": 11}),
                shapes=[mark_line(each, MEASURED) for each in floors],
                annotations=[_label_floor(each) for each in floors],
                showlegend=False,
            ),
        }

    def _tell(self, search: Search) -> None:
        """Show the verdict and every candidate, each with why it was refused and a button that adds it."""
        diagnosis: Diagnosis = search.result
        self._result.clear()
        may_add = self._desk.diagnosed is search
        kind, first = headline(diagnosis.verdict, diagnosis.missing, parameters_off=diagnosis.parameters_off)
        with self._result:
            plain = self._desk.plain
            ui.label(plain(first)).classes("text-weight-medium").props(f'data-testid="found" data-kind="{kind}"')
            ui.label(in_page_words(plain(diagnosis.sentence))).props('data-testid="found-sentence"')
            with ui.row():
                for effects in diagnosis.choices if may_add else ():
                    named = plain(", ".join(effects))
                    button = ui.button(f"Add {named}" if named else "Use the fitted parameters", icon="add")
                    button.on_click(lambda effects=effects: self._add(search, effects))
                    button.props('no-caps data-testid="add"')
            if diagnosis.experiment is not None:
                ui.label(f"Experiment: {diagnosis.experiment.sentence}.")
            for number, step in enumerate(diagnosis.steps, start=1):
                before = self._desk.errors.shown(step.before.errors.test_rmse_m).text
                with ui.row().classes("items-baseline").style("gap: 6px"):
                    word(f"step {number}", "step")
                    ui.label(f"error before: {before} {self._desk.errors.unit} rms").classes("quiet")
                    word("held out")
                    ui.label("; judged by").classes("quiet")
                    word("evidence")
                self._candidates(diagnosis, number, may_add=may_add)

    def _tell_form(self, search: Search) -> None:
        """Show which form was found, and what adds it: it is a program, and goes home as one."""
        discovery: Discovery = search.result
        self._result.clear()
        with self._result:
            ui.label(in_page_words(discovery.sentence)).props('data-testid="form"')
            if not discovery.found:
                return
            ui.code("\n".join(discovery.found[0].form.equations)).classes("w-full")
            if self._desk.may_write_effects:
                add = ui.button("Add this form", icon="add", on_click=lambda: self._add_form(search))
                add.props('no-caps data-testid="add-form"')
            else:
                text = discovery.found[0].text(search.recording.name)
                ui.button("Save and export", icon="download", on_click=lambda: ui.download.content(text, "found.py"))

    def _add_form(self, search: Search) -> None:
        with errors_told():
            self._desk.extend_by_form(search)
        self._update_names()
        self._began()

    def _candidates(self, diagnosis: Diagnosis, number: int, *, may_add: bool) -> None:
        step, of = diagnosis.steps[number - 1], self._desk.errors
        heads = {
            "effect": "effect",
            "fitted": f"fitted, {of.unit}",
            "test": f"held out, {of.unit}",
            "bic": "evidence",
            "outcome": "outcome",
        }
        columns = [{"name": key, "label": head, "field": key, "align": "left"} for key, head in heads.items()]
        rows = [
            {
                "effects": diagnosis.with_those_before(number, each.tried.name),
                "effect": self._desk.plain(each.tried.name),
                "about": about_effect(each.tried.name),
                "fitted": of.shown(each.tried.train).text,
                "test": of.shown(each.tried.test).text,
                "bic": "–" if each.tried.gain is None else f"{each.tried.gain.bic:.1f}",
                "outcome": each.said,
            }
            for each in sorted(ranks(step), key=lambda each: each.order)
        ]
        table = ui.table(rows=rows, columns=columns, row_key="effect", pagination=10)
        table.props('dense flat bordered wrap-cells data-testid="candidates"').classes("w-full candidates")
        table.add_slot("body-cell-effect", ADDING_CELL if may_add else EFFECT_CELL)
        if may_add:
            table.on("add", lambda event: self._extend(event.args["effects"]))
            ui.label("press an effect to add it, whatever its outcome").classes("quiet")

    async def _add(self, search: Search, effects: Sequence[str]) -> None:
        """Add what was found: what is sure is not fitted again, one of several is."""
        if not search.result.sure or effects != search.result.choices[0]:
            self._extend(effects)
            return
        with errors_told():
            await aside(self._desk.add_verdict, search)
            self._changed("journal")


def _label_floor(floor: float) -> Figure:
    """Return what stands over the line of the floor, on an axis that is logarithmic."""
    where = {"x": log10(floor), "y": 1.0, "yref": "paper", "yanchor": "bottom"}
    return {"text": "floor", "showarrow": False, **where}
