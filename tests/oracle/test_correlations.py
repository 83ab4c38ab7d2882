"""Parameters that go together, against the textbook: normal distributions with full matrices, conditions by solving."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from bare_core import Bare, bare
from dense_filter import dense_filter
from faultbond.arrays import FloatArray
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.spec import EngineSpec, pack, root_of, unpack
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.fit.innovations import Variant, _declared
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_engine
from faultbond.synthesis.specify import build_spec

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
MODEL = (Path(__file__).parents[2] / "examples" / "dc_motor" / "model.yaml").read_text()
TOGETHER = {("L", "K"): 0.9, ("L", "J"): 0.8, ("K", "J"): 0.95, ("R", "C"): -0.6}
TEXT = MODEL + "correlations: {K: {J: 0.95, L: 0.9}, J: {L: 0.8}, C: {R: -0.6}}\n"
CALLS = """
double t_given;
int64_t t_depends(State *state, const int64_t *chosen, const int64_t *n, double *row, double *variance)
{
    static Given given;
    int members[LARGEST_SET];
    (void)state;
    for (int64_t i = 0; i < *n; i++) members[i] = (int)chosen[i];
    *variance = depends_on(members, (int)*n, &given);
    memcpy(row, given.row[0], N_PARAMETERS * sizeof *row);
    return 0;
}
int64_t t_renew(State *state, const int64_t *chosen, const int64_t *n)
{
    static Given given;
    int members[LARGEST_SET];
    for (int64_t i = 0; i < *n; i++) members[i] = (int)chosen[i];
    for (int64_t i = 0; i < *n; i++) renew_parameter(state, members + i, (int)(*n - i), &given);
    return 0;
}
int64_t t_own(State *state, const int64_t *k, double *value, double *variance)
{
    *value = own_value(state->healthy.lane, (int)*k);
    *variance = own_variance(state->healthy.lane, (int)*k);
    return 0;
}
"""


@cache
def engine(text: str = TEXT) -> tuple[BondGraph, EngineSpec, Core]:
    """The motor, with parameters that go together."""
    graph = parse_model(text)
    return (graph, *build_engine(graph))


def core() -> Bare:
    """The motor's core with calls of this test."""
    return bare(CALLS, TEXT)


def stated(spec: EngineSpec) -> FloatArray:
    """The covariance of the parameters, (n, n), from the numbers above, with 3 % of accuracy."""
    names = [item.name for item in spec.parameters]
    together = np.eye(len(names))
    for (one, other), value in TOGETHER.items():
        i, j = names.index(one), names.index(other)
        together[i, j] = together[j, i] = value
    return 0.03**2 * together


def recording(graph: BondGraph, spec: EngineSpec, rows: int) -> FloatArray:
    """Packed samples of a motor whose inertia jumps."""
    time = np.asarray(np.arange(rows) * 0.02)
    u = random_steps(time, np.random.default_rng(5), low=2, high=12, shortest=0.4, longest=1.2)[:, None]
    made = simulate(graph, Inputs(time=time, values=u), [Fault(parameter="J", factor=1.2, start=4.0)], seed=3)
    samples, place = np.zeros((rows, spec.n_sample)), spec.sample_fields
    samples[1:, place["dt"]], samples[1:, place["u_before"]] = 0.02, made.inputs[:-1]
    samples[:, place["u"]], samples[:, place["y"]] = made.inputs, made.outputs
    samples[:, place["use"]] = samples[:, place["scale"]] = 1.0
    samples[:, place["fresh"]] = spec.input_variance
    return samples


def begun(spec: EngineSpec, parameters: FloatArray) -> FloatArray:
    """A healthy lane (n_numbers, 1) written down plainly: states of sd 1, parameters with this covariance."""
    P = np.diag([1.0] * spec.n_joint)
    P[spec.parameter_slice, spec.parameter_slice] = parameters
    P[spec.noise_slice, spec.noise_slice] = np.diag([spec.inputs[k].noise ** 2 for k in spec.noisy_inputs])
    lane = np.zeros((spec.n_numbers, 1))
    lane[spec.parameter_slice] = 1.0
    lane[spec.covariance_slice, 0] = pack(P)
    return lane


def apart(spec: EngineSpec, one: FloatArray, two: FloatArray) -> float:
    """By how much two lanes differ: z in standard deviations, P in variances."""
    n, (P, Q) = spec.n_joint, (unpack(spec, lane[spec.covariance_slice, 0]) for lane in (one, two))
    sd = np.sqrt(np.diag(Q)) + 1e-12
    return max(float(np.max(np.abs(one[:n, 0] - two[:n, 0]) / sd)), float(np.max(np.abs(P - Q) / np.outer(sd, sd))))


def test_the_healthy_filter_is_that_of_the_textbook() -> None:
    """It begins with the declared covariance and is the plain filter from then on; without it it is another."""
    graph, spec, core = engine()
    samples = recording(graph, spec, 300)
    given = core.healthy_lane(np.zeros(2), np.eye(2))
    dense = dense_filter(graph)[1]
    right, _ = dense.advance(begun(spec, stated(spec)), samples)
    left_out, _ = dense.advance(begun(spec, np.diag(np.diag(stated(spec)))), samples)
    found = core.advance(given, samples)[0]
    assert apart(spec, found, right) < 1e-6
    assert apart(spec, found, left_out) > 0.3


def test_a_start_that_is_solved_has_them_too() -> None:
    """States that were found with parameters that are off are off with them, and these go together as declared."""
    graph, spec, core = engine()
    samples = recording(graph, spec, 300)[:20]
    alone = engine(MODEL)[2].solve_start(samples)[1]
    covariance = core.solve_start(samples)[1]
    n_x, first = len(spec.states), spec.parameter_slice.start
    led = alone[:n_x, first:] @ np.linalg.inv(alone[first:, first:])  # slopes of the states by the parameters
    assert covariance[first:, first:] == pytest.approx(stated(spec))
    assert covariance[:n_x, first:] == pytest.approx(led @ stated(spec))
    more = led @ (stated(spec) - alone[first:, first:]) @ led.T
    assert covariance[:n_x, :n_x] - alone[:n_x, :n_x] == pytest.approx(more)


def test_lanes_of_suspects_know_of_the_others_what_was_known() -> None:
    """A hypothesis frees its suspects; what the others are is what it is where these tell nothing: their marginal."""
    _, spec, core = engine()
    place, n = spec.parameter_slice, len(spec.parameters)
    lane = core.healthy_lane(np.zeros(2), np.eye(2))[:, 0]
    for members in {spec.hypotheses[k] for k in plan_lanes(spec).hypothesis}:
        free = core_lane(spec, lane, members)
        P = unpack(spec, free[spec.covariance_slice])[place, place]
        rest = [k for k in range(n) if k not in members]
        assert P[np.ix_(rest, rest)] == pytest.approx(stated(spec)[np.ix_(rest, rest)])
        assert np.all(P[np.ix_(rest, members)] == 0.0)


def core_lane(spec: EngineSpec, healthy: FloatArray, members: tuple[int, ...]) -> FloatArray:
    """The lane of a start of these suspects, as the core begins it."""
    made, lane = bare(LANES, TEXT), np.zeros(spec.n_numbers)
    made.call("t_suspect", np.array(members, dtype=np.int64), np.array([len(members)]), healthy.copy(), lane)
    return lane


LANES = """
int64_t t_suspect(State *state, const int64_t *members, const int64_t *n, const double *healthy, double *lane)
{
    Start start;
    (void)state;
    memset(&start, 0, sizeof start);
    start.n = *n;
    for (int64_t s = 0; s < *n; s++) {
        start.parameter[s] = (int)members[s];
        start.value[s] = 0.9;
        start.sd[s] = 0.35;
    }
    suspect_lane(&start, healthy, lane);
    return 0;
}
"""


def test_what_the_analysis_takes_is_the_same() -> None:
    """The specification's covariance, and its root, which a plant may be drawn with; negative values turn."""
    graph, spec, _ = engine()
    assert spec.prior == pytest.approx(stated(spec))
    root = root_of(np.full(len(spec.parameters), 0.03), graph.correlated)
    assert root @ root.T == pytest.approx(stated(spec))
    other = build_spec(build_step_model(build_plant(parse_model(TEXT.replace("K: 2 V*s/rad", "K: -2 V*s/rad")))))
    turned = [-1.0 if item.name == "K" else 1.0 for item in spec.parameters]
    assert other.prior == pytest.approx(stated(spec) * np.outer(turned, turned))


@pytest.mark.parametrize("times", [0.25, 3.0])
def test_a_trial_of_other_accuracies_keeps_what_goes_together(times: float) -> None:
    """Accuracies so many times as large have the whole covariance times the square."""
    _, spec, core = engine()
    P = unpack(spec, _declared(core, Variant(accuracy=times))[spec.covariance_slice, 0])
    assert P[spec.parameter_slice, spec.parameter_slice] == pytest.approx(times**2 * stated(spec))


SETS = [[0], [3], [2, 3], [3, 2], [1, 3], [0, 4], [4]]


def given_others(P: FloatArray, chosen: list[int]) -> tuple[FloatArray, FloatArray, list[int]]:
    """Slopes of a part of normal numbers by the rest, covariance of that part given the rest, and which the rest is."""
    rest = [k for k in range(len(P)) if k not in chosen]
    slopes = P[np.ix_(chosen, rest)] @ np.linalg.inv(P[np.ix_(rest, rest)])
    return slopes, P[np.ix_(chosen, chosen)] - slopes @ P[np.ix_(rest, chosen)], rest


@pytest.mark.parametrize("chosen", SETS)
def test_a_parameter_is_known_beside_all_that_are_no_suspects(chosen: list[int]) -> None:
    """Row and variance are those of the normal distribution of a parameter, given all but the other suspects."""
    made = core()
    row, variance = np.zeros(len(made.spec.parameters)), np.zeros(1)
    made.call("t_depends", np.array(chosen), np.array([len(chosen)]), row, variance)
    slopes, left, rest = given_others(stated(made.spec), chosen)
    assert row[rest] == pytest.approx(-slopes[0], abs=1e-12)
    assert row[chosen] == pytest.approx([1.0, *[0.0] * (len(chosen) - 1)])
    assert variance[0] == pytest.approx(left[0, 0])


@pytest.mark.parametrize("chosen", SETS)
def test_what_was_repaired_is_what_the_others_let_expect(chosen: list[int]) -> None:
    """With all that is known of the others by now: mean and covariance are those of the chain of both distributions."""
    made = core()
    spec, generator = made.spec, np.random.default_rng(2)
    n, first = spec.n_joint, spec.parameter_slice.start
    lane = np.zeros(spec.n_numbers)
    lane[:n] = 1.0 + 0.05 * generator.standard_normal(n)
    root = generator.standard_normal((n, n))
    P = root @ root.T * 1e-4
    lane[spec.covariance_slice] = pack(P)
    made["healthy.lane"] = lane
    made.call("t_renew", np.array(chosen), np.array([len(chosen)]))
    slopes, left, rest = given_others(stated(spec), chosen)
    new, others = [first + k for k in chosen], [k for k in range(n) if k - first not in chosen]
    by = np.zeros((len(chosen), len(others)))
    by[:, [others.index(first + k) for k in rest]] = slopes
    Q = unpack(spec, made["healthy.lane"][spec.covariance_slice])
    rows = np.ix_(others, others)
    assert made["healthy.lane"][new] == pytest.approx(1.0 + slopes @ (lane[[first + k for k in rest]] - 1.0))
    assert Q[np.ix_(new, others)] == pytest.approx(by @ P[rows], abs=1e-12)
    assert Q[np.ix_(new, new)] == pytest.approx(left + by @ P[rows] @ by.T, abs=1e-12)
    assert Q[rows] == pytest.approx(P[rows])


@pytest.mark.parametrize("k", range(5))
def test_what_walks_is_a_parameter_beside_the_others(k: int) -> None:
    """Value and variance of a parameter less what the others let expect of it."""
    made = core()
    spec, generator = made.spec, np.random.default_rng(4)
    n, first = spec.n_joint, spec.parameter_slice.start
    root, lane = generator.standard_normal((n, n)), np.zeros(spec.n_numbers)
    lane[:n], lane[spec.covariance_slice] = generator.standard_normal(n), pack(root @ root.T)
    made["healthy.lane"] = lane
    value, variance = np.zeros(1), np.zeros(1)
    made.call("t_own", np.array([k]), value, variance)
    slopes, _, rest = given_others(stated(spec), [k])
    weights = np.zeros(n)
    weights[first + k], weights[[first + j for j in rest]] = 1.0, -slopes[0]
    assert value[0] == pytest.approx(weights @ lane[:n])
    assert variance[0] == pytest.approx(weights @ (root @ root.T) @ weights)
