"""The way of single values from the network to the queue: their quality, their row, their units."""

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from faultbond.errors import FaultbondError, RecordingError
from faultbond.io.recording import row_reader
from faultbond.io.row_block import Quality
from faultbond.io.times import finite_number
from faultbond.model.graph import TimeColumn
from faultbond.service.contract.source import Subscriber
from faultbond.service.sources.assembly import Assembly, RawRow
from faultbond.service.sources.options import SourceOptions
from faultbond.service.sources.queue import ArrivalQueue

SETTLE = 0.02  # s within which values are taken to come together
LONGEST = 0.5  # s between two looks at what waits, so that it is bounded
SAMPLES, LEAST, MOST = 2.0, 0.2, 5.0  # patience where none is declared: so many samples, within these s
TOGETHER = 0.5  # of a sample: the grid takes the row that is no farther off
TIME = "\0time"  # the name of no column
UNREADABLE, UNKNOWN = "unreadable", "unknown"  # what is no number, or no message; what no column is named after
RETAINED = "retained"  # an old value without a time: it says nothing of now


class Reading(NamedTuple):
    """A value as it came. time: of its source, s; None where the source gave none."""

    column: str
    value: object
    time: float | None = None
    quality: Quality = Quality.GOOD


class Intake:
    """Takes the values of one asset and lets its rows wait in a queue.

    Parameters
    ----------
    subscriber : whose values
    options : the policy
    queue : where its rows wait
    """

    def __init__(self, subscriber: Subscriber, options: SourceOptions, queue: ArrivalQueue) -> None:
        columns, graph = subscriber.columns, subscriber.graph
        names = dict.fromkeys(item.header for item in (*columns.inputs, *columns.outputs))
        self.columns = {name: k for k, name in enumerate(names)}
        self._signals = [self.columns[item.header] for item in (*columns.inputs, *columns.outputs)]
        self.asset, self._queue, self.time_unit = subscriber.asset, queue, columns.time.unit
        self.held = frozenset(held_columns(subscriber, options))
        step = graph.row_time or graph.sample_time
        usual = min(max(SAMPLES * (step or 0.0), LEAST), MOST)
        self._assembly = Assembly(
            len(self.columns),
            hold=sorted(self.columns[name] for name in self.held),
            patience=usual if options.patience is None else options.patience,
            together=TOGETHER * (step or 0.0) if options.together is None else options.together,
            settle=SETTLE,
        )
        own = replace(columns, time=TimeColumn(column=TIME))
        self._row = row_reader(own, [TIME, *self.columns], subscriber.asset)
        self._looked = time.monotonic()

    def take(self, readings: Sequence[Reading]) -> None:
        """Take values that came just now."""
        now = time.monotonic()
        for item in readings:
            number = finite_number(item.value)
            if item.quality is not Quality.GOOD:
                self.count(item.quality.name.lower())
            elif isinstance(item.value, str) and math.isnan(number):
                self.count(UNREADABLE)
            value = math.nan if item.quality is Quality.BAD else number
            moment = time.time() if item.time is None else item.time
            self._assembly.add(self.columns[item.column], value, moment, now, item.quality)
        if now >= self._looked + LONGEST:  # who takes rows stands still
            self.look()

    def forget(self, columns: Iterable[str]) -> None:
        """Forget what holds of some columns: it is of the past, and in rows of before only."""
        self.look()
        self._assembly.forget(self.columns[name] for name in columns)

    def count(self, name: str, number: int = 1) -> None:
        """Count what is in no row, or in one as missing."""
        self._queue.count(self.asset, name, number)

    def tell_stale(self, why: str) -> None:
        """Tell why all values are of the past, or by an empty text that they are of now."""
        self._queue.tell_stale(self.asset, why)

    def look(self) -> None:
        """Let the rows go that need not wait any more; whoever takes rows asks for it before."""
        self._looked = time.monotonic()
        self._pass_on(self._assembly.ready(self._looked))

    def close(self) -> None:
        """Let all rows go, complete or not."""
        self._pass_on(self._assembly.finish())

    def _pass_on(self, rows: Sequence[RawRow]) -> None:
        since = time.time() - time.monotonic()
        for item in rows:
            try:
                row = self._row(1, (item.time, *item.values))
            except RecordingError:  # no number makes it
                self.count(UNREADABLE)
                continue
            qualities = [item.qualities[k] for k in self._signals] if any(item.qualities) else None
            quality = None if qualities is None else np.array(qualities, dtype=np.uint8)
            self._queue.put(self.asset, replace(row, quality=quality, arrived=since + item.came))


def held_columns(subscriber: Subscriber, options: SourceOptions) -> tuple[str, ...]:
    """Give the columns whose last value holds: those that are declared, else of the inputs that the model holds.

    Raises
    ------
    FaultbondError
        Where a declared column is none of the asset.
    """
    columns = subscriber.columns
    if options.hold is None or subscriber.asset not in options.hold:
        held = {item.column for item in subscriber.graph.inputs if not item.linear}
        return tuple(dict.fromkeys(item.header for item in columns.inputs if item.header in held))
    known = [item.header for item in (*columns.inputs, *columns.outputs)]
    for name in options.hold[subscriber.asset]:
        if name not in known:
            raise FaultbondError(
                f"{subscriber.asset}: hold names {name!r}, which is no column. There are {', '.join(known)}."
            )
    return tuple(dict.fromkeys(options.hold[subscriber.asset]))
