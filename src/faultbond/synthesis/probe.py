"""What each lane expects of the signals that a person can measure by hand (`checks` in the model file)."""

from dataclasses import replace

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.graph import BondGraph, Sensor
from faultbond.runtime.advice import Probe
from faultbond.types import CheckKind


def build_probe(spec: EngineSpec, graph: BondGraph) -> Probe | None:
    """Give the function (lane, inputs) -> expected values of the checked signals, SI; None where there are none."""
    signals = tuple(
        Sensor(name=item.name, column=item.name, unit=item.unit, reads=item.reads, noise=item.noise)
        for item in graph.checks
        if item.kind is CheckKind.SIGNAL and item.reads is not None
    )
    if not signals:
        return None
    model = build_step_model(build_plant(replace(graph, sensors=signals)), all_inputs=True)

    def probe(lane: FloatArray, inputs: FloatArray) -> FloatArray:
        layout = spec if len(lane) == spec.n_numbers else spec.slotted
        factors, errors = lane[layout.parameter_slice].copy(), np.zeros(len(spec.inputs))
        errors[list(spec.noisy_inputs)] = lane[layout.noise_slice]
        if layout.slot:
            size = lane[layout.slot_slice][0]
            factors += lane[layout.role_fields["theta"]] * size
            errors += lane[layout.role_fields["input"]] * size
        joint = np.concatenate([lane[: layout.parameter_slice.start], factors, errors])
        return np.asarray(model.measure(joint, inputs, lane[layout.loop_slice])[0].full()[:, 0])

    return probe
