"""Modbus/TCP Security: mutual TLS round Modbus TCP, and roles from certificates.

Both ends show a certificate that the other's authority has signed; the client also checks that the server's was made
for the host it called. TLS 1.2 or newer, by the standard library. The client's certificate names its role in the
extension 1.3.6.1.4.1.50316.802.1 (a UTF8String: observer, operator or engineer). What the role does not permit is
refused with exception 1, as the protocol has it, and one line in the log.
"""

import math
import socket
import ssl
import struct
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from config.errors import InputError
from config.roles import Role
from config.tls_table import Tls

ROLE_OID = "1.3.6.1.4.1.50316.802.1"
_UTF8_STRING = 0x0C
MOST_WRITTEN = 123
"""Registers that one request may write."""

Writers = Callable[[int], Role]
"""From a register's address to the role that may write it."""


@dataclass(frozen=True, slots=True)
class Identity:
    """Who a verified certificate says its owner is."""

    name: str
    role: Role
    until_s: float = math.inf
    """When the certificate ends, s since 1970."""

    def __str__(self) -> str:
        return f"{self.name} ({self.role.name.lower()})"


NOBODY = Identity("nobody", Role.NONE)


def client_context(tls: Tls) -> ssl.SSLContext:
    """Return what a client needs for its connections; certificate and host name of the server are checked.

    Raises:
        InputError: a file that is not there or does not fit.
    """
    return _context(tls, ssl.PROTOCOL_TLS_CLIENT)


def failure_reason(error: OSError) -> str:
    """Return in a few words why a handshake or a secured connection failed."""
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"its certificate is not accepted: {error.verify_message.rstrip('.')}"
    if isinstance(error, TimeoutError):
        return "no TLS handshake in time"
    if isinstance(error, ssl.SSLEOFError):
        return "hung up in the TLS handshake"
    if isinstance(error, ssl.SSLError):
        return f"TLS: {(error.reason or 'failed').lower().replace('_', ' ')}"
    return error.strerror or "the connection failed"


def expiry(tls: Tls) -> datetime:
    """Return when the first of an end's certificate and its authority's ends.

    Raises:
        InputError: a file that is not there or does not fit, or the package `cryptography` is missing.
    """
    _require_cryptography(tls)
    from cryptography import x509

    client_context(tls)
    files = (tls.authority, tls.certificate)
    return min(
        each.not_valid_after_utc for file in files for each in x509.load_pem_x509_certificates(file.read_bytes())
    )


class NotAuthorized(Exception):
    """A request that the client's role does not permit; the text says which role does."""


class Guard:
    """A server's side: handshakes, and what each client may do.

    Args:
        tls: the server's certificate and key, and who signs for its clients.
        writers: which role each register needs to be written.

    Raises:
        InputError: a file that is not there or does not fit, or the package `cryptography` is missing.
    """

    def __init__(self, tls: Tls, writers: Writers) -> None:
        _require_cryptography(tls)
        self._context = _context(tls, ssl.PROTOCOL_TLS_SERVER)
        self._context.verify_mode = ssl.CERT_REQUIRED
        self._context.num_tickets = 0  # every connection shows its certificate
        self._timeout_s = tls.handshake_timeout_s
        self._writers = writers

    def wrap(self, connection: socket.socket) -> ssl.SSLSocket:
        """Return an accepted connection as a TLS socket, before its `handshake`."""
        return self._context.wrap_socket(connection, server_side=True, do_handshake_on_connect=False)

    def handshake(self, connection: ssl.SSLSocket) -> Identity:
        """Do the TLS handshake and return who the client is. Blocks its thread for the handshake time-out at most.

        Raises:
            OSError: no handshake; `failure_reason` puts it in words.
        """
        connection.settimeout(self._timeout_s)
        connection.do_handshake()
        certificate = connection.getpeercert(binary_form=True)
        assert certificate is not None  # CERT_REQUIRED
        return identity_in(certificate)

    def authorize(self, identity: Identity, pdu: bytes) -> None:
        """Check that a client's role permits a request (MODBUS/TCP Security Protocol Specification, section 8.3).

        Raises:
            NotAuthorized: it needs a higher role, that of the highest register written.
        """
        first, count = _written_range(pdu)
        needed = max((self._writers(address) for address in range(first, first + count)), default=Role.OBSERVER)
        if identity.role < needed:
            raise NotAuthorized(f"function {pdu[0]} needs the role {needed.name.lower()}")


def identity_in(certificate: bytes) -> Identity:
    """Return who a certificate (DER) says its owner is."""
    from cryptography import x509

    parsed = x509.load_der_x509_certificate(certificate)
    names = parsed.subject.get_attributes_for_oid(x509.NameOID.COMMON_NAME)
    name = str(names[0].value) if names else "nameless"
    until_s = parsed.not_valid_after_utc.timestamp()
    for extension in parsed.extensions:
        if extension.oid.dotted_string == ROLE_OID and isinstance(extension.value, x509.UnrecognizedExtension):
            return Identity(name, _role(extension.value.value), until_s)
    return Identity(name, Role.NONE, until_s)


def role_extension(role: Role) -> bytes:
    """Return a role as the extension's value (DER)."""
    text = role.name.lower().encode()
    return bytes((_UTF8_STRING, len(text))) + text


def _role(value: bytes) -> Role:
    return next((role for role in Role if role and role_extension(role) == value), Role.NONE)


def _written_range(pdu: bytes) -> tuple[int, int]:
    """Return first address and number of the registers that a request writes; 0 of them for all else.

    A count that no request may have is not walked through: the request is refused in any case.
    """
    if pdu[0] == 6 and len(pdu) >= 3:
        return int.from_bytes(pdu[1:3]), 1
    at = {16: 1, 23: 5}.get(pdu[0])
    if at is None or len(pdu) < at + 4:
        return 0, 0
    address, count = struct.unpack(">HH", pdu[at : at + 4])
    return address, min(count, MOST_WRITTEN)


def _context(tls: Tls, protocol: int) -> ssl.SSLContext:
    context = ssl.SSLContext(protocol)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    for file in (tls.authority, tls.certificate, tls.key):
        _require_readable(file)
    try:
        context.load_verify_locations(tls.authority)
    except ssl.SSLError:
        raise InputError(str(tls.authority), "holds no certificate in PEM form") from None
    try:
        # The password is never asked for on a terminal: a gateway starts without anybody there.
        context.load_cert_chain(tls.certificate, tls.key, password=b"")
    except (ssl.SSLError, ValueError) as error:
        mismatch = isinstance(error, ssl.SSLError) and error.reason == "KEY_VALUES_MISMATCH"
        problem = (
            f"is not the certificate of {tls.key}" if mismatch else f"and {tls.key} are no PEM pair without password"
        )
        raise InputError(str(tls.certificate), problem) from None
    return context


def _require_readable(file: Path) -> None:
    try:
        with file.open("rb"):
            pass
    except OSError as error:
        raise InputError(str(file), f"cannot be read: {error.strerror}") from None


def _require_cryptography(tls: Tls) -> None:
    try:
        from cryptography import x509  # noqa: F401 - now, not while the first client waits for its answer
    except ModuleNotFoundError:
        raise InputError(str(tls.certificate), "TLS needs cryptography: pip install 'positioner[tls]'") from None
