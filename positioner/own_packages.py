"""The top-level packages that come with `positioner`, and what of another's stands in their way.

`config`, `sim`, `drivers`, `workbench` are names that others use as well. Python takes the first that it finds: a
`config.py` in the current folder (`python -m`, a notebook, PYTHONPATH), a package installed into the same environment.
Ours stand beside `positioner`; found elsewhere, they are another's. They are looked for, not imported: nothing foreign
is executed.
"""

import sys
from importlib.util import find_spec
from pathlib import Path

OWN = ("config", "signals", "fieldbus", "drivers", "sim", "workbench", "webpage", "northbound")
HOME = Path(__file__).resolve().parents[1]
WHAT_TO_DO = (
    "start from another folder, take its folder off PYTHONPATH, or install positioner in an environment of its own"
)


def in_the_way() -> str:
    """Return a line that names the first foreign file, the package it hides and what to do; empty if there is none."""
    for name in OWN:
        file = _found(name)
        if file is None:
            return f"positioner's own package {name} is not there: install positioner again"
        if file != HOME / name / "__init__.py":
            return f"{file} is in the way of positioner's own package {name}: {WHAT_TO_DO}"
    return ""


def _found(name: str) -> Path | None:
    """Return the file that `import NAME` would run, or has run."""
    there = sys.modules.get(name)
    spec = find_spec(name) if there is None else there.__spec__
    file = spec.origin if spec else getattr(there, "__file__", None)
    return Path(file).resolve() if file else None


def sharing() -> str:
    """Return a line on another distribution that installed files into one of our packages; empty if there is none."""
    from importlib.metadata import packages_distributions

    there = packages_distributions()
    for name in OWN:
        for other in there.get(name, ()):
            if other != "positioner":
                return f"{other} has installed its own {name} among positioner's: {WHAT_TO_DO}"
    return ""
