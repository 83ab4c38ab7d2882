"""A recording as a fit takes it: samples as the monitor packs them, and those of the likelihood made of them.

An absent input is held, and a reading is not used while an input that reaches it directly settles.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.samples import Sample
from faultbond.contract.spec import EngineSpec
from faultbond.errors import NoVerdictError
from faultbond.fit.likelihood import sample_fields
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor

LEAST_PART = 2  # times the samples from which a start is solved: a shorter part tells little more than that


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HealthyRecording:
    """A recording of N samples, from the first with a value of every input; SI.

    points: of the whole recording. time (N,), s; u (N, n_inputs), held where absent; y (N, n_outputs), nan where
    absent; packed (N, spec.n_sample), as the engine takes them; samples (N, n), as the likelihood does, see
    `likelihood.sample_fields`; use (N, n_outputs), which readings count; wild (N, n_outputs), which were left out since
    they lie far off: None, none was.
    """

    name: str
    points: tuple[Sample, ...]
    time: FloatArray
    u: FloatArray
    y: FloatArray
    packed: FloatArray
    samples: FloatArray
    use: BoolArray
    wild: BoolArray | None = None

    @property
    def readings(self) -> int:
        """How many values of sensors are used."""
        return int(self.use.sum())

    def part(self, count: int) -> "HealthyRecording":
        """Give its first samples; of `points` and `packed`, which no likelihood looks at, all."""
        return replace(
            self,
            time=self.time[:count],
            u=self.u[:count],
            y=self.y[:count],
            samples=self.samples[:count],
            use=self.use[:count],
            wild=None if self.wild is None else self.wild[:count],
        )

    def without(self, wild: BoolArray) -> "HealthyRecording":
        """Give the recording with some readings (N, n_outputs) left out."""
        samples, use, far = self.samples.copy(), self.use & ~wild, self.use & wild
        samples[:, sample_fields(self.u.shape[1], self.y.shape[1], 0)["use"]] = use
        return replace(self, samples=samples, use=use, wild=far if self.wild is None else self.wild | far)


def trusted(spec: EngineSpec, packed: FloatArray) -> BoolArray:
    """Tell which sensors have a value in packed samples (n, n_sample) and are not blanked, (n, n_outputs)."""
    place = spec.sample_fields
    return np.asarray((packed[:, place["use"]] > 0) & (packed[:, place["scale"]] < spec.thresholds.blank_factor))


def judged_parts(name: str, points: Sequence[Sample], core: Core) -> tuple[tuple[str, Sequence[Sample]], ...]:
    """Give the parts of a recording in which the model holds, each with a name; all of it where it always does.

    What the plant does between them nobody knows, so each begins anew. Too short ones are left out.

    Raises
    ------
    NoVerdictError
        Where none is long enough.
    """
    if core.spec.condition < 0:
        return ((name, points),)
    monitor, least = Monitor(core), LEAST_PART * int(core_settings()["START_SAMPLES"])
    parts: list[list[Sample]] = [[]]
    held = np.full(len(core.spec.inputs), np.nan)
    for point in points:
        held = np.where(np.isfinite(point.u), point.u, held)
        if monitor.pack(point) is not None and monitor.is_outside:
            parts.append([])
        elif parts[-1] or len(parts) == 1:
            parts[-1].append(point)
        else:  # what was told before holds
            parts[-1].append(replace(point, u=held))
    kept = [
        part
        for part in parts
        if len(part) >= least and np.isfinite(np.array([point.y for point in part])).any(axis=0).all()
    ]
    if not kept:
        problem = f"{least} samples in a row with a value of each sensor; check the condition of `valid_when`"
        raise NoVerdictError(f"{name}: nowhere does the model hold for {problem}")
    if len(parts) == 1:
        return ((name, points),)
    return tuple((f"{name}, part {k}", part) for k, part in enumerate(kept, start=1))


def _take_noise(spec: EngineSpec, packed: FloatArray, fade: FloatArray, fresh: FloatArray) -> None:
    """Fill in how the noise of each input goes on, (n, n_inputs) each: white, but for smooth inputs."""
    fresh[:] = 1.0
    place = spec.sample_fields
    for k in spec.smooth_inputs:
        number = spec.noisy_inputs[k]
        fade[:, number] = packed[:, place["fade"].start + k]
        fresh[:, number] = packed[:, place["fresh"].start + k] / spec.inputs[number].noise ** 2


def healthy_recording(name: str, points: Sequence[Sample], core: Core) -> HealthyRecording:
    """Give a recording on the grid of samples, from the first one with a value of every input.

    Raises
    ------
    NoVerdictError
        Where an input or a sensor has no value at all.
    """
    spec, monitor = core.spec, Monitor(core)
    rows, held = list[FloatArray](), list[FloatArray]()
    u = np.full(len(spec.inputs), np.nan)
    for point in points:
        u = np.where(np.isfinite(point.u), point.u, u)
        row = monitor.pack(point)
        if row is not None:
            rows.append(row)
            held.append(u)
    for item, value in zip(spec.inputs, u, strict=True):
        if not np.isfinite(value):
            raise NoVerdictError(f"{name}: no row has a value of the input {item.name}; check its column")
    begun = len(points) - len(rows)
    y = np.array([item.y for item in points[begun:]]).reshape(-1, len(spec.outputs))
    for k, output in enumerate(spec.outputs):
        if not np.isfinite(y[:, k]).any():
            raise NoVerdictError(f"{name}: no row has a value of the sensor {output.name}; check its column")
    packed = np.array(rows)
    fields = sample_fields(len(spec.inputs), len(spec.outputs), len(spec.held))
    use = trusted(spec, packed)
    samples = np.zeros((len(rows), fields["fresh"].stop))
    for field, place in fields.items():
        if field not in ("use", "fade", "fresh"):
            samples[:, place] = packed[:, spec.sample_fields[field]]
    samples[:, fields["use"]] = use
    _take_noise(spec, packed, samples[:, fields["fade"]], samples[:, fields["fresh"]])
    return HealthyRecording(
        name=name,
        points=tuple(points),
        time=np.array([item.time for item in points[begun:]]),
        u=np.array(held),
        y=y,
        packed=packed,
        samples=samples,
        use=use,
    )
