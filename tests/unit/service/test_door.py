"""The page by TLS: certificates that are right, all that can be wrong with one, and what a browser is given."""

import signal
import socket
import ssl
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.broker import free_port

from faultbond.cli import main
from faultbond.errors import FaultbondError
from faultbond.service.door import page_address, page_names, read_certificate
from faultbond.service.site import Site, SiteAsset
from faultbond.service.web.security import hashed
from loop_asset import MODEL, plant

httpx = pytest.importorskip("httpx", reason="there is no httpx: pip install httpx")
pytest.importorskip("uvicorn", reason='there is no uvicorn: pip install "faultbond[serve]"')

LONGEST = 90.0  # s that anything takes on a busy machine
NAMES = "subjectAltName=DNS:plant.example,DNS:*.plant.example,IP:127.0.0.1"


def openssl(*words: str) -> None:
    """Run it."""
    subprocess.run(["openssl", *words], check=True, capture_output=True)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with certificates and keys of all kinds."""
    folder = tmp_path_factory.mktemp("tls")
    for name, kind in {"page": "rsa:2048", "other": "rsa:2048"}.items():
        pair = ("-keyout", str(folder / f"{name}.key"), "-out", str(folder / f"{name}.pem"))
        openssl(
            "req", "-x509", "-newkey", kind, "-nodes", "-days", "90", *pair, "-subj", f"/CN={name}", "-addext", NAMES
        )
    curve = ("-name", "prime256v1", "-genkey", "-noout")
    openssl("ecparam", *curve, "-out", str(folder / "curve.key"))
    openssl("rsa", "-in", str(folder / "page.key"), "-aes256", "-passout", "pass:x", "-out", str(folder / "secret.key"))
    request, key = str(folder / "request"), ("-signkey", str(folder / "page.key"))
    openssl("req", "-new", "-key", str(folder / "page.key"), "-subj", "/CN=page", "-out", request)
    openssl("x509", "-req", "-in", request, *key, "-days", "-1", "-out", str(folder / "old.pem"))
    openssl("x509", "-req", "-in", request, *key, "-days", "5", "-out", str(folder / "ending.pem"))
    (folder / "use").write_text("extendedKeyUsage=clientAuth")
    use = ("-extfile", str(folder / "use"))
    openssl("x509", "-req", "-in", request, *key, "-days", "90", *use, "-out", str(folder / "client.pem"))
    issuer = ("-CA", str(folder / "other.pem"), "-CAkey", str(folder / "other.key"), "-CAcreateserial")
    openssl("x509", "-req", "-in", request, *issuer, "-days", "90", "-out", str(folder / "issued.pem"))
    (folder / "chain.pem").write_text((folder / "issued.pem").read_text() + (folder / "other.pem").read_text())
    return folder


def site(folder: Path, certificate: str, key: str) -> Site:
    """Give a site with a certificate."""
    asset = SiteAsset(name="loop", plant=plant())
    return Site(name="loop", assets=(asset,), certificate=str(folder / certificate), key=str(folder / key))


def test_a_certificate_tells_its_names_and_its_end(made: Path) -> None:
    """By them the page is asked; one that ends soon is known for that."""
    found = read_certificate(site(made, "page.pem", "page.key"))
    assert found is not None
    assert found.names == ("plant.example", "*.plant.example", "127.0.0.1")
    assert 89.0 < (found.until - time.time()) / 86400.0 < 91.0
    assert not found.ends_soon
    ending = read_certificate(site(made, "ending.pem", "page.key"))
    assert ending is not None
    assert ending.ends_soon
    assert read_certificate(replace(site(made, "", ""), certificate="")) is None
    assert found.context.minimum_version >= ssl.TLSVersion.TLSv1_2


@pytest.mark.parametrize("name", ["issued.pem", "chain.pem"])
def test_whoever_signed_it(made: Path, name: str) -> None:
    """One of an authority of the plant's own is as good, with its chain or without."""
    assert read_certificate(site(made, name, "page.key")) is not None


@pytest.mark.parametrize(
    ("certificate", "key", "told"),
    [
        ("absent.pem", "page.key", "certificate .*absent.pem: cannot be read: No such file"),
        ("page.pem", "absent.key", "key .*absent.key: cannot be read: No such file"),
        ("page.pem", "other.key", "certificate .*page.pem and key .*other.key do not belong together"),
        ("page.pem", "curve.key", ".* do not belong together"),
        ("page.key", "page.key", "certificate .*page.key: this is no certificate in PEM"),
        ("page.pem", "page.pem", "key .*page.pem: this is no key in PEM, or it has a passphrase"),
        ("page.pem", "secret.key", "key .*secret.key: this is no key in PEM, or it has a passphrase"),
        ("old.pem", "page.key", "certificate .*old.pem: it has expired. Renew it"),
        ("client.pem", "page.key", "certificate .*client.pem: a browser would refuse it: un.* purpose"),
    ],
)
def test_mistakes_are_told_in_a_line(made: Path, certificate: str, key: str, told: str) -> None:
    """Before anything is opened, and without asking for a passphrase."""
    with pytest.raises(FaultbondError, match=f"^listen: {told}") as failed:
        read_certificate(site(made, certificate, key))
    assert "\n" not in str(failed.value)


def written(folder: Path, made: Path, certificate: str, port: int) -> Path:
    """Write a site file with a user and a certificate."""
    path = folder / "site.yaml"
    listen = f"{{port: {port}, certificate: {made / certificate}, key: {made / 'page.key'}}}"
    users = f'{{anna: {{role: engineer, password: "{hashed("open sesame")}"}}}}'
    path.write_text(f"assets: {{loop: {{model: {MODEL}}}}}\nlisten: {listen}\nusers: {users}\n")
    return path


def test_a_check_says_by_which_certificate(tmp_path: Path, made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Or what is wrong with it, with the exit code of a mistake."""
    assert main(["serve", "--check", "--site", str(written(tmp_path, made, "page.pem", 0))]) == 0
    said = capsys.readouterr()
    assert f"TLS by {made / 'page.pem'}, of plant.example, *.plant.example, 127.0.0.1, until 20" in said.out
    assert said.err == ""
    assert main(["serve", "--check", "--site", str(written(tmp_path, made, "ending.pem", 0))]) == 0
    assert f"faultbond: {made / 'ending.pem'}: the certificate ends at" in capsys.readouterr().err
    assert main(["serve", "--check", "--site", str(path := written(tmp_path, made, "old.pem", 0))]) == 2
    assert capsys.readouterr().err == f"{path}:2: listen: certificate {made / 'old.pem'}: it has expired. Renew it.\n"


def test_the_address_that_is_told_can_be_opened(tmp_path: Path, made: Path) -> None:
    """On all addresses it has the name of the certificate, else that of the machine, by which the page is served."""
    certified = site(made, "page.pem", "page.key")
    certificate = read_certificate(certified)
    assert page_address(certified, certificate, 7) == "https://127.0.0.1:7/"
    everywhere = replace(certified, host="0.0.0.0", names=("behind.example",))  # noqa: S104
    assert page_address(everywhere, certificate, 7) == "https://plant.example:7/, and on all addresses of this machine"
    told = f"http://{socket.gethostname()}:7/, and on all addresses of this machine"
    assert page_address(everywhere, None, 7) == page_address(replace(everywhere, host="::"), None, 7) == told
    assert {"behind.example", socket.gethostname()} <= set(page_names(everywhere, None))
    assert socket.gethostname() not in page_names(replace(everywhere, host="10.0.0.7"), None)
    assert page_address(replace(everywhere, host="fe80::7"), None, 7) == "http://[fe80::7]:7/"


def answer(client: Any, path: str) -> Any:
    """Ask until somebody answers."""
    end = time.monotonic() + LONGEST
    while True:
        try:
            return client.get(path)
        except httpx.TransportError:
            if time.monotonic() > end:
                raise
            time.sleep(0.05)


def test_the_page_by_tls(tmp_path: Path, made: Path) -> None:
    """Who trusts the certificate is served, under its names; the cookie never goes without TLS, nor does a request."""
    port = free_port()
    command = [sys.executable, "-m", "faultbond", "serve", "--site", str(written(tmp_path, made, "page.pem", port))]
    trust = ssl.create_default_context(cafile=str(made / "page.pem"))
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as process:
        try:
            with httpx.Client(base_url=f"https://127.0.0.1:{port}", verify=trust) as client:
                assert answer(client, "/health").json().keys() == {"ok"}
                assert client.get("/", headers={"host": f"plant.example:{port}"}).status_code == 200
                assert client.get("/", headers={"host": f"else.example:{port}"}).status_code == 421
                body = {"name": "anna", "password": "open sesame"}
                entered = client.post("/api/v1/login", json=body)
                assert entered.status_code == 200
                assert {"secure", "httponly", "samesite=strict"} <= {
                    word.strip().lower() for word in entered.headers["set-cookie"].split(";")
                }
                assert client.get("/api/v1/me").json()["name"] == "anna"
                assert client.get("/health").json()["parts"]["store"]["ok"]
            with pytest.raises(httpx.TransportError):
                httpx.get(f"http://127.0.0.1:{port}/health")
            with pytest.raises(httpx.ConnectError, match=r"(?i)certificate verify failed"):
                httpx.get(f"https://127.0.0.1:{port}/health", verify=ssl.create_default_context())
        finally:
            process.send_signal(signal.SIGTERM)
            said, _ = process.communicate(timeout=LONGEST)
    assert said == f"site: https://127.0.0.1:{port}/ - Ctrl-C stops it.\n"
