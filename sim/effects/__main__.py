"""The catalogue of the effects, written from their own declarations: `python -m sim.effects [docs/effects.md]`.

Without a file it prints the catalogue; with one it puts it between that file's two marks.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

from sim.effect import PLACES, Effect, Parameter, shipped_effect, shipped_effects

BEGIN = "<!-- catalogue: written by `python -m sim.effects docs/effects.md` -->"
END = "<!-- end of the catalogue -->"
WORDS = {"s": "s", "m": "m", "m2": "m²", "m3": "m³", "ms": "(m s)", "n": "N", "ns": "N s", "ns2": "N s²", "pa": "Pa"}
"""Units as they stand in names, and as they are written."""


def catalogue() -> str:
    """Return the catalogue, in the order of the path from command to indication."""
    effects = [shipped_effect(name, "catalogue") for name in shipped_effects()]
    along = sorted(effects, key=lambda each: [*PLACES].index(each.places[0]))
    by_place = [(place, [each.name for each in along if each.places[0] == place]) for place in PLACES]
    overview = "\n".join(f"- {place}: {', '.join(f'`{name}`' for name in names)}" for place, names in by_place if names)
    sections = ["\n\n".join(_section(each)) for each in along]
    return "\n\n".join([overview, *sections])


def renew_catalogue(document: str) -> str:
    """Return a document with the catalogue between its marks."""
    head, _, rest = document.partition(BEGIN)
    _, _, tail = rest.partition(END)
    return f"{head}{BEGIN}\n{catalogue()}\n\n{END}{tail}"


def unit(name: str) -> str:
    """Return the unit that a parameter's name ends in; 1 for a pure number."""
    *_, above, last = ["", *name.split("_")]
    if above != "per":
        return WORDS.get(last, "1")
    return f"{WORDS.get(name.split('_')[-3], '1')}/{WORDS[last]}"


def _section(effect: Effect) -> Iterator[str]:
    yield f"### {effect.name}"
    yield effect.text
    yield f"```\n{effect.equation}\n```"
    yield "\n".join(_line(key, each) for key, each in effect.parameters.items())
    yield f"In a record: {effect.looks}"


def _line(key: str, parameter: Parameter) -> str:
    given = ", given, not fitted" if parameter.given else ""
    off = "" if parameter.off is None else f"; {parameter.off:g} is none"
    return f"- `{key}`, {unit(key)}{given}: {parameter.text}; {parameter.least:g} to {parameter.most:g}{off}"


if __name__ == "__main__":
    for path in [Path(text) for text in sys.argv[1:]]:
        path.write_text(renew_catalogue(path.read_text(encoding="utf-8")), encoding="utf-8")
    if not sys.argv[1:]:
        print(catalogue())
