"""Inputs and sensors that stood, at an alarm, where they never were in the recordings to which the model was fitted."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.familiar import familiar_range
from faultbond.contract.findings import Detection
from faultbond.io.grid import PointBlock
from faultbond.model.graph import BondGraph, Input, Sensor
from faultbond.report.numbers import figure, join, unit_text

BEFORE = 100  # samples before the alarm in which that counts of an input, and all from the onset on
READ = 10  # of as many before the onset that a sensor must have read


@dataclass(frozen=True, slots=True, kw_only=True)
class Unfamiliar:
    """An input, and the value that was farthest from where it had been, SI; or a sensor, and what it usually read."""

    signal: Input | Sensor
    value: float


def unfamiliar_signals(graph: BondGraph, points: Iterable[PointBlock], alarm: Detection) -> tuple[Unfamiliar, ...]:
    """Give what stood where it never was in the recordings of the fit; none where that is not known.

    A fault moves sensors, so of these only what they read before its onset counts, of inputs all up to the alarm.

    Parameters
    ----------
    graph : the plant
    points : of the recording, from its beginning
    alarm : the first one
    """
    if all(item.fitted_range is None for item in graph.instruments):
        return ()
    u, y = _about(points, alarm)
    found = [_farthest(item, u[np.isfinite(u[:, k]), k]) for k, item in enumerate(graph.inputs)]
    for k, sensor in enumerate(graph.sensors):
        read = y[np.isfinite(y[:, k]), k]
        found.append(_farthest(sensor, np.array([np.median(read)] if len(read) >= READ else [])))
    return tuple(item for item in found if item is not None)


def _farthest(item: Input | Sensor, seen: FloatArray) -> Unfamiliar | None:
    """Give what of some values (n,), SI, is clearly beyond where it was, and farthest; None: none is."""
    if item.fitted_range is None or not len(seen):
        return None
    lower, upper = familiar_range(item.fitted_range, item.unit.offset)
    off = np.maximum(lower - seen, seen - upper)
    return Unfamiliar(signal=item, value=float(seen[np.argmax(off)])) if off.max() > 0.0 else None


def unfamiliar_sentence(found: Sequence[Unfamiliar]) -> str:
    """Say what was never compared with the plant; empty where nothing is."""
    inputs, sensors = ([item for item in found if isinstance(item.signal, kind)] for kind in (Input, Sensor))
    told = [f"up to the alarm {join([_words(item, 'was') for item in inputs])}"] if inputs else []
    told += [f"before anything changed {join([_words(item, 'read') for item in sensors])}"] if sensors else []
    if not told:
        return ""
    where = join(told)
    return (
        f"{where[:1].upper()}{where[1:]}: there the model was never compared with the plant, and what it gets wrong "
        "looks like a fault. "
        + (
            "If the plant was healthy then, fit the model to such recordings too."
            if sensors
            else "Fit it to healthy recordings of such operation too."
        )
    )


def _words(found: Unfamiliar, verb: str) -> str:
    item, unit = found.signal, found.signal.unit
    lower, upper = (figure(unit.from_si(end), digits=3).number() for end in item.fitted_range or (0.0, 0.0))
    text = unit_text(unit.text)
    value = f"{figure(unit.from_si(found.value), digits=3).number()} {text}".rstrip()
    return f"{item.name} {verb} {value} ({f'{lower} to {upper} {text}'.rstrip()} in the recordings of the fit)"


def _about(points: Iterable[PointBlock], alarm: Detection) -> tuple[FloatArray, FloatArray]:
    """Give inputs from the onset, or some samples before the alarm, up to it, (n, n_inputs); sensors before the onset.

    These (m, n_sensors), at most BEFORE rows.
    """
    parts, before = [], list[FloatArray]()
    for block in points:
        counts = (block.index <= alarm.sample) & (
            (block.index > alarm.sample - BEFORE) | (block.time >= alarm.change_time)
        )
        parts.append(block.u[counts])
        before = [np.concatenate([*before, block.y[block.time < alarm.change_time]])[-BEFORE:]]
        if len(block) and block.index[-1] > alarm.sample:
            break
    return np.concatenate(parts), before[0]
