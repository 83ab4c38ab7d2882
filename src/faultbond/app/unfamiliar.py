"""Inputs that stood, at an alarm, where they never were in the recordings to which the model was fitted."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.contract.findings import Detection
from faultbond.io.grid import PointBlock
from faultbond.model.graph import BondGraph, Input
from faultbond.report.numbers import figure, join, unit_text

BEYOND = 0.05  # of its range in these recordings by which an input must lie beyond it
LEAST = 0.02  # of its largest value there in its own unit, at least
BEFORE = 100  # samples before the alarm in which that counts, and all from the onset on


@dataclass(frozen=True, slots=True, kw_only=True)
class Unfamiliar:
    """An input, and the value that was farthest from where it had been, SI."""

    input: Input
    value: float


def unfamiliar_inputs(graph: BondGraph, points: Iterable[PointBlock], alarm: Detection) -> tuple[Unfamiliar, ...]:
    """Give inputs that stood where they never were in the recordings of the fit; none where that is not known.

    Parameters
    ----------
    graph : the plant
    points : of the recording, from its beginning
    alarm : the first one
    """
    known = [(k, item) for k, item in enumerate(graph.inputs) if item.fitted_range is not None]
    if not known:
        return ()
    u = _about(points, alarm)
    found = []
    for k, item in known:
        lower, upper = item.fitted_range or (0.0, 0.0)
        zero = item.unit.offset  # 20 degC are 20, not 293
        room = max(BEYOND * (upper - lower), LEAST * max(abs(lower - zero), abs(upper - zero)))
        seen = u[np.isfinite(u[:, k]), k]
        off = np.maximum(lower - seen, seen - upper)
        if len(seen) and off.max() > room:
            found.append(Unfamiliar(input=item, value=float(seen[np.argmax(off)])))
    return tuple(found)


def unfamiliar_sentence(found: Sequence[Unfamiliar]) -> str:
    """Say what was never compared with the plant; empty where nothing is."""
    if not found:
        return ""
    return (
        f"Up to the alarm {join([_words(item) for item in found])}: there the model was never compared with the plant, "
        "and what it gets wrong looks like a fault. Fit it to healthy recordings of such operation too."
    )


def _words(found: Unfamiliar) -> str:
    item, unit = found.input, found.input.unit
    lower, upper = (figure(unit.from_si(end), digits=3).number() for end in item.fitted_range or (0.0, 0.0))
    text = unit_text(unit.text)
    value = f"{figure(unit.from_si(found.value), digits=3).number()} {text}".rstrip()
    return f"{item.name} was {value} ({f'{lower} to {upper} {text}'.rstrip()} in the recordings of the fit)"


def _about(points: Iterable[PointBlock], alarm: Detection) -> np.ndarray:
    """Give the inputs from the onset, or some samples before the alarm, up to it, (n, n_inputs)."""
    parts = []
    for block in points:
        counts = (block.index <= alarm.sample) & (
            (block.index > alarm.sample - BEFORE) | (block.time >= alarm.change_time)
        )
        parts.append(block.u[counts])
        if len(block) and block.index[-1] > alarm.sample:
            break
    return np.concatenate(parts)
