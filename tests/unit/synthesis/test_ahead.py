"""How far apart the moments are at which advice predicts: as fine as what is left of the plant's modes asks for."""

import numpy as np
import pytest

from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.model.text import parse_model
from faultbond.synthesis.ahead import AHEAD, GONE, LONGEST, PART, ahead_lengths
from faultbond.synthesis.specify import at_reference
from made import graph_of

CIRCUIT = """
name: circuit
sample_time: {step} s
inputs: {{V: {{unit: V}}}}
components:
  source: {{type: Se, law: e = V}}
  R: {{type: R, parameters: {{R: {ohm} ohm}}}}
  L: {{type: I, parameters: {{L: 1 H}}}}
  C: {{type: C, parameters: {{C: 1 F}}}}
junctions: {{loop: 1}}
bonds: [source -> loop, loop -> R, loop -> L, loop -> C]
sensors: {{v: {{reads: C.e, unit: V, noise: 1 mV}}}}
"""


def circuit(step: float, ohm: float) -> StepModel:
    """A circuit of 1 H and 1 F, which swings with 1 rad/s."""
    return build_step_model(build_plant(parse_model(CIRCUIT.format(step=step, ohm=ohm))))


@pytest.mark.parametrize("name", ["tank", "rlc", "three_tank", "cascaded_tanks", "dc_motor"])
def test_steps_are_short_beside_what_is_left(name: str) -> None:
    """All samples are passed, no step longer than a quarter of the time of a mode that is still there, but for one."""
    model = build_step_model(build_plant(graph_of(name)))
    lengths, n_x = ahead_lengths(model), len(model.states)
    assert sum(lengths) == AHEAD
    assert max(lengths) <= LONGEST
    assert list(lengths[:-1]) == sorted(lengths[:-1])
    modes = np.linalg.eigvals(model.rates(*at_reference(model))[1].full()[:, :n_x]) * (
        model.plant.graph.sample_time or 1.0
    )
    for begin, length in zip(np.cumsum((0, *lengths)).tolist(), lengths, strict=False):
        left = np.abs(modes[np.exp(modes.real * begin) > GONE])
        assert length == 1 or length * left.max(initial=0.0) <= PART


def test_what_swings_without_end_is_followed_to_the_end() -> None:
    """Of 1 rad and of 0.1 rad a sample: each sample, and each second one. What is damped is so only at first."""
    assert ahead_lengths(circuit(1.0, 1e-6)) == (1,) * AHEAD
    assert set(ahead_lengths(circuit(0.1, 1e-6))) == {2}
    damped = ahead_lengths(circuit(1.0, 1.0))
    assert damped[:9] == (1,) * 9
    assert damped[12] == LONGEST
