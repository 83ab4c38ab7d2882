"""What runs the innovations of a plant with fixed parameters, and how its numbers lie.

The same extended Kalman filter as that of the engine, but for states, slow errors and input noise alone: parameters and
sizes of noise are given, to each lane its own. Slopes are differences between lanes (`fit/objective.py`).

Source: Ljung, System Identification, 2nd ed. 1999, sections 7.2 to 7.4 (prediction errors, maximum likelihood).
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import casadi as ca
import numpy as np

from faultbond.arrays import FloatArray, IntArray
from faultbond.equations.step import StepModel
from faultbond.model.graph import BondGraph


class Likelihood(Protocol):
    """Runs filters over samples: `synthesis/likelihood.c`, or the like. Pure: the arguments are not changed."""

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter over a block of samples.

        Parameters
        ----------
        lanes : float array, shape (n_numbers, n_lanes), see `build_begin`
        samples : float array, shape (n_samples, n_sample); layout `Layout.sample_fields`, SI

        Returns
        -------
        lanes : as the argument
        seen : float array, shape (n_samples, 2 * n_outputs, n_lanes); for each sensor the difference between the
            measured value and what the past and the sensors before it foretell, then the variances of these; SI
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How the numbers of a filter, of a direction and of a sample lie.

    A lane: mean, packed covariance and what is felt of changes of inputs, what is given, implicit signals. q: factors
    of the parameters, logarithms of the noise sd of sensors, slow errors and noisy inputs, of the memories of slow
    errors, s, and of how much larger these are for each unit of a change that is felt; a lane is given these as
    variances and rates.
    """

    n_x: int
    n_b: int
    n_w: int
    n_p: int
    n_y: int
    n_u: int
    n_z: int
    n_held: int  # sensors with a condition of their own
    n_felt: int  # inputs whose changes a slow error follows, of each of them

    @property
    def n_mean(self) -> int:
        """States, slow errors, input noise."""
        return self.n_x + self.n_b + self.n_w

    @property
    def variances(self) -> IntArray:
        """Where the variances of the mean lie in a lane, (n_mean,): at the heads of the rows of the triangle."""
        return self.n_mean + np.cumsum([0, *range(self.n_mean, 1, -1)])[: self.n_mean]

    @property
    def output_variances(self) -> slice:
        """Where those of the noise of sensors lie in a lane: behind the triangle, what is felt, and the parameters."""
        first = self.n_mean + self.n_mean * (self.n_mean + 1) // 2 + self.n_felt + self.n_p
        return slice(first, first + self.n_y)

    @property
    def n_q(self) -> int:
        """Numbers that may be unknown, without the start."""
        return self.first_each + self.n_felt

    @property
    def first_noise(self) -> int:
        """Where the sizes of noise begin in q: sensors, slow errors, inputs."""
        return self.n_p

    @property
    def first_memory(self) -> int:
        """Where the memories of slow errors begin in q."""
        return self.n_p + self.n_y + self.n_b + self.n_w

    @property
    def first_each(self) -> int:
        """Where it begins in q how much larger slow errors are after changes."""
        return self.first_memory + self.n_b

    @property
    def sample_fields(self) -> dict[str, slice]:
        """Layout of a sample: dt, u_before, u, y, use (1 or 0), held, fade, fresh.

        held: 1 of each sensor with a condition of its own that does not read as stated. Of the noise of an input `fade`
        is left from the sample before, and `fresh` times its variance is new.
        """
        return sample_fields(self.n_u, self.n_y, self.n_held)

    @property
    def n_sample(self) -> int:
        """Length of a sample."""
        return int(self.sample_fields["fresh"].stop)


def sample_fields(n_inputs: int, n_outputs: int, n_held: int) -> dict[str, slice]:
    """Give the layout of a sample: see `Layout.sample_fields`."""
    sizes = {"dt": 1, "u_before": n_inputs, "u": n_inputs, "y": n_outputs, "use": n_outputs}
    sizes |= {"held": n_held, "fade": n_inputs, "fresh": n_inputs}
    ends = np.cumsum([0, *sizes.values()]).tolist()
    return {name: slice(*place) for name, place in zip(sizes, pairwise(ends), strict=True)}


def felt_moves(graph: BondGraph) -> list[tuple[int, str]]:
    """Give which moves slow errors feel, in the order of q: number of the error, and the input."""
    return [(k, name) for k, item in enumerate(graph.slow_errors) for name in item.after]


def layout_of(model: StepModel) -> Layout:
    """Give the sizes of a plant."""
    plant = model.plant
    return Layout(
        n_x=len(model.states),
        n_b=plant.b.numel(),
        n_w=len(model.noisy),
        n_p=plant.theta.numel(),
        n_y=len(plant.graph.sensors),
        n_u=plant.u.numel(),
        n_z=plant.z.numel(),
        n_held=sum(item.valid_when is not None for item in plant.graph.sensors),
        n_felt=len(felt_moves(plant.graph)),
    )


def build_begin(model: StepModel) -> ca.Function:
    """Give (q, start) -> a lane before the first sample, see `Layout`; of several columns as many lanes.

    start (n_states,), SI, coordinates of the step model: used where the model file gives no start. Where it does,
    content and its sd are those of the file.
    """
    size, graph = layout_of(model), model.plant.graph
    q, start = ca.SX.sym("q", size.n_q), ca.SX.sym("start", size.n_x)
    parts = [size.n_p, size.n_y, size.n_b, size.n_w, size.n_b, size.n_felt]
    factors, sensors, slow, noise, memories, each = ca.vertsplit(q, list(np.cumsum([0, *parts])))
    theta = factors * ca.DM(model.scales) if size.n_p else factors
    nominal = np.array([item.nominal for item in graph.parameters])
    content = model.contents(model.reference_state, nominal).full()[:, 0]
    known = known_starts(model)
    for k, item in known.items():
        content[k] = item[0]
    held = ca.SX.sym("content", size.n_x)
    value = model.coordinates(held, theta)
    by_content = ca.jacobian(value, held)
    value, by_content = ca.substitute([value, by_content], [held], [ca.SX(ca.DM(content))])
    mean, spread = ca.SX.zeros(size.n_mean, 1), ca.SX(size.n_mean, size.n_mean)
    for k in range(size.n_x):
        mean[k] = value[k] if k in known else start[k]
        if k in known:
            spread[k, k] = (by_content[k, k] * known[k][1]) ** 2
    sizes = ca.vertcat(slow, noise)
    for k in range(sizes.numel()):
        spread[size.n_x + k, size.n_x + k] = ca.exp(2 * sizes[k])
    triangle = ca.vertcat(*(spread[i, j] for i in range(size.n_mean) for j in range(i, size.n_mean)))
    given = ca.vertcat(factors, ca.exp(2 * ca.vertcat(sensors, sizes)), ca.exp(-memories), ca.exp(2 * each))
    lane = ca.vertcat(mean, triangle, ca.SX.zeros(size.n_felt, 1), given, ca.DM(model.reference_implicit))
    return ca.Function("begin", [q, start], [ca.densify(lane)])


def known_starts(model: StepModel) -> dict[int, tuple[float, float]]:
    """Give content and its sd, SI, of the states whose start the model file gives, by state."""
    starts = {item.name: item.start for item in model.plant.graph.components}
    found = ((k, starts.get(state.component or "")) for k, state in enumerate(model.plant.network.states))
    return {k: (start.mean, start.sd) for k, start in found if start is not None}


def nominal_q(model: StepModel) -> FloatArray:
    """Give q as the model file states it, shape (n_q,)."""
    graph = model.plant.graph
    factors = [item.nominal / item.scale for item in graph.parameters]
    noises = [
        *(item.noise for item in graph.sensors),
        *(item.sd for item in graph.slow_errors),
        *(graph.inputs[k].noise for k in model.noisy),
    ]
    memories = [item.memory for item in graph.slow_errors]
    each = [x for item in graph.slow_errors for x in item.each]
    return np.array(
        [*factors, *np.log(np.maximum(noises, _LEAST)), *np.log(memories), *np.log(np.maximum(each, _LEAST))]
    )


_LEAST = 1e-150  # a size of noise whose square is still a number
