"""What a gateway installs is pinned, with hashes, and is what `pyproject.toml` asks for; else: `make locked`."""

import re
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
LOCKED = (ROOT / "deploy" / "locked" / "gateway.txt").read_text(encoding="utf-8")
PINNED = re.findall(r"^([\w.-]+)==(\S+)((?: \\\n    --hash=sha256:[0-9a-f]{64})*)", LOCKED, re.MULTILINE)
EXTRAS = ("tls", "canopen", "metrics")


def test_every_package_is_pinned_and_has_hashes() -> None:
    lines = [line for line in LOCKED.splitlines() if line and not line.startswith((" ", "#"))]
    assert len(lines) == len(PINNED) > 5
    assert all(hashes for _, _, hashes in PINNED)
    assert "://" not in LOCKED, "where it comes from is the site's business"


def test_it_is_what_the_project_asks_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    table = project["project"]
    asked = [*table["dependencies"], *project["build-system"]["requires"]]
    asked += [each for extra in EXTRAS for each in table["optional-dependencies"][extra]]
    versions = {canonicalize_name(name): version for name, version, _ in PINNED}
    for each in map(Requirement, asked):
        assert each.specifier.contains(versions[canonicalize_name(each.name)]), f"{each}: make locked"


def test_the_container_installs_nothing_else() -> None:
    recipe = (ROOT / "deploy" / "container" / "Containerfile").read_text(encoding="utf-8")
    assert "--require-hashes -r /source/deploy/locked/gateway.txt" in recipe
    assert "--no-deps --no-build-isolation /source" in recipe
    assert recipe.count("pip install") == 2
