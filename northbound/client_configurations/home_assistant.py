"""What people watch of a valve for Home Assistant: its integration `modbus`, for `configuration.yaml`.

It asks for each value by itself, so this has the values that people watch, not all registers.
"""

import json
import re
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from config.registers import BY_NAME

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile

WATCHED = (
    *("position", "reference", "pressure", "command", "mode", "state", "fault", "quality", "sample_age"),
    *("ne107", "ne107_cause", "friction", "friction_ratio", "travel", "reversals", "stiction_index"),
    *("identifications", "event_number", "event"),
)
SCAN_EVERY_S = 10
DECIMALS = 6
"""It rounds to whole numbers unless told otherwise."""


def home_assistant(files: "Sequence[DaemonFile]") -> str:
    """Return the table `modbus:` with one hub for each address, and the sensors of its valves."""
    return "\n".join(_lines(files)) + "\n"


def _lines(files: "Sequence[DaemonFile]") -> Iterator[str]:
    yield "modbus:"
    for (host, port), valves in groupby(files, key=lambda each: (each.supervisory.host, each.supervisory.port)):
        yield f"  - name: {json.dumps(f'positioner {host}:{port}')}"
        yield "    type: tcp"
        yield f"    host: {json.dumps(host)}"
        yield f"    port: {port}"
        yield "    sensors:"
        for file in valves:
            yield from _sensors(file)


def _sensors(file: "DaemonFile") -> Iterator[str]:

    valve = file.valve.name
    for register in (BY_NAME[name] for name in WATCHED):
        said = register.name.replace("_", " ")
        yield f"      - name: {json.dumps(f'{valve} {said}')}"
        yield f"        unique_id: {_identity(f'positioner_{valve}_{register.name}')}"
        yield f"        slave: {file.supervisory.unit}"
        yield f"        address: {register.address}"
        yield "        input_type: input"
        yield f"        data_type: {register.type}"
        if register.unit != "1":
            yield f"        unit_of_measurement: {json.dumps(register.unit)}"
        if register.type == "float32":
            yield f"        precision: {DECIMALS}"
        yield f"        scan_interval: {SCAN_EVERY_S}"


def _identity(text: str) -> str:
    return re.sub(r"\W+", "_", text.lower())
