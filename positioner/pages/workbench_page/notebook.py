"""What was done on a desk as a notebook (nbformat 4): the library's own calls, to be run again and gone on from."""

import json
from collections.abc import Iterator, Mapping
from math import inf
from pathlib import Path
from typing import Any

from config.writing import valve_toml
from positioner.pages.workbench_page.desk import Desk
from positioner.pages.workbench_page.opening import Opened
from sim.effect import tried_effects
from workbench.report.comparison_report import headline

KERNEL = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
IMPORTS = "from pathlib import Path\n\nimport positioner as pos"
EXPORTS = """
from config.exports.column_mapping import ExportOptions, read_mapping, read_status
from config.historian_export import read_export"""
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
    assert desk.valve is not None
    assert desk.compared is not None
    first = desk.journal[0].before if desk.journal else desk.valve
    said = "\n".join(f"- {each}" for each in desk.compared.sentences)
    yield "markdown", f"# {desk.opened.name} against {first.name}\n\n{headline(desk.compared)[1]}\n\n{said}"
    yield "code", IMPORTS + (EXPORTS if any(each and each.choice for each in (desk.opened, desk.held_out)) else "")
    for name, path in desk.effects.items():
        yield "code", f"Path({f'{name}.py'!r}).write_text({path.read_text(encoding='utf-8')!r})"
    if desk.sealed:
        yield "code", f"hidden = pos.hide({desk.seed})\nrecording, valve = hidden.fit, hidden.base"
    else:
        yield "code", f"recording = {_read(desk.opened)}"
        toml = f'"""\\\n{desk.plain(valve_toml(first.file))}"""'
        name = repr(Path(first.name).with_suffix(".toml").name)
        yield "code", f"Path({name}).write_text({toml})\nvalve = pos.valve({name})"
    held_out = ""
    if desk.held_out is not None:
        held_out = ", test=held_out"
        yield "code", f"held_out = {_read(desk.held_out)}"
    yield "code", "compared = pos.compare(recording, valve)\ncompared"
    yield "code", "compared.plot();"
    own = [f"./{name}.py" for name in desk.effects]
    effects = f", effects={[*own, *tried_effects()]!r}" if own else ""
    budget = "" if desk.budget_s == inf else f"  # on the page: within {desk.budget_s:g} s"
    yield "markdown", "Which effect is missing? It takes minutes."
    yield "code", f"found = pos.diagnose(recording, valve{held_out}{effects}){budget}\nfound"
    for step in desk.journal:
        added = [desk.plain(each) for each in step.extension.effects]
        yield "code", f"better = pos.extend(recording, valve, {added!r}{held_out})\nvalve = better.valve\nbetter"
    if desk.journal:
        yield "code", 'pos.compare(recording, valve).plot()\npos.write_valve(Path("better.toml"), valve)'


def _read(opened: Opened) -> str:
    """Return what reads a recording."""
    path = f"Path({opened.name!r})"
    if opened.choice is None:
        return f"pos.Recording.read({path})"
    choice = opened.choice
    period = "" if choice.period_s is None else f", {choice.period_s!r}"
    options = [f"{choice.decimal or None!r}", f"{choice.time_format or None!r}"]
    options += [f"status=read_status({list(choice.status)!r})"] if choice.status else []
    options += [f"period_s={choice.period_s!r}"] if choice.period_s is not None else []
    return (
        "read_export(\n"
        f"    {path}, read_mapping({choice.named!r}{period}), {choice.stroke_m!r}, {choice.ends_pa!r}, "
        f"ExportOptions({', '.join(options)})\n)"
    )
