"""On which keys of the configuration it hangs what is kept."""

from typing import Any

from config.daemon_file import DaemonFile
from positioner.daemon.memory.known_configuration import pressure_scales


def file(command: dict[str, Any], **device: Any) -> DaemonFile:
    places = {"position_m": {"address": 1, "type": "int16", "scale": 1e-5}, "command_pa": command}
    return DaemonFile.model_validate({"valve": {"stroke_m": 0.1}, "device": {"bus": "modbus", "map": places, **device}})


def test_a_pressure_is_what_scale_and_offset_make_of_a_register_wherever_it_stands() -> None:
    here = pressure_scales(file({"address": 2, "type": "uint16", "scale": 20.0}))
    assert here == {"device.map.command_pa.scale": "20.0", "device.map.command_pa.offset": "0.0"}
    assert pressure_scales(file({"address": 9, "type": "int32", "scale": 20.0}, host="gateway")) == here
    assert pressure_scales(file({"address": 2, "type": "uint16", "scale": 10.0})) != here
