"""What to check next: what a check tells, which moves part candidates, and what it costs."""

from dataclasses import replace
from functools import cache
from math import ceil, log2, nan, sqrt
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bare_core import CELL, Bare, aligned, bare
from cell_course import ACCEPTED, cell, course
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.findings import Advice, Candidate
from faultbond.contract.spec import CheckSpec
from faultbond.equations.plant import build_plant
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, simulate
from faultbond.synthesis.ahead import AHEAD
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_core, build_engine
from faultbond.types import CheckKind
from made import TANK_START, changed, plant, recorded, run, samples_of

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
TANK = (Path(__file__).parents[3] / "examples" / "tank" / "model.yaml").read_text(encoding="utf-8")
FAULT = Fault(parameter="K6", factor=9.0, start=230.0)
PARTED = ACCEPTED - 24  # of the course: a moment at which a move of its input would part what could be at fault
APART, WORTH, LEAST = (core_settings()[name] for name in ("APART", "WORTH", "LEAST_LIKELY"))
INPUTS = """\
name: many inputs
sample_time: 1 s
max_faults: 1
constants: {A: 1 V/percent, B: 1 V/K}
inputs:
  P0: {unit: percent}
  V0: {unit: V}
  V1: {unit: V}
  T0: {unit: degC}
  T1: {unit: degC}
  T2: {unit: degC}
  P1: {unit: percent}
  P2: {unit: percent}
  V2: {unit: V}
  P3: {unit: percent, fitted_range: [30, 80]}
  V3: {unit: V, fitted_range: [2, 6]}
  V4: {unit: V, fitted_range: [2, 6]}
  V5: {unit: V, range: [0, 1]}
  P4: {unit: percent, range: [5, 75]}
  P5: {unit: percent}
components:
  source: {type: Se, law: e = A*(P0 + P1 + P2 + P3 + P4 + P5) + V0 + V1 + V2 + V3 + V4 + V5 + B*(T0 + T1 + T2)}
  series: {type: R, parameters: {R1: 10 ohm}}
  cell: {type: C, parameters: {C1: 1 F}}
junctions: {loop: 1}
bonds: [source -> loop, loop -> series, loop -> cell]
sensors: {v: {reads: cell.e, unit: V, noise: 10 mV}}
checks: {T2: {move: 5 K}, P1: {move: 20}, P2: {move: 20}, V2: {move: 3}, V4: {move: 3}, V5: {move: 1}, P5: {move: no}}
"""
BY_HAND = """\
checks:
  inflow: {reads: line.f, unit: m^3/s, noise: 2e-6 m^3/s, cost: 2}
  coarse: {reads: line.f, unit: m^3/s, noise: 2e-3 m^3/s}
  volume: {reads: tank.q, unit: m^3, noise: 1 m^3}
"""
CALLS = """
int64_t t_values(State *state, int64_t *k, double *values)
{
    return values_of(&state->inputs, state->inputs.held[*k], (int)*k, values);
}
int64_t t_part(State *state, Rivals *rivals, const double *apart, int64_t *n, int64_t *group)
{
    (void)state;
    rivals->n = *n;
    memcpy(rivals->apart, apart, sizeof rivals->apart);
    return part_rivals(rivals, group);
}
int64_t t_room(State *state) { return (void)state, (int64_t)sizeof(Rivals); }
"""
AHEAD_CALL = """
int64_t t_pack(State *state, const int64_t *t, const double *held, double *packed)
{
    pack_ahead(state->inputs.held, held, &state->normal, t[0], t[1], packed);
    return 0;
}
/* How far two predictions of each sensor are apart, (difference, own sd), beside a noise of this factor. */
int64_t t_apart(State *state, const double *expected, const double *variance, const double *scale, double *found)
{
    static Rivals rivals;
    (void)state;
    memset(&rivals, 0, sizeof rivals);
    rivals.at[1] = 1;
    for (int j = 0; j < N_OUTPUTS; j++) {
        rivals.sample[SAMPLE_SCALE + j] = scale[j];
        for (int r = 0; r < 2; r++) {
            rivals.told[0][0][j][r] = -expected[2 * j + r];
            rivals.told[0][0][N_OUTPUTS + j][r] = variance[j];
        }
    }
    add_apart(1, 0, 1.0, &rivals);
    found[0] = rivals.squares[1][0];
    found[1] = rivals.along[1][0];
    return 0;
}
int64_t t_ahead(State *state, Work *work, Diagnosis *found, double *first)
{
    int64_t group[MOST_RIVALS];
    conclude(state, found, &work->ranking);
    prepare_filters(&work->filters);
    find_rivals(found, &work->rivals);
    memcpy(work->rivals.held, state->inputs.held, sizeof work->rivals.held);
    part_ahead(state, found, group, &work->rivals, &work->filters);
    for (int64_t k = 0; k < WIDE_NUMBERS; k++)
        first[k] = work->rivals.is_wide[0] ? work->rivals.wide[0][k][0]
            : k < PLAIN_NUMBERS ? work->rivals.plain[0][k][0] : 0.0;
    return 0;
}
"""
HAND_CALL = """
int64_t t_by_hand(State *state, Work *work, const double *plain, const double *wide, double *signal)
{
    lanes values[N_SIGNALS];
    for (int64_t i = 0; i < PLAIN_NUMBERS; i++) work->filters.plain.lane[i] = broadcast(plain[i]);
    for (int64_t i = 0; i < WIDE_NUMBERS; i++) work->filters.wide.lane[i] = broadcast(wide[i]);
    expect_signals_plain(work->filters.plain.lane, state->inputs.held, values);
    for (int k = 0; k < N_SIGNALS; k++) signal[k] = first_of(values[k]);
    expect_signals_wide(work->filters.wide.lane, state->inputs.held, values);
    for (int k = 0; k < N_SIGNALS; k++) signal[N_SIGNALS + k] = first_of(values[k]);
    return 0;
}
"""


@cache
def leaking() -> Monitor:
    """A tank some time after a leak was detected; the outlet has stood still, so several parts could be the cause."""
    graph, _, core = plant("tank")
    time = np.arange(420.0)
    u = np.stack([np.where(time % 120.0 < 60.0, 80.0, 50.0), np.full(time.shape, 50.0)], axis=1)
    made = simulate(graph, Inputs(time=time, values=u), [FAULT], seed=2, start={"tank.q": TANK_START})
    monitor, _ = run(core, samples_of(time, made.inputs, made.outputs))
    assert monitor.number("clock.alarm") >= 0
    return monitor


@cache
def checked() -> Monitor:
    """The same, where the leak is dear to look at, and the outlet cheap to move, as far as is stated."""
    graph, spec, _ = plant("tank")
    leak = CheckSpec(name="leak", kind=CheckKind.COMPONENT, cost=100.0)
    outlet = CheckSpec(name="u_out", kind=CheckKind.INPUT, cost=0.5, move=40.0)
    monitor = Monitor(build_core(build_plant(graph), replace(spec, checks=(leak, outlet))))
    monitor._state[:] = leaking()._state
    return monitor


def outlet() -> float:
    """Where the outlet valve stands, percent."""
    return float(leaking().numbers("inputs.held")[1])


def advised(monitor: Monitor, *parts: tuple[int, float]) -> tuple[tuple[Candidate, ...], tuple[Advice, ...]]:
    """Candidates of the diagnosis of now, by number, with these probabilities, the largest first, and the advice."""
    monitor.conclude()
    found = monitor._found[0]
    rows = found["candidates"].copy()
    for row, (k, probability) in enumerate(parts):
        found["candidates"][row] = rows[k]
        found["candidates"]["probability"][row] = probability
    found["n_candidates"] = len(parts)
    advice, listed = monitor.advise(), monitor.conclude().candidates
    return tuple(listed[k] for k, _ in parts), advice


def single(monitor: Monitor, **parts: float) -> tuple[Advice, ...]:
    """The advice with these single components as the only candidates."""
    listed = [item.components for item in monitor.conclude().candidates]
    chosen = sorted(parts.items(), key=lambda item: -item[1])
    return advised(monitor, *((listed.index((name,)), probability) for name, probability in chosen))[1]


def looks(found: tuple[Advice, ...]) -> dict[str, Advice]:
    """Advice to look at a part, by part."""
    return {item.target: item for item in found if item.kind is CheckKind.COMPONENT}


def entropy(*parts: float) -> float:
    """Entropy in bits."""
    return -sum(part * log2(part) for part in parts if part > 0)


def test_a_look_tells_whether_the_part_is_among_the_faulty() -> None:
    """Looking at a part tells as many bits as its probability has, and parts the candidates that hold it."""
    found = looks(single(leaking(), leak=0.5, outlet=0.3, tank=0.2))
    assert set(found) == {"leak", "outlet", "tank"}
    for name, part in (("leak", 0.5), ("outlet", 0.3), ("tank", 0.2)):
        assert found[name].gain == pytest.approx(entropy(part, 1.0 - part))
        assert found[name].separates[0] == ((name,),)
        assert len(found[name].separates[1]) == 2


def test_a_candidate_alone_needs_no_advice() -> None:
    """Nothing is advised while one candidate has all but the least probability."""
    assert single(leaking(), leak=1.0 - LEAST / 2, outlet=LEAST / 2) == ()
    assert single(leaking(), leak=1.0 - LEAST, outlet=LEAST) == ()  # what it would tell is not worth it
    assert single(leaking(), leak=0.9, outlet=0.1) != ()


def test_a_model_that_is_off_gives_no_advice() -> None:
    """What would be expected of a move is as wrong as the model."""
    graph, spec, _ = plant("tank")
    known = Monitor(build_core(build_plant(graph), replace(spec, false_alarms=1)))
    known._state[:] = leaking()._state
    assert single(leaking(), leak=0.5, outlet=0.5) != ()
    assert single(known, leak=0.5, outlet=0.5) == ()


def test_costs_order_the_advice() -> None:
    """What tells more for its cost comes first; a part that is dear to look at goes back."""
    found = single(checked(), leak=0.5, outlet=0.3, tank=0.2)
    worth = [item.gain / item.cost for item in found]
    assert worth == sorted(worth, reverse=True)
    assert looks(found)["leak"].cost == 100.0
    assert (found[0].target, found[0].cost, found[-1].target) == ("u_out", 0.5, "leak")
    alike = [item.target for item in single(leaking(), leak=0.5, outlet=0.5) if item.kind is CheckKind.COMPONENT]
    assert alike == sorted(alike)


def test_moving_the_outlet_parts_leak_and_outlet() -> None:
    """A leak and a wider outlet look alike until the outlet valve moves; moving the inlet valve does not part them."""
    moves = {item.target: item for item in single(leaking(), leak=0.5, outlet=0.5) if item.kind is CheckKind.INPUT}
    assert set(moves) == {"u_out"}
    move = moves["u_out"]
    assert move.gain == pytest.approx(1.0)
    assert move.value is not None
    assert 0.0 <= move.value <= 100.0
    assert abs(move.value - outlet()) > 5.0
    assert move.within == 300.0


def test_a_stated_move_is_the_one_that_is_tried() -> None:
    """Where the model file says how far an input may be moved, no other move is advised."""
    moves = [item for item in single(checked(), leak=0.5, outlet=0.5) if item.kind is CheckKind.INPUT]
    assert [abs((item.value or 0.0) - outlet()) for item in moves] == [40.0]


@cache
def tools() -> Bare:
    """The core of a plant with inputs of many kinds."""
    return bare(CALLS, INPUTS)


@pytest.mark.parametrize(
    ("name", "seen", "now", "expected"),
    [
        ("P0", (20.0, 30.0), 30.0, [50.0, 10.0, 70.0, 0.0, 90.0]),
        ("V0", (2.0, 10.0), 10.0, [8.0, 6.0, 4.0]),  # never beyond 10, never turned round
        ("V0", (2.0, 10.0), 5.0, [7.0, 3.0, 9.0, 1.0, 10.0, 0.0]),  # zero counts as a place where it has been
        ("V1", (-10.0, 10.0), 4.0, [6.0, 2.0, 8.0, 0.0, 10.0, -2.0]),
        ("V1", (np.inf, -np.inf), 4.0, []),  # where it has been nobody knows
        ("T0", (280.0, 300.0), 290.0, [294.0, 286.0, 298.0, 282.0, 300.0, 280.0]),
        ("T1", (290.0, 290.0), 290.0, []),  # where it has never moved nobody knows how far it may
        ("T2", (290.0, 290.0), 290.0, [295.0, 285.0]),
        ("P1", (20.0, 30.0), 85.0, [100.0, 65.0]),
        ("P2", (20.0, 30.0), 95.0, [75.0]),  # to the end it would be a quarter of the move only
        ("V2", (1.0, 2.0), 2.0, [5.0, -1.0]),  # how far is left to whoever stated it
        ("P3", (20.0, 30.0), 45.0, [65.0, 30.0, 80.0]),  # nothing is known of where it was not fitted
        ("V3", (0.0, 10.0), 4.5, [6.0, 2.5, 2.0]),
        ("V4", (1.0, 7.0), 2.0, [5.0, -1.0]),
        ("V5", (0.0, 1.0), 0.0, [1.0]),  # a command that is off or on
        ("V5", (0.0, 1.0), 1.0, [0.0]),
        ("P4", (20.0, 80.0), 30.0, [50.0, 10.0, 70.0, 5.0, 75.0]),  # nor beyond what it can be
        ("P5", (20.0, 80.0), 30.0, []),  # nobody can move it
    ],
)
def test_where_an_input_may_be_moved(name: str, seen: tuple[float, float], now: float, expected: list[float]) -> None:
    """Within where it has been and zero, but for degC; of a stated move as far as stated; percentages from 0 to 100."""
    state, values = tools(), np.full(6, nan)
    k = [item.name for item in state.spec.inputs].index(name)
    for field, value in zip(("held", "lowest", "highest"), (now, *seen), strict=True):
        state[f"inputs.{field}"][k] = value
    count = state.call("t_values", np.array([k]), values)
    assert values[:count] == pytest.approx(expected)


@settings(max_examples=100, deadline=None)
@given(n=st.integers(1, 8), seed=st.integers(0, 10**6), near=st.floats(0.05, 0.5))
def test_groups_are_what_hangs_together(n: int, seed: int, near: float) -> None:
    """Two candidates are in one group where a chain of near ones leads from one to the other, and in no other case."""
    generator, apart = np.random.default_rng(seed), np.zeros((8, 8))
    close = np.tril(generator.random((8, 8)) < near, -1)
    apart[:] = np.where(
        close, generator.choice([0.0, APART - 1e-9, nan], (8, 8)), generator.choice([APART, np.inf], (8, 8))
    )
    group, room = np.full(8, -1), aligned(tools().call("t_room"))
    count = tools().call("t_part", room, apart, np.array([n]), group)
    reach = close | close.T | np.eye(8, dtype=bool)
    reach = np.linalg.matrix_power(reach[:n, :n].astype(np.int64), 8) > 0
    assert np.array_equal(group[:n, None] == group[None, :n], reach)
    assert set(group[:n]) == set(range(count))


def parted(monitor: Monitor, rivals: tuple[Candidate, ...], held: FloatArray) -> list[list[tuple[str, ...]]]:
    """The groups of candidates under held inputs, each filter run by itself, all numbers of a run at once."""
    spec, now, n_y = monitor.spec, monitor.numbers("inputs.held"), len(monitor.spec.outputs)
    place, step = spec.sample_fields, spec.sample_time or 1.0
    samples = np.zeros((AHEAD, spec.n_sample))
    samples[:, place["dt"]], samples[:, place["scale"]], samples[:, place["again"]] = step, 1.0, 1.0
    samples[:, place["fresh"]] = spec.input_variance
    samples[:, place["u"]] = samples[:, place["u_before"]] = held
    samples[0, place["u_before"]] = now
    for j, output in enumerate(spec.outputs):
        settling = [spec.inputs[k].settling for k in output.direct_inputs if held[k] != now[k]]
        blank = ceil(max(settling, default=0.0) / step)
        samples[:blank, place["scale"].start + j] = spec.thresholds.blank_factor
    told = []
    for item in rivals:
        lane = monitor.lane(item.lane)
        engine: Core = monitor.core if len(lane) == spec.n_numbers else monitor.core.slot
        told.append(engine.advance(lane[:, None], samples)[1][:, :, 0])
    noise = spec.output_noise**2 * samples[:, place["scale"]]
    near = np.eye(len(rivals), dtype=bool)
    for i, one in enumerate(told):
        for j, two in enumerate(told):
            size = np.abs(one - two)[:, :n_y] / np.sqrt(noise)
            own = np.sqrt(np.maximum((one + two)[:, n_y:] / noise - 2.0, 0.0))
            whole = float(np.sqrt(np.sum(size**2)))
            near[i, j] |= whole == 0.0 or whole / np.sqrt(1.0 + (np.sum(size * own) / whole) ** 2) < APART
    reach = np.linalg.matrix_power(near.astype(np.int64), len(rivals)) > 0
    return sorted(
        {
            tuple(np.flatnonzero(row)): sorted(rivals[k].components for k in np.flatnonzero(row)) for row in reach
        }.values()
    )


@pytest.mark.parametrize("lanes", [0, 8, 4, 1])
def test_moves_part_what_predictions_part(lanes: int) -> None:
    """Groups are those of filters run one by one, of all kinds of lanes, with any number of them side by side."""
    monitor = Monitor(cell(lanes), course().saved[PARTED]) if lanes else leaking()
    listed, spec = monitor.conclude().candidates, monitor.spec
    names = [item.components for item in listed]
    wide = [k for k, item in enumerate(listed) if len(monitor.lane(item.lane)) > spec.n_numbers]
    plain = [k for k in range(len(listed)) if k not in wide]
    chosen = [*plain[:4], *wide[:4]] if lanes else [names.index(("leak",)), names.index(("outlet",)), *wide[:3]]
    rivals, found = advised(monitor, *((k, 1.0 / len(chosen)) for k in chosen))
    now, moves = monitor.numbers("inputs.held"), [item for item in found if item.kind is CheckKind.INPUT]
    waited = bits(parted(monitor, rivals, now), rivals)
    assert moves
    for item in moves:
        held, k = now.copy(), [other.name for other in spec.inputs].index(item.target)
        assert item.value is not None
        held[k] = item.value
        groups = parted(monitor, rivals, held)
        assert sorted(sorted(group) for group in item.separates) == groups
        assert item.gain == pytest.approx(bits(groups, rivals))
        assert item.gain >= waited + WORTH


def test_what_a_sensor_out_of_use_would_read_is_no_reason_for_a_move() -> None:
    """A move is advised for what the others read; noise that was accepted counts."""
    monitor = leaking()
    listed = monitor.conclude().candidates
    names = [item.components for item in listed]
    chosen = [(names.index((name,)), 0.5) for name in ("leak", "outlet")]
    gains = []
    for noise in (1.0, 1e6, np.inf):
        found = advised(changed(monitor, **{"normal.noise": noise}), *chosen)[1]
        gains.append(max((item.gain for item in found if item.kind is CheckKind.INPUT), default=0.0))
    assert gains == [pytest.approx(1.0), 0.0, 0.0]


def test_of_all_moves_the_nearest_is_advised_that_tells_most() -> None:
    """Each move of each valve is asked by itself: none tells more than the one that is advised, none nearer as much."""
    monitor = leaking()
    listed, spec, now = monitor.conclude().candidates, monitor.spec, monitor.numbers("inputs.held")
    names = [item.components for item in listed]
    wide = [k for k, item in enumerate(listed) if len(monitor.lane(item.lane)) > spec.n_numbers]
    chosen = [names.index(("leak",)), names.index(("outlet",)), *wide[:3]]
    rivals, found = advised(monitor, *((k, 1.0 / len(chosen)) for k in chosen))
    waited, partial = bits(parted(monitor, rivals, now), rivals), 0
    for k, item in enumerate(spec.inputs):
        values = [now[k] + sign * size for size in (20.0, 40.0, 60.0) for sign in (1.0, -1.0)]
        values = list(dict.fromkeys(value for value in np.clip(values, 0.0, 100.0) if abs(value - now[k]) > 10.0))
        told = [
            bits(parted(monitor, rivals, np.where(np.arange(len(now)) == k, value, now)), rivals) for value in values
        ]
        best = int(np.argmax(np.round(told, 2)))  # the first of equals
        advised_value = [one.value for one in found if one.kind is CheckKind.INPUT and one.target == item.name]
        assert advised_value == ([values[best]] if told[best] >= waited + WORTH else [])
        partial += any(waited + WORTH <= one < told[best] - 0.01 for one in told)
    assert partial  # somewhere a move tells something, and another one more


def bits(groups: list[list[tuple[str, ...]]], rivals: tuple[Candidate, ...]) -> float:
    """What it tells to know the group, of rivals that are equally likely."""
    return entropy(*(len(group) / len(rivals) for group in groups))


def test_an_accepted_drift_goes_on() -> None:
    """What is predicted holds that a parameter whose drift was accepted moves on."""
    state = bare(AHEAD_CALL)
    state.restore(course().saved[ACCEPTED - 1])
    work, found = (aligned(cell().sizes[name]) for name in ("work", "diagnosis"))
    moved = []
    for rate in (0.0, 1e-4):
        state["normal.rates"], first = rate, np.zeros(state.spec.slotted.n_numbers)
        state.call("t_ahead", work, found, first)
        moved.append(first[state.spec.parameter_slice])
    assert moved[1] - moved[0] == pytest.approx(1e-4 * AHEAD * (state.spec.sample_time or 0.0))


def test_what_settles_after_a_move_is_not_counted() -> None:
    """A sensor that feels the moved input at once is blanked for as long as that settles; nothing is measured."""
    state, now = bare(AHEAD_CALL), np.array([2.0, 0.3])
    place, state["inputs.held"], packed = state.spec.sample_fields, now, np.full(state.spec.n_sample, nan)
    blank = state.spec.thresholds.blank_factor
    for held, t, length, scale in (
        ([4.0, 0.3], 6, 1, blank),
        ([4.0, 0.3], 7, 1, 1.0),
        ([4.0, 0.3], 8, 3, 1.0),
        ([2.0, 0.2], 1, 1, 1.0),
        ([2.0, 0.2], 5, 5, 1.0),
    ):
        state.call("t_pack", np.array([t, length]), np.array(held), packed)
        assert packed[place["dt"]].item() == length * (state.spec.sample_time or 0.0)
        assert packed[place["scale"]].tolist() == [scale, 1.0]
        assert packed[place["u"]].tolist() == held
        assert packed[place["u_before"]].tolist() == (held if t > length else now.tolist())
        assert not packed[place["use"]].any()


def test_predictions_are_apart_by_the_noise_that_their_readings_have() -> None:
    """With a part of the reading, and with what was accepted; a sensor out of use parts nothing."""
    state, found = bare(AHEAD_CALL, CELL.replace("noise: 5 mA}", "noise: 5 mA + 10 %}")), np.zeros(2)
    expected, variance = np.array([[2.0, 2.4], [5.0, 5.0]]), np.zeros(2)
    for factor in (1.0, 4.0):
        noise = factor * (0.005**2 + 0.1**2 * np.mean(expected[0] ** 2))
        variance[0] = noise * 1.5
        state.call("t_apart", expected.ravel(), variance, np.array([factor, 1.0]), found)
        assert found == pytest.approx([0.16 / noise, 0.4 / sqrt(noise)], rel=1e-9)
    state.call("t_apart", expected.ravel(), variance, np.array([np.inf, 1.0]), found)
    assert found.tolist() == [0.0, 0.0]


def test_what_is_expected_by_hand() -> None:
    """A flow, and a content which no sensor reads, follow from states, parameters and inputs, as sensors do."""
    state = bare(HAND_CALL, TANK + BY_HAND)
    spec, (_, _, core) = state.spec, plant("tank")
    state["inputs.held"] = 60.0, 40.0
    mean = np.array([12000.0])
    lane = core.healthy_lane(mean, np.eye(1))
    sample = np.zeros((1, spec.n_sample))
    sample[:, spec.sample_fields["u"]] = state["inputs.held"]
    flow, pressure = -core.advance(lane, sample)[1][0, :2, 0]
    wide, found, k3 = np.zeros(spec.slotted.n_numbers), np.zeros(6), [item.name for item in spec.parameters].index("K3")
    wide[: spec.parameter_slice.stop] = lane[: spec.parameter_slice.stop, 0]
    wide[spec.slotted.loop_slice] = lane[spec.loop_slice, 0]
    wide[spec.slotted.slot_slice], wide[spec.slotted.role_fields["theta"].start + k3] = (1e6, 0.0), 1.0
    state.call("t_by_hand", aligned(core.sizes["work"] + 10**4), lane[:, 0].copy(), wide, found)
    parameter, values = spec.parameters[k3], {item.name: item.value for item in plant("tank")[0].constants}
    k2 = next(item.nominal for item in spec.parameters if item.name == "K2")
    assert found[:3] == pytest.approx([flow * np.sqrt(values["K_meter"] / k2)] * 2 + [pressure / parameter.nominal])
    assert found[5] == pytest.approx(pressure / (parameter.scale * parameter.upper))  # up to the end of its range


def test_a_measurement_by_hand_parts_what_expects_other_values() -> None:
    """A flow that can be measured by hand tells a wrong flow sensor from a narrower pipe, unless it is too coarse."""
    _, core = build_engine(parse_model(TANK + BY_HAND))
    monitor, _ = run(core, recorded("tank", 330, Fault(parameter="K2", factor=1.5, start=230.0)))
    signals = [item for item in single(monitor, flow=0.5, pipe=0.5) if item.kind is CheckKind.SIGNAL]
    assert [item.target for item in signals] == ["inflow"]
    assert signals[0].cost == 2.0
    assert signals[0].gain == pytest.approx(1.0)
    assert sorted(signals[0].separates) == [(("flow",),), (("pipe",),)]


def test_every_piece_of_advice_is_worth_something() -> None:
    """No check that tells next to nothing is advised, and each names groups that hold all candidates."""
    monitor = leaking()
    monitor.conclude()
    found = monitor.advise()
    assert found
    for item in found:
        assert item.gain >= WORTH
        assert len(item.separates) > 1
        assert len({tuple(sorted(group)) for group in item.separates}) == len(item.separates)
    assert np.all(np.isfinite([item.gain for item in found]))
