"""A recording as the likelihood takes it: samples in a row, what is blanked, and how the slow errors are kicked.

The rules are those of the monitor: an absent input is held, a reading is not used while an input that reaches it
directly settles, and a slow error that follows an input grows after a change of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.errors import NoVerdictError
from faultbond.fit.likelihood import Layout
from faultbond.runtime.packing import CHANGE_MEMORY
from faultbond.runtime.state import Sample


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Record:
    """A recording: time (N,), s; samples (N, n_sample), layout `Layout.sample_fields`; use (N, n_outputs), SI."""

    name: str
    time: FloatArray
    u: FloatArray
    y: FloatArray
    samples: FloatArray
    use: BoolArray
    wild: int = 0  # readings left out since they lie far off

    @property
    def readings(self) -> int:
        """How many values of sensors are used."""
        return int(self.use.sum())

    def without(self, layout: Layout, wild: BoolArray) -> "Record":
        """Give the recording with some readings (N, n_outputs) left out."""
        samples, use = self.samples.copy(), self.use & ~wild
        samples[:, layout.sample_fields["use"]] = use
        return replace(self, samples=samples, use=use, wild=self.wild + int((self.use & wild).sum()))


def prepare(name: str, points: Sequence[Sample], spec: EngineSpec, layout: Layout) -> Record:
    """Give a recording on the grid of samples, from the first one with a value of every input.

    Raises
    ------
    NoVerdictError
        Where an input or a sensor has no value at all.
    """
    time, dt = (np.array([getattr(item, field) for item in points]) for field in ("time", "dt"))
    u = np.array([item.u for item in points]).reshape(len(points), layout.n_u)
    y = np.array([item.y for item in points]).reshape(len(points), layout.n_y)
    u = _held(name, u, spec)
    begun = int(np.argmax(np.isfinite(u).all(axis=1))) if layout.n_u else 0
    time, dt, u, y = (item[begun:] for item in (time, dt, u, y))
    for k, output in enumerate(spec.outputs):
        if not np.isfinite(y[:, k]).any():
            raise NoVerdictError(f"{name}: no row has a value of the sensor {output.name}; check its column")
    dt = np.concatenate([[0.0], dt[1:]])
    before = np.concatenate([u[:1], u[:-1]])
    use = np.isfinite(y) & ~_settling(spec, dt, u, u - before)
    samples = np.zeros((len(time), layout.n_sample))
    fields = layout.sample_fields
    samples[:, fields["dt"]] = dt[:, None]
    samples[:, fields["u_before"]], samples[:, fields["u"]] = before, u
    samples[:, fields["y"]], samples[:, fields["use"]] = np.where(np.isfinite(y), y, 0.0), use
    samples[:, fields["kick"]] = _kicks(spec, dt, u - before)
    return Record(name=name, time=time, u=u, y=y, samples=samples, use=use)


def _held(name: str, u: FloatArray, spec: EngineSpec) -> FloatArray:
    """Give inputs with absent values held; nan before the first one."""
    here = np.isfinite(u)
    for k, item in enumerate(spec.inputs):
        if not here[:, k].any():
            raise NoVerdictError(f"{name}: no row has a value of the input {item.name}; check its column")
    last = np.maximum.accumulate(np.where(here, np.arange(len(u))[:, None], -1), axis=0)
    return np.where(last < 0, np.nan, np.take_along_axis(u, np.maximum(last, 0), axis=0))


def _settling(spec: EngineSpec, dt: FloatArray, u: FloatArray, moved: FloatArray) -> BoolArray:
    """Whether a step of an input that reaches a sensor directly is still settling, (N, n_outputs)."""
    blank = np.zeros((len(dt), len(spec.outputs)), dtype=bool)
    clock = np.cumsum(dt)
    for k, item in enumerate(spec.inputs):
        if item.settling <= 0.0:
            continue
        limit = np.maximum(item.step, item.step_part * np.maximum.accumulate(np.abs(u[:, k])))
        stepped = np.abs(moved[:, k]) > limit
        last = np.maximum.accumulate(np.where(stepped, clock, -np.inf))
        reached = [j for j, output in enumerate(spec.outputs) if k in output.direct_inputs]
        blank[:, reached] |= (clock - last < item.settling)[:, None]
    return blank


def _kicks(spec: EngineSpec, dt: FloatArray, moved: FloatArray) -> FloatArray:
    """Give the variance that changes of inputs add to slow errors, (N, n_slow_errors)."""
    kicks = np.zeros((len(dt), len(spec.slow_errors)))
    if not any(error.after for error in spec.slow_errors):
        return kicks
    change, decay = np.zeros(moved.shape[1]), np.exp(-dt / CHANGE_MEMORY)
    for t in range(len(dt)):
        change = change * decay[t] + moved[t]
        released = 1.0 - decay[t] ** 2
        kicks[t] = [released * sum((each * change[k]) ** 2 for k, each in error.after) for error in spec.slow_errors]
    return kicks
