"""What a fault does to the healthy filter: the nonlinear plant with a parameter changed, through its recursion.

The core plays the plants, several side by side. Stores keep their contents when the parameter changes; nothing reacts
to the fault meanwhile. A bias of an instrument is a fault too: a sensor gives so much more, or so much less acts than
an input says. So is a gain of an input: so many times what it says acts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faultbond.analysis.false_alarm_trials import alarming, ratios_of
from faultbond.analysis.operation import Operation
from faultbond.analysis.sensitivity import BIAS, GAIN
from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.contract.spec import EngineSpec
from faultbond.equations.step import StepModel
from faultbond.runtime.core import Core

_ABSURD = 1e12  # noises; a plant that goes so far has run away, and counts as one without a solution
_MOST = 1e12  # standard deviations; more need not be told apart

_FIRST_PART = 0.05  # of its accuracy, the first size tried of a parameter
_LEAST = 1e-3  # and at least so much, in factors
_FIRST_NOISES, _MOST_NOISES = 1.0, 1e4  # the same of a sensor, and the largest; in its noise
_FIRST_INPUT, _MOST_INPUT = 0.01, 10.0  # the same of an input, in its largest value, and of its gain


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultTarget:
    """What may change: a parameter, a sensor or an input, by its position; -1 for the two that it is not.

    scale: SI size of one factor, in which all sizes are. first: the first size tried. most: the largest up, and down.
    is_gain: whether it is the gain of the input. largest: size of the input of which its faults are parts, SI.
    """

    name: str
    scale: float
    first: float
    most: tuple[float, float]
    parameter: int = -1
    output: int = -1
    input: int = -1
    is_gain: bool = False
    largest: float = 1.0


FaultCase = tuple[FaultTarget, int]  # sign of the change


def fault_targets(spec: EngineSpec, operation: Operation) -> tuple[FaultTarget, ...]:
    """Give all parameters, then the biases of the instruments that may fail, then the gains of such inputs."""
    found = [
        FaultTarget(
            name=item.name,
            scale=item.scale,
            first=max(_FIRST_PART * item.accuracy, _LEAST),
            most=(max(item.upper - item.healthy, 0.0), max(item.healthy - item.lower, 0.0)),
            parameter=k,
        )
        for k, item in enumerate(spec.parameters)
    ]
    largest = np.max(np.abs(operation.u), axis=0, initial=0.0)
    for item in spec.instruments:
        name = f"{item.name}{BIAS}"
        if item.is_output:
            noise, most = spec.outputs[item.index].noise, (_MOST_NOISES, _MOST_NOISES)
            found.append(FaultTarget(name=name, scale=noise, first=_FIRST_NOISES, most=most, output=item.index))
        elif largest[item.index] > 0.0:
            size, most = float(largest[item.index]), (_MOST_INPUT, _MOST_INPUT)
            found.append(
                FaultTarget(name=name, scale=size, first=_FIRST_INPUT, most=most, input=item.index, largest=size)
            )
    zeros = np.array([item.unit_offset for item in spec.inputs])
    shown = np.max(np.abs(operation.u - zeros), axis=0, initial=0.0)  # a gain is of what the unit counts
    for item in spec.instruments:
        if not item.is_output and shown[item.index] > 0.0:
            name, most, size = f"{item.name}{GAIN}", (_MOST_INPUT, 1.0), float(shown[item.index])
            gain = FaultTarget(name=name, scale=1.0, first=_FIRST_INPUT, most=most, input=item.index, is_gain=True)
            found.append(replace(gain, largest=size))
    return tuple(found)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shift:
    """What faults of some size (cases c) do after each onset o, over samples w.

    innovations: (w, c, o, n_outputs), in their sd. slow: (w, c, o, n_slow), in declared sd. largest: (c, n_outputs), of
    the outputs, SI. whole: (c,), whether the plant has a finite solution all along; else the numbers mean nothing.
    """

    innovations: FloatArray
    slow: FloatArray
    largest: FloatArray
    whole: BoolArray


class Faults:
    """Faults that begin at some rows (o, w) of an operation."""

    def __init__(self, model: StepModel, spec: EngineSpec, engine: Core, operation: Operation, rows: IntArray) -> None:
        self.model, self.spec, self.engine, self.operation, self.rows = model, spec, engine, operation, rows
        self.healthy = operation.mean[rows[:, 0]].copy()
        self.healthy[:, spec.noise_slice] = 0.0
        self.zeros = np.array([item.unit_offset for item in spec.inputs])
        self.samples = operation.packed[rows].copy()
        self.samples[:, 0, spec.sample_fields["dt"]] = 0.0  # they begin at the first sample
        self.outputs = self._outputs(self.healthy[None])[:, 0]

    def shift(self, cases: Sequence[FaultCase], sizes: FloatArray) -> Shift:
        """Give what faults of sizes (n_cases,), in factors, do to outputs, innovations and slow errors."""
        spec, operation, rows = self.spec, self.operation, self.rows
        moved = np.zeros((rows.shape[1], len(cases), len(rows), len(spec.outputs)))
        signed = [(item, sign * float(size)) for (item, sign), size in zip(cases, sizes, strict=True)]
        inside = [c for c, (item, _) in enumerate(signed) if item.parameter >= 0]
        if inside:
            starts = np.stack([self._changed(item.parameter, by) for item, by in (signed[c] for c in inside)])
            moved[:, inside] = self._outputs(starts) - self.outputs[:, None]
        for c, (item, by) in enumerate(signed):
            if item.input >= 0:
                moved[:, c] = self._acted_on(item, by) - self.outputs
            elif item.output >= 0:
                moved[:, c, :, item.output] = by * item.scale
        whole = np.asarray((np.abs(moved) < _ABSURD * spec.output_noise).all(axis=(0, 2, 3)))  # false for nan
        moved = np.where(whole[:, None, None], moved, 0.0)
        error = np.zeros((len(rows), len(cases), spec.n_joint))
        innovations, slow = np.zeros_like(moved), np.zeros((*moved.shape[:3], len(alarming(spec))))
        most = spec.thresholds.learning_bound or np.inf
        for w in range(rows.shape[1]):
            k = rows[:, w]
            if w:
                error = self._carried(error, k)
            spread = operation.spread[k][:, None, :]
            deviation = moved[w].transpose(1, 0, 2) - error @ operation.slope[k].transpose(0, 2, 1)
            learned = np.clip(deviation, -most * spread, most * spread)
            error = error + learned @ operation.gain[k].transpose(0, 2, 1)
            innovations[w] = np.clip(deviation / spread, -_MOST, _MOST).transpose(1, 0, 2)
            if slow.shape[-1]:
                ratios = ratios_of(spec, error, operation.aged[k][:, None])
                slow[w] = np.clip(ratios, -_MOST, _MOST).transpose(1, 0, 2)
        largest = np.max(np.abs(moved), axis=(0, 2))
        return Shift(innovations=innovations, slow=slow, largest=largest, whole=whole)

    def _carried(self, error: FloatArray, k: IntArray) -> FloatArray:
        """Carry errors (o, c, n_joint) to rows k (o,); parameters stay, slow errors fade, noise of inputs is anew."""
        spec, n_x = self.spec, len(self.spec.states)
        carried, slow = error.copy(), np.arange(spec.n_joint)[spec.slow_slice]
        carried[..., :n_x] = error @ self.operation.transition[k, :n_x].transpose(0, 2, 1)
        carried[..., spec.slow_slice] *= self.operation.transition[k[:, None], slow, slow][:, None, :]
        carried[..., spec.noise_slice] = 0.0
        return carried

    def _outputs(self, starts: FloatArray) -> FloatArray:
        """Give the outputs (w, n, o, n_outputs), SI, of plants (n, o, n_joint) that begin so at the onsets."""
        onsets = range(len(self.rows))
        return np.stack([self._played(starts[:, o], o, self.samples[o]) for o in onsets], axis=2)

    def _acted_on(self, item: FaultTarget, by: float) -> FloatArray:
        """Give the outputs (w, o, n_outputs), SI, of the healthy plant where more or less acts than an input says."""
        fields, samples = self.spec.sample_fields, self.samples.copy()
        for name in ("u_before", "u"):
            said = samples[..., fields[name].start + item.input]
            said += by * (said - self.zeros[item.input]) if item.is_gain else -by * item.scale
        played = [self._played(self.healthy[None, o], o, rows)[:, 0] for o, rows in enumerate(samples)]
        return np.stack(played, axis=1)

    def _played(self, starts: FloatArray, onset: int, samples: FloatArray) -> FloatArray:
        """Give the outputs (w, n, n_outputs), SI, of plants that are at `starts` (n, n_joint) at the first sample."""
        spec, lanes = self.spec, np.zeros((self.spec.n_numbers, len(starts)))
        lanes[: spec.n_joint] = starts.T
        lanes[spec.n_joint + spec.n_packed : -1] = self.operation.implicit[self.rows[onset, 0]][:, None]
        return self.engine.follow(lanes, samples).transpose(0, 2, 1)

    def _changed(self, parameter: int, change: float) -> FloatArray:
        """Give joint vectors (o, n_joint) after a step of a parameter; stores keep their contents."""
        n_x, place, scales = len(self.spec.states), self.spec.parameter_slice, self.model.scales
        changed, item = self.healthy.copy(), self.spec.parameters[parameter]
        moved = changed[:, place.start + parameter] + change
        changed[:, place.start + parameter] = np.clip(moved, item.lower, item.upper)
        for row, (old, new) in enumerate(zip(self.healthy, changed, strict=True)):
            content = self.model.contents(old[:n_x], old[place] * scales)
            changed[row, :n_x] = self.model.coordinates(content, new[place] * scales).full().reshape(-1)
        return changed
