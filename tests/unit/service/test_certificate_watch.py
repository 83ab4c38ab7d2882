"""A certificate that is renewed while the service runs, as who connects sees it."""

import asyncio
import hashlib
import logging
import os
import ssl
import subprocess
from pathlib import Path
from unittest.mock import Mock

import pytest

from faultbond.service import certificate_watch
from faultbond.service.certificate_watch import CertificateWatch
from faultbond.service.door import read_certificate
from faultbond.service.site import Site, SiteAsset
from loop_asset import plant


def signed(folder: Path, name: str, *, days: int = 90) -> None:
    """Make a certificate and its key."""
    pair = ("-keyout", str(folder / f"{name}.key"), "-out", str(folder / f"{name}.pem"))
    words = ("req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", str(days), *pair, "-subj", f"/CN={name}")
    subprocess.run(["openssl", *words], check=True, capture_output=True)


def begun(folder: Path) -> tuple[CertificateWatch, ssl.SSLContext]:
    """Begin to watch a certificate, and give the context that a server keeps."""
    listed = (SiteAsset(name="loop", plant=plant()),)
    site = Site(name="loop", assets=listed, certificate=str(folder / "live.pem"), key=str(folder / "live.key"))
    certificate = read_certificate(site)
    assert certificate is not None
    return CertificateWatch(site, certificate), certificate.context


def put(folder: Path, name: str, *files: str) -> None:
    """Put files of another certificate in place, as who renews does."""
    for ending in files or ("pem", "key"):
        made = folder / f"new.{ending}"
        made.write_bytes((folder / f"{name}.{ending}").read_bytes())
        made.replace(folder / f"live.{ending}")


def seen(context: ssl.SSLContext, name: str | None) -> str:
    """Give the fingerprint that a browser is shown that asks for a name, or for an address."""

    async def ask() -> str:
        async with await asyncio.start_server(lambda reader, writer: None, "127.0.0.1", 0, ssl=context) as server:
            browser = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
            browser.check_hostname, browser.verify_mode = False, ssl.CERT_NONE
            port = server.sockets[0].getsockname()[1]
            _, writer = await asyncio.open_connection("127.0.0.1", port, ssl=browser, server_hostname=name or "")
            shown = writer.get_extra_info("ssl_object").getpeercert(binary_form=True)
            writer.close()
            return hashlib.sha256(shown).hexdigest()

    return asyncio.run(asyncio.wait_for(ask(), 30.0))


def fingerprint(file: Path) -> str:
    """Give that of a file."""
    return hashlib.sha256(ssl.PEM_cert_to_DER_cert(file.read_text())).hexdigest()


@pytest.mark.parametrize("name", ["plant.example", None])
def test_who_connects_later_sees_the_new_one(
    tmp_path: Path, name: str | None, caplog: pytest.LogCaptureFixture
) -> None:
    """Whether a name is asked for or an address; and files that do not go together are left alone until they do."""
    caplog.set_level(logging.INFO)
    for made in ("first", "second"):
        signed(tmp_path, made)
    put(tmp_path, "first")
    watch, context = begun(tmp_path)
    first, second = (fingerprint(tmp_path / f"{made}.pem") for made in ("first", "second"))
    watch.look()
    assert (seen(context, name), caplog.messages) == (first, [])
    put(tmp_path, "second", "pem")
    for _ in range(2):  # told once
        watch.look()
    assert seen(context, name) == first
    (told,) = caplog.messages
    assert "do not belong together. The certificate of before is shown." in told
    put(tmp_path, "second", "key")
    watch.look()
    assert seen(context, name) == second
    assert f"{tmp_path / 'live.pem'}: renewed, until " in caplog.messages[1]
    os.remove(tmp_path / "live.key")
    watch.look()
    assert seen(context, name) == second
    assert "cannot be read" in caplog.messages[2]


def test_its_end_is_told_once_until_it_is_renewed(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Also where it comes while the service runs."""
    signed(tmp_path, "ending", days=5)
    signed(tmp_path, "fresh")
    put(tmp_path, "fresh")
    watch, _ = begun(tmp_path)
    watch.look()
    assert caplog.messages == []
    put(tmp_path, "ending")
    for _ in range(2):
        watch.look()
    (told,) = caplog.messages
    assert told.startswith(f"{tmp_path / 'live.pem'}: the certificate ends at ")


def test_a_file_that_goes_while_it_is_read_is_looked_at_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The watch goes on, and takes the new one once it is there; so it does where only rights have changed."""
    for made in ("first", "second"):
        signed(tmp_path, made)
    put(tmp_path, "first")
    watch, context = begun(tmp_path)
    put(tmp_path, "second")
    with monkeypatch.context() as patch:
        patch.setattr(certificate_watch, "read_certificate", Mock(side_effect=FileNotFoundError("gone")))
        watch.look()
    assert caplog.messages == ["gone The certificate of before is shown."]
    watch.look()
    assert seen(context, None) == fingerprint(tmp_path / "second.pem")
    read = Mock(side_effect=read_certificate)
    monkeypatch.setattr(certificate_watch, "read_certificate", read)
    watch.look()
    assert not read.called
    (tmp_path / "live.key").chmod(0o600 if (tmp_path / "live.key").stat().st_mode & 0o77 else 0o640)
    watch.look()
    assert read.called
