"""Who a client is, and what its role permits (Modbus/TCP Security).

The client's certificate names its role in the extension 1.3.6.1.4.1.50316.802.1 (a UTF8String: observer, operator or
engineer). What the role does not permit, by the table of `config.registers`, is refused with exception 1, as the
protocol has it, and one line in the log.
"""

import errno
import math
import struct
from collections.abc import Callable
from dataclasses import dataclass

from config.roles import Role

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
    serial: int = 0
    """Its number, by which it may be revoked."""

    def __str__(self) -> str:
        return f"{self.name} ({self.role.name.lower()})"


NOBODY = Identity("nobody", Role.NONE)


class NotAuthorized(Exception):
    """A request that the client's role does not permit; the text says which role does."""


def authorize(identity: Identity, pdu: bytes, writers: Writers) -> None:
    """Check that a client's role permits a request (MODBUS/TCP Security Protocol Specification, section 8.3).

    Raises:
        NotAuthorized: it needs a higher role, that of the highest register written.
    """
    first, count = _written_range(pdu)
    needed = max((writers(address) for address in range(first, first + count)), default=Role.OBSERVER)
    if identity.role < needed:
        raise NotAuthorized(f"function {pdu[0]} needs the role {needed.name.lower()}")


def identity_in(certificate: bytes) -> Identity:
    """Return who a certificate (DER) says its owner is.

    Raises:
        ConnectionAbortedError: it cannot be read, though an authority has signed it.
    """
    from cryptography import x509
    from cryptography.exceptions import UnsupportedAlgorithm

    unreadable = (ValueError, TypeError, UnsupportedAlgorithm, x509.InvalidVersion, x509.DuplicateExtension)
    try:
        return _identity_in(certificate)
    except (*unreadable, x509.UnsupportedGeneralNameType):
        raise ConnectionAbortedError(errno.ECONNABORTED, "its certificate cannot be read") from None


def _identity_in(certificate: bytes) -> Identity:
    from cryptography import x509

    parsed = x509.load_der_x509_certificate(certificate)
    names = parsed.subject.get_attributes_for_oid(x509.NameOID.COMMON_NAME)
    name = str(names[0].value) if names else "nameless"
    until_s = parsed.not_valid_after_utc.timestamp()
    for extension in parsed.extensions:
        if extension.oid.dotted_string == ROLE_OID and isinstance(extension.value, x509.UnrecognizedExtension):
            return Identity(name, role_in(extension.value.value), until_s, parsed.serial_number)
    return Identity(name, Role.NONE, until_s, parsed.serial_number)


def role_extension(role: Role) -> bytes:
    """Return a role as the extension's value (DER)."""
    text = role.name.lower().encode()
    return bytes((_UTF8_STRING, len(text))) + text


def role_in(value: bytes) -> Role:
    """Return the role that an extension's value names; NONE of any other."""
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
