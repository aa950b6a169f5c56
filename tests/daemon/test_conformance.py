"""The daemon's supervisory server against the Modbus specifications, frame by raw frame, while the cycle runs.

By "the guide" is meant the MODBUS Messaging on TCP/IP Implementation Guide V1.0b, by "the protocol" the MODBUS
Application Protocol Specification V1.1b3. Every test ends with the cycle asked whether it noticed.
"""

import socket
import struct
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from threading import Thread

import pytest

from config.registers import BY_NAME, SIZE
from config.slave_file import SlaveFile
from config.valve_file import shipped_valve
from fieldbus.modbus import admission
from fieldbus.modbus.admission import MOST_CLIENTS
from fieldbus.modbus.server import RegisterServer
from fieldbus.modbus.server_connection import SEND_TIMEOUT_S
from positioner.cli.parts.children import port_in
from positioner.dcs import Dcs
from sim.slave.clocks import Lockstep
from sim.slave.device_registers import DeviceRegisters
from sim.slave.slave import device_of
from tests.children import running

pytestmark = pytest.mark.real_time

UNIT = 3
WITHIN_S = 60.0
WORD_TEST = BY_NAME["word_test"].address
READ = struct.pack(">BHH", 3, WORD_TEST, 1)
ANSWER = struct.pack(">BBH", 3, 2, 0xB38C)


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """Run a daemon on a device in lockstep; give its supervisory port."""
    slave = SlaveFile.model_validate({"initial": {"position_m": 0.03, "pressure_pa": 24e3}})
    device = device_of(slave, shipped_valve("seed"))
    server = RegisterServer(DeviceRegisters(device, Lockstep(device)), "127.0.0.1", 0, 1)
    server.start()
    path: Path = tmp_path_factory.mktemp("conformance") / "daemon.toml"
    path.write_text(
        f"[valve]\nstroke_m = 0.1016\n[device]\nport = {server.port}\nreply_timeout_s = 10.0\n"
        f"[cycle]\nperiod_s = 5e-3\n[safety]\nstale_after_s = 60.0\n[supervisory]\nport = 0\nunit = {UNIT}\n"
    )
    with running("run", path) as ready:
        yield port_in(ready)
    server.stop()


@pytest.fixture
def port(daemon: int) -> Iterator[int]:
    """Give the port; afterwards the cycle must go on and have lost nothing."""
    with Dcs("127.0.0.1", daemon, unit=UNIT) as dcs:
        before = dcs.get_all("cycles", "lost_replies", "fault")
    yield daemon
    with Dcs("127.0.0.1", daemon, unit=UNIT) as dcs:
        after = dcs.get_all("cycles", "lost_replies", "fault")
        assert (after["lost_replies"], after["fault"]) == (0, 0)
        end_s = time.monotonic() + WITHIN_S
        while dcs.get("cycles") < before["cycles"] + 5:
            assert time.monotonic() < end_s, "the cycle stands still"


@pytest.fixture
def line(port: int) -> Iterator[socket.socket]:
    with connection(port) as line:
        yield line


def connection(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=WITHIN_S)


def frame(pdu: bytes, transaction: int = 1, unit: int = UNIT, protocol: int = 0) -> bytes:
    return struct.pack(">HHHB", transaction, protocol, len(pdu) + 1, unit) + pdu


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


def answered(line: socket.socket, transaction: int = 77) -> bool:
    """Ask for the test constant; return whether it is the next thing that comes."""
    line.sendall(frame(READ, transaction))
    assert reply(line) == (transaction, UNIT, ANSWER)
    return True


def is_closed(line: socket.socket) -> bool:
    with suppress(ConnectionResetError):  # closed with bytes unread
        assert line.recv(100) == b"", "closed without an answer"
    return True


# ---- frames and segments


def test_pipelined_requests_are_each_answered_in_order_with_their_own_transaction(line: socket.socket) -> None:
    requests = [(0xFFF0 + each & 0xFFFF, each % SIZE) for each in range(100)]
    line.sendall(b"".join(frame(struct.pack(">BHH", 4, at, 1), number) for number, at in requests))
    for number, _ in requests:
        transaction, unit, pdu = reply(line)
        assert (transaction, unit, pdu[:2]) == (number, UNIT, b"\x04\x02")


def test_good_and_bad_pipelined_requests_keep_their_answers_apart(line: socket.socket) -> None:
    pdus = [READ, b"\x41", struct.pack(">BHH", 3, 0, 0), READ, struct.pack(">BHH", 3, SIZE, 1), READ]
    line.sendall(b"".join(frame(pdu, number) for number, pdu in enumerate(pdus)))
    expected = [ANSWER, b"\xc1\x01", b"\x83\x03", ANSWER, b"\x83\x02", ANSWER]
    assert [reply(line) for _ in pdus] == [(number, UNIT, pdu) for number, pdu in enumerate(expected)]


def test_a_request_split_anywhere_is_one_request(line: socket.socket) -> None:
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    for cut in range(1, 12):
        whole = frame(READ, cut)
        line.sendall(whole[:cut])
        line.sendall(whole[cut:])
        assert reply(line) == (cut, UNIT, ANSWER)


def test_segments_that_join_the_end_of_one_request_and_the_begin_of_the_next(line: socket.socket) -> None:
    stream = b"".join(frame(READ, number) for number in range(30))
    for start in range(0, len(stream), 17):  # a frame has 12 bytes
        line.sendall(stream[start : start + 17])
    assert [reply(line)[0] for _ in range(30)] == list(range(30))


@pytest.mark.parametrize("protocol", [1, 0x00FF, 0xFFFF])
def test_a_frame_of_another_protocol_is_discarded_and_the_next_answered(line: socket.socket, protocol: int) -> None:
    """The guide: not 0, then the request is discarded. What it asked for is not done."""
    write = struct.pack(">BHHBH", 16, BY_NAME["heartbeat"].address, 1, 2, 4321)
    line.sendall(frame(write, 8, protocol=protocol) + frame(READ, 9))
    assert reply(line) == (9, UNIT, ANSWER)
    line.sendall(frame(struct.pack(">BHH", 3, BY_NAME["heartbeat"].address, 1), 10))
    assert reply(line) != (10, UNIT, struct.pack(">BBH", 3, 2, 4321))


@pytest.mark.parametrize("length", [0, 1, 255, 256, 0xFFFF])
def test_a_length_that_no_frame_has_ends_the_connection(line: socket.socket, port: int, length: int) -> None:
    """Where the next frame begins cannot be known: nothing on this connection can be trusted any more."""
    line.sendall(struct.pack(">HHHB", 1, 0, length, UNIT) + READ)
    assert is_closed(line)
    with connection(port) as again:
        assert answered(again)


def test_the_longest_frame_that_there_is_gets_an_answer(line: socket.socket) -> None:
    """A PDU of 253 bytes; as function 16 it has two bytes more than its count says."""
    line.sendall(frame(struct.pack(">BHHB", 16, 0, 123, 246) + bytes(247), 4))
    assert reply(line) == (4, UNIT, b"\x90\x03")
    assert answered(line)


def test_a_function_code_alone_is_a_frame_and_gets_its_exception(line: socket.socket) -> None:
    """The shortest there is, as functions 7, 11, 12 and 17 are asked for."""
    for function in (7, 11, 12, 17):
        line.sendall(frame(bytes((function,)), function))
        assert reply(line) == (function, UNIT, bytes((function | 0x80, 1)))


# ---- functions, counts, units


def test_a_function_that_is_not_served_is_exception_1(line: socket.socket) -> None:
    for function in {*range(128)} - {3, 4, 6, 16, 23}:
        line.sendall(frame(bytes((function,)) + bytes(4), function))
        assert reply(line) == (function, UNIT, bytes((function | 0x80, 1)))


@pytest.mark.parametrize("function", [3, 4])
def test_a_count_or_an_address_that_is_not_is_refused(line: socket.socket, function: int) -> None:
    """The protocol judges the count before the address."""
    counts = [(0, 0), (0, 126), (0, 0x8000), (0, 0xFFFF), (SIZE, 0)]
    addresses = [(SIZE, 1), (SIZE - 1, 2), (0xFFFF, 125)]
    for exception, refused in ((3, counts), (2, addresses)):
        for address, count in refused:
            line.sendall(frame(struct.pack(">BHH", function, address, count)))
            assert reply(line) == (1, UNIT, bytes((function | 0x80, exception)))


@pytest.mark.parametrize(
    ("pdu", "exception"),
    [
        (struct.pack(">BHHB", 16, 0, 0, 0), 3),
        (struct.pack(">BHHB", 16, 0, 124, 248) + bytes(246), 3),
        (struct.pack(">BHHBH", 16, 0, 2, 2, 0), 3),
        (struct.pack(">BHHBH", 16, 0, 1, 4, 0), 3),
        (struct.pack(">BHHB", 16, 0, 1, 2), 3),
        (struct.pack(">BHHBH", 16, 0, 1, 2, 0), 2),
        (struct.pack(">BHHBH", 16, WORD_TEST, 1, 2, 0), 2),
        (struct.pack(">BHH", 6, WORD_TEST, 0), 2),
        (struct.pack(">BH", 6, 3), 3),
        (struct.pack(">BHHH", 22, 3, 0, 0), 1),
        (struct.pack(">BHHHHBH", 23, 0, 0, BY_NAME["heartbeat"].address, 1, 2, 999), 3),
        (struct.pack(">BHHHHBH", 23, 0, 126, BY_NAME["heartbeat"].address, 1, 2, 999), 3),
        (struct.pack(">BHHHHB", 23, 0, 1, BY_NAME["heartbeat"].address, 0, 0), 3),
        (struct.pack(">BHHHHB", 23, 0, 1, 0, 122, 244) + bytes(243), 3),
        (struct.pack(">BHHHHBH", 23, SIZE, 1, BY_NAME["heartbeat"].address, 1, 2, 999), 2),
        (struct.pack(">BHHHHBH", 23, 0, 1, WORD_TEST, 1, 2, 999), 2),
    ],
)
def test_a_write_that_is_not_right_is_refused_and_changes_nothing(
    line: socket.socket, pdu: bytes, exception: int
) -> None:
    commands = struct.pack(">BHH", 3, 0, 22)
    line.sendall(frame(commands))
    before = reply(line)
    line.sendall(frame(pdu, 2))
    assert reply(line) == (2, UNIT, bytes((pdu[0] | 0x80, exception)))
    line.sendall(frame(commands))
    assert reply(line) == before


def test_function_23_writes_first_and_reads_what_it_wrote(line: socket.socket) -> None:
    heartbeat = BY_NAME["heartbeat"].address
    line.sendall(frame(struct.pack(">BHHHHBH", 23, heartbeat, 1, heartbeat, 1, 2, 777), 6))
    assert reply(line) == (6, UNIT, struct.pack(">BBH", 23, 2, 777))


@pytest.mark.parametrize("unit", [0, UNIT, 255])
def test_units_that_mean_this_device_are_answered_as_they_were_asked(line: socket.socket, unit: int) -> None:
    """There is no broadcast on TCP: the guide has 0 mean the device at this address, like 255."""
    line.sendall(frame(READ, 3, unit))
    assert reply(line) == (3, unit, ANSWER)
    heartbeat = struct.pack(">BHH", 6, BY_NAME["heartbeat"].address, unit)
    line.sendall(frame(heartbeat, 4, unit))
    assert reply(line) == (4, unit, heartbeat)


@pytest.mark.parametrize("unit", [1, 2, 4, 247, 248, 254])
def test_another_unit_is_a_gateway_target_that_does_not_answer(line: socket.socket, unit: int) -> None:
    for pdu in (READ, struct.pack(">BHH", 6, BY_NAME["heartbeat"].address, 5), b"\x41"):
        line.sendall(frame(pdu, 3, unit))
        assert reply(line) == (3, unit, bytes((pdu[0] | 0x80, 11)))


# ---- clients


def test_fifty_clients_at_once_each_get_their_own_answers(port: int) -> None:
    """Each pipelines its own transactions, and its requests are of its own length."""
    wrong: list[object] = []

    def ask(client: int) -> None:
        count = client + 1
        with connection(port) as line:
            for turn in range(0, 40, 4):
                numbers = [client << 8 | turn + each for each in range(4)]
                line.sendall(b"".join(frame(struct.pack(">BHH", 3, 0, count), number) for number in numbers))
                for number in numbers:
                    transaction, unit, pdu = reply(line)
                    if (transaction, unit, len(pdu)) != (number, UNIT, 2 + 2 * count):
                        wrong.append((client, number, transaction, unit, len(pdu)))

    clients = [Thread(target=ask, args=(client,)) for client in range(50)]
    for client in clients:
        client.start()
    for client in clients:
        client.join(WITHIN_S)
    assert not any(client.is_alive() for client in clients)
    assert wrong == []


def test_fifty_connections_stay_open_side_by_side(port: int) -> None:
    with ExitStack() as held:
        lines = [held.enter_context(connection(port)) for _ in range(50)]
        for transaction in range(3):
            for line in lines:
                assert answered(line, transaction)


def test_a_client_that_does_not_read_is_let_go_and_never_gets_a_torn_answer(port: int) -> None:
    """It asks for more than both buffers hold; what it reads at last are whole answers in order, then the end."""
    with connection(port) as deaf, connection(port) as good:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
        deaf.settimeout(3 * SEND_TIMEOUT_S)
        asked, end_s = 0, time.monotonic() + WITHIN_S
        longest = struct.pack(">BHH", 3, 0, min(125, SIZE))
        with suppress(ConnectionResetError, BrokenPipeError):
            while True:
                assert time.monotonic() < end_s, "it is not let go"
                try:
                    deaf.sendall(frame(longest, asked & 0xFFFF))
                    asked += 1
                except TimeoutError:
                    break  # what is left of that frame is never sent
                assert asked % 1000 or answered(good)
        deaf.settimeout(WITHIN_S)
        stream = b""
        with suppress(ConnectionResetError):
            while more := deaf.recv(1 << 17):
                stream += more
        size = 9 + 2 * min(125, SIZE)
        got = len(stream) // size
        for number in range(got):
            answer = stream[number * size : (number + 1) * size]
            assert answer[:8] == struct.pack(">HHHBB", number & 0xFFFF, 0, size - 6, UNIT, 3)
        assert got < asked, "it was let go"


def test_a_client_that_sends_byte_by_byte_holds_up_nobody(port: int) -> None:
    with connection(port) as slow, connection(port) as good:
        slow.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for byte in frame(READ, 6):
            slow.sendall(bytes((byte,)))
            assert answered(good)
        assert reply(slow) == (6, UNIT, ANSWER)


def test_clients_that_vanish_in_every_way_leave_the_others_their_answers(port: int) -> None:
    reset = struct.pack("ii", 1, 0)
    with connection(port) as good:
        for sent in (b"", frame(READ)[:3], frame(READ)[:9], frame(READ), frame(READ) * 50):
            with connection(port) as gone:
                gone.sendall(sent)
            with connection(port) as aborted:
                aborted.sendall(sent)
                aborted.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, reset)
            with connection(port) as half_open:
                half_open.sendall(sent)
                half_open.shutdown(socket.SHUT_WR)
                assert len(receive(half_open, 10_000)) % 11 == 0, "answers to what was whole, then the end"
            assert answered(good)


def test_when_all_places_are_taken_the_one_unused_for_longest_gives_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """The guide: the oldest unused connection is closed. So clients that vanished without a word lock out nobody."""
    monkeypatch.setattr(admission, "UNUSED_S", 0.0)

    class Words:
        def read(self, table: str, address: int, count: int) -> list[int]:
            return [0xB38C] * count

        def write(self, address: int, words: object, peer: str) -> None:
            raise NotImplementedError

    server = RegisterServer(Words(), "127.0.0.1", 0, UNIT)
    server.start()
    try:
        with ExitStack() as held:
            lines = [held.enter_context(connection(server.port)) for _ in range(MOST_CLIENTS)]
            for line in (*lines, lines[0]):
                assert answered(line)
            newcomer = held.enter_context(connection(server.port))
            assert answered(newcomer)
            assert is_closed(lines[1]), "the one unused for longest"
            assert all(answered(line) for line in (lines[0], *lines[2:]))
    finally:
        server.stop()


def test_it_serves_on_ipv6_too(tmp_path: Path) -> None:
    if not socket.has_ipv6:
        pytest.skip("no IPv6 on this machine")

    class Words:
        def read(self, table: str, address: int, count: int) -> list[int]:
            return [0xB38C] * count

        def write(self, address: int, words: object, peer: str) -> None:
            assert peer.startswith("[::1]:")

    server = RegisterServer(Words(), "::1", 0, UNIT)
    server.start()
    try:
        assert server.address == f"[::1]:{server.port}"
        with socket.create_connection(("::1", server.port), timeout=WITHIN_S) as line:
            assert answered(line)
            line.sendall(frame(struct.pack(">BHH", 6, 0, 1), 2))
            assert reply(line)[2] == struct.pack(">BHH", 6, 0, 1)
        with Dcs("::1", server.port, unit=UNIT) as dcs:
            assert dcs.get("word_test") == 0xB38C
    finally:
        server.stop()
