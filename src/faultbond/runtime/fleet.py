"""A fleet: many assets of one model watched side by side, each with its own inputs and readings at the same times.

An asset gets what a `Monitor` of its own would give it. While all is well it is a lane of the core's, of some ten
thousand bytes; one in alarm is a `Monitor`, and comes back some hundred samples after a diagnosis of it was accepted.
"""

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Candidate, Detection, Diagnosis
from faultbond.contract.samples import STATUSES, Samples, Status
from faultbond.errors import FaultbondError
from faultbond.runtime.core import Core, at, memory
from faultbond.runtime.monitor import Monitor

_LOST = STATUSES.index(Status.LOST)


class EventKind(Enum):
    """What happened to an asset at a sample; the value is the message."""

    DETECTION = "a fault was detected"
    DIAGNOSIS = "a diagnosis is due"
    LOSS = "the healthy filter lost the asset; it starts anew"


_ORDER = tuple(EventKind)


@dataclass(frozen=True, slots=True, kw_only=True)
class AssetEvent:
    """What happened to an asset, by its place in the fleet, at a sample, by its number from the fleet's first on."""

    asset: int
    sample: int
    kind: EventKind
    detection: Detection | None = None
    diagnosis: Diagnosis | None = None


class Fleet:
    """Watches many assets of one model; one thread's at a time.

    Parameters
    ----------
    core : of the model
    n_assets : how many there are
    time : of the beginning, s
    quiet : whether no alarm is ever raised
    threads : by how many at a time samples are taken; answers do not depend on it

    Raises
    ------
    ValueError
        Where there is no asset, or no thread, or the core was built without what fleets need.

    Examples
    --------
    >>> from faultbond.runtime.fleet import Fleet
    >>> spec, core = build_engine(graph, fleets=True)  # doctest: +SKIP
    >>> fleet = Fleet(core, 3)  # doctest: +SKIP
    >>> events = fleet.block(times, inputs, readings)  # doctest: +SKIP
    """

    def __init__(self, core: Core, n_assets: int, *, time: float = 0.0, quiet: bool = False, threads: int = 1) -> None:
        if n_assets < 1 or threads < 1:
            raise ValueError(f"a fleet of {n_assets} assets with {threads} threads: at least one of each is expected")
        if not hasattr(core.library, "fb_fleet_size"):
            raise ValueError(
                f"{core.spec.model}: its core serves no fleets; build it by build_engine(graph, fleets=True)"
            )
        self.core, self.spec, self.n_assets = core, core.spec, n_assets
        library = core.library
        self._threads = threads
        self._memory = memory(library.fb_fleet_size(n_assets))
        self._works = [memory(library.fb_fleet_work_size()) for _ in range(threads)]
        self._work_at = np.array([at(work) for work in self._works], dtype=np.uintp)
        self._work = memory(core.sizes["work"])
        self._monitors: dict[int, Monitor] = {}
        self._index = 0
        self._time: float | None = None
        library.fb_fleet_init(at(self._memory), at(self._works[0]), n_assets, time, int(quiet))

    @property
    def index(self) -> int:
        """How many samples were seen."""
        return self._index

    @property
    def size(self) -> int:
        """Bytes that are kept of all assets that are watched side by side."""
        return len(self._memory)

    @property
    def monitors(self) -> Mapping[int, Monitor]:
        """The assets that have a monitor of their own, by place: in alarm or lost, or lately so."""
        return MappingProxyType(self._monitors)

    @property
    def in_alarm(self) -> tuple[int, ...]:
        """The assets in alarm, in order."""
        return tuple(sorted(asset for asset, item in self._monitors.items() if item.number("clock.alarm") >= 0))

    def block(self, times: FloatArray, inputs: FloatArray, readings: FloatArray) -> tuple[AssetEvent, ...]:
        """Take samples of all assets, and tell what happened, in the order of samples, then of assets.

        Parameters
        ----------
        times : float array, shape (n_samples,), s
        inputs : float array, shape (n_assets, n_samples, n_inputs), SI; nan: missing
        readings : float array, shape (n_assets, n_samples, n_outputs), SI; nan: missing

        Raises
        ------
        ValueError
            Where the arrays have other shapes.
        """
        time, u, y = (np.ascontiguousarray(values, dtype=np.float64) for values in (times, inputs, readings))
        count, n_u, n_y = len(time), len(self.spec.inputs), len(self.spec.outputs)
        wanted = ((count,), (self.n_assets, count, n_u), (self.n_assets, count, n_y))
        if (time.shape, u.shape, y.shape) != wanted:
            raise ValueError(
                f"{self.n_assets} assets, {n_u} inputs, {n_y} sensors: times, inputs, readings of the shapes {wanted} "
                f"are expected, not {(time.shape, u.shape, y.shape)}"
            )
        if not count:
            return ()
        dt = np.diff(time, prepend=time[0] if self._time is None else self._time)
        self._time = float(time[-1])
        events: list[AssetEvent] = []
        taken = 0
        while taken < count:
            part = slice(taken, taken + self._begin(time[taken:], dt[taken:]))
            events += self._part(Samples(time=time[part], dt=dt[part], u=u[:, part], y=y[:, part]))
            taken = part.stop
        return tuple(events)

    def copy(self, asset: int) -> Monitor:
        """Give a monitor of its own that remembers what the fleet does of an asset.

        Raises
        ------
        IndexError
            Where there is no such asset.
        """
        if not 0 <= asset < self.n_assets:
            raise IndexError(f"asset {asset}: the fleet has assets 0 to {self.n_assets - 1}")
        return self._monitors[asset].copy() if asset in self._monitors else self._made(asset)

    def repeat(self, few: "Fleet") -> None:
        """Take over what another fleet remembers of its assets, again and again; none of them may be in alarm.

        Raises
        ------
        ValueError
            Where it is a fleet of another core, or has assets with a monitor of their own.
        """
        if few.core is not self.core or few.monitors:
            raise ValueError("a fleet is repeated that is of the same core and has no asset in alarm")
        self.core.library.fb_fleet_repeat(at(self._memory), at(few._memory))
        self._index, self._time, self._monitors = few.index, few._time, {}

    def conclude(self, asset: int) -> Diagnosis:
        """Give the diagnosis of now of an asset in alarm, see `Monitor.conclude`.

        Raises
        ------
        FaultbondError
            Where the asset is not in alarm.
        """
        return self._in_alarm(asset).conclude()

    def accept(self, asset: int, hypothesis: int, *, repaired: bool = False) -> Candidate:
        """Take a hypothesis as the new healthy model of an asset, or as repaired, and give the candidate as it stood.

        Raises
        ------
        FaultbondError
            Where the asset is not in alarm, and as `Monitor.accept`.
        """
        return self._in_alarm(asset).accept(hypothesis, repaired=repaired)

    def reject(self, asset: int, hypothesis: int) -> Candidate:
        """Rule a hypothesis out for an asset until its next alarm, and give it as it stood.

        Raises
        ------
        FaultbondError
            Where the asset is not in alarm, and as `Monitor.reject`.
        """
        return self._in_alarm(asset).reject(hypothesis)

    def _in_alarm(self, asset: int) -> Monitor:
        if asset not in self.in_alarm:
            raise FaultbondError(f"asset {asset} is not in alarm: there is nothing to conclude, accept or reject.")
        return self._monitors[asset]

    def _begin(self, time: FloatArray, dt: FloatArray) -> int:
        """Begin a part of a block; gives how many samples it has."""
        return int(self.core.library.fb_fleet_begin(at(self._memory), len(time), at(time), at(dt)))

    def _part(self, samples: Samples) -> list[AssetEvent]:
        """Take samples of all assets; u, y : (n_assets, n, ...), parts of contiguous arrays."""
        library, n = self.core.library, len(samples)
        left: np.ndarray[tuple[int], np.dtype[np.int64]] = np.full(self.n_assets, -1, dtype=np.int64)
        n_u = samples.u.shape[2]
        stride = samples.u.strides[0] // (8 * n_u) if n_u else samples.y.strides[0] // (8 * samples.y.shape[2])
        library.fb_fleet_watch_all(
            at(self._memory), at(self._work_at), self._threads, n, stride, at(samples.u), at(samples.y), at(left)
        )
        begun = dict.fromkeys(self._monitors, 0)
        for asset in np.flatnonzero(left >= 0).tolist():
            self._monitors[asset] = self._made(asset)
            begun[asset] = int(left[asset])
        events = self._watched(samples, begun)
        library.fb_fleet_end(at(self._memory), n)
        self._index += n
        for asset in list(self._monitors):
            if library.fb_fleet_return(at(self._memory), asset, self._monitors[asset].address):
                del self._monitors[asset]
        return events

    def _watched(self, samples: Samples, begun: Mapping[int, int]) -> list[AssetEvent]:
        """Let assets that are away take samples, each from its own on; gives what happened, in order."""
        given = [
            (asset, Samples(time=samples.time, dt=samples.dt, u=samples.u[asset], y=samples.y[asset])[first:], first)
            for asset, first in begun.items()
        ]
        if self._threads > 1 and len(given) > 1:
            with ThreadPoolExecutor(self._threads) as pool:
                found = [event for events in pool.map(lambda item: list(self._alone(*item)), given) for event in events]
        else:
            found = [event for item in given for event in self._alone(*item)]
        return sorted(found, key=lambda event: (event.sample, event.asset, _ORDER.index(event.kind)))

    def _alone(self, asset: int, samples: Samples, first: int) -> Iterator[AssetEvent]:
        """Let one monitor take samples, of which the first has that place in the part."""
        monitor, taken = self._monitors[asset], 0
        while taken < len(samples):
            reports = monitor.take(samples[taken:])
            begin = self._index + first + taken
            for lost in np.flatnonzero(reports.status == _LOST).tolist():
                yield AssetEvent(asset=asset, sample=begin + lost, kind=EventKind.LOSS)
            taken += len(reports)
            last = self._index + first + taken - 1
            if reports.detection is not None:
                yield AssetEvent(asset=asset, sample=last, kind=EventKind.DETECTION, detection=reports.detection)
            if reports.diagnosis is not None:
                yield AssetEvent(asset=asset, sample=last, kind=EventKind.DIAGNOSIS, diagnosis=reports.diagnosis)

    def _made(self, asset: int) -> Monitor:
        """Give a monitor of an asset as it is; of one that goes away, as it was before the sample at which it does."""
        monitor = Monitor(self.core)
        self.core.library.fb_fleet_leave(at(self._memory), asset, monitor.address, at(self._work))
        return monitor
