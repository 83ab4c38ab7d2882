"""What tests put into a store, and what they compare of it."""

from collections.abc import Iterable

import numpy as np

from faultbond.io.row_block import RowBlock
from faultbond.service.contract.messages import Action, Curves, Deed, NamedRecord
from faultbond.service.contract.store import Enrolment


def enrolment(asset: str = "pump", model: str = "a" * 64, n_inputs: int = 1, n_outputs: int = 2) -> Enrolment:
    """An asset of a model that nobody reads."""
    return Enrolment(
        asset=asset, model_sha256=model, label="m.yaml", text="name: m", n_inputs=n_inputs, n_outputs=n_outputs
    )


def some_rows(first: int, count: int, *, n_inputs: int = 1, n_outputs: int = 2) -> RowBlock:
    """Rows at seconds `first` and so on, which their values tell apart."""
    number = np.arange(first, first + count)
    time = number.astype(float)
    values = np.sin(time[:, None] * 0.7 + np.arange(n_inputs + n_outputs))
    values[number % 7 == 3, -1] = np.nan
    return RowBlock(
        time=time, u=values[:, :n_inputs], y=values[:, n_inputs:], saturated=number % 3, line=number * 1000 + 1
    )


def some_curves(first: int, count: int, *, n_inputs: int = 1, n_outputs: int = 2) -> Curves:
    """Points at seconds `first` and so on."""
    rows = some_rows(first, count, n_inputs=n_inputs, n_outputs=n_outputs)
    return Curves(
        time=rows.time, inputs=rows.u, measured=rows.y, expected=rows.y + 0.25, sd=rows.y * 0.0 + 0.5, cusum=rows.y**2
    )


def told(asset: str, sample: int, kind: str = "detection", **content: object) -> NamedRecord:
    """A record of a sample."""
    name = f"{asset}/a/{sample}/{kind}"
    return NamedRecord(
        id=name, asset=asset, sample=sample, time=float(sample), kind=kind, content={"record": kind, **content}
    )


def deed(asset: str, rows: int, action: Action = Action.ACKNOWLEDGE, comment: str = "", at: float = 0.0) -> Deed:
    """What Ada did."""
    return Deed(asset=asset, action=action, at=at, who="Ada", rows=rows, comment=comment, target=("K1",))


def flat(log: Iterable[RowBlock | Deed]) -> list[object]:
    """A log row by row: what was read of each to the last bit, and deeds as they are."""
    found: list[object] = []
    for item in log:
        if isinstance(item, Deed):
            found.append(item)
            continue
        found += [row_bits(item, k) for k in range(len(item))]
    return found


def row_bits(rows: RowBlock, k: int) -> tuple[object, ...]:
    """One row so that it can be compared, nan with nan too."""
    row = rows.row(k)
    return np.float64(row.time).tobytes(), row.u.tobytes(), row.y.tobytes(), row.saturated, row.line
