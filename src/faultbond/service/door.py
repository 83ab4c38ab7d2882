"""The door of the page: where it listens, who may come from elsewhere, and by which certificate it is known."""

import socket
import ssl
import time
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from faultbond.errors import FaultbondError
from faultbond.service.site import Site

LOOPBACK_NAME = "localhost"
SOON = 21 * 86400.0  # s before its end at which a certificate should have been renewed
EXPIRED, NOT_YET = 10, 9  # of OpenSSL's verification
STRANGERS = ("KEY_VALUES_MISMATCH", "KEY_TYPE_MISMATCH", "NO_CERTIFICATE_ASSIGNED")  # of a key, to a certificate
ROUNDS = 10  # of a handshake with itself; it takes three


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Certificate:
    """By what the page is known. names: host names and addresses in it. until: end of it, Unix s."""

    file: str
    context: ssl.SSLContext
    names: tuple[str, ...]
    until: float

    @property
    def ends_soon(self) -> bool:
        """Whether it should have been renewed."""
        return self.until - time.time() < SOON


def _of_listen(site: Site, key: str, problem: str) -> FaultbondError:
    """Give the error that says what is wrong with what the file says of `listen`."""
    return FaultbondError(f"{site.at(key)}listen: {problem}")


def _is_loopback(host: str) -> bool:
    """Whether a name or address is reached from this machine alone."""
    with suppress(ValueError):
        return ip_address(host).is_loopback
    return host == LOOPBACK_NAME


def refuse_open_door(site: Site) -> None:
    """Refuse to be reached from elsewhere where nobody has to log in, or where others could read how somebody does.

    Raises
    ------
    FaultbondError
        Where it is so.
    """
    if site.names and not site.users:
        raise _of_listen(
            site,
            "names",
            f"names: whoever asks for {site.names[0]} through a proxy would be an engineer, and there are no "
            "users. Name them in the site file.",
        )
    if _is_loopback(site.host):
        return
    if not site.users:
        raise _of_listen(
            site,
            "address",
            f"{site.host} can be reached from elsewhere, and there are no users. Name them in the site file, "
            "or listen on 127.0.0.1.",
        )
    if not site.certificate and not site.unencrypted:
        raise _of_listen(
            site,
            "address",
            f"{site.host} can be reached from elsewhere, and passwords could be read on the way. Name "
            "`certificate` and `key`, or say `unencrypted: yes` where a proxy with TLS stands before it.",
        )


def listens_everywhere(site: Site) -> bool:
    """Whether the page is on all addresses of this machine."""
    with suppress(ValueError):
        return ip_address(site.host).is_unspecified
    return False


def page_names(site: Site, certificate: Certificate | None) -> tuple[str, ...]:
    """Give the names under which the page may be asked from elsewhere; that by which it can be opened comes first."""
    certified = certificate.names if certificate is not None else ()
    own = (site.host, *site.names, *certified)
    if not listens_everywhere(site):
        return own
    openable = (name for name in certified if "*" not in name and not _is_loopback(name))
    return (*openable, socket.gethostname(), *own)


def page_address(site: Site, certificate: Certificate | None, port: int) -> str:
    """Give where the page can be opened, in words where it is elsewhere, too."""
    host = page_names(site, certificate)[0]
    scheme = "http" if certificate is None else "https"
    everywhere = ", and on all addresses of this machine" if listens_everywhere(site) else ""
    return f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}/{everywhere}"


def bound(site: Site) -> socket.socket:
    """Give the socket of the page.

    Raises
    ------
    FaultbondError
        Where it cannot listen there.
    """
    family = socket.AF_INET6 if ":" in site.host else socket.AF_INET
    try:
        return socket.create_server((site.host, site.port), family=family, backlog=256)
    except OSError as error:
        advice = "Name another port, there or by --port." if "port" in site.places else "Name another by --port."
        why = (error.strerror or str(error)).partition(" (while attempting")[0]  # Python says the address once more
        raise FaultbondError(
            f"{site.at('port')}{site.host}:{site.port}: cannot listen there: {why}. {advice}"
        ) from error


def read_certificate(site: Site) -> Certificate | None:
    """Give the certificate of the page as a browser would take it; None where there is none.

    Raises
    ------
    FaultbondError
        Where a file cannot be read or is none of its kind, the two do not belong together, or its time is not now.
    """
    if not site.certificate:
        return None
    _check_readable(site)
    browser = _browser(site)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2  # which some systems' Python leaves to their OpenSSL
    try:
        context.load_cert_chain(site.certificate, site.key, password=lambda: "")
    except ssl.SSLError as error:
        if error.reason in STRANGERS:
            problem = f"certificate {site.certificate} and key {site.key} do not belong together."
            raise _of_listen(site, "certificate", problem) from error
        problem = f"key {site.key}: this is no key in PEM, or it has a passphrase. Give one without."
        raise _of_listen(site, "key", problem) from error
    found = _seen(context, browser, site)
    names = tuple(name for kind, name in found.get("subjectAltName", ()) if kind in ("DNS", "IP Address"))
    until = float(ssl.cert_time_to_seconds(found["notAfter"]))
    return Certificate(file=site.certificate, context=context, names=names, until=until)


def _check_readable(site: Site) -> None:
    for name, file in (("certificate", site.certificate), ("key", site.key)):
        try:
            Path(file).read_bytes()
        except OSError as error:
            problem = f"{name} {file}: cannot be read: {error.strerror or error}."
            raise _of_listen(site, name, problem) from error


def _browser(site: Site) -> ssl.SSLContext:
    """Give somebody who trusts a certificate itself, whoever signed it."""
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    made.check_hostname = False
    made.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    try:
        made.load_verify_locations(site.certificate)
    except ssl.SSLError as error:
        problem = f"certificate {site.certificate}: this is no certificate in PEM."
        raise _of_listen(site, "certificate", problem) from error
    return made


def _seen(context: ssl.SSLContext, browser: ssl.SSLContext, site: Site) -> dict[str, Any]:
    """Give what a certificate says, after a handshake with a browser."""
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    client = browser.wrap_bio(back, there)
    sides = client, context.wrap_bio(there, back, server_side=True)
    try:
        for _ in range(ROUNDS):
            for side in sides:
                with suppress(ssl.SSLWantReadError):
                    side.do_handshake()
    except ssl.SSLCertVerificationError as error:
        known = {EXPIRED: "it has expired. Renew it", NOT_YET: "its time has not begun. Look at the clock"}
        why = known.get(error.verify_code, f"a browser would refuse it: {error.verify_message}")
        problem = f"certificate {site.certificate}: {why}."
        raise _of_listen(site, "certificate", problem) from error
    return dict(client.getpeercert() or {})
