"""A certificate that is renewed while the service runs: new connections see the new one."""

import asyncio
import logging
import ssl
from pathlib import Path

from faultbond.errors import FaultbondError
from faultbond.report.numbers import clock_text
from faultbond.service.door import Certificate, read_certificate
from faultbond.service.site import Site

LOOK = 30.0  # s between two looks at the files
_LOG = logging.getLogger(__name__)
_Stamp = tuple[tuple[int, int, int] | None, ...]


class CertificateWatch:
    """Looks after the certificate of the page.

    Parameters
    ----------
    site : says in which files it is
    certificate : the one with which the page began; its context shows the newest one from then on
    """

    def __init__(self, site: Site, certificate: Certificate) -> None:
        self._site, self._newest, self._seen = site, certificate, _stamp(site)
        self._is_warned = False
        # The context in which a connection began is changed for the newest once the client has said hello; to load
        # other files into the one in use would leave it without a key where they do not go together.
        certificate.context.sni_callback = self._show

    async def run(self) -> None:
        """Look again and again."""
        while True:
            await asyncio.to_thread(self.look)
            await asyncio.sleep(LOOK)

    def look(self) -> None:
        """Take the files if they are others than before and go together; else the one of before is still shown."""
        seen = _stamp(self._site)
        if seen != self._seen:
            self._seen = seen
            try:
                found = read_certificate(self._site)
            except (FaultbondError, OSError) as error:
                if isinstance(error, OSError):  # exchanged between two looks at it
                    self._seen = ()
                _LOG.warning("%s The certificate of before is shown.", error)
            else:
                self._newest, self._is_warned = found or self._newest, False
                _LOG.info("%s: renewed, until %s.", self._newest.file, clock_text(self._newest.until))
        if self._newest.ends_soon and not self._is_warned:
            self._is_warned = True
            _LOG.warning("%s: the certificate ends at %s. Renew it.", self._newest.file, clock_text(self._newest.until))

    def _show(self, connection: ssl.SSLObject, name: str, context: ssl.SSLContext) -> None:
        connection.context = self._newest.context


def _stamp(site: Site) -> _Stamp:
    """Give by what it is known that the files are others."""
    return tuple(_stamp_of(Path(file)) for file in (site.certificate, site.key))


def _stamp_of(file: Path) -> tuple[int, int, int] | None:
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_ctime_ns, found.st_size, found.st_ino  # ctime: who may read it counts, too
