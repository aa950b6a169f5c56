"""What was done on a desk as a notebook (nbformat 4): the library's own calls, to be run again and gone on from."""

import json
from collections.abc import Iterator, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any

from config.valve_file_writer import valve_toml
from sim.effect import tried_effects
from workbench.page.desk import Desk
from workbench.page.provenance import Extended, Hidden, NamedValve
from workbench.page.recording_opening import Opened
from workbench.report.comparison_report import headline

KERNEL = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
IMPORTS = "from pathlib import Path\n\nimport positioner as pos"
EXPORTS = "\nfrom workbench.imports.export_mapping import ExportMapping"
Cell = Mapping[str, Any]


def notebook(desk: Desk) -> str:
    """Return the notebook of a desk with a recording and a valve, as JSON."""
    whole = [_cell(i, kind, text) for i, (kind, text) in enumerate(_cells(desk))]
    return json.dumps({"cells": whole, "metadata": KERNEL, "nbformat": 4, "nbformat_minor": 5}, indent=1) + "\n"


def _cell(number: int, kind: str, text: str) -> Cell:
    common = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}, "source": text.splitlines(keepends=True)}
    return common if kind == "markdown" else common | {"execution_count": None, "outputs": []}


def _cells(desk: Desk) -> Iterator[tuple[str, str]]:
    assert desk.opened is not None
    assert desk.compared is not None
    valve = desk.as_set()
    said = "\n".join(f"- {each}" for each in desk.compared.sentences)
    yield "markdown", f"# {desk.opened.name} against {valve.name}\n\n{headline(desk.compared)[1]}\n\n{said}"
    names = _recordings(desk)
    yield "code", IMPORTS + (EXPORTS if any(each.choice for each in names) else "")
    for name, path in desk.effects.items():
        yield "code", f"Path({f'{name}.py'!r}).write_text({path.read_text(encoding='utf-8')!r})"
    for each, name in names.items():
        yield "code", f"{name} = {_read(each) if each.seed is None else f'pos.hide({each.seed}).fit'}"
    for link in valve.chain:
        for code in _make_valve(desk, link, names):
            yield "code", code
    yield "code", f"compared = pos.compare({names[desk.opened]}, valve)\ncompared"
    yield "code", "compared.plot();"
    if not desk.journal:
        yield "markdown", "Which effect is missing? It takes minutes."
        budget = "" if desk.budget_s == inf else f"  # on the page: within {desk.budget_s:g} s"
        own = [f"./{name}.py" for name in desk.effects]
        tried = (*own, *tried_effects()) if own else ()
        tried = desk.diagnosed.tried if desk.diagnosed else tried
        held_out = names[desk.held_out] if desk.held_out else None
        yield "code", f"{_diagnose(desk, names[desk.opened], held_out, tried)}{budget}\nfound"
    else:
        yield "code", 'pos.write_valve(Path("better.toml"), valve)'


def _recordings(desk: Desk) -> dict[Opened, str]:
    """Return what is read and its name, in order: what a valve on the way was refitted to, and what lies here."""
    made = [each.made for each in desk.as_set().chain if isinstance(each.made, Extended)]
    assert desk.opened is not None
    used = dict.fromkeys([*(each.recording for each in made), desk.opened])
    held = dict.fromkeys([*(each.held_out for each in made), desk.held_out])
    named = {each: "recording" if i == 1 else f"recording_{i}" for i, each in enumerate(used, start=1)}
    others = [each for each in held if each is not None and each not in named]
    return named | {each: "held_out" if i == 1 else f"held_out_{i}" for i, each in enumerate(others, start=1)}


def _make_valve(desk: Desk, valve: NamedValve, names: Mapping[Opened, str]) -> Iterator[str]:
    """Yield what makes a valve of the one before, or reads the one that was opened."""
    made = valve.made
    if not isinstance(made, Extended):
        if isinstance(made, Hidden):
            yield f"valve = pos.hide({made.seed}).base"
            return
        name = repr(Path(valve.name).with_suffix(".toml").name)
        text = f'"""\\\n{desk.plain(valve_toml(valve.file))}"""'
        yield f"Path({name}).write_text({text})\nvalve = pos.valve({name})"
        return
    recording, held_out = names[made.recording], names[made.held_out] if made.held_out else None
    test = f", test={held_out}" if held_out else ""
    effects = [desk.plain(each) for each in made.extension.effects]
    if made.diagnosed:
        yield f"{_diagnose(desk, recording, held_out, made.diagnosed.tried)}\nfound"
    if made.diagnosed and made.diagnosed.is_verdict:
        yield "valve = found.best.fit.valve"
        return
    on = ", diagnosis=found" if made.diagnosed else ""
    yield f"better = pos.extend({recording}, valve, {effects!r}{test}{on})\nvalve = better.valve\nbetter"


def _diagnose(desk: Desk, recording: str, held_out: str | None, tried: Sequence[str]) -> str:
    test = f", test={held_out}" if held_out else ""
    named = [desk.plain(each) for each in tried]
    effects = f", effects={named!r}" if tried and tuple(tried) != tuple(tried_effects()) else ""
    return f"found = pos.diagnose({recording}, valve{test}{effects})"


def _read(opened: Opened) -> str:
    """Return what reads a recording."""
    path = f"Path({opened.name!r})"
    if opened.choice is None:
        return f"pos.Recording.read({path})"
    said = "".join(f"    {key}={value!r},\n" for key, value in opened.choice.model_dump(exclude_defaults=True).items())
    return f"ExportMapping(\n{said}).read({path})"
