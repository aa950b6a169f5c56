"""Sessions: on an encrypted channel, of an application that is trusted, of a user with a password; what these may do.

asyncua itself lets less secure ones in, so this asks again at the one door that each session passes, its activation.
For it opens channels without security for whoever looks for endpoints, and takes sessions on them; it checks a
certificate only where the client sends it a second time; it gives a session to whoever guesses its number.
What is written and called never reaches its address space: `ValveDesk` answers.
"""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any

from asyncua import ua
from asyncua.common.utils import ServiceError
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.internal_server import InternalServer
from asyncua.server.internal_session import InternalSession
from cryptography import x509

from config.passwords import SignIn
from config.roles import Role
from northbound.opcua.application_keys import ApplicationKeys, Refusal, uris_in
from northbound.opcua.valve_desk import Answer

NOBODY = User(role=UserRole.Anonymous)
PUBLISHED_WITHIN_MS = (100.0, 3_600_000.0)
"""How often a subscription may be served: values change four times a second."""
Write = Callable[[Role, object], Awaitable[Answer]]
Method = Callable[[Role, list[object]], Awaitable[Answer]]


@dataclass(slots=True)
class Door:
    """Who comes in, and what they find to write and to call.

    Args:
        keys: whom it trusts.
        sign_in: the passwords of the roles; a user is called as a role is.
        say: takes a line about who was turned away, or what was refused.
    """

    keys: ApplicationKeys
    sign_in: SignIn
    say: Callable[[str], None]
    writes: dict[ua.NodeId, Write] = field(default_factory=dict)
    methods: dict[tuple[ua.NodeId, ua.NodeId], tuple[Method, bool]] = field(default_factory=dict)
    """By object and method; and whether it returns what became of it."""
    refused: str = ""
    """Why the last user was turned away."""

    def get_user(
        self, _server: InternalServer, username: str | None = None, password: str | None = None, **_other: object
    ) -> User | None:
        """Return who it is, None if that is nobody: asked by asyncua."""
        name = username or ""
        self.refused = self.sign_in.refused(name, password or "")
        return None if self.refused else User(role=UserRole.User, name=name)

    def turn_away(self, peer: object, refusal: Refusal) -> ServiceError:
        """Return what turns a client away, said in one line."""
        self.say(f"{_address(peer)} turned away: {refusal.text}")
        return ServiceError(getattr(ua.StatusCodes, refusal.status))


class GuardedServer(InternalServer):  # type: ignore[misc]  # asyncua's types are skipped, see pyproject.toml
    """asyncua's, with guarded sessions."""

    def __init__(self, door: Door) -> None:
        super().__init__(user_manager=door)
        self.door = door
        self.certificate_validator = self._require_own_uri

    def create_session(self, name: str, user: User = NOBODY, external: bool = False) -> InternalSession:
        """Return a session of a client, or an inner one."""
        if not external:
            return super().create_session(name, user, external)
        return GuardedSession(self, self.aspace, self.subscription_service, name, user=user, external=True)

    def lookup_external_session(self, auth_token: ua.NodeId) -> None:
        """Return none: a session ends with its connection."""

    def register_server(self, *_what: object) -> None:
        """Refuse: this is no register of servers."""
        raise ServiceError(ua.StatusCodes.BadServiceUnsupported)

    async def _require_own_uri(self, certificate: x509.Certificate, description: ua.ApplicationDescription) -> None:
        """Require that the certificate is the application's that it says it is."""
        if refusal := self.door.keys.refusal(certificate):
            raise self.door.turn_away("client", refusal)
        if description.ApplicationUri not in uris_in(certificate):
            named = ", ".join(uris_in(certificate)) or "nobody"
            said = f"its certificate names {named}, it says {description.ApplicationUri}"
            raise self.door.turn_away("client", Refusal("BadCertificateUriInvalid", said))


class GuardedSession(InternalSession):  # type: ignore[misc]  # the same
    """Of one client."""

    iserver: GuardedServer

    def activate_session(self, params: ua.ActivateSessionParameters, peer_certificate: bytes | None) -> Any:
        """Let a user in.

        Raises:
            ServiceError: the channel is not encrypted, the application not trusted, or the password wrong.
        """
        door = self.iserver.door
        if not peer_certificate:
            refusal = Refusal("BadSecurityModeInsufficient", "its channel is not encrypted")
            raise door.turn_away(self.name, refusal)
        if refused := door.keys.refusal(x509.load_der_x509_certificate(peer_certificate)):
            raise door.turn_away(self.name, refused)
        door.refused = "it asked to come in by other means than a password"
        try:
            return super().activate_session(params, peer_certificate)
        except ServiceError as error:
            door.say(f"{_address(self.name)} turned away: {door.refused or 'its session is over'}")
            raise error from None

    @property
    def role(self) -> Role:
        """What its user may do."""
        return Role[(self.user.name or "none").upper()]

    async def create_subscription(
        self, params: ua.CreateSubscriptionParameters, *calls_back: Any, **named: Any
    ) -> ua.CreateSubscriptionResult:
        """Subscribe, as often as it can be served.

        asyncua takes any interval: of a microsecond it takes the processor, of 0 it never says that it is alive.
        """
        least_ms, most_ms = PUBLISHED_WITHIN_MS
        asked_ms = min(params.RequestedPublishingInterval, most_ms)
        params.RequestedPublishingInterval = max(least_ms, asked_ms)  # in this order the least where none is a number
        return await super().create_subscription(params, *calls_back, **named)

    async def write(self, params: ua.WriteParameters) -> list[ua.StatusCode]:
        """Write the set points among them; nothing else can be written."""
        return [await self._write_one(each) for each in params.NodesToWrite]

    async def _write_one(self, asked: ua.WriteValue) -> ua.StatusCode:
        write = self.iserver.door.writes.get(asked.NodeId)
        if write is None or asked.AttributeId != ua.AttributeIds.Value:
            return ua.StatusCode(ua.StatusCodes.BadNotWritable)
        sent, quality = asked.Value.Value, asked.Value.StatusCode
        if quality is not None and not quality.is_good():
            # A value that its own client takes for bad or uncertain is nothing to move a valve by.
            doubtful = Answer("BadWriteNotSupported", f"only a good value is taken, its status was {quality.name}")
            return self._status(doubtful, "set point")
        return self._status(await write(self.role, None if sent is None else sent.Value), "set point")

    async def call(self, params: list[ua.CallMethodRequest]) -> list[ua.CallMethodResult]:
        """Call methods of valves; those of the server itself as asyncua has them."""
        return [await self._call_one(each) for each in params]

    async def _call_one(self, asked: ua.CallMethodRequest) -> ua.CallMethodResult:
        found = self.iserver.door.methods.get((asked.ObjectId, asked.MethodId))
        if found is None:
            return (await super().call([asked]))[0]
        method, returns = found
        values = [each.Value for each in asked.InputArguments or []]
        answer = await method(self.role, values)
        result = ua.CallMethodResult()
        status = self._status(answer, "call")
        refused = answer.status not in ("Good", "BadInvalidState")
        # A method that returns what became of it says by that, not by a status, that the valve is not as it must be.
        result.StatusCode = status if refused or not returns else ua.StatusCode()
        if returns and not refused:
            result.OutputArguments = [
                ua.Variant(answer.done, ua.VariantType.Boolean), ua.Variant(answer.text, ua.VariantType.String)
            ]  # fmt: skip
        result.InputArgumentResults = [ua.StatusCode() for _ in values]
        return result

    def _status(self, answer: Answer, what: str) -> ua.StatusCode:
        if not answer.done:
            self.iserver.door.say(f"{_address(self.name)} ({self.role.name.lower()}) {what} refused: {answer.text}")
        return ua.StatusCode(getattr(ua.StatusCodes, answer.status))


def _address(peer: object) -> str:
    return f"{peer[0]}:{peer[1]}" if isinstance(peer, tuple) and len(peer) >= 2 else str(peer)
