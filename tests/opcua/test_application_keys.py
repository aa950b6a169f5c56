"""Which applications are trusted: by their own certificate, or by the authority that signed it, and none besides."""

from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import NameOID

from config.errors import InputError
from northbound.opcua.application_keys import MOST_REJECTED, ApplicationKeys

NOW = datetime.now(UTC)


@cache
def private_key(whose: str, bits: int = 2048) -> rsa.RSAPrivateKey:
    return rsa.generate_private_key(65537, bits)


def signed(
    name: str,
    key: rsa.RSAPrivateKey | None = None,
    by: tuple[str, rsa.RSAPrivateKey] | None = None,
    *,
    may_sign: bool = False,
    ends: timedelta = timedelta(days=9),
) -> x509.Certificate:
    key = key or private_key("own")
    issuer, signer = by or (name, key)
    subject, other = (x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, each)]) for each in (name, issuer))
    made = x509.CertificateBuilder().subject_name(subject).issuer_name(other).public_key(key.public_key())
    made = made.serial_number(x509.random_serial_number()).not_valid_before(NOW - timedelta(days=10))
    made = made.not_valid_after(NOW + ends).add_extension(x509.BasicConstraints(may_sign, None), critical=True)
    return made.sign(signer, hashes.SHA256())


@pytest.fixture
def keys(tmp_path: Path) -> ApplicationKeys:
    return ApplicationKeys(tmp_path, "urn:here:positioner", "localhost")


def trust(keys: ApplicationKeys, certificate: x509.Certificate, encoding: Encoding = Encoding.DER) -> None:
    (keys.trusted / "it.crt").write_bytes(certificate.public_bytes(encoding))


def status(keys: ApplicationKeys, certificate: x509.Certificate) -> str:
    refusal = keys.refusal(certificate)
    return refusal.status if refusal else "taken"


@pytest.mark.parametrize("encoding", [Encoding.DER, Encoding.PEM])
def test_one_that_lies_there_is_taken_without_a_restart(keys: ApplicationKeys, encoding: Encoding) -> None:
    mine = signed("scada")
    assert status(keys, mine) == "BadCertificateUntrusted"
    trust(keys, mine, encoding)
    assert status(keys, mine) == "taken"
    assert status(keys, signed("scada")) == "BadCertificateUntrusted", "another of the same name and key"


def test_one_that_an_authority_signed_is_taken_and_one_that_a_client_signed_is_not(keys: ApplicationKeys) -> None:
    other = private_key("other")
    by_it = signed("scada", other, by=("plant", private_key("own")))
    trust(keys, signed("plant", may_sign=False))
    assert status(keys, by_it) == "BadCertificateUntrusted"
    trust(keys, signed("plant", may_sign=True))
    assert status(keys, by_it) == "taken"
    assert status(keys, signed("scada", other, by=("plant", other))) == "BadCertificateUntrusted", "a forged signature"
    trust(keys, signed("plant", may_sign=True, ends=timedelta(days=-1)))
    assert status(keys, by_it) == "BadCertificateUntrusted", "an authority that is too old"


def test_one_that_is_too_old_or_of_a_short_key_is_refused_though_it_lies_there(keys: ApplicationKeys) -> None:
    for certificate, said in (
        (signed("scada", ends=timedelta(days=-1)), "BadCertificateTimeInvalid"),
        (signed("scada", private_key("short", 1024)), "BadCertificatePolicyCheckFailed"),
    ):
        trust(keys, certificate)
        assert status(keys, certificate) == said


def test_what_is_no_certificate_among_the_trusted_lets_nobody_in(keys: ApplicationKeys) -> None:
    (keys.trusted / "it.crt").write_text("-----BEGIN CERTIFICATE-----\nspoilt\n")
    assert status(keys, signed("scada")) == "BadCertificateUntrusted"


def test_strangers_do_not_fill_the_disk(keys: ApplicationKeys) -> None:
    for _ in range(MOST_REJECTED + 5):
        assert status(keys, signed("stranger")) == "BadCertificateUntrusted"
    assert len(list(keys.rejected.iterdir())) == MOST_REJECTED


def test_its_own_is_made_once_and_only_its_owner_reads_the_key(keys: ApplicationKeys, tmp_path: Path) -> None:
    assert keys.made
    assert keys.key.stat().st_mode & 0o077 == 0
    again = ApplicationKeys(tmp_path, "urn:here:positioner", "localhost")
    assert (again.made, again.own) == (False, keys.own)
    keys.key.write_bytes(private_key("other").private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    with pytest.raises(InputError, match="is not the key of"):
        ApplicationKeys(tmp_path, "urn:here:positioner", "localhost")
