"""`positioner opcua` beside a running daemon: what clients see and may do, and who is turned away, in one line each."""

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from asyncua import Client, Node, ua
from asyncua.client.ua_client import UaClient
from asyncua.crypto.cert_gen import dump_private_key_as_pem, generate_private_key, generate_self_signed_app_certificate
from asyncua.crypto.security_policies import SecurityPolicyAes256Sha256RsaPss, SecurityPolicyBasic256Sha256
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509.oid import ExtendedKeyUsageOID

from config.codes import Mode, Ne107Cause
from config.role_passwords import set_password
from northbound.opcua.address_space import OURS
from northbound.opcua.valve_nodes import SETPOINT, SIGNAL
from positioner.cli.main import main
from positioner.cli.parts.children import port_in
from positioner.dcs import Dcs
from tests.children import child, running
from tests.daemon_files import PATIENT, daemon_file, slave_file

pytestmark = pytest.mark.patient

SECRET = "a password of "
ADJUST = "SignalSet.Position.AutoAdjustPositioner"
HISTORY_AND_ALARM = "[history]\nfolder = 'history'\n[alarms.high]\nthreshold = 0.6\n"
START = ua.Variant(2, ua.VariantType.Int32)


def certificate(folder: Path, name: str) -> None:
    key = generate_private_key()
    names: list[x509.GeneralName] = [x509.UniformResourceIdentifier(f"urn:{name}"), x509.DNSName("localhost")]
    made = generate_self_signed_app_certificate(
        key, name, {"organizationName": "test"}, names, [ExtendedKeyUsageOID.CLIENT_AUTH], 30
    )
    (folder / f"{name}-key.pem").write_bytes(dump_private_key_as_pem(key))
    (folder / f"{name}.pem").write_bytes(made.public_bytes(Encoding.PEM))


@dataclass
class Site:
    folder: Path
    url: str
    daemon_port: int

    def log(self) -> list[str]:
        return (self.folder / "opcua.log").read_text().splitlines()

    @asynccontextmanager
    async def client(self, user: str = "observer", name: str = "client", **other: Any) -> AsyncIterator[Client]:
        client = Client(self.url, timeout=30)
        client.application_uri = f"urn:{name}"
        policy = other.get("policy", SecurityPolicyBasic256Sha256)
        mine = (self.folder / f"{name}.pem", self.folder / f"{name}-key.pem")
        await client.set_security(policy, *mine, server_certificate=self.folder / "keys" / "own.pem")
        client.set_user(user)
        client.set_password(other.get("password", SECRET + user))
        async with client:
            yield client

    def seen(self, user: str, look: Callable[["Nodes"], Awaitable[Any]], **other: Any) -> Any:
        async def done() -> Any:
            async with self.client(user, **other) as client:
                return await look(Nodes(client, await client.get_namespace_index(OURS)))

        return asyncio.run(asyncio.wait_for(done(), 60))


@dataclass
class Nodes:
    client: Client
    index: int

    def __call__(self, path: str = "") -> Node:
        return self.client.get_node(ua.NodeId(f"FV-101.{path}" if path else "FV-101", self.index))

    async def call(self, method: str, on: str = "", *values: Any) -> Any:
        return await self(on).call_method(self(method).nodeid, *values)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("opcua")
    for user in ("observer", "operator", "engineer"):
        set_password(folder / "users.json", user, SECRET + user)
    for name in ("client", "stranger"):
        certificate(folder, name)
    (folder / "keys" / "trusted").mkdir(parents=True)
    (folder / "keys" / "trusted" / "client.pem").write_bytes((folder / "client.pem").read_bytes())
    with running("sim", slave_file(folder), "--listen-port", "0") as slave:
        file = daemon_file(folder, port_in(slave), HISTORY_AND_ALARM, PATIENT)
        file.write_text(file.read_text().replace("2e-3", "10e-3"))
        with running("run", file) as daemon:
            port = port_in(daemon)
            served = folder / "opcua.toml"
            served.write_text(file.read_text().replace("[supervisory]\nport = 0", f"[supervisory]\nport = {port}"))
            options = ("--users", str(folder / "users.json"), "--keys", str(folder / "keys"), "--listen-port", "0")
            with child("opcua", served, *options) as (process, first):
                assert first.endswith("made; clients are to trust it"), first
                yield Site(folder, process.line().rpartition(" on ")[2], port)


@pytest.mark.parametrize("policy", [SecurityPolicyBasic256Sha256, SecurityPolicyAes256Sha256RsaPss])
def test_an_observer_sees_the_valve_and_writes_nothing(site: Site, policy: type) -> None:
    async def look(valve: Nodes) -> None:
        assert await valve(SIGNAL).read_value() == pytest.approx(0.03 / 0.1016 * 100, abs=1)
        assert await valve("DeviceHealth").read_value() == 2, "function check, in DI's numbers"
        assert await valve("AssetId").read_value() == "FV-101"
        for node, value in ((SETPOINT, 40.0), ("AssetId", "other"), ("Wear.Friction", 1.0)):
            with pytest.raises(ua.UaStatusCodeError) as refusal:
                await valve(node).write_value(ua.Variant(value))
            assert refusal.value.code in (ua.StatusCodes.BadUserAccessDenied, ua.StatusCodes.BadNotWritable)
        with pytest.raises(ua.uaerrors.BadUserAccessDenied):
            await valve.call("Identify")

    site.seen("observer", look, policy=policy)


@pytest.mark.parametrize(
    ("asked_ms", "served_ms"),
    [(0.0, 100.0), (-1.0, 100.0), (1e-3, 100.0), (float("nan"), 100.0), (1e300, 3.6e6), (500.0, 500.0)],
)
def test_a_subscription_is_served_as_often_as_it_can_be(site: Site, asked_ms: float, served_ms: float) -> None:
    """One of a microsecond took two thirds of a processor, and one of 0 was never told that the server is alive."""

    async def look(valve: Nodes) -> Any:
        asked = ua.CreateSubscriptionParameters(asked_ms, RequestedMaxKeepAliveCount=1)
        alive = asyncio.Event()
        subscribed = await valve.client.uaclient.create_subscription(asked, lambda _: alive.set())
        await alive.wait()
        return subscribed.RevisedPublishingInterval

    assert site.seen("observer", look) == served_ms


def test_an_operator_moves_the_valve_and_identifies_nothing(site: Site) -> None:
    async def look(valve: Nodes) -> None:
        await valve(SETPOINT).write_value(ua.Variant(41.0, ua.VariantType.Float))
        with pytest.raises(ua.uaerrors.BadOutOfRange):
            await valve(SETPOINT).write_value(ua.Variant(141.0, ua.VariantType.Float))
        with pytest.raises(ua.uaerrors.BadOutOfRange):
            await valve(SETPOINT).write_value(ua.Variant("half", ua.VariantType.String))
        # What the client itself says to be bad, or uncertain, as a broker that lost its source, moves nothing.
        for doubt in (ua.StatusCodes.BadSensorFailure, ua.StatusCodes.UncertainLastUsableValue):
            value = ua.DataValue(ua.Variant(77.0, ua.VariantType.Float), ua.StatusCode(doubt))
            with pytest.raises(ua.uaerrors.BadWriteNotSupported):
                await valve(SETPOINT).write_attribute(ua.AttributeIds.Value, value)
        assert await valve.call("Acknowledge") == [True, "acknowledged, no fault is latched any more"]
        with pytest.raises(ua.uaerrors.BadUserAccessDenied):
            await valve.call(ADJUST, "SignalSet.Position", START)

    site.seen("operator", look)
    with Dcs("127.0.0.1", site.daemon_port) as dcs:
        assert dcs.get("reference") == pytest.approx(0.41)
    for got in ("141", "'half'"):
        said = f"(operator) set point refused: set point: allowed is 0 to 100 %, got {got}"
        assert any(line.rstrip().endswith(said) for line in site.log()), got


@pytest.mark.parametrize("of_the_server", [False, True])
def test_who_subscribes_is_told_each_event_once_with_kind_cause_and_severity(site: Site, of_the_server: bool) -> None:
    async def look(valve: Nodes) -> list[Any]:
        told: asyncio.Queue[Any] = asyncio.Queue()

        class Handler:
            def event_notification(self, event: Any) -> None:
                if event.Kind == "MODE" or event.Kind.startswith("ALARM"):
                    told.put_nowait(event)

        types = await valve.client.get_node(ua.ObjectIds.BaseEventType).get_children()
        (kind,) = [each for each in types if (await each.read_browse_name()).Name == "ValveEventType"]
        subscription = await valve.client.create_subscription(100, Handler())
        source = valve.client.nodes.server if of_the_server else valve()
        await subscription.subscribe_events(source, kind)
        with Dcs("127.0.0.1", site.daemon_port) as dcs:
            writes = (
                {"mode": Mode.MANUAL},
                {"manual_pressure": 85e3},
                {"alarm_acknowledge": Ne107Cause.HIGH},
                {"manual_pressure": 0.0},
                {"mode": Mode.HOLD},
            )
            events = []
            for write in writes:
                await asyncio.to_thread(dcs.set_all, write)
                events.append(await asyncio.wait_for(told.get(), 20))
        return events

    events = site.seen("observer", look)
    assert [(each.Kind, each.Cause) for each in events] == [
        ("MODE", Mode.MANUAL),
        ("ALARM_RAISED", Ne107Cause.HIGH),
        ("ALARM_ACKNOWLEDGED", Ne107Cause.HIGH),
        ("ALARM_RETURNED", Ne107Cause.HIGH),
        ("MODE", Mode.HOLD),
    ]
    first = events[0]
    assert [each.Severity for each in events] == [400, 300, 100, 100, 400]
    assert sorted(each.Number for each in events) == [each.Number for each in events]
    assert first.SourceName == "FV-101"
    assert "mode" in first.Message.Text


def test_an_engineer_is_told_why_nothing_is_identified(site: Site) -> None:
    async def look(valve: Nodes) -> None:
        done, text = await valve.call("Identify")
        assert not done
        assert text.startswith("the mode is not automatic")
        with pytest.raises(ua.uaerrors.BadInvalidState):
            await valve.call(ADJUST, "SignalSet.Position", START)

    site.seen("engineer", look)


def test_the_history_is_the_daemons(site: Site) -> None:
    async def look(valve: Nodes) -> None:
        since, until = datetime(2001, 1, 1, tzinfo=UTC), datetime(2100, 1, 1, tzinfo=UTC)
        events = await valve().read_event_history(since, until, evtypes=[await event_type(valve)])
        assert events[0].Kind == "STARTED"
        assert events[0].SourceName == "FV-101"
        assert [each.Number for each in events] == list(range(1, len(events) + 1))
        newest = await valve().read_event_history(until, since, numvalues=1, evtypes=[await event_type(valve)])
        assert [each.Number for each in newest] == [len(events)]
        (health,) = await valve("DeviceHealth").read_raw_history(since, until)
        assert health.Value.Value == 2
        with pytest.raises(ua.UaStatusCodeError):
            await valve("Status.Mode").read_raw_history(since, until)

    async def event_type(valve: Nodes) -> Node:
        base = valve.client.nodes.base_event_type
        return await base.get_child(ua.QualifiedName("ValveEventType", valve.index))

    site.seen("observer", look)


async def nothing(_valve: Nodes) -> None:
    return None


@pytest.mark.parametrize(
    ("user", "name", "password", "said"),
    [
        ("engineer", "stranger", SECRET + "engineer", "stranger: its certificate is not trusted; it is rejected/"),
        ("engineer", "client", "a wrong password", "wrong password"),
        ("admin", "client", "a wrong password", "wrong password"),
        ("", "client", "", "it asked to come in by other means than a password"),
    ],
)
def test_who_is_turned_away_is_one_line_and_the_others_go_on(
    site: Site, user: str, name: str, password: str, said: str
) -> None:
    before = len(site.log())
    with pytest.raises((ua.UaStatusCodeError, ConnectionError)):
        site.seen(user, nothing, name=name, password=password)
    (line,) = site.log()[before:]
    assert f"turned away: {said}" in line
    site.seen("observer", nothing)
    assert len(site.log()) == before + 1


def test_what_was_rejected_is_kept_for_who_may_trust_it(site: Site) -> None:
    with pytest.raises((ua.UaStatusCodeError, ConnectionError)):
        site.seen("observer", nothing, name="stranger")
    (kept,) = (site.folder / "keys" / "rejected").iterdir()
    mine = x509.load_pem_x509_certificate((site.folder / "stranger.pem").read_bytes())
    assert x509.load_der_x509_certificate(kept.read_bytes()) == mine


@asynccontextmanager
async def in_the_clear(site: Site) -> AsyncIterator[UaClient]:
    """Open a channel without security, as whoever looks for endpoints does."""
    client = UaClient(30)
    host, _, port = site.url.removeprefix("opc.tcp://").partition(":")
    await client.connect_socket(host, int(port))
    try:
        await client.send_hello(site.url)
        opening = ua.OpenSecureChannelParameters()
        opening.RequestedLifetime = 60_000
        opening.SecurityMode = ua.MessageSecurityMode.None_
        opening.RequestType = ua.SecurityTokenRequestType.Issue
        opening.ClientNonce = b""
        await client.open_secure_channel(opening)
        yield client
    finally:
        client.disconnect_socket()


def test_the_right_password_on_a_channel_in_the_clear_is_turned_away(site: Site) -> None:
    """asyncua 2.1 takes it, and asks nothing further of such a session."""

    async def come_in() -> None:
        async with in_the_clear(site) as client:
            asked = ua.CreateSessionParameters()
            asked.EndpointUrl, asked.SessionName, asked.RequestedSessionTimeout = site.url, "clear", 60_000.0
            await client.create_session(asked)
            user = ua.ActivateSessionParameters()
            user.UserIdentityToken = ua.UserNameIdentityToken(
                PolicyId="username", UserName="engineer", Password=f"{SECRET}engineer".encode()
            )
            await client.activate_session(user)

    before = len(site.log())
    with pytest.raises(ua.uaerrors.BadSecurityModeInsufficient):
        asyncio.run(asyncio.wait_for(come_in(), 60))
    (line,) = site.log()[before:]
    assert line.endswith("turned away: its channel is not encrypted")


def test_no_session_is_taken_over_by_who_guesses_its_number(site: Site) -> None:
    """asyncua 2.1 numbers sessions from 1001 on and gives one to a channel that names its number."""

    async def take_over() -> list[str]:
        answers: list[str] = []
        async with site.client("engineer"):
            for number in range(1000, 1040):
                async with in_the_clear(site) as thief:
                    assert thief.protocol is not None
                    thief.protocol.authentication_token = ua.NodeId(number)
                    wrong = ua.ActivateSessionParameters()
                    wrong.UserIdentityToken = ua.AnonymousIdentityToken()
                    for asked in (thief.activate_session(wrong), Node(thief, ua.NodeId(2255)).read_value()):
                        try:
                            answers.append(f"taken: {await asked}")
                        except (ua.UaError, ConnectionError):
                            answers.append("refused")
        return answers

    answers = asyncio.run(asyncio.wait_for(take_over(), 120))
    assert len(answers) == 80
    assert set(answers) == {"refused"}


@pytest.mark.parametrize(
    ("words", "spoil", "said"),
    [
        ([], "", "--users: is needed"),
        (["--users", "users.json"], "", "--keys: is needed"),
        (["--users", "nowhere.json", "--keys", "keys"], "", "nowhere.json: cannot be read"),
        (["--users", "users.json", "--keys", "keys"], "own.pem", "own.pem: is no certificate in PEM or DER form"),
        (["--users", "users.json", "--keys", "keys"], "own.key", "own.key: is no private key in PEM form"),
        (["--users", "users.json", "--keys", "keys", "--listen-port", "99999"], "", "--listen-port: must lie between"),
    ],
)
def test_bad_input_is_one_line(
    words: list[str],
    spoil: str,
    said: str,
    site: Site,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("own.pem", "own.key"):
        (tmp_path / "keys").mkdir(exist_ok=True)
        text = (site.folder / "keys" / name).read_text()
        (tmp_path / "keys" / name).write_text("spoilt" if name == spoil else text)
    (tmp_path / "users.json").write_text((site.folder / "users.json").read_text())
    assert main(["opcua", str(site.folder / "opcua.toml"), *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_wrong_word_for_a_user_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "users.json"
    file.write_text(json.dumps({"admin": {"salt": "00", "digest": "00"}}))
    assert main(["opcua", "daemon.toml", "--users", str(file), "--keys", str(tmp_path / "keys")]) == 2
    assert "role: allowed are observer, operator, engineer, got admin" in capsys.readouterr().err
