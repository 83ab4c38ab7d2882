"""Plants with a fault, as the core plays them: against the step model, sample by sample."""

import numpy as np
import pytest

from faultbond.analysis.faulty import Faults, FaultTarget, fault_targets
from faultbond.analysis.operation import Operation, advance_function, usual_operation
from faultbond.arrays import FloatArray, IntArray
from faultbond.contract.spec import EngineSpec
from faultbond.equations.step import StepModel
from faultbond.synthesis.engine import build_engine
from faultbond.synthesis.specify import build_spec
from plants import LAMP, example, stated

SIZE = {"bias": 0.02, "gain": 0.05}  # of faults of inputs, in their largest value, and in their gain


def stepped(
    model: StepModel, spec: EngineSpec, operation: Operation, rows: IntArray, start: FloatArray, item: FaultTarget
) -> FloatArray:
    """Give the outputs (w, n_outputs) of a plant from `start` on, with what is wrong with an input."""
    fields, z, v, found = spec.sample_fields, operation.implicit[rows[0]], start, []
    zeros, one = np.array([k.unit_offset for k in spec.inputs]), np.eye(len(spec.inputs))[item.input]
    step = advance_function(model)
    for w, row in enumerate(rows):
        packed = operation.packed[row]
        acts = [packed[fields[name]] for name in ("u_before", "u")]
        if item.is_gain:
            acts = [u + one * SIZE["gain"] * (u - zeros) for u in acts]
        elif item.input >= 0:
            acts = [u - one * SIZE["bias"] * item.scale for u in acts]
        if w:
            v, z, y = (part.full()[:, 0] for part in step(v, z, *acts, packed[fields["dt"]]))
        else:
            y = model.measure(v, acts[1], z)[0].full()[:, 0]
        found.append(y)
    return np.array(found)


@pytest.mark.parametrize("model", [example("tank"), stated(LAMP)], ids=["tank", "lamp, with signals that are implicit"])
def test_the_core_plays_the_plant_as_it_is_stated(model: StepModel) -> None:
    """A parameter off, and an input: what the sensors move by is what the nonlinear plant gives, from each onset on."""
    spec, (_, engine) = build_spec(model), build_engine(model.plant.graph)
    operation = usual_operation(model, spec, engine, 300)
    rows = np.array([[150], [220]]) + np.arange(40)
    faults = Faults(model, spec, engine, operation, rows)
    targets = [item for item in fault_targets(spec, operation) if item.output < 0]
    sizes = np.array([item.first if item.input < 0 else SIZE[item.name.rpartition(".")[2]] for item in targets])
    shown = faults.shift([(item, 1) for item in targets], sizes)
    assert shown.whole.all()
    healthy = FaultTarget(name="", scale=1.0, first=0.0, most=(0.0, 0.0))
    clean = [stepped(model, spec, operation, row, faults.healthy[o], healthy) for o, row in enumerate(rows)]
    for c, (item, size) in enumerate(zip(targets, sizes, strict=True)):
        start = faults.healthy if item.parameter < 0 else faults._changed(item.parameter, float(size))
        seen = [stepped(model, spec, operation, row, start[o], item) - clean[o] for o, row in enumerate(rows)]
        least = 1e-7 * spec.output_noise
        assert np.all(np.abs(shown.largest[c] - np.abs(seen).max(axis=(0, 1))) < least)
        for o, row in enumerate(rows):  # the first innovation is the first move, since nothing is learned yet
            assert np.all(np.abs(shown.innovations[0, c, o] * operation.spread[row[0]] - seen[o][0]) < least)


def test_a_plant_is_played_alike_whatever_is_beside_it() -> None:
    """Each lane ends its search for implicit signals by itself: to the last digit, with one plant and with many."""
    model = stated(LAMP)
    spec, (_, engine) = build_spec(model), build_engine(model.plant.graph)
    operation = usual_operation(model, spec, engine, 300)
    faults = Faults(model, spec, engine, operation, np.array([[150]]) + np.arange(60))
    starts = np.stack([faults._changed(k, by)[0] for k in range(len(spec.parameters)) for by in (0.3, -0.2, 1e-4)])
    together = faults._played(starts, 0, faults.samples[0])
    alone = [faults._played(start[None], 0, faults.samples[0])[:, 0] for start in starts]
    assert np.array_equal(together, np.stack(alone, axis=1))
