"""Modbus/TCP Security: mutual TLS round Modbus TCP, and roles from certificates.

Both ends show a certificate that the other's authority has signed; the client also checks that the server's was made
for the host it called. TLS 1.2 or newer, by the standard library. Who a client is, and what it may: `client_roles.py`.

A server reads its files anew when they change: certificates are replaced, and revoked, without a restart. A session
ends with its certificate, and when that is revoked. Of files that do not fit the log tells, and those before stay.
"""

import logging
import re
import socket
import ssl
import stat
import time
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from config.errors import InputError, explain_failure
from config.tls_table import Tls
from fieldbus.modbus.client_roles import Identity, Writers, authorize, identity_in

log = logging.getLogger(__name__)

LOOK_EVERY_S = 1.0
"""How often a server looks whether its files have changed, while somebody asks for something."""
PEM_LIST = re.compile(rb"-----BEGIN X509 CRL-----.*?-----END X509 CRL-----\n?", re.DOTALL)
HUNG_UP = ssl.SSLEOFError, ssl.SSLZeroReturnError, ssl.SSLSyscallError
"""What OpenSSL raises, by the moment, where the other end is gone; the last two give no reason."""


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
    if isinstance(error, HUNG_UP):
        return "hung up in the TLS handshake"
    if isinstance(error, ssl.SSLError):
        return f"TLS: {(error.reason or 'failed').lower().replace('_', ' ')}"
    return error.strerror or "the connection failed"


def expiry(tls: Tls) -> datetime:
    """Return when the first of an end's certificate, its authority's and its list of revoked ones ends.

    Raises:
        InputError: a file that is not there or does not fit, or the package `cryptography` is missing.
    """
    _require_cryptography(tls)
    client_context(tls)
    ends = [end for file in (tls.authority, tls.certificate) for end in _ends_of_certificates(file)]
    return min(ends if tls.revoked is None else [*ends, *_ends_of_lists(tls.revoked)])


def _ends_of_certificates(file: Path) -> list[datetime]:
    from cryptography import x509

    try:
        return [each.not_valid_after_utc for each in x509.load_pem_x509_certificates(file.read_bytes())]
    except (ValueError, TypeError, x509.InvalidVersion):  # OpenSSL, which has taken it, reads less of it
        raise InputError(str(file), "holds a certificate that cannot be read") from None


def _ends_of_lists(file: Path) -> list[datetime]:
    from cryptography import x509

    try:
        lists = [x509.load_pem_x509_crl(each) for each in PEM_LIST.findall(file.read_bytes())]
        return [end for each in lists if (end := each.next_update_utc) is not None]
    except (ValueError, TypeError, x509.InvalidVersion):
        raise InputError(str(file), "holds a list of revoked certificates that cannot be read") from None


class AcceptedSocket(ssl.SSLSocket):
    """The TLS socket of an accepted connection: it was connected, even where its peer has reset it by now.

    The module ssl asks for the peer's address to find out whether a socket is connected. It leaves one open that is
    reset at that moment. Here the handshake finds it out.
    """

    def getpeername(self) -> Any:
        """Return the peer's address; None of one that has reset the connection."""
        with suppress(OSError):
            return super().getpeername()
        return None


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
        self._tls = tls
        self._writers = writers
        self._stamps = _stamps(tls)
        self._looked_s = time.monotonic()
        self._context, self._revoked = _server_context(tls), _revoked_numbers(tls)

    def wrap(self, connection: socket.socket) -> ssl.SSLSocket:
        """Return an accepted connection as a TLS socket, before its `handshake`, which finds out whether it is gone."""
        self._look_for_changes()
        return self._context.wrap_socket(connection, server_side=True, do_handshake_on_connect=False)

    def handshake(self, connection: ssl.SSLSocket) -> Identity:
        """Do the TLS handshake and return who the client is. Blocks its thread for the handshake time-out at most.

        Raises:
            OSError: no handshake; `failure_reason` puts it in words.
        """
        connection.settimeout(self._tls.handshake_timeout_s)
        connection.do_handshake()
        certificate = connection.getpeercert(binary_form=True)
        assert certificate is not None  # CERT_REQUIRED
        return identity_in(certificate)

    def ending(self, identity: Identity) -> str | None:
        """Return why a session is over, None while it may go on."""
        self._look_for_changes()
        if identity.until_s < time.time():
            return "its certificate has ended"
        return "its certificate is revoked" if identity.serial in self._revoked else None

    def _look_for_changes(self) -> None:
        """Read the files anew if one has changed. What is read is replaced whole: any thread may look."""
        now_s = time.monotonic()
        if now_s - self._looked_s < LOOK_EVERY_S:
            return
        self._looked_s = now_s
        if (stamps := _stamps(self._tls)) == self._stamps:
            return
        self._stamps = stamps
        try:
            self._context, self._revoked = _server_context(self._tls), _revoked_numbers(self._tls)
        except InputError as error:
            log.error("certificates have changed, those before stay in use: %s", error)
            return
        log.info("certificates have changed and are in use")

    def authorize(self, identity: Identity, pdu: bytes) -> None:
        """Check that a client's role permits a request.

        Raises:
            NotAuthorized: it needs a higher role.
        """
        authorize(identity, pdu, self._writers)


def _server_context(tls: Tls) -> ssl.SSLContext:
    context = _context(tls, ssl.PROTOCOL_TLS_SERVER)
    context.verify_mode = ssl.CERT_REQUIRED
    context.num_tickets = 0  # every connection shows its certificate
    context.sslsocket_class = AcceptedSocket
    return context


def _files(tls: Tls) -> list[Path]:
    return [tls.authority, tls.certificate, tls.key, *([] if tls.revoked is None else [tls.revoked])]


def _stamps(tls: Tls) -> list[tuple[int, int, int] | None]:
    """Return by what a change of the files shows; None of one that is not there."""
    return [_stamp(file) for file in _files(tls)]


def _stamp(file: Path) -> tuple[int, int, int] | None:
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def _revoked_numbers(tls: Tls) -> frozenset[int]:
    """Return the numbers of the certificates that the list names; none without a list.

    Raises:
        InputError: it holds no list.
    """
    if tls.revoked is None:
        return frozenset()
    from cryptography import x509

    lists = PEM_LIST.findall(tls.revoked.read_bytes())
    try:
        return frozenset(each.serial_number for one in lists for each in x509.load_pem_x509_crl(one))
    except (ValueError, TypeError, x509.InvalidVersion):
        raise InputError(str(tls.revoked), "holds no list of revoked certificates in PEM form") from None


def _context(tls: Tls, protocol: int) -> ssl.SSLContext:
    context = ssl.SSLContext(protocol)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    for file in _files(tls):
        _require_readable(file)
    if tls.key.stat().st_mode & stat.S_IROTH:
        log.warning("%s: everybody on this machine may read the key; chmod 600 it, and have it made anew", tls.key)
    try:
        context.load_verify_locations(tls.authority)
    except ssl.SSLError:
        raise InputError(str(tls.authority), "holds no certificate in PEM form") from None
    if tls.revoked is not None:
        if not PEM_LIST.search(tls.revoked.read_bytes()):
            raise InputError(str(tls.revoked), "holds no list of revoked certificates in PEM form")
        try:
            context.load_verify_locations(tls.revoked)
        except ssl.SSLError:
            raise InputError(str(tls.revoked), "holds no list of revoked certificates in PEM form") from None
        context.verify_flags |= ssl.VERIFY_CRL_CHECK_LEAF
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
    with explain_failure(file, "cannot be read"), file.open("rb"):
        pass


def _require_cryptography(tls: Tls) -> None:
    try:
        from cryptography import x509  # noqa: F401 - now, not while the first client waits for its answer
    except ModuleNotFoundError:
        raise InputError(str(tls.certificate), "TLS needs cryptography: pip install 'positioner[tls]'") from None
