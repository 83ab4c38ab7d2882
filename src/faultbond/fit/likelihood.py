"""One sample of the innovations of a plant with fixed parameters, and their derivative along one direction.

The same extended Kalman filter as that of the engine, but for states, slow errors and input noise alone: parameters
and sizes of noise are given. Each lane carries a direction in which the unknowns move, and how everything follows it:
exact derivatives (forward automatic differentiation), one direction a lane, several lanes at a time. The filter itself
is the same for all, and runs once.

Source: Ljung, System Identification, 2nd ed. 1999, sections 7.2 to 7.4 (prediction errors, maximum likelihood).
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, Protocol

import casadi as ca
import numpy as np

from faultbond.arrays import FloatArray
from faultbond.equations.step import StepModel
from faultbond.model.graph import BondGraph

_ANYWHERE = 1e3  # times the noise of a sensor: an sd that says nothing of what it reads


class Advanced(NamedTuple):
    """Where a likelihood stands after a block of samples, and what it saw at each of them.

    common : shape (n_common,); lanes : shape (n_numbers, n_lanes); seen : shape (n_samples, n_seen);
    innovations : shape (n_samples, n_innovations, n_lanes)
    """

    common: FloatArray
    lanes: FloatArray
    seen: FloatArray
    innovations: FloatArray


class Likelihood(Protocol):
    """Runs `build_likelihood` over samples. Pure: the arguments are not changed."""

    def advance(self, common: FloatArray, lanes: FloatArray, samples: FloatArray) -> Advanced:
        """Filter over a block of samples.

        Parameters
        ----------
        common : float array, shape (n_common,)
        lanes : float array, shape (n_numbers, n_lanes)
        samples : float array, shape (n_samples, n_sample); layout `Layout.sample_fields`, SI

        Returns
        -------
        common, lanes : as the arguments
        seen : float array, shape (n_samples, n_seen)
        innovations : float array, shape (n_samples, n_innovations, n_lanes)
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How the numbers of a filter, of a direction and of a sample lie.

    A filter: mean, packed covariance and what is felt of changes of inputs, q, implicit signals. A direction: that of
    all but the latter. q: factors of the parameters, logarithms of the noise sd of sensors, slow errors and noisy
    inputs, of the memories of slow errors, s, and of how much larger these are for each unit of a change that is felt.
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
    def n_filter(self) -> int:
        """Mean, packed covariance, changes that are felt."""
        return self.n_mean + self.n_mean * (self.n_mean + 1) // 2 + self.n_felt

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


def build_likelihood(model: StepModel, *, slopes: bool = True) -> ca.Function:
    """Give (common, lane, sample) -> (common, seen, lane, innovations) of one sample.

    seen: for each sensor the difference between the measured value and what the past and the sensors before it predict,
    then the variances of these; SI. A lane is a direction, and its innovations are the derivatives of both along it.
    Without `slopes` nothing is common: each lane is a filter of its own, and its innovations are what is seen.
    """
    size = layout_of(model)
    sample = ca.SX.sym("sample", size.n_sample)
    fields = {name: sample[place] for name, place in size.sample_fields.items()}
    moving = ca.SX.sym("moving", size.n_filter + size.n_q)
    implicit = ca.SX.sym("implicit", size.n_z)
    direction = ca.SX.sym("direction", moving.numel())
    known = _Known()
    following, seen, solved = _sample(model, size, moving, implicit, fields, known)
    n_f, none = size.n_filter, ca.SX(0, 1)
    before, after = ca.vertcat(moving, implicit), ca.vertcat(following, moving[n_f:], solved)
    if not slopes:
        after, seen = known.in_full(after, seen)
        return _function([none, before, sample], [none, none, after, seen])
    change = known.along(ca.vertcat(following, seen), moving, direction)
    ends = known.in_full(after, seen, ca.vertcat(change[:n_f], direction[n_f:]), change[n_f:])
    return _function([before, direction, sample], ends)


class _Known:
    """Values that count only where something is true, and are 0 else, with their derivatives, whatever they would be.

    Where a law has no value, a factor of 0 would not take away what is no number, and least of all of a derivative. So
    each such value stands for itself until the derivatives are there.
    """

    def __init__(self) -> None:
        self._found: list[tuple[ca.SX, ca.SX, ca.SX]] = []  # what stands for it, whether it counts, and it

    def where(self, counts: ca.SX, value: ca.SX) -> ca.SX:
        """Give a value, or 0 of the same shape where it does not count."""
        symbol = ca.SX.sym(f"known{len(self._found)}", value.sparsity())
        self._found.append((symbol, counts, value))
        return symbol

    def along(self, what: ca.SX, moving: ca.SX, direction: ca.SX) -> ca.SX:
        """Give the derivative of a column along a direction in which `moving` moves."""
        for symbol, counts, value in self._found:
            change = _where(counts, ca.jtimes(_column(value), moving, direction))
            moving, direction = ca.vertcat(moving, _column(symbol)), ca.vertcat(direction, change)
        return ca.jtimes(what, moving, direction)

    def in_full(self, *what: ca.SX) -> list[ca.SX]:
        """Give expressions in which each value stands itself."""
        found = list(what)
        for symbol, counts, value in reversed(self._found):
            found = ca.substitute(found, [_column(symbol)], [_where(counts, _column(value))])
        return found


def _column(matrix: ca.SX) -> ca.SX:
    """Give the entries of a matrix that are not zero by its structure."""
    return ca.vec(matrix.nz[:])


def _where(counts: ca.SX, values: ca.SX) -> ca.SX:
    """Give values (n,) where something is true, else 0."""
    return ca.vertcat(*(ca.if_else(counts, values[k], 0) for k in range(values.numel()))) if values.numel() else values


def _function(arguments: list[ca.SX], results: list[ca.SX]) -> ca.Function:
    return ca.Function(
        "filter_step",
        arguments,
        [ca.densify(item) for item in results],
        ["common", "lane", "sample"],
        ["common_next", "seen", "lane_next", "innovations"],
        {"cse": True},
    )


def _sample(
    model: StepModel, size: Layout, moving: ca.SX, implicit: ca.SX, fields: dict[str, ca.SX], known: _Known
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Predict and update; give filter state, innovations with variances, implicit signals."""
    n = size.n_mean
    parts = [n, size.n_filter - n - size.n_felt, size.n_felt, *_parts_of_q(size)]
    mean, packed, felt, factors, sensor_noise, slow_noise, input_noise, memories, each = ca.vertsplit(
        moving, list(np.cumsum([0, *parts]))
    )
    covariance = _unpacked(packed, n)
    kept = [*range(size.n_x + size.n_b), *range(n + size.n_p - size.n_w, n + size.n_p)]
    x_next, slope, implicit = model.follow(
        _joint(size, mean, factors), fields["u_before"], fields["u"], implicit, fields["dt"]
    )
    transition, added = ca.SX(n, n), ca.SX(n, n)
    transition[: size.n_x, :] = slope[:, kept]
    for held, place, sd in _lagging(model):  # it may be anywhere once the sensor reads as stated again
        off = fields["held"][held]
        x_next[place] = known.where(1 - off, x_next[place]) + off * mean[place]
        transition[place, :] = known.where(1 - off, transition[place, :])
        added[place, place] = off * sd**2
    decay = ca.exp(-fields["dt"] * ca.exp(-memories))
    numbers = {item.name: i for i, item in enumerate(model.plant.graph.inputs)}
    followed = [(k, numbers[name]) for k, name in felt_moves(model.plant.graph)]
    felt = ca.vertcat(
        *(felt[e] * decay[k] + fields["u"][i] - fields["u_before"][i] for e, (k, i) in enumerate(followed))
    )
    for k in range(size.n_b):
        place = size.n_x + k
        squares = [(ca.exp(each[e]) * felt[e]) ** 2 for e, (own, _) in enumerate(followed) if own == k]
        transition[place, place] = decay[k]
        added[place, place] = (ca.exp(2 * slow_noise[k]) + sum(squares)) * (1 - decay[k] * decay[k])
    for k, number in enumerate(model.noisy):
        place = n - size.n_w + k
        transition[place, place] = fields["fade"][number]
        added[place, place] = ca.exp(2 * input_noise[k]) * fields["fresh"][number]
    lasting = [transition[k, k] * mean[k] for k in range(size.n_x, n)]
    mean = ca.vertcat(x_next, *lasting)
    covariance = ca.triu2symm(ca.triu(transition @ covariance @ transition.T + added))
    expected, slope, implicit = model.measure(_joint(size, mean, factors), fields["u"], implicit)
    slope, judged = slope[:, kept], _conditional(model)
    for j in judged:
        slope[j, :] = known.where(fields["use"][j], slope[j, :])
    told = [known.where(fields["use"][j], expected[j]) if j in judged else expected[j] for j in range(size.n_y)]
    growth = [1.0 + (item.growth * told[j]) ** 2 for j, item in enumerate(model.plant.graph.sensors)]
    noise = ca.exp(2 * sensor_noise) * ca.vertcat(*growth)
    shift, covariance, seen = _update(fields, covariance, expected, slope, noise, judged, known)
    return ca.vertcat(mean + shift, _packed(covariance), felt), seen, implicit


def _parts_of_q(size: Layout) -> list[int]:
    return [size.n_p, size.n_y, size.n_b, size.n_w, size.n_b, size.n_felt]


def _joint(size: Layout, mean: ca.SX, factors: ca.SX) -> ca.SX:
    """Give the step model's vector from filter mean and factors."""
    n = size.n_x + size.n_b
    known, noise = ca.vertsplit(mean, [0, n, size.n_mean])
    return ca.vertcat(known, factors, noise)


def _update(
    fields: dict[str, ca.SX],
    covariance: ca.SX,
    expected: ca.SX,
    slope: ca.SX,
    noise: ca.SX,
    conditional: Collection[int],
    known: _Known,
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Take the sensors one after the other."""
    shift = ca.SX.zeros(covariance.shape[0], 1)
    innovations, variances = [], []
    for j in range(expected.numel()):
        row = slope[j, :]
        cross = covariance @ row.T
        variance = row @ cross + noise[j]
        innovation = fields["y"][j] - expected[j] - row @ shift
        weight = cross * (fields["use"][j] / variance)
        shift = shift + weight * (known.where(fields["use"][j], innovation) if j in conditional else innovation)
        covariance = ca.triu2symm(ca.triu(covariance - weight @ cross.T))
        innovations.append(innovation)
        variances.append(variance)
    return shift, covariance, ca.vertcat(*innovations, *variances)


def _conditional(model: StepModel) -> tuple[int, ...]:
    """Give the sensors that do not always read as stated."""
    return tuple(j for j, item in enumerate(model.plant.graph.sensors) if item.valid_when is not None)


def _lagging(model: StepModel) -> Iterator[tuple[int, int, float]]:
    """Give which of these lag: number among them, state, and an sd that is as good as none for that state, SI."""
    sensors = model.plant.graph.sensors
    for held, j in enumerate(_conditional(model)):
        for state, store in enumerate(model.plant.network.states):
            if store.owner == sensors[j].name and sensors[j].lag:
                yield held, state, _ANYWHERE * sensors[j].noise


def _unpacked(packed: ca.SX, n: int) -> ca.SX:
    full, k = ca.SX(n, n), 0
    for i in range(n):
        for j in range(i, n):
            full[i, j] = full[j, i] = packed[k]
            k += 1
    return full


def _packed(full: ca.SX) -> ca.SX:
    n = full.shape[0]
    return ca.vertcat(*(full[i, j] for i in range(n) for j in range(i, n)))


def build_begin(model: StepModel) -> ca.Function:
    """Give (q, start) -> a filter before the first sample, see `Layout`, and its slopes by q and start.

    start (n_states,), SI, coordinates of the step model: used where the model file gives no start. Where it does,
    content and its sd are those of the file.
    """
    size, graph = layout_of(model), model.plant.graph
    q, start = ca.SX.sym("q", size.n_q), ca.SX.sym("start", size.n_x)
    factors, _, slow, noise, _, _ = ca.vertsplit(q, list(np.cumsum([0, *_parts_of_q(size)])))
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
    for k in range(size.n_b):
        spread[size.n_x + k, size.n_x + k] = ca.exp(2 * slow[k])
    for k in range(size.n_w):
        place = size.n_x + size.n_b + k
        spread[place, place] = ca.exp(2 * noise[k])
    begin = ca.vertcat(mean, _packed(spread), ca.SX.zeros(size.n_felt, 1))
    slopes = [ca.densify(ca.jacobian(begin, item)) for item in (q, start)]
    return ca.Function("begin", [q, start], [ca.densify(begin), *slopes])


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
