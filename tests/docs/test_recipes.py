"""The recipes, `docs/add-*.md`, each followed block by block in a copy of the tree."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = (
    "config",
    "docs",
    "drivers",
    "fieldbus",
    "northbound",
    "positioner",
    "signals",
    "sim",
    "tests",
    "webpage",
    "workbench",
)
RECIPES = {path.stem: path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs").glob("add-*.md"))}
BEING_WRITTEN = "*.pyc.*"
"""A compiled module that another process has not yet given its name."""
BLOCK = re.compile(r"^```(\w+) ?([\w/.]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
WANTED = {
    *("add-an-effect", "add-an-effect-test", "add-a-register", "add-a-fault", "add-a-command", "add-a-check"),
    *("add-a-law", "add-a-law-test"),
}
BEGINS_AFTER = {"add-a-law-test": "add-a-law", "add-an-effect-test": "add-an-effect"}
"""Pages that go on from another."""


def test_there_is_a_recipe_for_all_that_is_added_often() -> None:
    assert set(RECIPES) == WANTED


@pytest.mark.parametrize("name", RECIPES)
def test_a_recipe_s_blocks_fit_the_tree(name: str, tmp_path: Path) -> None:
    for language, file, _ in blocks(name):
        if language != "sh" and (ROOT / file).exists():
            (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / file, tmp_path / file)
    assert write(name, tmp_path)
    for path in tmp_path.rglob("*.py"):
        compile(path.read_text(encoding="utf-8"), path, "exec")


@pytest.mark.long
@pytest.mark.parametrize("name", RECIPES)
def test_a_recipe_can_be_followed(name: str, tmp_path: Path) -> None:
    tree = tmp_path / "tree"
    for room in ROOMS:
        shutil.copytree(ROOT / room, tree / room, ignore=shutil.ignore_patterns("img", BEING_WRITTEN))
    shutil.copy(ROOT / "pyproject.toml", tree)
    commands = write(name, tree)
    install(tree)
    for command in commands:
        run(command, tree)


def blocks(name: str) -> list[tuple[str, str, str]]:
    """Return language, file and text of each block of a recipe, after those of the page that it goes on from."""
    return BLOCK.findall(RECIPES.get(BEGINS_AFTER.get(name, ""), "") + RECIPES[name])


def write(name: str, tree: Path) -> list[str]:
    """Write a recipe's files and changes into a tree; return its command lines."""
    commands = []
    for language, file, text in blocks(name):
        if language == "sh":
            commands += text.splitlines()
        elif language == "diff":
            change(tree / file, text)
        else:
            assert not (tree / file).exists(), f"{file} is no new file"
            (tree / file).parent.mkdir(parents=True, exist_ok=True)
            (tree / file).write_text(text, encoding="utf-8")
    return commands


def change(path: Path, diff: str) -> None:
    """Change a file: the lines that stay or go must stand in it once, as they are."""
    lines = diff.splitlines(keepends=True)
    old, new = ("".join(line[1:] or "\n" for line in lines if line[0] != sign) for sign in "+-")
    text = "\n" + path.read_text(encoding="utf-8")
    assert text.count("\n" + old) == 1, f"{path.name} has {text.count(old)} times:\n{old}"
    path.write_text(text.replace("\n" + old, "\n" + new)[1:], encoding="utf-8")


def install(tree: Path) -> None:
    """Leave what `make venv` leaves of the tree's entry points."""
    project = tomllib.loads((tree / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    metadata = tree / "positioner-1.0.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: positioner\nVersion: {version('positioner')}\n")
    groups = project["entry-points"].items()
    lines = [line for group, each in groups for line in (f"[{group}]", *(f"{k} = {v}" for k, v in each.items()))]
    (metadata / "entry_points.txt").write_text("\n".join(lines) + "\n")


def run(command: str, tree: Path) -> None:
    """Run a command line in the tree, with the tree's own packages."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PYTHONPATH": str(tree), "PATH": path}
    done = subprocess.run(
        ["sh", "-c", command], cwd=tree, env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
