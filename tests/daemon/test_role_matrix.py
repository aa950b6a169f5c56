"""Roles over functions and registers, the whole matrix, generated: what each may on a secured connection.

Over TLS, a session and a certificate each. What is said of registers here is said a second time, on purpose.
"""

import socket
import ssl
import struct
from collections.abc import Iterator, Sequence

import pytest
from pymodbus.constants import ExcCodes

from config.codes import Mode
from config.registers import BY_NAME, REGISTERS, SIZE, Register
from config.roles import Role
from fieldbus.modbus.admission import ServerLimits
from fieldbus.modbus.client_roles import Identity, NotAuthorized
from fieldbus.modbus.server import RegisterServer
from fieldbus.modbus.server_connection import HEADER
from fieldbus.modbus.tls import client_context
from positioner.daemon.service import guard_of
from tests.certificates import tls
from tests.daemon.panel import Panel

ROLES = (Role.OBSERVER, Role.OPERATOR, Role.ENGINEER)
AT_ONCE = 40
ALARMS = {"alarm_acknowledge", "alarm_shelve", "alarm_shelve_time"}
OPERATORS = {"reference", "reference_scaled", "acknowledge", "heartbeat", "experiment_veto"} | ALARMS
"""What an operator writes; everything else that may be written is the engineer's."""
READS = (3, 4)
WRITES = (6, 16, 23)


class Secured:
    """The registers of a virtual valve behind a server with TLS, and a session of each role."""

    def __init__(self) -> None:
        self.panel = Panel()
        self._server = RegisterServer(
            self.panel.registers, "127.0.0.1", 0, 1, guard_of(tls("daemon")), limits=ServerLimits(requests_per_s=0.0)
        )
        self._server.start()
        self._sessions = {role: self._session(role.name.lower()) for role in ROLES}

    def close(self) -> None:
        """End the sessions."""
        for each in self._sessions.values():
            each.close()
        self._server.stop()

    def ask(self, role: Role, *requests: bytes) -> list[bytes]:
        """Return the answers to requests, sent some at a time."""
        return [answer for some in batched(requests, AT_ONCE) for answer in self._asked(self._sessions[role], some)]

    def _session(self, name: str) -> ssl.SSLSocket:
        plain = socket.create_connection(("127.0.0.1", self._server.port), timeout=20.0)
        return client_context(tls(name)).wrap_socket(plain, server_hostname="127.0.0.1")

    def _asked(self, session: ssl.SSLSocket, requests: Sequence[bytes]) -> Iterator[bytes]:
        session.sendall(b"".join(HEADER.pack(n, 0, len(pdu) + 1, 1) + pdu for n, pdu in enumerate(requests)))
        stream = session.makefile("rb")
        for n in range(len(requests)):
            transaction, _, length, _ = HEADER.unpack(stream.read(HEADER.size))
            assert transaction == n
            yield stream.read(length - 1)
        stream.close()


def batched(requests: Sequence[bytes], most: int) -> Iterator[Sequence[bytes]]:
    return (requests[at : at + most] for at in range(0, len(requests), most))


@pytest.fixture(scope="module")
def secured() -> Iterator[Secured]:
    made = Secured()
    yield made
    made.close()


def exceptions(answers: Sequence[bytes], requests: Sequence[bytes]) -> list[int | None]:
    """Return the exception of each answer, None where there is none."""
    assert all(answer[0] & 0x7F == pdu[0] & 0x7F for answer, pdu in zip(answers, requests, strict=True))
    return [answer[1] if answer[0] & 0x80 else None for answer in answers]


def needed_by(register: Register) -> Role:
    """Return who may write it; whoever has a role is told that it cannot be written."""
    if register.access == "r":
        return Role.OBSERVER
    return Role.OPERATOR if register.name in OPERATORS else Role.ENGINEER


def read_request(function: int, register: Register) -> bytes:
    return struct.pack(">BHH", function, register.address, register.format.words)


def write_requests(register: Register) -> Iterator[bytes]:
    """Yield a write of a value that is allowed, by each function that can."""
    value = register.minimum if register.minimum is not None else 0.0
    words = register.format.encode(value)
    body = struct.pack(f">{len(words)}H", *words)
    if len(words) == 1:
        yield struct.pack(">BHH", 6, register.address, *words)
    head = struct.pack(">HHB", register.address, len(words), 2 * len(words))
    yield b"\x10" + head + body
    yield b"\x17" + struct.pack(">HH", BY_NAME["state"].address, 1) + head + body


@pytest.mark.parametrize("role", ROLES, ids=lambda role: role.name.lower())
def test_every_register_is_read_by_whoever_has_a_role(secured: Secured, role: Role) -> None:
    requests = [read_request(function, register) for register in REGISTERS for function in READS]
    assert set(exceptions(secured.ask(role, *requests), requests)) == {None}


def test_whose_certificate_names_no_role_may_nothing() -> None:
    guard, nobody = guard_of(tls("daemon")), Identity("nobody", Role.NONE)
    for register in REGISTERS:
        for pdu in (*(read_request(each, register) for each in READS), *write_requests(register)):
            with pytest.raises(NotAuthorized):
                guard.authorize(nobody, pdu)
    for function in range(256):
        with pytest.raises(NotAuthorized):
            guard.authorize(nobody, bytes((function,)))


@pytest.mark.parametrize("role", ROLES, ids=lambda role: role.name.lower())
def test_every_register_is_written_by_its_writers_and_by_nobody_else(secured: Secured, role: Role) -> None:
    for register in REGISTERS:
        requests = list(write_requests(register))
        before = secured.panel.cycle.requests
        refused = set(exceptions(secured.ask(role, *requests), requests))
        if role < needed_by(register):
            assert refused == {ExcCodes.ILLEGAL_FUNCTION}, register.name
            assert secured.panel.cycle.requests is before
        elif register.access == "r":
            assert refused == {ExcCodes.ILLEGAL_ADDRESS}, register.name
        else:
            assert ExcCodes.ILLEGAL_FUNCTION not in refused, register.name


@pytest.mark.parametrize("role", ROLES, ids=lambda role: role.name.lower())
def test_every_other_function_is_refused_to_everybody(secured: Secured, role: Role) -> None:
    before = secured.panel.cycle.requests
    others = [function for function in range(1, 128) if function not in (*READS, *WRITES)]
    requests = [bytes((each,)) + body for each in others for body in (b"", b"\0\0\0\1", b"\0\x03\0\1\2\0\2")]
    assert set(exceptions(secured.ask(role, *requests), requests)) == {ExcCodes.ILLEGAL_FUNCTION}
    assert secured.panel.cycle.requests is before


@pytest.mark.parametrize("role", ROLES, ids=lambda role: role.name.lower())
def test_a_write_over_several_words_needs_the_highest_role_of_any(secured: Secured, role: Role) -> None:
    """Every stretch of words, whoever's they are: the guard has its say before the registers."""
    word_needs = {at: needed_by(each) for each in REGISTERS for at in range(each.address, each.end)}
    stretches = [(address, count) for address in range(SIZE) for count in (1, 2, 5)] + [(0, 123), (500, 123)]
    requests = [struct.pack(">BHHB", 16, at, count, 2 * count) + bytes(2 * count) for at, count in stretches]
    refused = exceptions(secured.ask(role, *requests), requests)
    for (address, count), code in zip(stretches, refused, strict=True):
        needed = max(word_needs.get(each, Role.OBSERVER) for each in range(address, address + count))
        assert (code == ExcCodes.ILLEGAL_FUNCTION) == (role < needed), (address, count)


def test_an_operator_moves_the_reference_and_cannot_choose_the_mode(secured: Secured) -> None:
    by_hand = struct.pack(">BHH", 6, BY_NAME["mode"].address, Mode.MANUAL)
    follow = struct.pack(">BHH", 6, BY_NAME["reference_scaled"].address, 5000)
    assert secured.ask(Role.OPERATOR, by_hand) == [bytes((0x86, ExcCodes.ILLEGAL_FUNCTION))]
    assert secured.ask(Role.OPERATOR, follow) == [follow]
    assert secured.ask(Role.ENGINEER, by_hand) == [by_hand]
