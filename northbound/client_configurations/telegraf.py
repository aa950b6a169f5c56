"""The supervisory registers as the configuration of Telegraf, a collector for historians: its input plugin `modbus`.

One `[[inputs.modbus]]` a valve, its registers in one request of input registers (FC4), most significant byte and word
first (ABCD). Telegraf reads and never writes here.
"""

import json
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from config.registers import REGISTERS, Register

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile

MEASUREMENT = "positioner"


def telegraf(files: "Sequence[DaemonFile]") -> str:
    """Return the configuration for the valves of a daemon's file."""

    return "".join(f"{line}\n" for file in files for line in _valve(file, REGISTERS))


def _valve(file: "DaemonFile", registers: Sequence[Register]) -> Iterator[str]:
    where = file.supervisory
    yield "[[inputs.modbus]]"
    yield f"  name = {json.dumps(file.valve.name)}"
    yield f'  controller = "tcp://{where.host}:{where.port}"'
    yield '  timeout = "1s"'
    yield '  configuration_type = "request"'
    yield "  [[inputs.modbus.request]]"
    yield f"    slave_id = {where.unit}"
    yield '    byte_order = "ABCD"'
    yield '    register = "input"'
    yield f'    measurement = "{MEASUREMENT}"'
    yield "    fields = ["
    for each in registers:
        yield f'      {{ address = {each.address}, name = "{each.name}", type = "{each.type.upper()}" }},'
    yield "    ]"
    yield "    [inputs.modbus.request.tags]"
    yield f"      valve = {json.dumps(file.valve.name)}"
    yield ""
