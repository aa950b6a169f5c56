"""A certificate authority for trials of Modbus/TCP Security: keys on the elliptic curve P-256, without passwords."""

import ipaddress
import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from config.roles import Role
from fieldbus.modbus.client_roles import ROLE_OID, role_extension

CLOCKS_DIFFER = timedelta(hours=1)
"""A certificate is valid this much before it is made: the clocks of its readers may be slow."""


@dataclass(frozen=True, slots=True)
class Owner:
    """Whom a certificate is made for: a server has hosts, a client has a role, and both may be."""

    name: str
    hosts: Sequence[str] = ()
    role: Role = Role.NONE


class Authority:
    """Signs certificates and writes them, each beside its key, into a folder.

    Args:
        folder: where `authority.pem` and its key go; it must be there.
        days: how long the authority and what it signs are valid.

    Raises:
        FileExistsError: there is an authority already; nothing is ever written over.
    """

    def __init__(self, folder: Path, days: float) -> None:
        self._folder = folder
        self._days = days
        self._key = ec.generate_private_key(ec.SECP256R1())
        self._name = _common_name("test authority")
        usage = x509.KeyUsage(**{each: each in ("key_cert_sign", "crl_sign") for each in _USES})
        built = (
            self._builder(self._name, self._key, datetime.now(UTC), days)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(usage, critical=True)
        )
        self._write("authority", built, self._key)

    def sign(self, owner: Owner, since: datetime | None = None) -> None:
        """Make a key and a certificate for it, `NAME.key` and `NAME.pem`.

        Raises:
            FileExistsError: there is one of that name already.
        """
        key = ec.generate_private_key(ec.SECP256R1())
        built = self._builder(_common_name(owner.name), key, since or datetime.now(UTC), self._days)
        built = built.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        if purposes := _purposes(owner):
            built = built.add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
        if owner.hosts:
            names = x509.SubjectAlternativeName([_host(each) for each in owner.hosts])
            built = built.add_extension(names, critical=False)
        if owner.role:
            role = x509.UnrecognizedExtension(x509.ObjectIdentifier(ROLE_OID), role_extension(owner.role))
            built = built.add_extension(role, critical=False)
        self._write(owner.name, built, key)

    def _builder(
        self, subject: x509.Name, key: ec.EllipticCurvePrivateKey, since: datetime, days: float
    ) -> x509.CertificateBuilder:
        public, signer = key.public_key(), self._key.public_key()
        return (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(self._name)
            .public_key(public)
            .serial_number(x509.random_serial_number())
            .not_valid_before(since - CLOCKS_DIFFER)
            .not_valid_after(since + timedelta(days=days))
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(public), critical=False)
            .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(signer), critical=False)
        )

    def _write(self, name: str, built: x509.CertificateBuilder, key: ec.EllipticCurvePrivateKey) -> None:
        certificate = built.sign(self._key, hashes.SHA256())
        secret = key.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
        _write_new(self._folder / f"{name}.key", secret, 0o600)
        _write_new(self._folder / f"{name}.pem", certificate.public_bytes(serialization.Encoding.PEM), 0o644)


_USES = (
    "digital_signature",
    "content_commitment",
    "key_encipherment",
    "data_encipherment",
    "key_agreement",
    "key_cert_sign",
    "crl_sign",
    "encipher_only",
    "decipher_only",
)


def _common_name(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


def _purposes(owner: Owner) -> list[x509.ObjectIdentifier]:
    server = [ExtendedKeyUsageOID.SERVER_AUTH] if owner.hosts else []
    return server + ([ExtendedKeyUsageOID.CLIENT_AUTH] if owner.role else [])


def _host(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _write_new(path: Path, data: bytes, mode: int) -> None:
    with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
        file.write(data)
