"""A slider for each parameter, a switch for each effect, and what undoes them."""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass

from nicegui import events, ui
from nicegui.elements.mixins.value_element import ValueElement

from webpage.live_text import LiveText
from webpage.messages import errors_told, heading
from webpage.number_field import NumberField
from webpage.units import Units
from workbench.fit.parameter_estimate import Fitted
from workbench.model.search_coordinates import Parameter
from workbench.page.explained_words import about_effect, explain_text
from workbench.page.live_model import LiveModel
from workbench.report.display_units import parameter as in_words

SLIDER_STEP = 0.0005
"""Of the way of a slider: of a range of a factor 2500 a step is 0.4 %."""
MOVES_EVERY_S = 0.02
"""While a slider is dragged: what comes faster is left out by the browser."""


class Slider(ValueElement[float]):
    """A slider from 0 to 1 that goes with the hand, whatever the server is busy with."""

    LOOPBACK = None

    def __init__(self, value: float, name: str, words: str) -> None:
        super().__init__(tag="q-slider", value=value, throttle=MOVES_EVERY_S)
        self.props.update(
            {"min": 0.0, "max": 1.0, "step": SLIDER_STEP, "aria-label": words, "data-testid": f"slider-{name}"}
        )


@dataclass(frozen=True, slots=True)
class Row:
    """What shows one parameter."""

    parameter: Parameter
    slider: Slider
    value: LiveText
    factor: float
    unit: str


class Sliders:
    """Sets a model by hand.

    Args:
        live: the model.
        fitted: values and intervals of a fit, by the parameter's name.
        moved: called while something moves,
        settled: and when it has come to rest.
        units: that it is read in.
    """

    def __init__(
        self,
        live: LiveModel,
        fitted: Mapping[str, Fitted],
        moved: Callable[[], None],
        settled: Callable[[], Awaitable[None]],
        units: Units,
    ) -> None:
        self._live = live
        self._units = units
        self._moved = moved
        self._settled = settled
        self._held = False
        self._following = False
        self._let_go = ("", 0.0)
        """Which slider was let go last, and where."""
        heading("Parameters")
        self._rows = [self._row(each, fitted.get(each.name)) for each in live.parameters.values()]
        self._switches: dict[str, ui.switch] = {}
        if live.effects:
            heading("Effects")
            for name, written in zip(live.effects, live.written, strict=True):
                with ui.row().classes("items-center").style("gap: 4px"):
                    self._switches[name] = ui.switch(
                        "", value=True, on_change=lambda event, name=name: self._handle_switch(name, event)
                    ).props(f'data-testid="switch-{name}" aria-label="{name}"')
                    explain_text(name, about_effect(written))
        undo = ui.button("Undo", icon="undo", on_click=self._undo).props('outline no-caps dense data-testid="undo"')
        undo.classes("q-mt-sm")
        self._follow()

    def _row(self, parameter: Parameter, fitted: Fitted | None) -> Row:
        words, per_si, shown = in_words(parameter.name)
        factor, unit = self._units.as_chosen(per_si, shown)
        with ui.column().classes("w-full").style("gap: 0"):
            with ui.row().classes("w-full items-center justify-between no-wrap"):
                ui.label(words)
                with ui.row().classes("items-center no-wrap").style("gap: 8px"):
                    value = LiveText().classes("number").props(f'data-testid="value-{parameter.name}"')
                    typed = NumberField("", name=f"{words}, {unit}" if unit else words)
                    typed.props(
                        f'dense outlined placeholder="type" data-testid="type-{parameter.name}" aria-label="{words}"'
                    )
                    typed.props(remove="label").classes("typed").style("width: 72px").on(
                        "keydown.enter", lambda: self._handle_text(parameter, typed, factor, unit)
                    )
            slider = Slider(self._live.share(parameter), parameter.name, words)
            low, high = (factor * self._live.value_at(parameter, share) for share in (0.0, 1.0))
            told = f"{low:.3g} to {high:.3g} {unit}".rstrip()
            if fitted is not None:
                interval = " to ".join(f"{factor * each:.4g}" for each in (fitted.lower, fitted.upper))
                told += f"; fitted {factor * fitted.value:.4g} ({interval})"
            ui.label(told).classes("quiet")
        slider.on_value_change(lambda event: self._handle_drag(parameter, event.value))
        slider.on("change", lambda event: self._handle_release(parameter, slider, event.args))
        return Row(parameter, slider, value, factor, unit)

    def _handle_drag(self, parameter: Parameter, share: float) -> None:
        if self._following:
            return
        if not self._held and (parameter.name, share) == self._let_go:
            self._follow()  # a last move that comes after the release: it is there, or undone, already
            return
        if not self._held:
            self._live.keep()
            self._held = True
        self._live.move(parameter, share)
        self._show_values()
        self._moved()

    async def _handle_text(self, parameter: Parameter, typed: NumberField, factor: float, unit: str) -> None:
        """Take a number that was typed beside a slider, in the unit that stands there."""
        words = in_words(parameter.name)[0]
        with errors_told({parameter.name: f"{words}, {unit}" if unit else words}):
            value = typed.number()
            if value is None:
                return
            self._live.put(parameter, value, factor)
            typed.set_value("")
            self._held = False
            self._follow()
            self._moved()
            await self._settled()

    async def _handle_release(self, parameter: Parameter, slider: Slider, share: float) -> None:
        """Take where the slider was let go: the last move may still be on its way."""
        self._handle_drag(parameter, share)
        slider.update()  # the browser moved it by itself: `undo` must find it where it is
        self._held, self._let_go = False, (parameter.name, share)
        self._follow()
        await self._settled()

    async def _handle_switch(self, name: str, event: events.ValueChangeEventArguments[bool]) -> None:
        if self._following:
            return
        self._live.switch(name, bool(event.value))
        self._moved()
        await self._settled()

    async def _undo(self) -> None:
        if self._live.undo():
            self._held = False
            self._follow()
            self._moved()
            await self._settled()

    def _follow(self) -> None:
        """Put every slider and switch to where the model is."""
        self._following = True
        for row in self._rows:
            row.slider.set_value(self._live.share(row.parameter))
        for name, switch in self._switches.items():
            switch.set_value(name not in self._live.setting.off)
        self._following = False
        self._show_values()

    def _show_values(self) -> None:
        for row in self._rows:
            row.value.show(f"{row.factor * self._live.value(row.parameter):.4g} {row.unit}")
