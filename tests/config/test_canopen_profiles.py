"""The CANopen profiles show every key of their table, and are valid as they stand and with every line that is off."""

import re
import tomllib
from pathlib import Path

import pytest

from config.canopen_device import CanopenDevice
from config.daemon_file import DaemonFile
from config.loading import SHIPPED, Schema
from config.slave_file import CanopenBus, SlaveFile

PROFILES: dict[str, tuple[type[Schema], type[Schema], str]] = {
    "daemon_canopen.toml": (DaemonFile, CanopenDevice, "device"),
    "slave_canopen.toml": (SlaveFile, CanopenBus, "bus"),
}


@pytest.mark.parametrize("name", PROFILES)
def test_it_is_valid_and_shows_every_key_with_its_default(name: str, tmp_path: Path) -> None:
    whole, table, key = PROFILES[name]
    text = (SHIPPED / "profiles" / name).read_text()
    assert getattr(whole.model_validate(tomllib.loads(text)), key) == table()  # type: ignore[call-arg,unused-ignore]
    for field in table.model_fields:
        assert re.search(rf"^(# )?(\[{key}\.)?{field}\b", text, re.MULTILINE), field
    switched_on = re.sub(r"^# (?=\[|\w+ +=|\w+ = )", "", text, flags=re.MULTILINE)
    assert switched_on != text
    whole.model_validate(tomllib.loads(switched_on), context={"folder": tmp_path})
