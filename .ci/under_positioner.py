"""Writes the imports of all rooms as `positioner.ROOM`: docs/decisions/0021-one-name-when-installed.md.

python .ci/under_positioner.py     in a clean clone; then mend what lint and tests say, and delete this file
"""

import os
import re
from collections.abc import Iterator
from pathlib import Path

ROOMS = ("config", "signals", "webpage", "fieldbus", "drivers", "sim", "workbench", "northbound")
CORE = (
    *("cli", "control", "daemon", "dcs", "estimation", "history", "own_packages", "paper", "response", "testing"),
    *("tests_on_the_valve", "virtual"),
)
ANY = "|".join(ROOMS)
BY_HAND = {
    "sim/kernel.py": ((r"^from sim\.karnopp", r"^from positioner\.sim\.karnopp"),),
    "config/loading.py": (('resources.files("config")', 'resources.files("positioner.config")'),),
    "positioner/testing/site_files.py": (('HOME / "config"', 'HOME / "positioner" / "config"'),),
}


def files() -> Iterator[Path]:
    """Yield the files that may name a module."""
    for root, folders, names in os.walk("."):
        folders[:] = [each for each in folders if each not in {".git", ".venv", "__pycache__"}]
        folders[:] = [each for each in folders if not Path(root, each).is_symlink()]
        yield from (Path(root, each) for each in names if each.endswith((".py", ".toml", ".md")))


def renamed(text: str) -> str:
    """Return a text with modules under their new names."""
    text = re.sub(rf"\bfrom ({ANY})(?=[. ])(?=[\w. ]* import\b)", r"from positioner.\1", text)
    text = re.sub(rf"^(\s*(?:>>> )?)import ({ANY})\.", r"\1import positioner.\2.", text, flags=re.MULTILINE)
    text = re.sub(rf"^(\s*(?:>>> )?)import ({ANY})$", r"\1from positioner import \2", text, flags=re.MULTILINE)
    named = rf"(?<=[\"'`])({ANY})\.(?=[a-z_]+)(?![\w.]*\.(?:toml|py|csv|md)\b)"
    return re.sub(named, r"positioner.\1.", text).replace("positioner.positioner.", "positioner.")


def project(text: str) -> str:
    """Return pyproject.toml: one package in the wheel, for mypy and for the contracts; the core by its rooms."""
    text = re.sub(r'^packages = \["config".*"workbench"\]$', 'packages = ["positioner"]', text, flags=re.MULTILINE)
    text = re.sub(
        r'^packages = \["config".*"benchmarks"\]$', 'packages = ["positioner", "tests", "benchmarks"]', text, flags=re.M
    )
    head, contracts = text.split("[tool.importlinter]")
    lines = [
        line if line.startswith("name =") else re.sub(r'"([^"]*)"', _module, line) for line in contracts.split("\n")
    ]
    contracts = re.sub(r"root_packages = .*", 'root_packages = ["positioner"]', "\n".join(lines))
    core = ", ".join(f'"positioner.{each}"' for each in CORE)
    contracts = re.sub(
        r'(forbidden_modules = \[[^\]]*?)"positioner"(?=[,\]])', lambda found: found[1] + core, contracts
    )
    facade = r"(positioner\.\*\*.*?forbidden_modules = )\[[^\]]*\](\nas_packages = false)"
    contracts = re.sub(facade, r'\1["positioner"]\2', contracts, flags=re.DOTALL)
    towers = " : ".join(f"positioner.{each}" for each in (*CORE, "workbench", "northbound"))
    contracts = contracts.replace('"positioner : positioner.workbench : positioner.northbound"', f'"{towers}"')
    return f"{head}[tool.importlinter]{contracts}"


def _module(found: re.Match[str]) -> str:
    said = found[1]
    if " : " in said or " | " in said or re.fullmatch(rf"({ANY})(\.[\w.*]+)?", said):
        said = re.sub(rf"(?<![\w.])({ANY})(?=$|[.\s])", r"positioner.\1", said)
    return f'"{said}"'


def main() -> None:
    """Rewrite the tree, and link the rooms into `positioner/`."""
    for path in files():
        if path.name in {"CHANGELOG.md", "under_positioner.py"}:
            continue
        before = path.read_text(encoding="utf-8")
        after = renamed(before)
        for old, new in BY_HAND.get(path.as_posix(), ()):
            after = after.replace(old, new)
        if path.as_posix() == "pyproject.toml":
            after = project(after)
        if after != before:
            path.write_text(after, encoding="utf-8")
    for room in ROOMS:
        Path("positioner", room).symlink_to(f"../{room}")


if __name__ == "__main__":
    main()
