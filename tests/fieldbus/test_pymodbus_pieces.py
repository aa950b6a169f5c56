"""Where pymodbus's pieces fail, so that ours are kept: docs/decisions/0012-pymodbus.md names these cases.

A test that turns red here is good news: the piece can be looked at again.
"""

import ast
import asyncio
import gc
import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from pymodbus.client import ModbusTcpClient, ModbusTlsClient
from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest, ReadWriteMultipleRegistersRequest
from pymodbus.simulator import DataType, SimData, SimDevice

ROOT = Path(__file__).parents[2]
OURS = ("config", "fieldbus", "drivers", "positioner", "sim")
READ = b"\3\0\0\0\1"
NOTHING = (0, 0, 0, b"")


def framed(pdu: bytes, protocol: int = 0, length: int | None = None) -> bytes:
    return struct.pack(">HHHB", 1, protocol, len(pdu) + 1 if length is None else length, 1) + pdu


# ---- frames


@pytest.fixture
def framer() -> FramerSocket:
    return FramerSocket(DecodePDU(is_server=True))


def test_a_frame_of_another_protocol_stays_in_front_of_all_that_follow(framer: FramerSocket) -> None:
    """Ours discards it and answers the next: `test_a_frame_of_another_protocol_is_discarded_and_the_next_answered`."""
    assert framer.decode(framed(READ, protocol=1) + framed(READ)) == NOTHING


@pytest.mark.parametrize("length", [255, 0xFFFF])
def test_a_length_that_no_frame_has_is_waited_for(framer: FramerSocket, length: int) -> None:
    """Ours ends the connection: `test_a_length_that_no_frame_has_ends_the_connection`."""
    assert framer.decode(framed(READ, length=length) + 20 * framed(READ)) == NOTHING


def test_a_pdu_of_one_byte_takes_a_byte_of_the_next_frame(framer: FramerSocket) -> None:
    """Ours keeps them apart: `test_a_function_code_alone_is_a_frame_and_gets_its_exception`."""
    used, _, _, pdu = framer.decode(framed(b"\x07") + framed(READ)[:1])
    assert (used, pdu) == (9, b"\x07\0")


def test_noise_behind_a_serial_frame_is_taken_for_nothing() -> None:
    """Ours refuses it: `test_what_is_not_the_reply_is_a_named_event_and_the_driver_recovers`."""
    framer = FramerRTU(DecodePDU(is_server=False))
    reply = b"\3\2\0\7"
    frame = framer.encode(reply, 1, 0)
    for noise in (b"\xfe", b"\0", frame):
        assert framer.decode(frame + noise)[3] == reply


def test_a_serial_frame_of_an_unknown_function_is_none() -> None:
    """Ours answers exception 1: `test_the_slave_answers_its_unit_and_obeys_but_does_not_answer_all`."""
    framer = FramerRTU(DecodePDU(is_server=True))
    assert framer.decode(framer.encode(b"\x41\0\0", 1, 0)) == NOTHING


# ---- requests


def test_what_follows_a_read_is_passed_over() -> None:
    """Ours is exception 3: `test_a_bad_request_gets_its_exception_and_changes_nothing`."""
    ReadHoldingRegistersRequest().decode(READ[1:] + b"\0")


def test_function_23_may_write_more_than_121_registers() -> None:
    """Ours is exception 3: `test_a_bad_request_gets_its_exception_and_changes_nothing`."""
    request = ReadWriteMultipleRegistersRequest()
    request.decode(struct.pack(">HHHHB", 0, 1, 0, 122, 244) + bytes(244))
    assert request.write_count == 122


# ---- the server


async def served(*bursts: bytes) -> list[bytes]:
    """Return the first reply of pymodbus's server, ten registers of 0 behind it, to each of some bursts of frames."""
    from pymodbus.server import ModbusTcpServer  # takes half a second to load

    zeros = SimData(0, values=[0] * 10, datatype=DataType.REGISTERS)
    server: Any = ModbusTcpServer(SimDevice(1, simdata=[zeros]), address=("127.0.0.1", 0))
    await server.serve_forever(background=True)
    reader, writer = await asyncio.open_connection(*server.transport.sockets[0].getsockname())
    replies = []
    for burst in bursts:
        writer.write(burst)
        header = await reader.readexactly(7)
        replies.append(header[:2] + await reader.readexactly(header[5] - 1))
    writer.close()
    await writer.wait_closed()
    await server.shutdown()
    return replies


def test_its_server_answers_the_first_of_pipelined_requests_only() -> None:
    """Ours answers all: `test_pipelined_requests_are_each_answered_in_order_with_their_own_transaction`."""
    numbered = [struct.pack(">H", number) + framed(READ)[2:] for number in range(1, 5)]
    assert asyncio.run(served(b"".join(numbered[:3]), numbered[3])) == [b"\0\1\3\2\0\0", b"\0\4\3\2\0\0"]


def test_its_server_writes_before_it_finds_that_it_cannot_read() -> None:
    """Ours changes nothing: `test_a_write_that_is_not_right_is_refused_and_changes_nothing`."""
    beyond = framed(struct.pack(">BHHHHBH", 23, 500, 1, 0, 1, 2, 999))
    refused, read = asyncio.run(served(beyond, framed(READ)))
    assert refused[2:] == b"\x97\2"
    assert read[2:] == b"\3\2" + struct.pack(">H", 999)


# ---- the client


@contextmanager
def answering(*replies: bytes) -> Iterator[int]:
    """Run a server that sends these, whatever it is asked; give its port."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            line, _ = listener.accept()
            with line:
                for reply in replies:
                    transaction = line.recv(300)[:2]
                    line.sendall(transaction + reply[2:])

        thread = threading.Thread(target=serve)
        thread.start()
        yield listener.getsockname()[1]
        thread.join(10)


def test_its_client_takes_another_count_function_and_echo_for_an_answer() -> None:
    """Ours ends the connection: `test_a_reply_that_does_not_fit_ends_the_connection`."""
    wrong_echo = b"\x10" + struct.pack(">HH", 10, 9)
    with (
        answering(framed(b"\3\2\0\7"), framed(b"\4\2\0\7"), framed(wrong_echo)) as port,
        ModbusTcpClient("127.0.0.1", port=port, timeout=10, retries=0) as client,
    ):
        assert client.read_holding_registers(0, count=2).registers == [7]
        assert client.read_holding_registers(0, count=1).function_code == 4
        assert client.write_registers(11, [1, 2]).count == 9


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # it leaves its socket open
def test_its_client_cannot_check_the_host_name_of_a_secured_server() -> None:
    """Ours does: `test_the_host_name_is_checked_as_it_was_called`."""
    with pytest.raises(ValueError, match="check_hostname requires server_hostname"):
        ModbusTlsClient("127.0.0.1").connect()  # type: ignore[no-untyped-call]
    gc.collect()


# ---- what we use of it


def test_nothing_private_of_pymodbus_is_used() -> None:
    """Of other objects only attributes without an underscore; what is imported of it, too, and nothing overridden."""
    users = [file for room in OURS for file in (ROOT / room).rglob("*.py") if "pymodbus" in file.read_text()]
    assert {file.name for file in users} >= {"client.py", "function_codes.py", "rtu.py", "modbus_device.py"}
    for file in users:
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Attribute) and private(node.attr):
                assert isinstance(node.value, ast.Name), f"{file}:{node.lineno}"
                assert node.value.id in ("self", "cls"), f"{file}:{node.lineno}"
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pymodbus"):
                assert not any(map(private, [*(node.module or "").split("."), *(each.name for each in node.names)]))
            if isinstance(node, ast.ClassDef):
                assert not imported(file) & {base.id for base in node.bases if isinstance(base, ast.Name)}


def private(name: str) -> bool:
    return name.startswith("_") and not name.endswith("__")


def imported(file: Path) -> set[str]:
    """Return the names that a file has from pymodbus."""
    return {
        each.asname or each.name
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pymodbus")
        for each in node.names
    }
