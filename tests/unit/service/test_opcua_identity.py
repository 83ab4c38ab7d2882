"""By what OPC UA knows us: files of either form under any name, and what is wrong with others."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from faultbond.errors import FaultbondError

pytest.importorskip("asyncua")

from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from arriving import tank_subscriber
from faultbond.service.sinks.opening import open_sinks
from faultbond.service.sinks.options import SinkOptions
from faultbond.service.sources.opcua_identity import certificate_of, read_identity
from faultbond.service.sources.opening import open_source
from faultbond.service.sources.options import SourceOptions

OPEN, DER, PKCS8 = serialization.NoEncryption(), serialization.Encoding.DER, serialization.PrivateFormat.PKCS8


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a certificate and its key in both forms, under names that tell nothing, and what goes with neither."""
    from asyncua.crypto import cert_gen  # noqa: PLC0415 - an extra

    folder = tmp_path_factory.mktemp("identity")
    for name in ("our", "other"):
        files = folder / f"{name}.key", folder / f"{name}.cert"
        asyncio.run(cert_gen.setup_self_signed_certificate(*files, "urn:here:us", "localhost", [], {}))
    key = serialization.load_pem_private_key((folder / "our.key").read_bytes(), None)
    shown = x509.load_der_x509_certificate((folder / "our.cert").read_bytes())
    (folder / "pem.cert").write_bytes(shown.public_bytes(serialization.Encoding.PEM))
    (folder / "der.pem").write_bytes(shown.public_bytes(DER))
    (folder / "der.key").write_bytes(key.private_bytes(DER, PKCS8, OPEN))
    closed = serialization.BestAvailableEncryption(b"sesame")
    (folder / "closed.key").write_bytes(key.private_bytes(serialization.Encoding.PEM, PKCS8, closed))
    curve = ec.generate_private_key(ec.SECP256R1())
    (folder / "curve.key").write_bytes(curve.private_bytes(serialization.Encoding.PEM, PKCS8, OPEN))
    return folder


@pytest.mark.parametrize("certificate", ["our.cert", "pem.cert", "der.pem"])
@pytest.mark.parametrize("key", ["our.key", "der.key"])
def test_the_form_of_a_file_is_seen_in_it(made: Path, certificate: str, key: str) -> None:
    """Whatever its name ends in; all forms are the same identity."""
    found = read_identity(str(made / certificate), str(made / key))
    assert found.name == "urn:here:us"
    assert found.certificate == (made / "our.cert").read_bytes() == certificate_of(str(made / certificate))
    assert found.key == (made / "der.key").read_bytes()


@pytest.mark.parametrize(
    ("certificate", "key", "told"),
    [
        ("absent", "our.key", "FOLDER/absent: cannot be read: No such file or directory."),
        ("our.cert", "absent", "FOLDER/absent: cannot be read: No such file or directory."),
        ("our.key", "our.key", "FOLDER/our.key: this is no certificate, in PEM or DER."),
        ("our.cert", "our.cert", "FOLDER/our.cert: this is no key, in PEM or DER, or it has a passphrase. Give one"),
        ("our.cert", "closed.key", "FOLDER/closed.key: this is no key, in PEM or DER, or it has a passphrase. Give"),
        ("our.cert", "curve.key", "FOLDER/curve.key: this is no RSA key, as OPC UA wants it."),
        ("our.cert", "other.key", "certificate FOLDER/our.cert and key FOLDER/other.key do not belong together."),
    ],
)
def test_mistakes_are_told_before_anything_is_opened(made: Path, certificate: str, key: str, told: str) -> None:
    """Of a source as of a sink."""
    files: dict[str, Any] = {"certificate": str(made / certificate), "key": str(made / key)}
    told = told.replace("FOLDER", str(made))
    with pytest.raises(FaultbondError) as source:
        open_source("opc.tcp://plc", [tank_subscriber()], SourceOptions(**files))
    assert str(source.value).startswith(f"source opc.tcp://plc: {told}")
    word = made / "word"
    word.write_text("sesame")
    options = SinkOptions(
        name="a", to="opc.tcp://127.0.0.1:4841", where="tell a", user="b", password_file=str(word), **files
    )
    with pytest.raises(FaultbondError) as sink:
        open_sinks([options], {})
    assert str(sink.value).startswith(f"tell a: {told}")
