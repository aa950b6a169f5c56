"""What does on a command line what was done on a desk: the links of its valve's chain, and what was asked of it."""

import shlex
from collections.abc import Iterator
from math import inf

from sim.effect import tried_effects
from workbench.page.desk import Desk
from workbench.page.provenance import (
    DataSheetMade,
    Extended,
    Hidden,
    NamedValve,
    SetByHand,
    blind_folder,
)
from workbench.page.recording_opening import Opened

Words = tuple[str, ...]


def command_lines(desk: Desk) -> tuple[str, ...]:
    """Return the lines, in order; none before a recording and a valve are there.

    The last line compares the valve as it is set: it prints the error that the page shows.
    """
    if desk.opened is None or desk.valve is None:
        return ()
    valve = desk.as_set()
    lines: list[Words] = [
        ("hide", "--seed", str(seed), "-o", blind_folder(seed)) for seed in _seeds(valve, desk.opened)
    ]
    for each in valve.chain:
        if isinstance(each.made, Extended) and each.made.form:
            lines.append(
                ("discover", *_of(each.made.recording, each.made.held_out, each.made.before), "-o", each.made.form)
            )
        lines += [words for words in (_make_valve(each),) if words]
    if not desk.journal:
        lines.append(("diagnose", *_of(desk.opened, desk.held_out, valve), *_search(desk)))
    lines.append(("compare", desk.opened.name, "--valve", valve.name, *desk.opened.words))
    return tuple(desk.plain(shlex.join(("positioner", *line))) for line in lines)


def _seeds(valve: NamedValve, opened: Opened) -> list[int]:
    """Return what the blind cases were drawn from, of which anything was used."""
    made = [each.made for each in valve.chain]
    recordings = [*(each.recording for each in made if isinstance(each, Extended)), opened]
    seeds = [*(each.seed for each in made if isinstance(each, Hidden)), *(each.seed for each in recordings)]
    return [seed for seed in dict.fromkeys(seeds) if seed is not None]


def _make_valve(valve: NamedValve) -> Words:
    """Return what makes a valve of the one before; nothing of one that was opened."""
    match valve.made:
        case DataSheetMade(sheet):
            low, high = sheet.range_bar
            words = ["valve", "--area-cm2", repr(sheet.area_cm2), "--range-bar", repr(low), repr(high)]
            words += ["--stroke-mm", repr(sheet.stroke_mm)]
            for flag, value in (
                ("--friction-percent", sheet.friction_percent),
                ("--breakaway-ratio", sheet.breakaway_ratio),
            ):
                words += [] if value is None else [flag, repr(value)]
            return (*words, "-o", valve.name)
        case SetByHand(before, values, without):
            words = ["valve", "--of", before.name]
            words += ["--set", *(f"{name}={value!r}" for name, value in values.items())] if values else []
            words += ["--without", *without] if without else []
            return (*words, "-o", valve.name)
        case Extended() as made:
            return (*_extend(made), "-o", valve.name)
    return ()


def _extend(made: Extended) -> Iterator[str]:
    effects = made.extension.effects
    if made.diagnosed is None:
        yield from ("extend", made.before.name, *(("--effect", *effects) if effects else ()))
        yield from ("--fit", made.recording.name, *_test_option(made.held_out), *made.recording.words)
        return
    yield from ("diagnose", *_of(made.recording, made.held_out, made.before))
    yield from _effects_option(made.diagnosed.tried)
    if not made.diagnosed.is_verdict:
        yield from ("--add", *effects)


def _search(desk: Desk) -> Words:
    """Return how a diagnosis that is not yet made would be."""
    budget = () if desk.budget_s == inf else ("--budget-s", f"{desk.budget_s:g}")
    found = desk.diagnosed
    return (*budget, *_effects_option(found.tried if found else (*map(str, desk.effects.values()), *tried_effects())))


def _effects_option(effects: Words) -> Words:
    return () if effects in ((), tuple(tried_effects())) else ("--effects", *effects)


def _of(recording: Opened, held_out: Opened | None, valve: NamedValve) -> Words:
    return (recording.name, "--valve", valve.name, *_test_option(held_out), *recording.words)


def _test_option(held_out: Opened | None) -> Words:
    return ("--test", held_out.name) if held_out else ()
