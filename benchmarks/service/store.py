"""How fast and how small the store is, on this machine: python -m benchmarks.service.store [FOLDER].

20 signals by commits of 100 rows, with curves and now and then a state; 100 assets at 1 Hz; the curves of a long
period; what forgetting costs. The folder is where the store is written: the disk counts.
"""

import sys
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time, sleep

import numpy as np

from faultbond.io.row_block import RowBlock
from faultbond.service.contract.messages import Curves
from faultbond.service.contract.store import Commit, Enrolment
from faultbond.service.store.opening import open_store
from faultbond.service.store.relational import RelationalStore

N_INPUTS, N_OUTPUTS = 5, 15


def main() -> None:
    """Measure and print."""
    base = sys.argv[1] if len(sys.argv) > 1 else None
    if base is not None and "://" in base:
        for k, measure in enumerate((one_asset, live, many_assets)):
            measure(lambda name, k=k: f"{base}?schema=bench_{k}_{name}")  # type: ignore[misc]
        return
    for measure in (one_asset, live, many_assets):
        with TemporaryDirectory(dir=base) as folder:
            measure(lambda name, folder=folder: f"{folder}/{name}.db")  # type: ignore[misc]
    for measure_file in (long_period, forgetting):
        with TemporaryDirectory(dir=base) as folder:
            measure_file(Path(folder) / "plant.db")


def enrolled(
    path: str | Path, names: list[str], n_inputs: int = N_INPUTS, n_outputs: int = N_OUTPUTS
) -> RelationalStore:
    """Give a new store that knows some assets."""
    store = open_store(path, reserve=0)
    for name in names:
        store.enrol(
            Enrolment(asset=name, model_sha256="0" * 64, label="m", text="", n_inputs=n_inputs, n_outputs=n_outputs)
        )
    return store


def signals(n: int, n_signals: int, seed: int = 0) -> np.ndarray:
    """Give values as instruments show them: five digits, slow movement and noise."""
    rng = np.random.default_rng(seed)
    slow = np.sin(np.arange(n)[:, None] / 700 + np.arange(n_signals))
    return np.round(100 + 10 * slow + 0.2 * rng.standard_normal((n, n_signals)), 3)


def rows_of(values: np.ndarray, first: int, n_inputs: int = N_INPUTS) -> RowBlock:
    """Give rows at 1 Hz."""
    n = len(values)
    return RowBlock(
        time=1.7e9 + np.arange(first, first + n, dtype=np.float64),
        u=values[:, :n_inputs],
        y=values[:, n_inputs:],
        saturated=np.zeros(n, dtype=np.intp),
        line=np.arange(first, first + n),
    )


def curves_of(rows: RowBlock) -> Curves:
    """Give curves of rows; what is expected has every digit."""
    expected = rows.y + np.sin(rows.y)
    return Curves(
        time=rows.time, inputs=rows.u, measured=rows.y, expected=expected, sd=0 * rows.y + 0.1, cusum=expected**2
    )


def timed(call: Callable[[], object]) -> float:
    """Give how long a call takes, ms."""
    begin = perf_counter()
    call()
    return 1e3 * (perf_counter() - begin)


def told(what: str, times: list[float], begun: float) -> None:
    """Print how long commits took; begun: processor time of this program before them, s."""
    p50, p99, most = np.percentile(times, [50, 99, 100])
    print(
        f"{what}: p50 {p50:.2f} ms, p99 {p99:.2f} ms, longest {most:.1f} ms; processor {process_time() - begun:.2f} s"
    )


def size_of(store: RelationalStore, kind: int) -> float:
    """Give bytes a row of large chunks."""
    statement = "SELECT sum(length(content) + coalesce(length(overview), 0)) * 1.0 / sum(count) FROM chunks"
    return float(store._database.number(f"{statement} WHERE kind=? AND dense=1", kind))


def one_asset(place: Callable[[str], str]) -> None:
    """Measure one asset of 20 signals, 100 rows a commit."""
    n, each = 200_000, 100
    values = signals(n, N_INPUTS + N_OUTPUTS)
    for with_curves in (False, True):
        store, times = enrolled(place(f"{with_curves}".lower()), ["a"]), list[float]()
        state, begun = np.random.default_rng(0).bytes(2**20), process_time()
        for k, first in enumerate(range(0, n, each)):
            rows = rows_of(values[first : first + each], first)
            part = Commit(
                asset="a",
                rows=rows,
                arrived=float(first),
                curves=curves_of(rows) if with_curves else None,
                checkpoint=state if with_curves and k % 60 == 0 else None,
            )
            times.append(timed(partial(store.commit, [part])))
        what = "rows, curves, and 1 MB of state each 60 commits" if with_curves else "rows alone"
        told(f"20 signals, {each} rows a commit, {what}: {1e3 * n / sum(times):,.0f} rows/s", times, begun)
        if with_curves:
            print(f"bytes a row after merging: rows {size_of(store, 0):.0f}, curves {size_of(store, 1):.0f}")
        read = timed(partial(deque, store.log_after("a", 0, 0), 0))
        print(f"log of {n} rows read in {read:.0f} ms; {store._database.used() / n:.0f} bytes a row")
        store.close()


def live(place: Callable[[str], str]) -> None:
    """Measure 20 signals at 100 Hz, for a minute, five commits a second."""
    n, each = 6000, 20
    values = signals(n, N_INPUTS + N_OUTPUTS)
    store, times = enrolled(place("live"), ["a"]), list[float]()
    begun, began = process_time(), perf_counter()
    for first in range(0, n, each):
        sleep(max(0.0, began + first / 100 - perf_counter()))
        rows = rows_of(values[first : first + each], first)
        part = Commit(asset="a", rows=rows, arrived=float(first), curves=curves_of(rows))
        times.append(timed(partial(store.commit, [part])))
    told(f"20 signals at 100 Hz for a minute, {each} rows a commit", times, begun)
    store.close()


def many_assets(place: Callable[[str], str]) -> None:
    """Measure 100 assets of 4 signals at 1 Hz, a commit a second of all of them."""
    names = [f"a{k}" for k in range(100)]
    n = 1500
    values = signals(n, 4)
    store, times = enrolled(place("many"), names, 2, 2), list[float]()
    begun = process_time()
    for k in range(n):
        rows = rows_of(values[k : k + 1], k, 2)
        curves = curves_of(rows)
        parts = [Commit(asset=name, rows=rows, arrived=float(k), curves=curves) for name in names]
        times.append(timed(partial(store.commit, parts)))
    told(f"100 assets of 4 signals, one row each a commit: {1e3 * n * 100 / sum(times):,.0f} rows/s", times, begun)
    print(f"bytes a row after merging: rows {size_of(store, 0):.0f}, curves {size_of(store, 1):.0f}")
    print(f"a day of one of them read back: {timed(lambda: list(store.log_after('a7', 0, 0))) * 86400 / n:.0f} ms")
    store.close()


def long_period(path: Path) -> None:
    """Measure the curves of a million points of 10 signals."""
    n = 1_000_000
    values = signals(n, 10)
    store = enrolled(path, ["a"], 2, 8)
    for first in range(0, n, 5000):
        rows = rows_of(values[first : first + 5000], first, 2)
        store.commit([Commit(asset="a", rows=rows, curves=curves_of(rows))])
    for words, span in (("all", n), ("a tenth", n // 10), ("a hundredth", n // 100), ("a thousandth", n // 1000)):
        begin = 1.7e9 + n // 2 - span / 2
        took = [timed(partial(store.curves, "a", begin, begin + span, 2000)) for _ in range(5)]
        print(f"curves of {words} of a million points of 10 signals, 2000 points: {min(took):.0f} ms")
    print(f"file: {path.stat().st_size / 1e6:.0f} MB")
    store.close()


def forgetting(path: Path) -> None:
    """Measure how long it takes to forget half of a store."""
    store = enrolled(path, ["a"])
    values = signals(100_000, N_INPUTS + N_OUTPUTS)
    for first in range(0, 400_000, 1000):
        rows = rows_of(values[first % 100_000 : first % 100_000 + 1000], first)
        store.commit([Commit(asset="a", rows=rows, arrived=float(first), curves=curves_of(rows))])
    store.commit([Commit(asset="a", checkpoint=b"state")])
    store._database.shrink()
    before = path.stat().st_size
    took = timed(lambda: store.retain(at_most=before // 2))
    print(f"forgetting half of {before / 1e6:.0f} MB: {took:.0f} ms, {path.stat().st_size / 1e6:.0f} MB are left")
    store.close()


if __name__ == "__main__":
    main()
