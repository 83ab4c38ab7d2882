"""`serve`: a site watched until somebody stops it, with its page."""

import asyncio
import logging
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from getpass import getpass
from types import ModuleType

from faultbond.app.signals import STOPPING, Stopped
from faultbond.errors import FaultbondError, Mistakes, StoreError, UnreadyStoreError
from faultbond.io.out import Out
from faultbond.report.numbers import clock_text
from faultbond.service.certificate_watch import CertificateWatch
from faultbond.service.contract.store import LogStore
from faultbond.service.door import Certificate, bound, page_address, page_names
from faultbond.service.log_lines import LogForm, logged
from faultbond.service.memory import keep_little
from faultbond.service.sinks.opening import metrics_token, open_sinks
from faultbond.service.sinks.options import KINDS
from faultbond.service.site import Site, SiteAsset
from faultbond.service.site_check import check_site, doubts
from faultbond.service.site_log import Done
from faultbond.service.sources.opening import open_source, shown_address
from faultbond.service.station import RETRY, Service
from faultbond.service.store.address import shown_store
from faultbond.service.store.opening import open_store
from faultbond.service.systemd import ServiceManager, UnitState, reassure
from faultbond.service.web.security import Guard, LocalGuard, LoginGuard, Role, hashed
from faultbond.service.web.shield import LOOPBACK

EXTRA = 'The page needs more: install it by `pip install "faultbond[serve]"`.'
_LOG = logging.getLogger(__name__)
SHORTEST = 8  # characters of a password
GRACE = 5  # s that answers which are being given have at the end


def serve(
    site: Site, *, out: Out, check: bool = False, log: LogForm | None = None, mistakes: Mistakes | None = None
) -> None:
    """Watch a site and show it, until a signal comes; then every asset is kept as it stands.

    check: only say what would be watched, once it is known that it can be. log: how standard error is written; None:
    as it suits that. mistakes: what is known to be wrong with the site; it is told with all else that is.

    Raises
    ------
    FaultbondError
        Where the address is taken, or open to others without a login or TLS, the certificate is not right, or a part is
        not installed.
    StoreError
        Where the store cannot be opened or, at the end, written.
    Stopped
        When a signal came.
    """
    uvicorn = _web_server()
    certificate = check_site(site, mistakes or Mistakes(), store=check)
    if check:
        _tell(site, certificate, out)
        return
    keep_little()
    with logged(log):
        try:
            number = asyncio.run(_serve(site, certificate, out, uvicorn))
        except FaultbondError:
            raise
        except BrokenPipeError:
            _LOG.warning("Nobody reads standard output any more. The service ends; started again, it goes on.")
            raise
        except Exception:
            _LOG.critical("The service ends; started again, it goes on from its log.", exc_info=True)
            raise
    if number is not None:
        raise Stopped(number)


def hash_password(out: Out) -> None:
    """Ask for a password, and tell its hash for the site file.

    Raises
    ------
    FaultbondError
        Where none was given, or one that is guessed soon.
    """
    password = getpass("Password: ") if sys.stdin.isatty() else sys.stdin.readline().rstrip("\n")
    if not password:
        raise FaultbondError("no password was given.")
    if len(password) < SHORTEST:
        raise FaultbondError(f"the password has {len(password)} characters; take {SHORTEST} or more.")
    kept = hashed(password)
    out.say(kept)
    out.record({"record": "password", "hash": kept})


def _tell(site: Site, certificate: Certificate | None, out: Out) -> None:
    """Say what a site watches."""
    for item in site.assets:
        rule = "" if item.accept is None else f"; accepts what is {item.accept:g} sure"
        topic = f", topic {item.topic}" if item.topic else ""
        model, source = item.plant.document[0], shown_address(item.source)
        out.say(f"{item.name}: {item.plant.graph.name} ({model}) from {source}{topic}{rule}")
        if item.picture is not None:
            out.say(f"{item.name}: {item.picture.told()}")
    for sink in open_sinks(site.tell, site.topics()):
        what = [kind for kind in KINDS if kind in sink.kinds] + ["how assets stand"] * sink.shows
        out.say(f"{sink.name}: is told {', '.join(what)} by {sink.address}")
    people = ", ".join(f"{user.name} ({user.role})" for user in site.users.values())
    store = shown_store(site.store)
    out.say(f"Kept in {store}. Page: {site.host}:{site.port}. People: {people or 'whoever is at this machine'}.")
    if certificate is not None:
        known = f", of {', '.join(certificate.names)}" if certificate.names else ""
        out.say(f"TLS by {certificate.file}{known}, until {clock_text(certificate.until)}.")
        if certificate.ends_soon:
            out.warn(f"{certificate.file}: the certificate ends at {clock_text(certificate.until)}. Renew it.")
    for doubt in doubts(site):
        out.warn(doubt)
    out.record(
        {
            "record": "site",
            "name": site.name,
            "assets": [_asset_content(item) for item in site.assets],
            "store": store,
            "address": site.host,
            "port": site.port,
        }
    )


def _asset_content(item: SiteAsset) -> dict[str, object]:
    told: dict[str, object] = {"name": item.name, "model": item.plant.document[0], "source": item.source}
    return told if item.picture is None else told | {"picture": item.picture.content()}


def _web_server() -> ModuleType:
    try:
        import fastapi  # noqa: F401, PLC0415 - an extra
        import uvicorn  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise FaultbondError(EXTRA) from error
    return uvicorn


async def _serve(site: Site, certificate: Certificate | None, out: Out, uvicorn: ModuleType) -> int | None:
    """Run service and page; gives the signal that ended it."""
    from faultbond.service.web.application import application  # noqa: PLC0415 - needs fastapi

    manager, door = ServiceManager(), bound(site)
    manager.tell(status="reads its store")
    store, service = await _begun(site, out, manager)
    try:
        names = {*LOOPBACK, *page_names(site, certificate)}
        page = application(
            service, _guard(site), hosts=names, metrics_token=metrics_token(site.tell), desk=service.desk
        )
        server = uvicorn.Server(
            uvicorn.Config(
                page,
                log_config=None,  # its events go where ours do
                access_log=False,
                timeout_graceful_shutdown=GRACE,
                ssl_context_factory=(lambda *_: certificate.context) if certificate is not None else None,
            )
        )
        server.capture_signals = _no_signals  # ours go first
        with door, _signals() as stopped:
            out.append()
            out.settle()
            out.say(f"{site.name}: {page_address(site, certificate, door.getsockname()[1])} - Ctrl-C stops it.")
            if out.text is not None:
                out.text.flush()  # into the journal of a system, too
            watching = asyncio.create_task(service.run())
            showing = asyncio.create_task(server.serve(sockets=[door]))
            ended = asyncio.create_task(stopped.wait())
            alive = asyncio.create_task(reassure(manager, lambda: service.is_alive, lambda: _status(service)))
            renewing = asyncio.create_task(CertificateWatch(site, certificate).run()) if certificate else None
            manager.tell(UnitState.READY)
            await asyncio.wait((watching, showing, ended), return_when=asyncio.FIRST_COMPLETED)
            manager.tell(UnitState.STOPPING, status="keeps its assets as they stand")
            for task in filter(None, (ended, alive, renewing, watching)):
                task.cancel()
            try:
                with suppress(asyncio.CancelledError):
                    await watching
            finally:
                page.state.broadcast.close()
                server.should_exit = True
                await showing
        return stopped.number
    finally:
        store.close()


async def _begun(site: Site, out: Out, manager: ServiceManager) -> tuple[LogStore, Service]:
    """Read the store; where it cannot be had now, as after a loss of power its server, say so once and wait for it."""
    is_told = False
    while True:
        try:
            store = open_store(site.store, tell=_LOG.warning)
            try:
                return store, Service(
                    site,
                    store,
                    lambda address, fed: open_source(address, fed, site.options(address)),
                    hear=lambda done: _record(out, done),
                    sinks=open_sinks(site.tell, site.topics()),
                )
            except BaseException:
                with suppress(StoreError):
                    store.close()
                raise
        except UnreadyStoreError as error:
            if not is_told:
                _LOG.warning("%s The service begins once it can be used.", error)
            is_told = True
            manager.tell(status=f"waits for its store: {error}")
        await asyncio.sleep(RETRY)


def _status(service: Service) -> str:
    """Say how a service is, in a line."""
    parts = service.health()["parts"]
    troubles = [f"{name}: {part['trouble']}" for name, part in parts.items() if not part["ok"]]
    return "; ".join(troubles) or "all parts work"


def _guard(site: Site) -> Guard:
    """Give who may do what."""
    people = {user.name: (user.password, Role[user.role.upper()]) for user in site.users.values()}
    return LoginGuard(users=people) if people else LocalGuard()


class _Stop(asyncio.Event):
    """Set by a signal, which it notes."""

    number: int | None = None

    def note(self, number: int) -> None:
        """Take a signal."""
        self.number = number
        self.set()


@contextmanager
def _signals() -> Iterator[_Stop]:
    """Note the signals that stop the program."""
    loop, stop = asyncio.get_running_loop(), _Stop()
    taken = [number for number in STOPPING if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.getsignal(number) for number in taken}
    for number in taken:
        loop.add_signal_handler(number, stop.note, int(number))
    try:
        yield stop
    finally:
        for number, handler in before.items():
            loop.remove_signal_handler(number)
            signal.signal(number, handler)


@contextmanager
def _no_signals() -> Iterator[None]:
    yield


def _record(out: Out, done: Done) -> None:
    """Write the records of an asset, each with its asset and id."""
    for told in done.outcome.records:
        out.record(told.told())
        sys.stdout.flush()
