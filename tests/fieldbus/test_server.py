"""The register server against the specification: by bytes, by an independent client (modbus-tk), and by bad frames."""

import errno
import socket
import struct
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from socketserver import ThreadingTCPServer
from types import SimpleNamespace

import pytest
from pymodbus.constants import ExcCodes

from config.errors import InputError
from fieldbus.modbus import server as server_module
from fieldbus.modbus import server_connection
from fieldbus.modbus.admission import MOST_CLIENTS, ServerLimits
from fieldbus.modbus.function_codes import RegisterError, Table
from fieldbus.modbus.server import RegisterServer
from tests.independent import independent_client, refused_with

pytestmark = pytest.mark.real_time

SIZE = 200


class Bank:
    """Holding registers 0 to 199, the first ten read-only; input registers say their own address."""

    def __init__(self) -> None:
        self.words = [0] * SIZE
        self.peers: list[str] = []
        self.broken = False

    def read(self, table: Table, address: int, count: int) -> Sequence[int]:
        if address + count > SIZE:
            raise RegisterError(ExcCodes.ILLEGAL_ADDRESS)
        return self.words[address : address + count] if table == "holding" else range(address, address + count)

    def write(self, address: int, words: Sequence[int], peer: str) -> None:
        if self.broken:
            raise ZeroDivisionError
        if address < 10 or address + len(words) > SIZE:
            raise RegisterError(ExcCodes.ILLEGAL_ADDRESS)
        self.peers.append(peer)
        self.words[address : address + len(words)] = words


@pytest.fixture
def bank() -> Bank:
    return Bank()


@pytest.fixture
def server(bank: Bank) -> Iterator[RegisterServer]:
    server = RegisterServer(bank, "127.0.0.1", 0, 7)
    server.start()
    yield server
    server.stop()


@pytest.fixture
def line(server: RegisterServer) -> Iterator[socket.socket]:
    with connection(server) as line:
        yield line


def connection(server: RegisterServer) -> socket.socket:
    return socket.create_connection(("127.0.0.1", server.port), timeout=60)


def frame(pdu: bytes, transaction: int = 1, unit: int = 7) -> bytes:
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu


def receive(line: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size and (more := line.recv(size - len(data))):
        data += more
    return data


def reply(line: socket.socket) -> tuple[int, int, bytes]:
    """Return transaction, unit and PDU of the next reply."""
    transaction, protocol, length, unit = struct.unpack(">HHHB", receive(line, 7))
    assert protocol == 0
    return transaction, unit, receive(line, length - 1)


WRITE_20 = "0014 0001 02 002a"  # one word, 42, at 20


@pytest.mark.parametrize(
    ("request_pdu", "expected"),
    [
        ("03 0000 0002", "03 04 0000 0000"),
        ("04 0064 0002", "04 04 0064 0065"),
        ("06 000a 1234", "06 000a 1234"),
        ("10 " + WRITE_20, "10 0014 0001"),
        ("17 0013 0003 " + WRITE_20, "17 06 0000 002a 0000"),
    ],
)
def test_requests_are_answered_as_specified(server: RegisterServer, request_pdu: str, expected: str) -> None:
    assert server.answer(bytes.fromhex(request_pdu), "test") == bytes.fromhex(expected)


@pytest.mark.parametrize(
    ("request_pdu", "exception"),
    [
        ("01 0000 0001", 1),
        ("02 0000 0001", 1),
        ("05 000a ff00", 1),
        ("0f 000a 0001 01 01", 1),
        ("2b 0e 01 00", 1),
        ("41", 1),
        ("03 0000 0000", 3),
        ("03 0000 007e", 3),
        ("03 0000", 3),
        ("03 0000 0001 00", 3),
        ("04 00c8 0001", 2),
        ("03 ffff 007d", 2),
        ("06 0009 0001", 2),
        ("06 000a", 3),
        ("10 000a 0000 00", 3),
        ("10 000a 007c f8" + 248 * "55", 3),
        ("10 000a 0002 02 0001", 3),
        ("10 000a 0001 02 0001 0002", 3),
        ("10 000a 0001 04 0001", 3),
        ("10 0009 0002 04 0001 0002", 2),
        ("10 00c7 0002 04 0001 0002", 2),
        ("17 0000 0000 " + WRITE_20, 3),
        ("17 0000 007e " + WRITE_20, 3),
        ("17 0000 0001 0014 0000 00", 3),
        ("17 0000 0001 0014 007a f4" + 244 * "55", 3),
        ("17 0000 0001 0014 0002 02 002a", 3),
        ("17 00c8 0001 " + WRITE_20, 2),
        ("17 0000 0001 0009 0001 02 002a", 2),
    ],
)
def test_a_bad_request_gets_its_exception_and_changes_nothing(
    server: RegisterServer, bank: Bank, request_pdu: str, exception: int
) -> None:
    pdu = bytes.fromhex(request_pdu)
    assert server.answer(pdu, "test") == bytes((pdu[0] | 0x80, exception))
    assert bank.words == [0] * SIZE


def test_the_largest_requests_are_allowed(server: RegisterServer, bank: Bank) -> None:
    assert len(server.answer(bytes.fromhex("03 0000 007d"), "test")) == 252
    assert server.answer(bytes.fromhex("10 000a 007b f6" + 246 * "55"), "test") == bytes.fromhex("10 000a 007b")
    assert len(server.answer(bytes.fromhex("17 0000 007d 000a 0079 f2" + 242 * "66"), "test")) == 252
    assert bank.words[10:133] == 121 * [0x6666] + 2 * [0x5555]


def test_a_fault_of_the_registers_is_exception_4_and_the_server_lives(server: RegisterServer, bank: Bank) -> None:
    bank.broken = True
    assert server.answer(bytes.fromhex("06 000a 0001"), "test") == bytes.fromhex("86 04")
    bank.broken = False
    assert server.answer(bytes.fromhex("06 000a 0001"), "test") == bytes.fromhex("06 000a 0001")


def test_an_independent_client_agrees(server: RegisterServer, bank: Bank) -> None:
    with independent_client(server.port, unit=7) as client:
        assert client.write(20, [1, 2, 3]) == (20, 3)
        assert client.write_one(23, 4) == (23, 4)
        assert client.read_holding(20, 4) == [1, 2, 3, 4]
        assert client.read_input(50, 2) == [50, 51]
        assert client.write_and_read(21, [9], 20, 2) == [1, 9]
        with refused_with(ExcCodes.ILLEGAL_FUNCTION):
            client.read_coils(0, 1)
        with refused_with(ExcCodes.ILLEGAL_ADDRESS):
            client.read_holding(199, 2)


def test_a_write_names_its_client(line: socket.socket, bank: Bank) -> None:
    line.sendall(frame(bytes.fromhex("06 000a 0001")))
    reply(line)
    host, port = line.getsockname()
    assert bank.peers == [f"{host}:{port}"]


@pytest.mark.parametrize("unit", [0, 7, 255])
def test_its_own_unit_and_those_that_mean_this_device(line: socket.socket, unit: int) -> None:
    line.sendall(frame(bytes.fromhex("03 0000 0001"), unit=unit))
    assert reply(line) == (1, unit, bytes.fromhex("03 02 0000"))


def test_another_unit_is_a_gateway_target_that_does_not_answer(line: socket.socket, bank: Bank) -> None:
    line.sendall(frame(bytes.fromhex("06 000a 0001"), unit=8))
    assert reply(line) == (1, 8, bytes.fromhex("86 0b"))
    assert bank.words == [0] * SIZE


def test_pipelined_requests_are_answered_in_order(line: socket.socket) -> None:
    line.sendall(b"".join(frame(struct.pack(">BHH", 4, each, 1), transaction=each) for each in range(40)))
    for each in range(40):
        assert reply(line) == (each, 7, struct.pack(">BBH", 4, 2, each))


def test_a_request_in_pieces_is_one_request(line: socket.socket) -> None:
    for byte in frame(bytes.fromhex("04 0005 0001")):
        line.sendall(bytes((byte,)))
    assert reply(line)[2] == bytes.fromhex("04 02 0005")


@pytest.mark.parametrize(
    "garbage",
    [
        struct.pack(">HHHB", 1, 0, 300, 7),  # longer than a frame can be
        struct.pack(">HHHB", 1, 0, 0, 7),
        b"GET / HTTP/1.1\r\n\r\n",
    ],
)
def test_a_broken_frame_ends_that_connection_and_no_other(server: RegisterServer, garbage: bytes) -> None:
    with connection(server) as bad, connection(server) as good:
        bad.sendall(garbage)
        with suppress(ConnectionResetError):  # closed with bytes unread
            assert bad.recv(100) == b"", "closed without an answer"
        good.sendall(frame(bytes.fromhex("04 0005 0001")))
        assert reply(good)[2] == bytes.fromhex("04 02 0005")


def test_a_client_that_stops_midway_or_never_reads_holds_up_nobody(server: RegisterServer) -> None:
    with connection(server) as half, connection(server) as deaf, connection(server) as good:
        half.sendall(frame(bytes.fromhex("04 0005 0001"))[:9])
        deaf.setblocking(False)
        try:
            for _ in range(10_000):
                deaf.sendall(frame(bytes.fromhex("03 0000 007d")))
        except BlockingIOError:
            pass  # both buffers are full: its thread waits for it
        for _ in range(20):
            good.sendall(frame(bytes.fromhex("04 0005 0001")))
            assert reply(good)[2] == bytes.fromhex("04 02 0005")


def test_more_clients_than_allowed_are_turned_away(server: RegisterServer) -> None:
    lines = [connection(server) for _ in range(MOST_CLIENTS)]
    try:
        for line in lines:
            line.sendall(frame(bytes.fromhex("04 0005 0001")))
            assert reply(line)[2] == bytes.fromhex("04 02 0005")
        with connection(server) as one_more:
            assert one_more.recv(1) == b""
    finally:
        for line in lines:
            line.close()


def test_a_request_waits_while_the_registers_are_held(server: RegisterServer, bank: Bank, line: socket.socket) -> None:
    with server.lock:
        line.sendall(frame(bytes.fromhex("03 0000 0002")))
        bank.words[0] = 1
        bank.words[1] = 2
    assert reply(line)[2] == bytes.fromhex("03 04 0001 0002")


def test_a_port_in_use_is_bad_input(server: RegisterServer, bank: Bank) -> None:
    second = RegisterServer(bank, "127.0.0.1", server.port, 1)
    with pytest.raises(InputError, match=f"127.0.0.1:{server.port}: cannot listen there: Address already in use"):
        second.start()


def test_a_host_that_is_not_ours_is_bad_input(bank: Bank) -> None:
    with pytest.raises(InputError, match="cannot listen there"):
        RegisterServer(bank, "192.0.2.1", 0, 1).start()


def test_stop_ends_connections_and_frees_the_port(server: RegisterServer, bank: Bank, line: socket.socket) -> None:
    line.sendall(frame(bytes.fromhex("04 0005 0001")))
    reply(line)
    port = server.port
    server.stop()
    line.settimeout(0.3)
    assert line.recv(1) == b""
    again = RegisterServer(bank, "127.0.0.1", port, 7)
    again.start()
    with connection(again) as line_again:
        line_again.sendall(frame(bytes.fromhex("04 0005 0001")))
        assert reply(line_again)[2] == bytes.fromhex("04 02 0005")
    again.stop()


def test_a_host_that_takes_its_places_leaves_those_of_others(bank: Bank) -> None:
    """127.0.0.2 is another host."""
    server = RegisterServer(bank, "127.0.0.1", 0, 7, limits=ServerLimits(clients_per_host=2))
    server.start()
    lines = [connection(server) for _ in range(3)]
    lines.append(socket.create_connection(("127.0.0.1", server.port), 60, source_address=("127.0.0.2", 0)))
    try:
        for index in (0, 1, 3):
            lines[index].sendall(frame(bytes.fromhex("04 0005 0001")))
            assert reply(lines[index])[2] == bytes.fromhex("04 02 0005")
        assert lines[2].recv(1) == b""
    finally:
        for line in lines:
            line.close()
        server.stop()


def test_a_client_that_asks_without_end_is_made_to_wait(bank: Bank, monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float] = []
    monkeypatch.setattr(server_connection, "time", SimpleNamespace(sleep=waits.append, monotonic=time.monotonic))
    server = RegisterServer(bank, "127.0.0.1", 0, 7, limits=ServerLimits(requests_per_s=10.0))
    server.start()
    try:
        with connection(server) as line:
            line.sendall(b"".join(frame(struct.pack(">BHH", 4, each, 1), transaction=each) for each in range(40)))
            for each in range(40):
                assert reply(line) == (each, 7, struct.pack(">BBH", 4, 2, each))
    finally:
        server.stop()
    assert len(waits) >= 35
    assert waits[-1] > 3.0


def test_out_of_descriptors_it_waits_before_it_accepts_again(
    bank: Bank, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """What knocks goes on knocking: asked at once, the loop would spin."""
    server = RegisterServer(bank, "127.0.0.1", 0, 7)
    attempts = [0]
    waits: list[float] = []
    accept = ThreadingTCPServer.get_request

    def scarce(listener: ThreadingTCPServer) -> tuple[socket.socket, tuple[str, int]]:
        attempts[0] += 1
        if attempts[0] <= 5:
            raise OSError(errno.EMFILE, "Too many open files")
        return accept(listener)

    monkeypatch.setattr(ThreadingTCPServer, "get_request", scarce)
    monkeypatch.setattr(server_module, "time", SimpleNamespace(sleep=waits.append, monotonic=time.monotonic))
    server.start()
    try:
        with connection(server) as line:
            line.sendall(frame(bytes.fromhex("04 0005 0001")))
            assert reply(line)[2] == bytes.fromhex("04 02 0005")
    finally:
        server.stop()
    assert waits == [server_module.SCARCE_WAIT_S] * 5
    assert "Too many open files" in caplog.text


def test_a_client_that_asks_for_nothing_for_too_long_is_disconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_connection, "SEND_TIMEOUT_S", 0.02)
    server = RegisterServer(Bank(), "127.0.0.1", 0, 7, limits=ServerLimits(idle_s=0.5))
    server.start()
    with connection(server) as silent, connection(server) as busy:
        asked = 0
        silent.settimeout(0.05)
        while True:
            busy.sendall(frame(bytes.fromhex("03 0000 0001")))
            reply(busy)
            asked += 1
            try:
                assert silent.recv(1) == b""
                break
            except TimeoutError:
                assert asked < 1000
        assert asked > 3, "at once"
        busy.sendall(frame(bytes.fromhex("03 0000 0001")))
        assert reply(busy)
    server.stop()
