"""The supervisory registers for modbus_exporter, a Prometheus exporter for any Modbus device: its `modbus.yml`.

Addresses are 300 000, for input registers, and the register's, counted from 0. Which daemon and unit is read Prometheus
says (`target`, `sub_target`), so one module serves all valves; the head of the file has the addresses.
"""

import json
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from config.registers import REGISTERS

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile

INPUT_REGISTERS = 300_000  # its prefix of input registers
MODULE = "positioner"


def modbus_exporter(files: "Sequence[DaemonFile]") -> str:
    """Return the module, and above it how each valve of a daemon's file is asked for."""
    return "\n".join(_lines(files)) + "\n"


def _lines(files: "Sequence[DaemonFile]") -> Iterator[str]:

    for file in files:
        where = file.supervisory
        asked = f"target={where.host}:{where.port}&sub_target={where.unit}&module={MODULE}"
        yield f"# {file.valve.name}: /modbus?{asked}"
    yield "modules:"
    yield f"  - name: {MODULE}"
    yield "    protocol: tcp/ip"
    yield "    metrics:"
    for each in REGISTERS:
        yield f"      - name: positioner_{each.name}"
        yield f"        help: {json.dumps(f'{each.text} ({each.unit})')}"
        yield f"        address: {INPUT_REGISTERS + each.address}"
        yield f"        dataType: {each.type}"
        yield "        endianness: big"
        yield "        metricType: gauge"
