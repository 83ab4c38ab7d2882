"""What a site would stumble over: all of it at once, before anything is begun."""

import os
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from faultbond.errors import AbsentStoreError, FaultbondError, Mistakes, StoreError
from faultbond.service.contract.source import Subscriber
from faultbond.service.door import Certificate, read_certificate, refuse_open_door
from faultbond.service.sinks.opening import metrics_token, open_sinks
from faultbond.service.site import Site
from faultbond.service.sources.opening import open_source
from faultbond.service.store.address import ServerAddress, store_address
from faultbond.service.store.opening import open_store


def check_site(site: Site, mistakes: Mistakes, *, store: bool = False) -> Certificate | None:
    """Give by what the page is known, where nothing is wrong with the site; nothing is connected.

    Parameters
    ----------
    site : the site
    mistakes : what is known of it to be wrong
    store : whether a file that it is to be kept in is looked at, too

    Raises
    ------
    FaultbondError
        Where something is wrong with it: all that is.
    """
    mistakes.or_else(lambda: refuse_open_door(site), None)
    certificate = mistakes.or_else(lambda: read_certificate(site), None)
    with mistakes.noted():
        _check_store(site, looks=store)
    for item in site.assets:
        subscriber = Subscriber(asset=item.name, columns=item.plant.columns, graph=item.plant.graph)
        try:
            open_source(item.source, [subscriber], site.options(item.source))
        except FaultbondError as error:
            mistakes.note(FaultbondError(f"{item.where}{error}"))
    with mistakes.noted():
        metrics_token(site.tell)
    filters: dict[str, str] = mistakes.or_else(site.topics, {})
    for told in site.tell:
        with mistakes.noted():
            open_sinks([told], filters)
    mistakes.tell()
    return certificate


def _check_store(site: Site, *, looks: bool) -> None:
    """Refuse what is no address of a store and, if it looks, a file that cannot be written or is none of ours."""
    try:
        place = store_address(site.store)
        if not looks or isinstance(place, ServerAddress):
            return
        if place.exists():
            open_store(place, writes=False).close()
        elif not os.access(place.parent, os.W_OK):
            told = "may not be written" if place.parent.is_dir() else "is not there"
            raise StoreError(f"store {place}: the folder {place.parent} {told}. Name another place.")
    except StoreError as error:
        raise StoreError(f"{site.at('store')}{error}") from error


def doubts(site: Site) -> Iterator[str]:
    """Give what would not do if the service began now, and may be another by then; each is a line."""
    try:
        if isinstance(store_address(site.store), ServerAddress):
            with suppress(AbsentStoreError):  # it will be made
                open_store(site.store, writes=False).close()
    except StoreError as error:
        yield f"{site.at('store')}{error}"
    with suppress(OSError), socket.create_connection((site.host, site.port), timeout=1.0):
        yield (
            f"{site.at('port')}{site.host}:{site.port}: somebody listens there already. If that is not this service, "
            "name another port."
        )
    for item in site.assets:
        file = item.source.removeprefix("file:").partition("?")[0]
        if item.source.startswith("file:") and not Path(file).expanduser().exists():
            yield f"{item.where}source {item.source}: there is no such file yet. {item.name} has no data until then."
