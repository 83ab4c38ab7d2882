"""Certificates and keys of OPC UA from their files, whether these are PEM or DER and whatever they are called."""

from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.rsa import RSAPrivateKey

from faultbond.errors import FaultbondError

PEM = b"-----BEGIN"


@dataclass(frozen=True, slots=True, kw_only=True)
class OpcUaIdentity:
    """By what we are known. certificate, key: DER. name: of our application as the certificate has it, or empty."""

    certificate: bytes
    key: bytes
    name: str


def read_identity(certificate: str, key: str) -> OpcUaIdentity:
    """Give by what we are known, of two files.

    Raises
    ------
    FaultbondError
        Where a file cannot be read or is none of its kind, or the two do not belong together.
    """
    shown, own = _certificate(certificate), _key(key)
    if shown.public_key() != own.public_key():
        raise FaultbondError(f"certificate {certificate} and key {key} do not belong together.")
    return OpcUaIdentity(
        certificate=shown.public_bytes(serialization.Encoding.DER),
        key=own.private_bytes(
            serialization.Encoding.DER, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        ),
        name=_application(shown),
    )


def certificate_of(file: str) -> bytes:
    """Give the certificate of a file, DER.

    Raises
    ------
    FaultbondError
        Where it cannot be read or is none.
    """
    return _certificate(file).public_bytes(serialization.Encoding.DER)


def _certificate(file: str) -> x509.Certificate:
    data = _bytes(file)
    try:
        return x509.load_pem_x509_certificate(data) if PEM in data else x509.load_der_x509_certificate(data)
    except ValueError as error:
        raise FaultbondError(f"{file}: this is no certificate, in PEM or DER.") from error


def _key(file: str) -> RSAPrivateKey:
    data = _bytes(file)
    try:
        load = serialization.load_pem_private_key if PEM in data else serialization.load_der_private_key
        found = load(data, password=None)
    except (ValueError, TypeError) as error:
        told = f"{file}: this is no key, in PEM or DER, or it has a passphrase. Give one without."
        raise FaultbondError(told) from error
    if not isinstance(found, RSAPrivateKey):
        raise FaultbondError(f"{file}: this is no RSA key, as OPC UA wants it.")
    return found


def _bytes(file: str) -> bytes:
    try:
        return Path(file).read_bytes()
    except OSError as error:
        raise FaultbondError(f"{file}: cannot be read: {error.strerror or error}.") from error


def _application(certificate: x509.Certificate) -> str:
    """Give what a certificate calls its application, by which servers know it; empty where it does not say."""
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (ValueError, x509.ExtensionNotFound):
        return ""
    return next(iter(names.get_values_for_type(x509.UniformResourceIdentifier)), "")
