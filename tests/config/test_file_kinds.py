"""A file where another one is asked for is told by what it is, not by its first key that does not fit."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from config.daemon_file import load_daemon
from config.errors import InputError
from config.loading import SHIPPED
from config.slave_file import load_slave
from config.valve_file import load_valve

FILES = {
    "valve": '[valve]\nname = "v"\nmass_kg = 1.36\n',
    "slave": 'valve = "seed"\n\n[bus]\nport = 5020\n',
    "daemon": '[valve]\nname = "v"\nstroke_m = 0.1\n\n[device]\nport = 5020\n',
}
LOADERS: dict[str, Callable[[Path], Any]] = {"valve": load_valve, "slave": load_slave, "daemon": load_daemon}


@pytest.mark.parametrize(("kind", "wanted"), [(kind, wanted) for kind in FILES for wanted in LOADERS if kind != wanted])
def test_it_is_told_which_file_it_is(kind: str, wanted: str, tmp_path: Path) -> None:
    path = tmp_path / "it.toml"
    path.write_text(FILES[kind], encoding="utf-8")
    with pytest.raises(InputError, match=f"is the file of a {kind}; here that of a {wanted} is asked for"):
        LOADERS[wanted](path)


def test_a_drive_is_a_valves_file(tmp_path: Path) -> None:
    path = tmp_path / "drive.toml"
    path.write_text('[drive]\nkind = "linear"\n', encoding="utf-8")
    with pytest.raises(InputError, match="is the file of a valve"):
        load_daemon(path)


@pytest.mark.parametrize("path", sorted((SHIPPED / "valves").glob("*.toml")), ids=lambda path: path.stem)
def test_what_ships_is_what_it_is(path: Path) -> None:
    assert load_valve(path).valve.mass_kg > 0.0


def test_a_table_that_tells_nothing_is_left_to_its_first_wrong_key(tmp_path: Path) -> None:
    path = tmp_path / "it.toml"
    path.write_text("[coffee]\nsugar = 1\n", encoding="utf-8")
    with pytest.raises(InputError, match="coffee: unknown key"):
        load_slave(path)
