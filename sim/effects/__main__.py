"""The catalogue of the effects, written from their own declarations: `python -m sim.effects [docs/effects.md]`.

Without a file it prints the catalogue; with one it puts it between that file's two marks.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

from sim.effect import PLACES, Effect, Parameter, shipped_effect, shipped_effects

BEGIN = "<!-- catalogue: written by `python -m sim.effects docs/effects.md` -->"
END = "<!-- end of the catalogue -->"


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


def _section(effect: Effect) -> Iterator[str]:
    yield f"### {effect.name}"
    yield effect.text
    lines = [_line(f"{key:{max(map(len, effect.parameters))}}", each) for key, each in effect.parameters.items()]
    yield "\n".join(["```text", effect.equation, "", *lines, "```"])
    yield effect.looks


def _line(key: str, parameter: Parameter) -> str:
    given = ", given" if parameter.given else ""
    off = "" if parameter.off is None else f"; none: {parameter.off:g}"
    return f"{key}  {parameter.text}{given}; {parameter.least:g} to {parameter.most:g}{off}"


if __name__ == "__main__":
    for path in [Path(text) for text in sys.argv[1:]]:
        path.write_text(renew_catalogue(path.read_text(encoding="utf-8")), encoding="utf-8")
    if not sys.argv[1:]:
        print(catalogue())
