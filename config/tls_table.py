"""The tables that ask for Modbus/TCP Security: whose certificate, whose key, and who signs for the other end."""

from config.loading import NearFile, Positive, Schema


class Tls(Schema):
    """Table `[device.tls]` and the like: this end's certificate and key, and who signs for the other end."""

    authority: NearFile
    certificate: NearFile
    key: NearFile
    revoked: NearFile | None = None
    """The authority's list of certificates that it has taken back (CRL, PEM); an outdated list lets nobody in."""
    handshake_timeout_s: Positive = 0.5
