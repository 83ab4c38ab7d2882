"""The plant in discrete time: one step of f and h with derivatives by automatic differentiation.

Discretisation: the two-stage Rosenbrock method ROS2, gamma = 1 - 1/sqrt(2). It is of second order whatever Jacobian is
used and L-stable, so a mode much faster than the sample time dies out instead of ringing as under the trapezoidal rule.
Source: Verwer, Spee, Blom, Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456, eq. 1.2. An input is held over the
step, as before or as after it, or goes linearly; the time is then one more state, so that what follows the input fast
follows it without error.

Implicit relations are solved by a fixed number of safeguarded Newton steps from the last solution; derivatives follow
from the implicit function theorem.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from math import ceil, sqrt

import casadi as ca
import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching

from faultbond.arrays import BoolArray, FloatArray
from faultbond.equations.linear import back, eliminate, triangle
from faultbond.equations.plant import Plant
from faultbond.equations.repeated import Repeated
from faultbond.errors import StructureError
from faultbond.model.graph import Input
from faultbond.types import Hold

GAMMA = 1.0 - 1.0 / sqrt(2.0)
NEWTON_STEPS = 10
NEWTON_PARTS = (1 / 64, 1 / 16, 1 / 4, 1.0, 4.0, 16.0, 64.0)
MAX_SUBSTEPS = 8
_RESOLVED = (
    0.25  # a substep is at most this part of the fastest time constant, up to MAX_SUBSTEPS; not of those of lags
)
# A lag acts on nothing that it follows, so that it makes a step no less stable, and is off by what its pole is: 0.4 %
# of a move where a substep is half as long as the lag. More than four are of no use: a lag so short is over by then.
_LAG_RESOLVED, _LAG_SUBSTEPS = 0.5, 4
_REFERENCE_STEPS = 100
_UP = 0.75  # of the way from the lowest to the highest that an input was in the recordings of a fit
_NUDGE_PARTS = (0.01, 0.1, 1.0)  # of what a step would bring to a store
_SOLVED = 1e-6  # relative size of the next Newton step at a solution; far from one it is large
_TINY = 1e-9  # a signal smaller than this is zero


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StepModel:
    """Functions of the joint vector v = [x, b, factors of theta, input noise].

    The coordinates x are efforts of C and flows of I where the law allows (then a change of the parameter leaves them
    nearly as they are, which a filter that estimates both needs), else contents; `states` names them.

    predict(v, u, z, dt) -> (x_next, slope of x_next by v, z), with inputs held at u; follow(v, u_before, u, z, dt) ->
    the same where inputs go on as the model says: linearly from u_before to u, or held at one of the two.
    measure(v, u, z) -> (y, slope of y by v, z).
    What these are made of, where the implicit signals z are solved: rates(v, u, z) -> (rates, slope by v) and
    readings(v, u, z) -> (y, slope by v). by_hand(v, u, z) -> signals that a person can measure.
    newton_step(v, u, z) -> (Newton's step of z, square of what is left to solve).
    prediction, held: give `follow` and `predict`, built at first use, since these are large and most of the analysis
    does without.
    scales: sizes of the parameters (n_parameters,), SI; v holds parameters as factors of them. noisy: inputs with an
    error in v. reference: state (n_states,) and implicit signals (n_implicit,), SI, of a nominal run, where the number
    of substeps was chosen. direct, of_parts: for each output the inputs that reach it without passing a state, and the
    parameters that do. felt: as direct, and those with `settling` that reach it by no state but those of lags. lagged:
    for each output those with a `lag` that reach it so.
    """

    plant: Plant
    v: ca.SX
    u: ca.SX
    z: ca.SX
    scales: FloatArray
    noisy: tuple[int, ...]
    rates: ca.Function
    prediction: Callable[[], ca.Function]
    held: Callable[[], ca.Function]
    measure: ca.Function
    readings: ca.Function
    by_hand: ca.Function
    newton_step: ca.Function
    substeps: int
    states: tuple[str, ...]
    contents: ca.Function  # (x, theta) -> stored quantities
    coordinates: ca.Function  # (stored quantities, theta) -> x
    reference_state: FloatArray
    reference_implicit: FloatArray
    measure_is_linear: bool
    direct: tuple[tuple[int, ...], ...]
    of_parts: tuple[tuple[int, ...], ...]
    felt: tuple[tuple[int, ...], ...]
    lagged: tuple[tuple[int, ...], ...]

    @property
    def follow(self) -> ca.Function:
        """One step in time."""
        return self.prediction()

    @property
    def predict(self) -> ca.Function:
        """One step in time with inputs that are held."""
        return self.held()


def build_step_model(plant: Plant, *, all_inputs: bool = False) -> StepModel:
    """Give the discrete-time model of a plant.

    Parameters
    ----------
    plant : the equations in continuous time
    all_inputs : whether v holds an error of every input, not only of those with noise
    """
    graph = plant.graph
    scales = np.array([item.scale for item in graph.parameters])
    noisy = tuple(k for k, item in enumerate(graph.inputs) if item.noise > 0 or all_inputs)
    n_x, n_b, n_p = plant.x.numel(), plant.b.numel(), plant.theta.numel()
    v = ca.SX.sym("v", n_x + n_b + n_p + len(noisy))
    x, b, factors, noise = ca.vertsplit(v, [0, n_x, n_x + n_b, n_x + n_b + n_p, v.numel()])
    held = plant.u
    for k, index in enumerate(noisy):
        held = held + noise[k] * ca.SX(ca.DM.eye(plant.u.numel())[:, index])
    contents, coordinates, rates_x = _coordinates(plant)
    theta = factors * ca.DM(scales) if n_p else factors
    old = ca.vertcat(plant.x, plant.b, plant.theta)
    new = ca.vertcat(contents(x, theta), b, theta)
    rates_, readings, by_hand, gap = ca.substitute(
        [rates_x, plant.readings, plant.by_hand, plant.gap], [old, plant.u], [new, held]
    )
    arguments = [v, plant.u, plant.z]
    places = (n_x, n_x + n_b, n_x + n_b + n_p)
    bounds = [k for k, item in enumerate(graph.slow_errors) if not item.wanders]
    rates = _with_slope("rates", rates_, gap, arguments, places, bounds)
    readings_ = _with_slope("readings", readings, gap, arguments, places, bounds)
    linear = np.array([float(item.linear) for item in graph.inputs])
    early = tuple(item.hold is Hold.NEXT for item in graph.inputs)
    climbing = (linear, _by_inputs(rates_, gap, arguments)) if linear.any() else None
    newton = _newton(gap, arguments)
    solved = newton(*arguments)[0]
    measure = ca.Function("measure", arguments, [*readings_(v, plant.u, solved), solved], {"cse": True})
    start = _nominal_start(plant, coordinates, v.numel(), scales)
    direct = _at_once(readings, plant.u, plant.z, gap)
    but_for_lags = _but_for_lags(plant, readings, rates_, x, gap)
    settling = {k for k, item in enumerate(graph.inputs) if item.settling > 0.0}
    lagging = {k for k, item in enumerate(graph.inputs) if item.lag}
    reference_x, reference_z, slopes = _reference(plant, rates, newton, start)
    substeps = _substeps(plant, slopes)
    return StepModel(
        plant=plant,
        v=v,
        u=plant.u,
        z=plant.z,
        scales=scales,
        noisy=noisy,
        rates=rates,
        prediction=(prediction := cache(lambda: _predict(rates, newton, arguments, n_x, substeps, climbing, early))),
        held=cache(lambda: _held(prediction())),
        measure=measure,
        readings=readings_,
        by_hand=ca.Function("by_hand", arguments, [ca.densify(by_hand)], {"cse": True}),
        newton_step=_newton_step(gap, arguments),
        substeps=substeps,
        states=tuple(
            co.name if co is not None else state.name
            for co, state in zip(plant.co_energy, plant.network.states, strict=True)
        ),
        contents=contents,
        coordinates=coordinates,
        reference_state=reference_x,
        reference_implicit=reference_z,
        measure_is_linear=not ca.depends_on(readings_(*arguments)[1], ca.vertcat(v, plant.z)),
        direct=direct,
        of_parts=_at_once(readings, factors, plant.z, gap),
        felt=tuple(tuple(sorted({*own, *(settling & late)})) for own, late in zip(direct, but_for_lags, strict=True)),
        lagged=tuple(tuple(sorted(lagging & late)) for late in but_for_lags),
    )


def _coordinates(plant: Plant) -> tuple[ca.Function, ca.Function, ca.SX]:
    """Give the maps between coordinates and contents, and the rates of the coordinates as functions of the contents."""
    symbols, contents, values, rates = [], [], [], []
    for k, co in enumerate(plant.co_energy):
        symbols.append(plant.x[k] if co is None else co.symbol)
        contents.append(plant.x[k] if co is None else co.content)
        values.append(plant.x[k] if co is None else co.value)
        rates.append(plant.rates[k] if co is None else ca.jacobian(co.value, plant.x) @ plant.rates)
    empty = ca.SX(0, 1)
    column = ca.vertcat(*symbols) if symbols else empty
    return (
        ca.Function("contents", [column, plant.theta], [ca.vertcat(*contents) if contents else empty]),
        ca.Function("coordinates", [plant.x, plant.theta], [ca.vertcat(*values) if values else empty]),
        ca.vertcat(*rates) if rates else empty,
    )


def _nominal_start(plant: Plant, coordinates: ca.Function, n_v: int, scales: FloatArray) -> FloatArray:
    """Give the joint vector of the nominal plant at its declared start, or empty."""
    graph, n_x, n_b = plant.graph, plant.x.numel(), plant.b.numel()
    starts = {item.name: item.start.mean for item in graph.components if item.start is not None}
    acting = dict(zip((item.name for item in graph.inputs), reference_inputs(plant).tolist(), strict=True))
    contents = np.array(
        [acting.get(state.source, starts.get(state.component or "", 0.0)) for state in plant.network.states]
    )
    v = np.zeros(n_v)
    nominal = np.array([item.nominal for item in graph.parameters])
    v[:n_x] = coordinates(contents, nominal).full()[:, 0]
    v[n_x + n_b : n_x + n_b + len(nominal)] = nominal / scales
    return v


def _with_slope(
    name: str, value: ca.SX, gap: ca.SX, arguments: list[ca.SX], places: tuple[int, int, int], bounds: list[int]
) -> ca.Function:
    """Give value and its total derivative by v; z follows v through gap = 0.

    The slopes by parameters are those of a plant without slow errors: see docs/decisions/014-consistent-filters.md.

    Parameters
    ----------
    places : where in v the slow errors and the parameters begin, and the parameters end
    bounds : which slow errors are declared as bounds: all but what wanders, see docs/decisions/022-wandering.md
    """
    v, _, z = arguments
    slope = ca.jacobian(value, v)
    if z.numel():
        slope = slope - ca.jacobian(value, z) @ eliminate(ca.jacobian(gap, z), ca.jacobian(gap, v))
    by_states, by_parameters, by_inputs = ca.horzsplit(slope, [0, places[1], places[2], v.numel()])
    errors = v[places[0] : places[1]][bounds]
    by_parameters = ca.substitute(by_parameters, errors, ca.SX.zeros(errors.shape))
    slope = ca.horzcat(by_states, by_parameters, by_inputs)
    return ca.Function(name, arguments, [ca.densify(value), ca.densify(slope)], {"cse": True})


def _by_inputs(rates: ca.SX, gap: ca.SX, arguments: list[ca.SX]) -> ca.Function:
    """Give the total derivative of the rates by the inputs; z follows these through gap = 0."""
    _, u, z = arguments
    slope = ca.jacobian(rates, u)
    if z.numel():
        slope = slope - ca.jacobian(rates, z) @ eliminate(ca.jacobian(gap, z), ca.jacobian(gap, u))
    return ca.Function("by_inputs", arguments, [ca.densify(slope)], {"cse": True})


def _newton(gap: ca.SX, arguments: list[ca.SX]) -> ca.Function:
    """Give z with gap = 0 from a first guess, and the size of the step that would come next.

    Each step tries parts and multiples of Newton's step and keeps the best: parts, since an exponential is overshot
    from its flat side, and multiples, since from its steep side Newton's step is ever the same small one.
    """
    v, u, z = arguments
    if not z.numel():
        return ca.Function("newton", arguments, [z, 0])
    step = _newton_step(gap, arguments)
    size = ca.Function("gap_size", arguments, [ca.sumsqr(gap)])
    current = z
    for _ in range(NEWTON_STEPS):
        move, best = step(v, u, current)
        kept = current
        for part in NEWTON_PARTS:
            trial = current + part * move
            misfit = size(v, u, trial)
            better = misfit <= best  # false for nan, so a wild step is never kept
            kept, best = ca.if_else(better, trial, kept), ca.if_else(better, misfit, best)
        current = kept
    left = ca.norm_1(step(v, u, current)[0])  # not norm_inf: that of nan is 0
    return ca.Function("newton", arguments, [current, left], {"cse": True})


def _newton_step(gap: ca.SX, arguments: list[ca.SX]) -> ca.Function:
    """Give Newton's step of z towards gap = 0, and the square of the gap."""
    z = arguments[2]
    full = -eliminate(ca.jacobian(gap, z), gap) if z.numel() else z
    return ca.Function("newton_step", arguments, [full, ca.sumsqr(gap)], {"cse": True})


def _held(follow: ca.Function) -> ca.Function:
    """Give (v, u, z, dt) -> what `follow` gives for inputs that do not move."""
    v, u, _, z, dt = (ca.SX.sym(name, *follow.size_in(k)) for k, name in enumerate(("v", "u", "same", "z", "dt")))
    return ca.Function("predict", [v, u, z, dt], list(follow(v, u, u, z, dt)))


def _predict(
    rates: ca.Function,
    newton: ca.Function,
    arguments: list[ca.SX],
    n_x: int,
    substeps: int,
    climbing: tuple[FloatArray, ca.Function] | None,
    early: tuple[bool, ...],
) -> ca.Function:
    """ROS2 over dt, in equal substeps; the slope treats the Jacobian inside the method as constant.

    climbing: 1 for inputs that go linearly over dt, else 0, and the slope of the rates by the inputs; the time is then
    one more state of the method, whose slope is that of the rates by time. early: which inputs are all the while what
    they are at the end.
    """
    v, before, z = arguments
    dt, after = ca.SX.sym("dt"), ca.SX.sym("after", before.numel())
    u = ca.vertcat(*(after[k] if early[k] else before[k] for k in range(len(early)))) if any(early) else before
    climb = (after - before) * climbing[0] / substeps if climbing is not None else ca.SX.zeros(u.shape)
    h = dt / substeps
    x, rest = ca.vertsplit(v, [0, n_x, v.numel()])  # slicing a scalar would turn it
    slope = ca.horzcat(ca.SX.eye(n_x), ca.SX(n_x, rest.numel()))  # of x by v
    still = ca.horzcat(ca.SX(rest.numel(), n_x), ca.SX.eye(rest.numel()))  # of rest by v
    solved = z
    for _ in range(substeps):
        solved = newton(ca.vertcat(x, rest), u, solved)[0]
        f0, d0 = rates(ca.vertcat(x, rest), u, solved)
        force = (
            GAMMA * climbing[1](ca.vertcat(x, rest), u, solved) @ climb if climbing is not None else ca.SX.zeros(n_x)
        )
        matrix = triangle(ca.SX.eye(n_x) - GAMMA * h * d0[:, :n_x])
        k1 = back(matrix, ca.horzcat(f0 + force, d0 @ ca.vertcat(slope, still)))
        u = u + climb
        middle, middle_slope = x + h * k1[:, 0], slope + h * k1[:, 1:]
        solved = newton(ca.vertcat(middle, rest), u, solved)[0]
        f1, d1 = rates(ca.vertcat(middle, rest), u, solved)
        k2 = back(matrix, ca.horzcat(f1 - force, d1 @ ca.vertcat(middle_slope, still)) - 2 * k1)
        x = x + 1.5 * h * k1[:, 0] + 0.5 * h * k2[:, 0]
        slope = slope + 1.5 * h * k1[:, 1:] + 0.5 * h * k2[:, 1:]
    return ca.Function("follow", [v, before, after, z, dt], [x, slope, solved])


def _at_once(readings: ca.SX, what: ca.SX, z: ca.SX, gap: ca.SX) -> tuple[tuple[int, ...], ...]:
    """For each output which of some symbols reach it without passing a state; implicit signals z leave no `gap`."""
    if not what.numel():
        return ((),) * readings.numel()
    pattern = _pattern(readings, what)
    if z.numel():
        pattern = pattern | (_pattern(readings, z) @ _passed_on(_pattern(gap, z)) @ _pattern(gap, what))
    return tuple(tuple(int(k) for k in np.flatnonzero(row)) for row in pattern)


def _pattern(values: ca.SX, by: ca.SX) -> BoolArray:
    """Give which symbols stand in which values, (n_values, n_symbols)."""
    return np.asarray(ca.DM(ca.jacobian_sparsity(ca.vertcat(values), by), 1.0).full() != 0)


def _passed_on(within: BoolArray) -> BoolArray:
    """Give which implicit signals (rows) follow what stands in which equations (columns); `within`: signals of each.

    Each signal is found from one equation, and follows the other signals in it.
    """
    own = maximum_bipartite_matching(csr_matrix(within.T), perm_type="column")  # of each signal
    if (own < 0).any():
        return np.ones_like(within)
    follows = within[own]
    for _ in range(len(within).bit_length()):
        follows = follows @ follows
    return np.asarray(follows[:, np.argsort(own)])


def _but_for_lags(plant: Plant, readings: ca.SX, rates: ca.SX, x: ca.SX, gap: ca.SX) -> tuple[frozenset[int], ...]:
    """For each output the inputs that would reach it at once if nothing lagged, and do not."""
    lags = {k for k, store in enumerate(plant.network.states) if store.lag}
    if not lags or not plant.u.numel():
        return (frozenset(),) * readings.numel()
    by_input, by_state = (_at_once(rates, what, plant.z, gap) for what in (plant.u, x))
    found = []
    for states in _at_once(readings, x, plant.z, gap):
        passed, reached = set[int](), lags & set(states)
        while reached:
            passed |= reached
            reached = (lags & {k for n in reached for k in by_state[n]}) - passed
        found.append(frozenset(k for n in passed for k in by_input[n]))
    return tuple(found)


def reference_inputs(plant: Plant) -> FloatArray:
    """Inputs of the nominal run (n_inputs,), SI: where they were in the recordings of a fit, at three quarters.

    In the middle of a range that goes both ways nothing moves. Where that is not known: three quarters of what they can
    be; else half range for percent, and one unit of the model file.
    """
    return np.array([_usual_input(item) for item in plant.graph.inputs])


def is_guessed(item: Input) -> bool:
    """Tell whether nothing says about where an input usually is."""
    return item.fitted_range is None and not np.isfinite([item.lower, item.upper]).all() and item.unit.text != "percent"


def _usual_input(item: Input) -> float:
    if is_guessed(item):
        return item.unit.to_si(1.0)
    if item.fitted_range is None and item.unit.text == "percent":
        return 50.0
    lower, upper = item.fitted_range or (item.lower, item.upper)
    return lower + _UP * (upper - lower)


def _reference(
    plant: Plant, rates: ca.Function, newton: ca.Function, start: FloatArray
) -> tuple[FloatArray, FloatArray, list[FloatArray]]:
    """Run the nominal plant a while; give its last state, implicit signals, and the slopes of the rates by the states.

    Where the start is one that the equations cannot leave, as tanks in a row that are all empty (a turbulent
    pipe between equal levels has an endless slope), the run is begun near it, with stores filled unlike each other.
    """
    u, asked, solve = reference_inputs(plant), Repeated(rates), Repeated(newton)
    first = _first_implicit(plant, solve, start, u)
    step = plant.graph.sample_time if plant.graph.sample_time is not None else 1.0

    def run(begin: FloatArray) -> tuple[FloatArray, FloatArray, list[FloatArray]]:
        v, z, slopes = begin.copy(), first, list[FloatArray]()
        for _ in range(count):
            x, after, slope = _advance(asked, solve, v, u, z, step)
            if not (np.all(np.isfinite(x)) and np.all(np.isfinite(slope))):
                break
            v[: len(x)], z = x, after
            slopes.append(slope)
        return v[: plant.x.numel()], z, slopes

    count = _REFERENCE_STEPS if plant.x.numel() else 0
    best = run(start)
    for nudge in _nudges(asked(start, u, first)[0][:, 0], step):
        if len(best[2]) == count:
            break
        near = start.copy()
        near[: len(nudge)] = np.where(np.isfinite(start[: len(nudge)]), start[: len(nudge)], 0.0) + nudge
        best = max(best, run(near), key=lambda item: len(item[2]))
    return best


def _nudges(rates: FloatArray, step: float) -> Iterator[FloatArray]:
    """Give moves of the states, no two alike: parts of what a step would bring, then of many sizes."""
    unlike = 1.0 + np.arange(len(rates)) / max(1, len(rates))
    moved = np.where(np.isfinite(rates), np.abs(rates), 0.0) * step
    yield from (part * moved * unlike for part in _NUDGE_PARTS)
    yield from (10.0**k * unlike for k in range(-6, 7))


def _advance(
    rates: Repeated, newton: Repeated, v: FloatArray, u: FloatArray, z: FloatArray, h: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Take one ROS2 step in numbers; give the state (nan: there is none), implicit signals, slope of the rates."""
    z = newton(v, u, z)[0][:, 0]
    f, by = rates(v, u, z)
    n_x, rate = len(f), f[:, 0]
    slope = by[:, :n_x]
    matrix = np.eye(n_x) - GAMMA * h * slope
    try:
        k1 = np.linalg.solve(matrix, rate)
        middle = np.concatenate([v[:n_x] + h * k1, v[n_x:]])
        z = newton(middle, u, z)[0][:, 0]
        k2 = np.linalg.solve(matrix, rates(middle, u, z)[0][:, 0] - 2.0 * k1)
    except np.linalg.LinAlgError:
        return np.full(n_x, np.nan), z, slope
    return v[:n_x] + 1.5 * h * k1 + 0.5 * h * k2, z, slope


def _substeps(plant: Plant, slopes: list[FloatArray]) -> int:
    """Give how many parts a step is taken in, from slopes (n_states, n_states) of the rates along a run, 1/s."""
    lagging = np.array([bool(store.lag) for store in plant.network.states], dtype=bool)
    grid = plant.graph.sample_time if plant.graph.sample_time is not None else 1.0
    own, lags = (_usual_rate([slope[np.ix_(which, which)] for slope in slopes]) for which in (~lagging, lagging))
    for_lags = min(ceil(lags * grid / _LAG_RESOLVED), _LAG_SUBSTEPS)
    return int(np.clip(max(ceil(own * grid / _RESOLVED), for_lags), 1, MAX_SUBSTEPS))


def _usual_rate(slopes: list[FloatArray]) -> float:
    """Give the median of the fastest rates, 1/s; equal slopes, as those of linear laws, are looked at once."""
    speeds: list[float] = []
    for k, slope in enumerate(slopes):
        same = k > 0 and np.array_equal(slope, slopes[k - 1])
        speeds.append(speeds[-1] if same else float(np.max(np.abs(np.linalg.eigvals(slope)), initial=0.0)))
    return float(np.median(speeds)) if speeds else 0.0


def _first_implicit(plant: Plant, newton: Repeated, v: FloatArray, u: FloatArray) -> FloatArray:
    """Find a first solution of the implicit relations from guesses over many sizes and both signs.

    Raises
    ------
    StructureError
        Where none is found; names the loop's signals.
    """
    n_z = plant.z.numel()
    if not n_z:
        return np.zeros(0)
    for size in (0.0, *(sign * 10.0**k for k in range(-6, 7) for sign in (1.0, -1.0))):
        z, left = np.full(n_z, size), np.inf
        for _ in range(20):
            found, step = newton(v, u, z)
            z, left = found[:, 0], float(step[0, 0])
        if left <= _SOLVED * max(float(np.max(np.abs(z))), _TINY):
            return z
    raise StructureError(
        f"{plant.graph.file}: no solution was found for the loop of {', '.join(plant.implicit)} at nominal parameters; "
        "check the laws in it (a root is easier to solve as its square, f*abs(f) = k**2*e), or give a known `start`"
    )
