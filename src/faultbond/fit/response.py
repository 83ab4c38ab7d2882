"""Which way outputs go where an input is a little larger: the plant's own answer, which no controller turns round."""

from collections.abc import Mapping

import numpy as np

from faultbond.arrays import FloatArray

A_LITTLE = 1e-3  # of the largest that an input was: its answers are those of the slope


def raised_inputs(u: FloatArray) -> FloatArray:
    """Give by how much inputs (N, n_inputs) are raised, one at a time, (n_inputs, n_inputs)."""
    largest = np.max(np.abs(np.nan_to_num(u)), axis=0, initial=0.0)
    return np.diag(A_LITTLE * np.where(largest > 0.0, largest, 1.0))


def with_raised(rows: FloatArray, fields: Mapping[str, slice], more: FloatArray) -> FloatArray:
    """Give packed samples whose inputs are larger by `more` (n_inputs,) all the time."""
    raised = rows.copy()
    raised[:, fields["u_before"]] += more
    raised[:, fields["u"]] += more
    return raised


def way_between(alone: FloatArray, raised: FloatArray) -> FloatArray:
    """Give how far `raised` is from `alone` on the whole, both (N, n_outputs); (n_outputs,), 0 where none is known."""
    off = raised - alone
    known = np.isfinite(off)
    return np.asarray(np.where(known, off, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1))
