"""Where the units of positions and pressures are chosen, in a page's header."""

from collections.abc import Callable

from nicegui import ui

from webpage.units import POSITIONS, PRESSURES, Units


def unit_choice(units: Units, changed: Callable[[], None]) -> None:
    """Show the two choices; `changed` is called when another unit is chosen."""

    def position(name: str) -> None:
        units.position = name
        changed()

    def pressure(name: str) -> None:
        units.choose_pressure(name)
        changed()

    for what, value, names, take in (
        ("position", units.position, list(POSITIONS), position),
        ("pressure", units.pressure.name, list(PRESSURES), pressure),
    ):
        select = ui.select(names, value=value, on_change=lambda change, take=take: take(change.value))
        select.props(f'dense dark options-dense borderless aria-label="unit of {what}" data-testid="unit-{what}"')
