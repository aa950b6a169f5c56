"""Certificates for tests of Modbus/TCP Security: made once, in a folder that goes away."""

import atexit
import shutil
import tempfile
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path

from config.roles import Role
from config.tls_table import Tls
from positioner.cli.parts.trial_authority import Authority, Owner

HERE = ("127.0.0.1",)
LONG_AGO = datetime.now(UTC) - timedelta(days=100)


@cache
def folder() -> Path:
    """Return the folder with certificates of one authority, and in `other` those of another."""
    made = Path(tempfile.mkdtemp(prefix="certificates-"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    authority = Authority(made, days=30)
    authority.sign(Owner("device", HERE))
    authority.sign(Owner("elsewhere", ("192.0.2.7", "valve-8"), Role.OPERATOR))
    authority.sign(Owner("daemon", HERE, Role.OPERATOR))
    authority.sign(Owner("outdated", HERE, Role.OPERATOR), since=LONG_AGO)
    authority.sign(Owner("nobody", HERE))
    for role in (Role.OBSERVER, Role.OPERATOR, Role.ENGINEER):
        authority.sign(Owner(role.name.lower(), (), role))
    (made / "other").mkdir()
    other = Authority(made / "other", days=30)
    other.sign(Owner("daemon", HERE, Role.OPERATOR))
    return made


def revoke(path: Path, *names: str, days: float = 30.0) -> None:
    """Write the authority's list of certificates that it has taken back."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    now = datetime.now(UTC)
    key = serialization.load_pem_private_key((folder() / "authority.key").read_bytes(), None)
    assert isinstance(key, ec.EllipticCurvePrivateKey)
    issuer = x509.load_pem_x509_certificate((folder() / "authority.pem").read_bytes()).subject
    built = x509.CertificateRevocationListBuilder().issuer_name(issuer)
    built = built.last_update(now - timedelta(days=60)).next_update(now + timedelta(days=days))
    for name in names:
        number = x509.load_pem_x509_certificate((folder() / f"{name}.pem").read_bytes()).serial_number
        one = x509.RevokedCertificateBuilder().serial_number(number).revocation_date(now)
        built = built.add_revoked_certificate(one.build())
    path.write_bytes(built.sign(key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM))


def tls(name: str, authority: str = "authority", handshake_timeout_s: float = 5.0) -> Tls:
    """Return the table of an end that shows a certificate and trusts an authority."""
    made = folder()
    return Tls(
        authority=made / f"{authority}.pem",
        certificate=made / f"{name}.pem",
        key=made / f"{name}.key",
        handshake_timeout_s=handshake_timeout_s,
    )
