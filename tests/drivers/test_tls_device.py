"""Modbus/TCP Security between driver and device: the contract of every driver, and every way not to get in."""

import logging
import re
import shutil
import socket
import ssl
import struct
import time
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from config.device import ModbusTcpDevice
from config.errors import InputError
from config.roles import Role
from config.slave_file import SlaveFile
from config.tls_table import Tls
from config.valve_file import shipped_valve
from drivers.boundary import DriverError, NoConnection, Refused
from drivers.modbus_tcp import ModbusTcpDriver
from fieldbus.modbus import server as server_module
from fieldbus.modbus import tls as tls_module
from fieldbus.modbus.admission import ServerLimits
from fieldbus.modbus.client_roles import Identity, NotAuthorized, identity_in
from fieldbus.modbus.server import RegisterServer
from fieldbus.modbus.tls import Guard, client_context, failure_reason
from sim.slave.clocks import Lockstep
from sim.slave.device_registers import DeviceRegisters
from sim.slave.simulated_device import Device
from sim.slave.slave import device_of
from tests.certificates import folder, revoke, tls
from tests.drivers import test_driver_contract as contract
from tests.recovery import opened

pytestmark = pytest.mark.real_time

PUSH_PA = 80e3
READ_ONE = bytes.fromhex("0001 0000 0006 01 03 0000 0001")


def guarded(name: str = "device", authority: str = "authority", handshake_timeout_s: float = 5.0) -> Guard:
    return Guard(tls(name, authority, handshake_timeout_s), lambda _: Role.OPERATOR)


class TestModbusTls(contract.TestModbusTcp):
    @pytest.fixture(autouse=True)
    def _secured(self) -> None:
        self.guard = guarded()
        self.driver_tls = tls("daemon")


@contextmanager
def device_with(guard: Guard | None, limits: ServerLimits | None = None) -> Iterator[tuple[Device, RegisterServer]]:
    device = device_of(SlaveFile(), shipped_valve("seed"))
    server = RegisterServer(DeviceRegisters(device, Lockstep(device)), "127.0.0.1", 0, 1, guard, limits=limits)
    server.start()
    try:
        yield device, server
    finally:
        server.stop()


def driver_to(server: RegisterServer, table: Tls | None, host: str = "127.0.0.1") -> ModbusTcpDriver:
    return ModbusTcpDriver(ModbusTcpDevice(host=host, port=server.port, reply_timeout_s=2.0, tls=table))


def turned_away(server: RegisterServer, table: Tls | None) -> str:
    """Return why the driver does not get in: one line."""
    driver = driver_to(server, table)
    with pytest.raises(NoConnection) as caught:
        driver.open()
    with pytest.raises(NoConnection):
        driver.exchange(PUSH_PA)
    driver.close()
    assert "\n" not in str(caught.value)
    return str(caught.value).removeprefix(f"127.0.0.1:{server.port} unit 1: ")


def refusals(caplog: pytest.LogCaptureFixture, number: int = 1) -> list[str]:
    """Return what the server logged of refused clients: a line each, some time after they noticed."""
    end_s = time.monotonic() + 60
    while len(lines := [each.getMessage() for each in caplog.records if "refused" in each.getMessage()]) < number:
        assert time.monotonic() < end_s, lines
        time.sleep(5e-3)
    assert all(re.match(r"(\w+ \(\w+\) at )?127\.0\.0\.1:\d+ refused: ", each) for each in lines), lines
    assert all(each.levelno == logging.WARNING and not each.exc_info for each in caplog.records)
    return [each.partition("refused: ")[2] for each in lines]


@pytest.mark.parametrize(
    ("shown", "trusted", "why"),
    [
        ("device", "other/authority", "its certificate is not accepted: self-signed certificate in certificate chain"),
        ("outdated", "authority", "its certificate is not accepted: certificate has expired"),
        (
            "elsewhere",
            "authority",
            "its certificate is not accepted: IP address mismatch, certificate is not valid for '127.0.0.1'",
        ),
        ("operator", "authority", "its certificate is not accepted: unsuitable certificate purpose"),
    ],
    ids=["of another authority", "expired", "of another host", "of no server"],
)
def test_a_device_with_a_wrong_certificate_is_not_trusted(
    shown: str, trusted: str, why: str, caplog: pytest.LogCaptureFixture
) -> None:
    with device_with(guarded(shown)) as (device, server):
        assert turned_away(server, tls("daemon", trusted)) == why
        assert len(refusals(caplog)) == 1
        assert device.samples == 0


def test_the_host_name_is_checked_as_it_was_called(monkeypatch: pytest.MonkeyPatch) -> None:
    """`valve-8` is this machine today; only a certificate for that name will do."""
    found = socket.getaddrinfo
    monkeypatch.setattr(
        socket, "getaddrinfo", lambda host, *rest: found("127.0.0.1" if host.startswith("valve-") else host, *rest)
    )
    with device_with(guarded("elsewhere")) as (_, server):
        driver = driver_to(server, tls("daemon"), "valve-8")
        driver.open()
        driver.close()
        with pytest.raises(NoConnection, match="Hostname mismatch, certificate is not valid for 'valve-9'"):
            driver_to(server, tls("daemon"), "valve-9").open()


@pytest.mark.parametrize(
    ("shown", "trusted", "told", "logged"),
    [
        ("other/daemon", "authority", "alert unknown ca", "unable to get local issuer certificate"),
        ("outdated", "authority", "alert certificate expired", "certificate has expired"),
        ("device", "authority", "alert unsupported certificate", "unsuitable certificate purpose"),
    ],
    ids=["of another authority", "expired", "of no client"],
)
def test_a_client_with_a_wrong_certificate_is_turned_away_and_told_why(
    shown: str, trusted: str, told: str, logged: str, caplog: pytest.LogCaptureFixture
) -> None:
    with device_with(guarded()) as (device, server):
        assert told in turned_away(server, tls(shown, trusted))
        assert refusals(caplog) == [f"its certificate is not accepted: {logged}"]
        assert device.samples == 0


def raw(server: RegisterServer, context: ssl.SSLContext) -> bytes:
    """Return what a client without our care for errors gets for a request."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=60) as line:
        try:
            with context.wrap_socket(line, server_hostname="127.0.0.1") as secured:
                secured.sendall(READ_ONE)
                return secured.recv(100)
        except OSError:
            return b""


def test_a_client_without_certificate_is_turned_away(caplog: pytest.LogCaptureFixture) -> None:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.load_verify_locations(folder() / "authority.pem")
    with device_with(guarded()) as (_, server):
        assert raw(server, context) == b""
        assert refusals(caplog) == ["TLS: peer did not return a certificate"]
        context.load_cert_chain(folder() / "observer.pem", folder() / "observer.key")
        assert raw(server, context) == bytes.fromhex("0001 0000 0005 01 03 02 0000"), "it was the certificate"


def test_a_key_that_everybody_may_read_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    table = tls("device")
    key = tmp_path / "device.key"
    key.write_bytes(table.key.read_bytes())
    said = []
    for mode in (0o600, 0o640, 0o644):
        key.chmod(mode)
        caplog.clear()
        Guard(table.model_copy(update={"key": key}), lambda _: Role.OPERATOR)
        said.append([each.getMessage() for each in caplog.records])
    assert said == [[], [], [f"{key}: everybody on this machine may read the key; chmod 600 it, and have it made anew"]]


def test_a_certificate_that_cannot_be_read_ends_the_connection_with_a_reason() -> None:
    """Found by fuzzing: of version 6, or with an extension twice, it ended the connection's thread with a traceback."""
    good = ssl.PEM_cert_to_DER_cert((folder() / "operator.pem").read_text())
    assert identity_in(good).role is Role.OPERATOR
    version_6 = good.replace(bytes.fromhex("a003020102"), bytes.fromhex("a003020105"))
    name_of_bits = good.replace(bytes.fromhex("06035504030c"), bytes.fromhex("060355040303"))
    for bad in (version_6, name_of_bits, good[:-1], b""):
        with pytest.raises(ConnectionAbortedError) as caught:
            identity_in(bad)
        assert failure_reason(caught.value) == "its certificate cannot be read"


def test_tls_1_1_is_too_old(caplog: pytest.LogCaptureFixture) -> None:
    context = client_context(tls("daemon"))
    context.set_ciphers("ALL:@SECLEVEL=0")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        context.minimum_version = context.maximum_version = ssl.TLSVersion.TLSv1_1
    with device_with(guarded()) as (_, server):
        assert raw(server, context) == b""
        assert refusals(caplog) == ["TLS: unsupported protocol"]


def test_tls_1_2_will_do() -> None:
    context = client_context(tls("daemon"))
    context.maximum_version = ssl.TLSVersion.TLSv1_2
    with device_with(guarded()) as (_, server):
        assert raw(server, context) != b""


def test_a_plain_driver_at_a_secured_device_does_not_get_in(caplog: pytest.LogCaptureFixture) -> None:
    with device_with(guarded()) as (device, server):
        assert turned_away(server, None).endswith(" at 0: the connection is closed")
        assert device.samples == 0
        assert refusals(caplog) == ["TLS: wrong version number"]


def test_a_secured_driver_at_a_plain_device_is_told_so() -> None:
    with device_with(None) as (device, server):
        assert turned_away(server, tls("daemon")) in ("hung up in the TLS handshake", "Connection reset by peer")
        assert device.samples == 0
        driver = driver_to(server, None)
        driver.open()
        driver.close()


@pytest.mark.parametrize("gone", [ssl.SSLEOFError, ssl.SSLZeroReturnError, ssl.SSLSyscallError])
def test_an_end_that_is_gone_in_the_handshake_has_hung_up_whatever_openssl_calls_it(gone: type[ssl.SSLError]) -> None:
    assert failure_reason(gone(5, "Some I/O error occurred")) == "hung up in the TLS handshake"


def test_an_observer_reads_and_moves_nothing(caplog: pytest.LogCaptureFixture) -> None:
    with device_with(guarded()) as (device, server):
        file = ModbusTcpDevice(port=server.port, reply_timeout_s=2.0, tls=tls("observer"))
        driver = ModbusTcpDriver(file.read_only())
        driver.open()
        assert driver.read().sample_counter == 0
        for act in (driver.exchange, driver.write):
            with pytest.raises(Refused, match="exception 1"):
                act(PUSH_PA)
        assert set(refusals(caplog, 3)) == {f"function {each} needs the role operator" for each in (16, 23)}
        assert "observer (observer) at 127.0.0.1:" in caplog.text
        assert device.samples == 0
        assert driver.read().sample_counter == 0, "and the connection holds"
        driver.close()


def test_sessions_and_refusals_are_witnessed_with_name_and_role() -> None:
    witnessed: list[tuple[str, str, str]] = []
    device = device_of(SlaveFile(), shipped_valve("seed"))
    registers = DeviceRegisters(device, Lockstep(device))
    server = RegisterServer(registers, "127.0.0.1", 0, 1, guarded(), witness=lambda *said: witnessed.append(said))
    server.start()
    try:
        file = ModbusTcpDevice(port=server.port, reply_timeout_s=2.0, tls=tls("observer"))
        driver = ModbusTcpDriver(file.read_only())
        driver.open()
        with pytest.raises(Refused):
            driver.write(PUSH_PA)
        driver.close()
        turned_away(server, tls("outdated"))
        end_s = time.monotonic() + 60
        while not {"gone", "turned away"} <= {what for _, what, _ in witnessed}:
            assert time.monotonic() < end_s, witnessed
            time.sleep(5e-3)
    finally:
        server.stop()
    named = [
        (what, why) for who, what, why in witnessed if re.fullmatch(r"observer \(observer\) at 127\.0\.0\.1:\d+", who)
    ]
    assert ("connected", "") in named
    assert ("gone", "") in named
    assert any(what == "refused" and "needs the role operator" in why for what, why in named)
    assert all("observer" not in who for who, what, _ in witnessed if what == "turned away")


def test_a_certificate_without_role_may_not_even_read(caplog: pytest.LogCaptureFixture) -> None:
    without = ssl.PEM_cert_to_DER_cert((folder() / "device.pem").read_text())
    assert identity_in(without).role is Role.NONE
    guard = guarded()
    with pytest.raises(NotAuthorized, match="function 3 needs the role observer"):
        guard.authorize(identity_in(without), READ_ONE[7:])


def test_a_refused_client_that_sends_on_still_reads_why(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With TLS 1.3 it has sent its first requests before it can know; a reset would cost it the alert."""
    monkeypatch.setattr(server_module, "LINGER_S", 20.0)
    context = client_context(tls("outdated"))
    with (
        device_with(guarded()) as (_, server),
        socket.create_connection(("127.0.0.1", server.port), timeout=20) as plain,
        context.wrap_socket(plain, server_hostname="127.0.0.1") as line,
    ):
        assert refusals(caplog)
        for _ in range(4):
            line.sendall(READ_ONE)
        with pytest.raises(ssl.SSLError, match="alert certificate expired"):
            line.recv(1)


@pytest.mark.parametrize("text", [b"Engineer", b"engineer ", b"", b"none", b"engineer\0", b"admin"])
def test_a_role_that_is_not_known_to_the_letter_is_none(text: bytes) -> None:
    from cryptography import x509
    from cryptography.hazmat.primitives import serialization

    from fieldbus.modbus.client_roles import ROLE_OID, role_in

    assert role_in(b"\x0c" + bytes((len(text),)) + text) is Role.NONE
    parsed = x509.load_pem_x509_certificate((folder() / "engineer.pem").read_bytes())
    value = parsed.extensions.get_extension_for_oid(x509.ObjectIdentifier(ROLE_OID)).value
    assert value == x509.UnrecognizedExtension(x509.ObjectIdentifier(ROLE_OID), b"\x0c\x08engineer")
    assert identity_in(parsed.public_bytes(serialization.Encoding.DER)).role is Role.ENGINEER


def test_handshakes_that_never_come_hold_up_nobody_and_end(caplog: pytest.LogCaptureFixture) -> None:
    with device_with(guarded(handshake_timeout_s=3.0)) as (_, server), ExitStack() as silent:
        lines = [silent.enter_context(socket.create_connection(("127.0.0.1", server.port))) for _ in range(20)]
        lines[0].sendall(b"\x16\x03\x01")  # one begins, and stops
        start_s = time.monotonic()
        driver = driver_to(server, tls("daemon"))
        driver.open()
        for _ in range(20):
            driver.exchange(PUSH_PA)
        assert time.monotonic() - start_s < 2.7, "it did not wait for them"
        for line in lines:
            line.settimeout(10)
            assert line.recv(1) == b""
        assert refusals(caplog, 20) == 20 * ["no TLS handshake in time"]
        driver.exchange(PUSH_PA)
        driver.close()


def test_a_device_that_accepts_and_says_nothing_costs_one_handshake_timeout() -> None:
    with socket.create_server(("127.0.0.1", 0)) as deaf:
        config = ModbusTcpDevice(port=deaf.getsockname()[1], tls=tls("daemon", handshake_timeout_s=0.1))
        start_s = time.monotonic()
        with pytest.raises(NoConnection, match="no TLS handshake in time"):
            ModbusTcpDriver(config).open()
        assert time.monotonic() - start_s < 2


@pytest.mark.parametrize(
    ("name", "update", "said"),
    [
        ("gone.pem", {"authority": "gone.pem"}, "cannot be read: No such file"),
        ("text.pem", {"authority": "text.pem"}, "holds no certificate in PEM form"),
        ("text.pem", {"certificate": "text.pem"}, "are no PEM pair without password"),
        ("daemon.pem", {"key": "observer.key"}, "is not the certificate of "),
        ("daemon.pem", {"key": "locked.key"}, "are no PEM pair without password"),
    ],
)
def test_files_that_do_not_fit_are_one_line_that_names_them(
    tmp_path: Path, name: str, update: dict[str, str], said: str
) -> None:
    from cryptography.hazmat.primitives import serialization

    (tmp_path / "text.pem").write_text("hello\n")
    key = serialization.load_pem_private_key((folder() / "daemon.key").read_bytes(), None)
    locked = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.BestAvailableEncryption(b"secret")
    )
    (tmp_path / "locked.key").write_bytes(locked)
    for each in ("authority.pem", "daemon.pem", "daemon.key", "observer.key"):
        (tmp_path / each).write_bytes((folder() / each).read_bytes())
    table = tls("daemon").model_dump() | {"authority": tmp_path / "authority.pem", "key": tmp_path / "daemon.key"}
    table |= {"certificate": tmp_path / "daemon.pem"} | {kind: tmp_path / file for kind, file in update.items()}
    for use in (client_context, lambda tls: Guard(tls, lambda _: Role.OPERATOR)):
        with pytest.raises(InputError) as caught:
            use(Tls(**table))
        assert str(caught.value).startswith(f"{tmp_path / name}: ")
        assert said in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_session_ends_with_its_certificate(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    with device_with(guarded()) as (device, server):
        driver = driver_to(server, tls("daemon"))
        driver.open()
        driver.exchange(PUSH_PA)
        now_s = time.time()
        with monkeypatch.context() as later:
            clock = SimpleNamespace(time=lambda: now_s + 40 * 86400.0, monotonic=time.monotonic)
            later.setattr(tls_module, "time", clock)
            with pytest.raises(NoConnection):
                driver.exchange(2 * PUSH_PA)
        assert device.command_pa == PUSH_PA
        assert "its certificate has ended, and its session with it" in caplog.text
        driver.close()


def revocable(revoked: Path) -> Guard:
    return Guard(tls("device").model_copy(update={"revoked": revoked}), lambda _: Role.OPERATOR)


def test_a_revoked_certificate_ends_its_session_and_does_not_get_in_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(tls_module, "LOOK_EVERY_S", 0.0)
    revoke(tmp_path / "revoked.pem")
    with device_with(revocable(tmp_path / "revoked.pem")) as (_, server):
        daemon, other = driver_to(server, tls("daemon")), driver_to(server, tls("elsewhere"))
        for driver in (daemon, other):
            driver.open()
            driver.exchange(PUSH_PA)
        revoke(tmp_path / "revoked.pem", "daemon")
        with pytest.raises(DriverError):
            daemon.exchange(PUSH_PA)
        assert "its certificate is revoked, and its session with it" in caplog.text
        other.exchange(PUSH_PA)
        assert "revoked" in turned_away(server, tls("daemon"))
        daemon.close()
        other.close()


def test_a_list_that_does_not_fit_leaves_the_one_before_in_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(tls_module, "LOOK_EVERY_S", 0.0)
    path = tmp_path / "revoked.pem"
    revoke(path, "daemon")
    with device_with(revocable(path)) as (_, server):
        path.write_text("half written")
        assert "revoked" in turned_away(server, tls("daemon"))
        driver = driver_to(server, tls("elsewhere"))
        driver.open()
        driver.exchange(PUSH_PA)
        driver.close()
    said = [each.getMessage() for each in caplog.records if "stay in use" in each.getMessage()]
    problem = "holds no list of revoked certificates in PEM form"
    assert said == [f"certificates have changed, those before stay in use: {path}: {problem}"]
    with pytest.raises(InputError, match=problem):
        revocable(path)


def test_an_outdated_list_lets_nobody_in(tmp_path: Path) -> None:
    revoke(tmp_path / "revoked.pem", days=-1.0)
    with device_with(revocable(tmp_path / "revoked.pem")) as (_, server):
        assert turned_away(server, tls("daemon"))


def test_a_device_whose_certificate_is_revoked_is_not_trusted(tmp_path: Path) -> None:
    revoke(tmp_path / "revoked.pem", "device")
    with device_with(guarded()) as (_, server):
        table = tls("daemon").model_copy(update={"revoked": tmp_path / "revoked.pem"})
        assert "revoked" in turned_away(server, table)


def test_a_certificate_that_is_replaced_is_shown_without_a_restart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tls_module, "LOOK_EVERY_S", 0.0)
    for name in ("certificate", "key"):
        shutil.copy(getattr(tls("outdated"), name), tmp_path / name)
    table = tls("device").model_copy(update={name: tmp_path / name for name in ("certificate", "key")})
    with device_with(Guard(table, lambda _: Role.OPERATOR)) as (_, server):
        assert turned_away(server, tls("daemon"))
        for name in ("certificate", "key"):
            shutil.copy(getattr(tls("device"), name), tmp_path / name)
        driver = driver_to(server, tls("daemon"))
        driver.open()
        driver.exchange(PUSH_PA)
        driver.close()


def test_who_is_not_let_in_takes_nobodys_place() -> None:
    """Connections without a certificate, however many, end nobody's session."""
    with device_with(guarded(), ServerLimits(most_clients=1)) as (_, server), ExitStack() as strangers:
        driver = driver_to(server, tls("daemon"))
        driver.open()
        for _ in range(4):
            strangers.enter_context(socket.create_connection(("127.0.0.1", server.port)))
        for _ in range(20):
            driver.exchange(PUSH_PA)
        second = driver_to(server, tls("daemon"))
        with pytest.raises(DriverError):
            second.open()
        driver.exchange(PUSH_PA)
        driver.close()
        second.close()


def test_a_count_that_no_request_may_have_is_not_walked_through() -> None:
    """It cost 15 ms of the interpreter that runs the cycle, even of an observer."""
    asked: list[int] = []

    def writers(address: int) -> Role:
        asked.append(address)
        return Role.OBSERVER

    guard = Guard(tls("device"), writers)
    guard.authorize(Identity("x", Role.OBSERVER), bytes.fromhex("10 0000 ffff 02 0001"))
    guard.authorize(Identity("x", Role.OBSERVER), bytes.fromhex("17 0000 0001 0000 ffff 02 0001"))
    assert len(asked) <= 2 * 123


RESET = struct.pack("ii", 1, 0)
"""To linger for no time: a close is then a reset."""


class ResetMeanwhile(socket.socket):
    """An accepted connection that its peer resets while the module ssl takes it over."""

    peer: socket.socket

    def gettimeout(self) -> float | None:
        self.peer.close()
        return super().gettimeout()


@pytest.mark.parametrize("moment", ["before", "meanwhile"])
def test_a_connection_that_is_reset_before_its_handshake_is_found_out_there_and_left_open_by_nobody(
    moment: str,
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        peer = socket.create_connection(listener.getsockname())
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
        accepted = ResetMeanwhile(fileno=listener.accept()[0].detach())
    accepted.peer = peer
    if moment == "before":
        peer.close()
    guard = guarded()
    with guard.wrap(accepted) as secured, pytest.raises(ConnectionResetError):
        guard.handshake(secured)


def test_connections_that_are_reset_at_once_are_refused_in_a_line_and_lock_out_nobody(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """400 of them were 64 tracebacks: the socket was gone before its thread had begun to secure it."""
    limits = ServerLimits(most_clients=8, clients_per_host=8)
    with device_with(guarded(), limits) as (_, server):
        for _ in range(60):
            line = socket.create_connection(("127.0.0.1", server.port), 5.0)
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
            line.close()
        driver = ModbusTcpDriver(ModbusTcpDevice(port=server.port, reply_timeout_s=5.0, tls=tls("daemon")))
        opened(driver)
        driver.close()
    assert [each.getMessage() for each in caplog.records if each.exc_info] == []
