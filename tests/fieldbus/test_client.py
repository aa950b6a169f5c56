"""The Modbus TCP client's own words: reading and writing registers, and what becomes of a reply that does not fit.

What the driver makes of faults is in `tests/drivers/test_modbus_faults.py`, the deadline in `test_reply_deadline.py`.
"""

import select
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import pytest

from fieldbus.modbus.client import ModbusClient
from fieldbus.modbus.client_errors import NobodyThere, NotConnected, Refused, ReplyTimeout, UnexpectedReply

pytestmark = pytest.mark.real_time

TIMEOUT_S = 20.0
UNIT = 7
WORDS = [1, 0xFFFE, 3]


def framed(transaction: bytes, pdu: bytes) -> bytes:
    return transaction + struct.pack(">HHB", 0, len(pdu) + 1, UNIT) + pdu


@contextmanager
def answered_with(pdu: bytes, asked: list[bytes] | None = None) -> Iterator[ModbusClient]:
    """Give a client of a server that answers its first request with a PDU, and then waits for its end."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            line, _ = listener.accept()
            with line:
                request = line.recv(300)
                if asked is not None:
                    asked.append(request[6:])
                line.sendall(framed(request[:2], pdu))
                line.recv(1)

        thread = threading.Thread(target=serve)
        thread.start()
        client = ModbusClient("127.0.0.1", listener.getsockname()[1], UNIT, TIMEOUT_S)
        client.open()
        try:
            yield client
        finally:
            client.close()
            thread.join(TIMEOUT_S)


def read(client: ModbusClient) -> object:
    return client.read_holding_registers(10, 3)


def write(client: ModbusClient) -> object:
    client.write_registers(10, WORDS)
    return None


def test_words_are_read_and_written_as_the_specification_has_it() -> None:
    asked: list[bytes] = []
    with answered_with(bytes.fromhex("03 06 0001 fffe 0003"), asked) as client:
        assert client.read_holding_registers(10, 3) == WORDS
    with answered_with(bytes.fromhex("10 000a 0003"), asked) as client:
        client.write_registers(10, WORDS)
    assert asked == [bytes.fromhex("07 03 000a 0003"), bytes.fromhex("07 10 000a 0003 06 0001 fffe 0003")]


@pytest.mark.parametrize(
    ("ask", "pdu"),
    [
        (read, "03 04 0001 fffe"),
        (read, "03 08 0001 fffe 0003 0004"),
        (read, "03 06 0001 fffe"),
        (read, "03 04 0001 fffe 0003"),
        (read, "04 06 0001 fffe 0003"),
        (read, "83"),
        (read, "83 02 00"),
        (read, "90 02"),
        (write, "10 000b 0003"),
        (write, "10 000a 0002"),
        (write, "10 000a"),
        (write, "10 000a 0003 00"),
        (write, "06 000a 0003"),
    ],
)
def test_a_reply_of_another_function_count_or_echo_ends_the_connection(
    ask: Callable[[ModbusClient], object], pdu: str
) -> None:
    with answered_with(bytes.fromhex(pdu)) as client:
        with pytest.raises(UnexpectedReply, match="the reply does not fit: "):
            ask(client)
        with pytest.raises(NotConnected, match="the connection is closed"):
            ask(client)


@pytest.mark.parametrize(
    ("ask", "pdu", "said"),
    [
        (read, "83 02", "exception 2, illegal data address"),
        (write, "90 06", "exception 6, slave device busy"),
        (write, "90 63", "exception 99, not in the specification"),
    ],
)
def test_an_exception_is_a_refusal_in_words(ask: Callable[[ModbusClient], object], pdu: str, said: str) -> None:
    with answered_with(bytes.fromhex(pdu)) as client, pytest.raises(Refused) as caught:
        ask(client)
    assert (str(caught.value), caught.value.code) == (said, bytes.fromhex(pdu)[1])


def test_nobody_there_and_a_name_nobody_knows_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(NobodyThere, match="nobody accepts a connection within 20000 ms"):
        ModbusClient("127.0.0.1", port, UNIT, TIMEOUT_S).open()

    def unknown(*_: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    with pytest.raises(NotConnected, match=r"^Name or service not known$") as caught:
        ModbusClient("valve-7", port, UNIT, TIMEOUT_S).open()
    assert not isinstance(caught.value, NobodyThere)


def test_opening_anew_ends_the_connection_before() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        client = ModbusClient("127.0.0.1", listener.getsockname()[1], UNIT, TIMEOUT_S)
        client.open()
        first, _ = listener.accept()
        held = client.line  # or it would end for want of an owner
        client.open()
        first.settimeout(TIMEOUT_S)
        assert first.recv(1) == b""
        assert held is not client.line
        client.close()
        first.close()


def test_a_late_reply_is_not_read_after_opening_anew() -> None:
    """Its connection is gone with it."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        client = ModbusClient("127.0.0.1", listener.getsockname()[1], UNIT, 0.05)
        client.open()
        first, _ = listener.accept()
        with pytest.raises(ReplyTimeout, match="no reply within 50 ms"):
            read(client)
        client.open()
        second, _ = listener.accept()
        late = framed(first.recv(300)[:2], bytes.fromhex("03 06 0001 fffe 0003"))
        with suppress(OSError):  # its end is closed, so that the second piece may not leave any more
            first.sendall(late)
            first.sendall(late)
        with pytest.raises(ReplyTimeout):
            read(client)
        first.close()
        second.close()


@pytest.mark.parametrize("host", ["a..b", "x" * 300])
def test_what_can_be_no_name_of_a_host_is_nobody(host: str) -> None:
    with pytest.raises(NotConnected, match="can be no name of a host"):
        ModbusClient(host, 502, 1, 1.0).open()


def test_a_reply_that_came_in_time_is_no_lost_one_to_a_caller_that_looks_late() -> None:
    """Many valves share a thread that may be held up: the reply waits in the socket, and no time-out takes it away."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        client = ModbusClient("127.0.0.1", listener.getsockname()[1], UNIT, TIMEOUT_S)
        client.open()
        line, _ = listener.accept()
        with line:
            pdu = bytes.fromhex("03 06 0001 fffe 0003")
            ready = client.ask(bytes.fromhex("03 000a 0003"))
            assert ready is not None
            line.sendall(framed(line.recv(300)[:2], pdu))
            select.select([ready], [], [], TIMEOUT_S)
            assert client.answer(late=True) == pdu
            client.ask(bytes.fromhex("03 000a 0003"))
            line.sendall(framed(line.recv(300)[:2], pdu)[:-1])
            select.select([ready], [], [], TIMEOUT_S)
            with pytest.raises(ReplyTimeout):
                client.answer(late=True)
