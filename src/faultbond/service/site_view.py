"""A site as people see it: what its assets, its store and what came of its sources show of each asset."""

import threading
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from faultbond.equations.causality import assign_causality
from faultbond.service.asset import RECENT, Asset
from faultbond.service.asset_status import AssetStatus, asset_status
from faultbond.service.contract.face import Shown
from faultbond.service.contract.messages import Arrivals, Monitoring
from faultbond.service.contract.part import ServicePart
from faultbond.service.contract.store import LogStore
from faultbond.service.shown import EVENTS, asset_of, curves_of, journal_of, measures_of, summary_of
from faultbond.service.sinks.measures import AssetMeasures
from faultbond.service.site import Site
from faultbond.service.site_log import Done, SiteLog
from faultbond.service.sources.queue import DROPPED

JOURNAL = 200  # newest deeds, and events, that are shown
REGULAR = 5  # times between values of sensors from which their pace is known
NOTES = 3  # newest remarks about the service that are


@dataclass(slots=True)
class _Seen:
    """What is known of an asset beside its log.

    heard: when a sensor of it gave a value last, s that only grow. gaps: between the last of these. is_empty:
    whether none did in what came last. stale: why what came is of the past; empty: it is of now. counts: of what did
    not become rows. status: and since when.
    """

    heard: float | None = None
    gaps: tuple[float, ...] = ()
    is_empty: bool = False
    stale: str = ""
    status: tuple[Any, ...] = ()
    since: float = 0.0
    counts: Counter[str] = field(default_factory=Counter)


class SiteView:
    """Shows a site; see `face.Face` for what.

    Parameters
    ----------
    site, log, store : what is shown
    lock : of log and store, between who writes them and who asks
    clock : gives Unix s
    steady : gives s that only grow
    parts : what each asset depends on: its source, the store, and the asset itself
    """

    def __init__(
        self,
        site: Site,
        log: SiteLog,
        store: LogStore,
        lock: threading.Lock,
        clock: Callable[[], float],
        steady: Callable[[], float],
        parts: Mapping[str, Sequence[ServicePart]],
    ) -> None:
        self._log, self._store, self._lock, self._clock, self._steady = log, store, lock, clock, steady
        self._parts = parts
        self._seen = {item.name: _Seen(since=clock()) for item in site.assets}
        self._graphs = {item.name: item.plant.graph for item in site.assets}
        self._drawings: dict[str, str] = {}  # by model
        self._drawing = threading.Lock()
        self._pictures = {item.name: item.picture for item in site.assets}
        self._notes: deque[str] = deque(maxlen=NOTES)
        self.is_stopped = False

    def note(self, arrivals: Arrivals, *, is_dropped: bool = False) -> None:
        """Note that rows came, and what came with them; who calls has the lock."""
        seen = self._seen[arrivals.asset]
        if len(arrivals.rows):
            seen.is_empty = not np.isfinite(arrivals.rows.y).any()  # what could not be read is no data
            if not seen.is_empty:
                now = self._steady()
                seen.gaps = () if seen.heard is None else (*seen.gaps, now - seen.heard)[-REGULAR:]
                seen.heard = now
        seen.stale = seen.stale if arrivals.stale is None else arrivals.stale
        seen.counts.update(arrivals.counts)
        if is_dropped:
            seen.counts[DROPPED] += len(arrivals.rows)

    def count(self, assets: Sequence[str], name: str) -> None:
        """Count what happened to some assets."""
        with self._lock:
            for asset in assets:
                self._seen[asset].counts[name] += 1

    def set_clock(self, moved: float, note: str) -> None:
        """Take it that the clock was set by so many s, and show a remark about that."""
        with self._lock:
            for seen in self._seen.values():
                seen.since += moved
            self._notes.append(note)

    def summaries(self) -> list[Shown]:
        """Give the summaries of all assets."""
        with self._lock:
            return [self._summary(asset) for asset in self._log.assets.values()]

    def measures(self) -> list[AssetMeasures]:
        """Give what is measured of all assets."""
        with self._lock:  # once for all of them: who writes may hold it for long, and would for each
            began = self._clock() - self._steady()  # of the clock that only grows, as that of the machine is now
            seen = ((asset, self._seen[asset.name]) for asset in self._log.assets.values())
            return [
                measures_of(
                    asset, self._summary(asset), of.counts, arrived=None if of.heard is None else began + of.heard
                )
                for asset, of in seen
            ]

    def asset(self, name: str) -> Shown:
        """Give an asset."""
        self._drawn(name)  # it may take a second: not while others wait for the lock
        with self._lock:
            return self._asset(self._log.assets[name])

    def picture(self, name: str) -> str:
        """Give the picture of the process of an asset; empty where there is none."""
        found = self._pictures[name]
        return "" if found is None else found.svg

    def curves(self, name: str, begin: float | None, end: float | None, most: int) -> Shown:
        """Give curves of an asset, the newest where no period is given."""
        with self._lock:
            asset = self._log.assets[name]
            graph = asset.plant.graph
            if begin is None and end is None:
                newest = asset.curves(most)
                if len(newest) >= min(most, RECENT) or asset.time is None:
                    return curves_of(graph, newest)
                begin = asset.time - most * (asset.spec.sample_time or 1.0)  # after a start, or an undo
            return curves_of(graph, self._store.curves(name, begin, end, most))

    def report(self, name: str) -> str:
        """Give the report of what an asset saw lately."""
        with self._lock:
            return self._log.assets[name].run.page()

    def newest_deed(self, name: str) -> Shown:
        """Give the newest entry of an asset's journal."""
        with self._lock:
            return journal_of(self._store.deeds(name, newest=JOURNAL))[0]

    def news(self, done: Sequence[Done]) -> list[tuple[str, Shown]]:
        """Give the messages that follow from what was done."""
        news: list[tuple[str, Shown]] = []
        changed = {what.asset for what in done if what.outcome.records or what.deed}
        for name in changed:
            self._drawn(name)
        with self._lock:
            assets = self._log.assets
            for what in done:
                curves = what.outcome.curves
                if curves is not None:
                    shown = curves_of(assets[what.asset].plant.graph, curves)
                    news.append(("samples", {"asset": what.asset, **shown}))
            for name in dict.fromkeys(what.asset for what in done):
                news.append(("summary", self._summary(assets[name])))
                if name in changed:
                    news.append(("asset", self._asset(assets[name])))
        return news

    def _stands(self, asset: Asset) -> AssetStatus:
        seen, parts = self._seen[asset.name], self._parts[asset.name]
        given_up = [part.trouble for part in parts if part.is_given_up]
        return asset_status(
            asset,
            silence=None if seen.heard is None else self._steady() - seen.heard,
            pace=min(seen.gaps) if len(seen.gaps) == REGULAR else 0.0,  # an outage or two are no pace
            trouble=next((part.trouble for part in parts[:2] if part.trouble), ""),
            stale=seen.stale,
            is_empty=seen.is_empty,
            unwatched="" if self.is_stopped else given_up[-1] if given_up else None,
        )

    def _summary(self, asset: Asset, stands: AssetStatus | None = None) -> Shown:
        seen, stands, now = self._seen[asset.name], stands or self._stands(asset), self._clock()
        status = (stands.status, stands.monitoring is Monitoring.NO_DATA)
        if seen.status != status:
            seen.status, seen.since = status, now
        return summary_of(asset, stands, since=seen.since, now=now)

    def _asset(self, asset: Asset) -> Shown:
        journal = [*self._store.journal(asset.name, kinds=EVENTS, newest=JOURNAL)]
        stands, counts, drawing = self._stands(asset), self._seen[asset.name].counts, self._drawn(asset.name)
        summary, now = self._summary(asset, stands), self._clock()
        shown = asset_of(asset, summary, drawing, journal, counts, absence=stands.absence, now=now)
        picture = self._pictures[asset.name]
        more = {"picture": "" if picture is None else picture.tag, "notes": [*self._notes, *shown["notes"]]}
        return shown | more

    def _drawn(self, name: str) -> str:
        """Give the drawing of an asset's bond graph, one for each model, made when it is first looked at.

        A start with hundreds of assets does not wait for it, nor for what it loads.
        """
        graph = self._graphs[name]
        with self._drawing:
            if graph.sha256 not in self._drawings:
                from faultbond.report.drawing import draw  # noqa: PLC0415 - loads scipy

                self._drawings[graph.sha256] = draw(graph, dict(assign_causality(graph).strokes))
            return self._drawings[graph.sha256]
