"""The supervisory registers as a flow for Node-RED, to be imported: a tab with a row of nodes for each valve.

Of its own nodes alone: once a second the row asks for all input registers (FC4) over TCP and puts out a message with
the valve's name as its topic and all values by name; NaN becomes null. Each request carries its first address as the
transaction's number, by which the answer is understood.
"""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from config.modbus_map import MOST_REGISTERS, runs_within, words_of
from config.registers import REGISTERS, Register

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile

REQUEST_EVERY_S = 1
ANSWER_WITHIN_MS = 200
ROW_PIXELS = 60  # between nodes in the editor
TAB = "positioner"

ASK = """const unit = {unit};
const blocks = {blocks};
msg.payload = Buffer.concat(blocks.map(([start, count]) => {{
    const request = Buffer.alloc(12);
    [start, 0, 6].forEach((word, at) => request.writeUInt16BE(word, 2 * at));
    request.writeUInt8(unit, 6);
    request.writeUInt8(4, 7);
    request.writeUInt16BE(start, 8);
    request.writeUInt16BE(count, 10);
    return request;
}}));
return msg;"""

READ = """const registers = {registers};
const read = {{
    uint16: (b, at) => b.readUInt16BE(at), int16: (b, at) => b.readInt16BE(at), uint32: (b, at) => b.readUInt32BE(at),
    uint64: (b, at) => Number(b.readBigUInt64BE(at)), float32: (b, at) => b.readFloatBE(at),
}};
const answer = msg.payload;
const values = {{}};
for (let at = 0; at + 9 <= answer.length; at += 6 + answer.readUInt16BE(at + 4)) {{
    const start = answer.readUInt16BE(at), end = at + 9 + answer[at + 8];
    if (answer[at + 7] !== 4 || end > answer.length) continue;
    for (const [name, address, type, words] of registers) {{
        const from = at + 9 + 2 * (address - start);
        if (address >= start && from + 2 * words <= end) {{
            const value = read[type](answer, from);
            values[name] = Number.isNaN(value) ? null : value;
        }}
    }}
}}
if (Object.keys(values).length < registers.length) {{
    node.warn({valve} + ": " + Object.keys(values).length + " of " + registers.length + " values came");
    return null;
}}
return {{topic: {valve}, payload: values}};"""


def node_red(files: "Sequence[DaemonFile]") -> str:
    """Return the flow."""

    nodes: list[dict[str, Any]] = [{"id": TAB, "type": "tab", "label": TAB}]
    for row, file in enumerate(files, start=1):
        nodes += _row(row, file, REGISTERS)
    return json.dumps(nodes, indent=1) + "\n"


def _row(row: int, file: "DaemonFile", registers: Sequence[Register]) -> list[dict[str, Any]]:
    where, valve = file.supervisory, json.dumps(file.valve.name)
    table = json.dumps([[each.name, each.address, each.type, each.format.words] for each in registers])
    kinds: list[tuple[str, str, dict[str, Any]]] = [
        ("inject", "every second", {"props": [], "repeat": str(REQUEST_EVERY_S), "once": True, "onceDelay": 0.1}),
        ("function", "ask", {"func": ASK.format(unit=where.unit, blocks=json.dumps(_blocks(registers))), "outputs": 1}),
        (
            "tcp request",
            f"{where.host}:{where.port}",
            {"server": where.host, "port": str(where.port), "out": "time", "ret": "buffer", "splitc": ANSWER_WITHIN_MS},
        ),
        ("function", "read", {"func": READ.format(registers=table, valve=valve), "outputs": 1}),
        ("debug", file.valve.name, {"active": True, "tosidebar": True, "complete": "payload", "targetType": "msg"}),
    ]
    names = [f"{TAB}_{row}_{column}" for column in range(len(kinds))]
    return [
        {
            "id": name,
            "type": kind,
            "z": TAB,
            "name": called,
            "x": 140 + 190 * column,
            "y": ROW_PIXELS * row,
            "wires": [[names[column + 1]]] if column + 1 < len(kinds) else [],
            **more,
        }
        for column, (name, (kind, called, more)) in enumerate(zip(names, kinds, strict=True))
    ]


def _blocks(registers: Sequence[Register]) -> list[tuple[int, int]]:
    """Return the requests that read all registers: first address and number of each."""
    runs = runs_within({each.name: each for each in registers}, MOST_REGISTERS)
    return [(min(each.address for each in run.values()), words_of(run)) for run in runs]
