"""The last samples and healthy lanes: kept beside the healthy filter, and what the bank begins from at the alarm."""

from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec

WILD = 5.0  # innovation in its sd that noise alone does not bring about
MOST_BURSTS = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Past:
    """The last samples, one row each, oldest first; what no run reaches yet is zero.

    A further row is written behind the last one, where no past that was given out looks. So nothing is copied but where
    the table is full, or where somebody goes on from an earlier past.

    table : (2 * depth, n_sample + n_numbers + 2)
        Packed sample, healthy lane after it, time (s), largest innovation (sd).
    end : where this past ends in it
    written : where the longest past in it ends, a cell that all of them share; one thread goes on with them at a time
    last : number of the last sample
    n_sample : numbers of a packed sample
    """

    table: FloatArray
    end: int
    written: list[int]
    last: int
    n_sample: int

    def place(self, number: int) -> int:
        """Give the place of a sample in the rows, counted from their end; its number is at most that of the last."""
        return number - self.last - 1

    @property
    def rows(self) -> FloatArray:
        """All rows, (depth, n_sample + n_numbers + 2)."""
        return self.table[self.end - len(self.table) // 2 : self.end]

    @property
    def samples(self) -> FloatArray:
        """Packed samples, (depth, n_sample)."""
        return self.rows[:, : self.n_sample]

    @property
    def lanes(self) -> FloatArray:
        """Healthy lanes, (depth, n_numbers)."""
        return self.rows[:, self.n_sample : -2]

    @property
    def times(self) -> FloatArray:
        """Times of the samples, (depth,), s."""
        return self.rows[:, -2]

    @property
    def wildness(self) -> FloatArray:
        """Largest innovation of each sample in its standard deviation, (depth,)."""
        return self.rows[:, -1]

    def followed(self, number: int, sample: FloatArray, lane: FloatArray, time: float, wildness: float) -> "Past":
        """Give this past with one more sample (n_sample,), its number, and the healthy lane after it (n_numbers,)."""
        table, end, written = self.table, self.end, self.written
        if end == len(table) or written[0] != end:
            table, end = np.concatenate([self.rows, np.zeros_like(self.rows)]), len(self.rows)
            written = [end]
        row = table[end]
        row[: self.n_sample], row[self.n_sample : -2], row[-2], row[-1] = sample, lane, time, wildness
        written[0] = end + 1
        return Past(table=table, end=end + 1, written=written, last=number, n_sample=self.n_sample)

    def mended(self, samples: FloatArray, lanes: FloatArray, wildness: FloatArray) -> "Past":
        """Give this past with other numbers in its last n rows.

        They are samples (n, n_sample), lanes (n, n_numbers), and largest innovations (n,), sd.
        """
        rows = self.rows.copy()
        last = rows[len(rows) - len(samples) :]
        last[:, : self.n_sample], last[:, self.n_sample : -2], last[:, -1] = samples, lanes, wildness
        return past_of(rows, self.last, self.n_sample)


def past_of(rows: FloatArray, last: int, n_sample: int) -> Past:
    """Give the past with these rows (depth, n_sample + n_numbers + 2), see `Past.table`, up to sample number `last`."""
    table = np.concatenate([rows, np.zeros_like(rows)])
    return Past(table=table, end=len(rows), written=[len(rows)], last=last, n_sample=n_sample)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trail:
    """The last samples and healthy lanes, oldest first: `samples` (n, n_sample), `lanes` (n, n_numbers).

    old : (n_numbers,), the healthy lane as it stood long ago, before a slow drift taught it wrongly; None: not kept
    alarm : place of the sample of the alarm; -1: the last one
    bursts : places at which innovations became wild
    """

    samples: FloatArray
    lanes: FloatArray
    old: FloatArray | None = None
    alarm: int = -1
    bursts: tuple[int, ...] = ()

    @property
    def alarmed(self) -> int:
        """Place of the sample of the alarm."""
        return self.alarm if self.alarm >= 0 else len(self.samples) - 1


def bursts(wildness: FloatArray) -> tuple[int, ...]:
    """Give the places at which innovations became wild, the wildest if there are many.

    wildness : float array, shape (n,)
        Largest innovation of each sample up to the alarm, sd; the first of them tells nothing.
    """
    wild = wildness > WILD
    wild[:1] = False
    begins = np.flatnonzero(wild & ~np.concatenate([[False], wild[:-1]]))
    wildest = begins[np.argsort(-wildness[begins], kind="stable")[:MOST_BURSTS]]
    return tuple(int(place) for place in np.sort(wildest))


def wildness_of(spec: EngineSpec, sample: FloatArray, innovations: FloatArray) -> float:
    """Give the largest innovation (2 * n_outputs,) of a packed sample (n_sample,) in its standard deviation."""
    n_y = len(spec.outputs)
    with np.errstate(invalid="ignore", divide="ignore"):  # of a filter that has run away
        score = np.abs(innovations[:n_y]) / np.sqrt(innovations[n_y:])
    return float(np.max(np.where(sample[spec.sample_fields["use"]] > 0, score, 0.0), initial=0.0))
