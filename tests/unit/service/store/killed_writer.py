"""Writes to a store without end and says what is safe; the test that starts it kills it.

Arguments: the store, the number of assets, the seed. It says after each commit how many rows each asset has.
"""

import sys

import numpy as np

from faultbond.service.contract.store import Commit
from faultbond.service.store.opening import open_store
from stored import deed, enrolment, some_curves, some_rows, told


def main() -> None:
    place, n_assets, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    random = np.random.default_rng(seed)
    store = open_store(place, reserve=2**16)
    rows = {}
    for k in range(n_assets):
        rows[f"a{k}"] = store.enrol(enrolment(f"a{k}")).rows
    done = 0
    while True:
        parts = []
        for asset, first in rows.items():
            count = int(random.integers(1, 61))
            behind = first + count
            parts.append(
                Commit(
                    asset=asset,
                    rows=some_rows(first, count),
                    arrived=float(behind),
                    cursor=str(behind),
                    curves=some_curves(first, count),
                    records=tuple(told(asset, k) for k in range(first, behind) if k % 10 == 0),
                    deeds=(deed(asset, behind),) if done % 3 == 0 else (),
                    checkpoint=str(behind).encode() * 2000 if done % 5 == 0 else None,
                )
            )
        store.commit(parts)
        rows = {part.asset: rows[part.asset] + len(part.rows or ()) for part in parts}
        done += 1
        sys.stdout.write(" ".join(map(str, rows.values())) + "\n")
        sys.stdout.flush()
        if done % 40 == 0:
            store.retain(older_than=min(rows.values()) - 1500.0)


if __name__ == "__main__":
    main()
