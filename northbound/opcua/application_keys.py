"""This server's certificate, and which applications it trusts: files in a folder, as plants keep them.

    own.pem, own.key    made at the first start
    trusted/            certificates (PEM, DER) of clients, or of authorities that sign theirs; read at each connection
    rejected/           those of clients that were turned away: what is moved to trusted/ is let in

A certificate is taken if it is valid now, of an RSA key of 2048 bits at least, and is in trusted/, or one there
signed it.
"""

from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from asyncua.crypto.cert_gen import dump_private_key_as_pem, generate_private_key, generate_self_signed_app_certificate
from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding, load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from config.errors import InputError, explain_failure

OWN_DAYS = 1825
LEAST_BITS = 2048
MOST_REJECTED = 20
"""Files; further ones are turned away without a trace on the disk."""
OWN_ALONE = 0o600  # the owner reads and writes


class Refusal(NamedTuple):
    """Why a certificate is not taken: a status of OPC UA by its name, and in words."""

    status: str
    text: str


class ApplicationKeys:
    """Those of one folder.

    Args:
        folder: made if need be.
        uri: the application's, which stands in its certificate.
        host: under which clients find it.

    Raises:
        InputError: the folder cannot be written, or its own certificate is damaged, too old, or another key's.
    """

    def __init__(self, folder: Path, uri: str, host: str) -> None:
        self.certificate, self.key = folder / "own.pem", folder / "own.key"
        self.trusted, self.rejected = folder / "trusted", folder / "rejected"
        self.made = False
        """Whether the certificate was made just now."""
        with explain_failure(folder, "cannot be written"):
            for each in (self.trusted, self.rejected):
                each.mkdir(parents=True, exist_ok=True)
            if not self.certificate.exists() and not self.key.exists():
                self._make(uri, host)
        self.own = self._own()

    def refusal(self, certificate: x509.Certificate) -> Refusal | None:
        """Return why a client's certificate is not taken, None where it is."""
        name = name_in(certificate)
        now = datetime.now(UTC)
        if not certificate.not_valid_before_utc <= now <= certificate.not_valid_after_utc:
            return Refusal("BadCertificateTimeInvalid", f"{name}: its certificate is not valid today")
        key = certificate.public_key()
        if not isinstance(key, rsa.RSAPublicKey) or key.key_size < LEAST_BITS:
            said = f"{name}: its certificate must be of an RSA key of {LEAST_BITS} bits at least"
            return Refusal("BadCertificatePolicyCheckFailed", said)
        if any(_vouches(each, certificate, now) for each in self._certificates()):
            return None
        where = self._put_aside(certificate)
        return Refusal("BadCertificateUntrusted", f"{name}: its certificate is not trusted{where}")

    def _make(self, uri: str, host: str) -> None:
        key = generate_private_key()
        names: list[x509.GeneralName] = [x509.UniformResourceIdentifier(uri), x509.DNSName(host)]
        made = generate_self_signed_app_certificate(
            key, "positioner", {"organizationName": "positioner"}, names, [ExtendedKeyUsageOID.SERVER_AUTH], OWN_DAYS
        )
        self.key.touch(OWN_ALONE)
        self.key.write_bytes(dump_private_key_as_pem(key))
        self.certificate.write_bytes(made.public_bytes(Encoding.PEM))
        self.made = True

    def _own(self) -> x509.Certificate:
        certificate = _read(self.certificate)
        try:
            key = load_pem_private_key(self.key.read_bytes(), None)
        except OSError as error:
            raise InputError(str(self.key), f"cannot be read: {error.strerror}") from None
        except (ValueError, TypeError):
            raise InputError(str(self.key), "is no private key in PEM form without a password") from None
        if key.public_key() != certificate.public_key():
            raise InputError(str(self.key), f"is not the key of {self.certificate}")
        if certificate.not_valid_after_utc <= datetime.now(UTC):
            raise InputError(str(self.certificate), "is too old: delete it with its key to have others made")
        return certificate

    def _certificates(self) -> list[x509.Certificate]:
        """Return those that are trusted; what is no certificate vouches for nobody."""
        found = []
        for path in sorted(self.trusted.iterdir()):
            try:
                found.append(_read(path))
            except InputError:
                continue
        return found

    def _put_aside(self, certificate: x509.Certificate) -> str:
        path = self.rejected / f"{certificate.fingerprint(hashes.SHA1()).hex()}.der"  # as OPC UA names them
        if not path.exists() and len(list(self.rejected.iterdir())) >= MOST_REJECTED:
            return ""
        path.write_bytes(certificate.public_bytes(Encoding.DER))
        return f"; it is {path.parent.name}/{path.name}: move it to {self.trusted.name}/ if it should be"


def name_in(certificate: x509.Certificate) -> str:
    """Return how its owner is called there, on one line."""
    said = [str(each.value) for each in certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)]
    return "".join(each if each.isprintable() else "?" for each in "".join(said[:1])) or "without a name"


def uris_in(certificate: x509.Certificate) -> list[str]:
    """Return the addresses of applications that it names."""
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (x509.ExtensionNotFound, ValueError):
        return []
    return names.get_values_for_type(x509.UniformResourceIdentifier)


def _read(path: Path) -> x509.Certificate:
    """Return a certificate in PEM or DER form.

    Raises:
        InputError: it cannot be read, or is none.
    """
    with explain_failure(path, "cannot be read"):
        content = path.read_bytes()
    try:
        pem = content.lstrip().startswith(b"-----")
        return x509.load_pem_x509_certificate(content) if pem else x509.load_der_x509_certificate(content)
    except ValueError:
        raise InputError(str(path), "is no certificate in PEM or DER form") from None


def _vouches(trusted: x509.Certificate, certificate: x509.Certificate, now: datetime) -> bool:
    """Return whether a trusted certificate is this one, or of the authority that signed it."""
    if trusted == certificate:
        return True
    try:
        may_sign = trusted.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
        certificate.verify_directly_issued_by(trusted)
    except (x509.ExtensionNotFound, InvalidSignature, ValueError, TypeError):
        return False
    return may_sign and trusted.not_valid_before_utc <= now <= trusted.not_valid_after_utc
