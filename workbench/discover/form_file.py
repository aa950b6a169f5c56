"""A form as an effect's file, such as `sim.effect` reads: the text, with starts from the grammar or where it was found.

A form that was found says in its file by which recording, over which range of its variable, and with which values; a
fit begins there, so that `positioner extend` ends where the discovery did.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill, indent

from workbench.discover.curve import FLAT, HEIGHT
from workbench.discover.grammar import Form, Quantity

LINE_CHARACTERS = 116  # of a line in the file


def write_forms(forms: Sequence[Form], folder: Path) -> dict[str, Form]:
    """Write forms as effects' files into a folder; return them by their paths."""
    written = {}
    for form in forms:
        path = folder / f"{form.name}.py"
        path.write_text(form_text(form), encoding="utf-8")
        written[str(path)] = form
    return written


def form_text(form: Form, found: Mapping[str, float] | None = None, remarks: Sequence[str] = ()) -> str:
    """Return the text of a form's file.

    Args:
        form: the form.
        found: its parameters by their keys, from which a fit is to begin; the grammar's starts without.
        remarks: sentences about where it was found.
    """
    said = [
        f'"""{form.words[:1].upper()}{form.words[1:]}: a form, not a cause.',
        "",
        *(f"    {each}" for each in form.equations),
        "",
        fill(_symbols(form), LINE_CHARACTERS),
        *(fill(each, LINE_CHARACTERS) for each in remarks),
        '"""',
    ]
    parameters = "\n".join(_declare_quantity(each, _begin(each, found)) for each in form.quantities)
    names = ", ".join(each.symbol for each in form.quantities)
    return (
        "\n\n".join(
            [
                "\n".join(said),
                _imports(form),
                _constants(form),
                f'\nclass Parameters(NamedTuple):\n    """{names}."""\n\n{parameters}',
                *(f"\n{each.strip()}" for each in _functions(form)),
            ]
        )
        + "\n"
    )


def _symbols(form: Form) -> str:
    said = "; ".join(f"{each.symbol} {each.text}{_unit(each.key)}" for each in form.quantities)
    return said + "."


def _unit(key: str) -> str:
    units = {"_n": ", N", "_m": ", m", "_s": ", s", "_pa": ", Pa"}
    return next((unit for ending, unit in units.items() if key.endswith(ending)), ", dimensionless")


def _imports(form: Form) -> str:
    functions = sorted({*form.place.imports, *form.shape.imports})
    needed = "Memory, Parameter" if form.variable.memory else "Parameter"
    lines = [f"from math import {', '.join(functions)}"] if functions else []
    lines += ["from typing import Annotated, NamedTuple", "", f"from sim.effect import {needed}"]
    return "\n".join([*lines, *(f"from sim.first_order_lag import {each}" for each in form.variable.shared)])


def _constants(form: Form) -> str:
    lines = list(form.variable.constants)
    if form.variable.memory:
        lines.append(f"MEMORY = {form.variable.memory}")
    if form.variable.step_s is not None:
        lines.append(f"STEP_S = {form.variable.step_s}")
    lines.append(f'LOOKS = "A form that a discovery proposed, not a cause: {form.words}."')
    return "\n".join([*lines, *(['INVERSE = "balance"'] if form.place.inverse else [])])


def _declare_quantity(each: Quantity, found: float | None) -> str:
    starts, scale = (each.starts, each.scale) if found is None else ((found,), "")
    words = [repr(each.text), f"{each.least!r}", f"{each.most!r}"]
    words += [f"off={each.off!r}"] if each.off is not None else []
    words += [f"starts={starts!r}"] + ([f"scale={scale!r}"] if scale else [])
    words += ["given=True"] if each.given else []
    return f"    {each.key}: Annotated[float, Parameter({', '.join(words)})]".replace("'", '"')


def _begin(each: Quantity, found: Mapping[str, float] | None) -> float | None:
    """Return where a fit is to begin; a height of a curve that is next to nothing begins at nothing."""
    if found is None:
        return None
    value = found[each.key]
    return 0.0 if each.key.startswith(HEIGHT) and abs(value) < FLAT else value


def _functions(form: Form) -> list[str]:
    variable, place = form.variable, form.place
    types = dict.fromkeys(form.arguments, "float") | {"q": "Parameters", "z": "Memory"}
    head = f"def {place.function}({', '.join(f'{name}: {types[name]}' for name in form.arguments)}) -> {place.returns}:"
    g = form.shape.expression.format(variable.symbol)
    result = place.result.format(g=g, c=f"q.{place.strength.key}")
    body = [
        f'"""{form.words[:1].upper()}{form.words[1:]}."""',
        *([variable.code] if variable.code else []),
        f"return {result}",
    ]
    return [
        *(each for each in (variable.upkeep, form.shape.functions) if each),
        head + "\n" + indent("\n".join(body), "    "),
    ]
