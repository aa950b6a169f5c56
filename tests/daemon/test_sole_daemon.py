"""Two daemons of one valve: what one keeps over restarts, the other does not write over."""

from contextlib import ExitStack
from pathlib import Path

import pytest

from config.daemon_file import DaemonFile
from config.errors import InputError
from positioner.daemon.sole_daemon import keep_alone


def file(name: str, **folders: str) -> DaemonFile:
    tables = {table: {"folder": folder} for table, folder in folders.items()}
    return DaemonFile.model_validate({"valve": {"name": name, "stroke_m": 0.1}, "device": {"bus": "modbus"}, **tables})


@pytest.mark.parametrize("table", ["health", "memory"])
def test_what_is_kept_of_a_valve_is_one_daemons(tmp_path: Path, table: str) -> None:
    one = file("FV 1", **{table: "kept"})
    with ExitStack() as first:
        keep_alone(one, tmp_path, first)
        with ExitStack() as second, pytest.raises(InputError) as refusal:
            keep_alone(one, tmp_path, second)
        assert str(refusal.value) == f"{tmp_path / 'kept'}: another daemon keeps FV 1.{table}.json there"
    with ExitStack() as again:
        keep_alone(one, tmp_path, again)


def test_health_and_memory_and_other_valves_may_share_a_folder(tmp_path: Path) -> None:
    with ExitStack() as all_of_them:
        for name in ("FV-1", "FV-2"):
            keep_alone(file(name, health="kept", memory="kept"), tmp_path, all_of_them)


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("")
    with ExitStack() as on_exit, pytest.raises(InputError, match="cannot be kept there: File exists"):
        keep_alone(file("FV-1", health="kept"), tmp_path, on_exit)
