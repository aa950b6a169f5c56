"""Certificates for tests of Modbus/TCP Security: made once, in a folder that goes away."""

import atexit
import shutil
import tempfile
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path

from config.roles import Role
from config.tls_table import Tls
from positioner.cli.parts.authority import Authority, Owner

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


def tls(name: str, authority: str = "authority", handshake_timeout_s: float = 5.0) -> Tls:
    """Return the table of an end that shows a certificate and trusts an authority."""
    made = folder()
    return Tls(
        authority=made / f"{authority}.pem",
        certificate=made / f"{name}.pem",
        key=made / f"{name}.key",
        handshake_timeout_s=handshake_timeout_s,
    )
