"""Which laws there are: the folders of `positioner/control/laws/`, so that a new one is named nowhere else.

Only names are looked up, where the package lies. Nothing of it is loaded: the ground floor imports nobody.
"""

from functools import cache
from importlib.util import find_spec
from pathlib import Path

DEFAULT_LAW = "slides"
REPLACED = {"breakaway": "pulses", "moves": "pulses, and slides where these do not reach"}
"""Laws that there were, and what they moved by."""


@cache
def law_names() -> tuple[str, ...]:
    """Return the names of the laws, in the order of the alphabet."""
    spec = find_spec("positioner")
    roots = [] if spec is None else list(spec.submodule_search_locations or ())
    folders = (each.parent for root in roots for each in Path(root, "control", "laws").glob("*/__init__.py"))
    return tuple(sorted({folder.name for folder in folders}))


def one_of_the_laws(name: str) -> str:
    """Return a name.

    Raises:
        ValueError: there is no such law; says which there are.
    """
    allowed = " or ".join(f'"{each}"' for each in law_names())
    if name in REPLACED:
        raise ValueError(f'it moved by {REPLACED[name]}, and is gone: "slides" replaces it; allowed is {allowed}')
    if name not in law_names():
        raise ValueError(f"allowed is {allowed}")
    return name
