"""The functions of method `classic`, made from routes: which they are, and what they are checked against."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from faultbond.algebra.solving.backward_euler import plant_of, random_inputs, simulate_frames
from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, build_components
from faultbond.equations.constraint_network import build_network
from faultbond.errors import StructureError
from faultbond.model.text import load_model
from faultbond.thesis.offline.build import build_classic, largest_sets
from faultbond.thesis.offline.functions import expected, from_before, from_samples, read_by, state_signals
from faultbond.thesis.offline.sides import independent, independent_relations
from faultbond.thesis.offline.tape_writer import compile_torn
from faultbond.thesis.offline.torn import tear
from faultbond.thesis.online.newton import solve_torn
from faultbond.thesis.online.plan import ClassicPlan, Programs
from faultbond.thesis.online.settings import Erratum, Settings
from faultbond.thesis.online.tape import NewtonTape, Program, run_program

EXAMPLES = Path(__file__).parents[3] / "examples"
ROWS = 12


@cache
def network_of(name: str) -> ComponentNetwork:
    """The component network of an example."""
    graph = load_model(EXAMPLES / name / "model.yaml")
    return build_components(graph, build_network(graph, assign_causality(graph)))


@cache
def built(name: str, settings: Settings | None = None) -> tuple[EngineSpec, ClassicPlan]:
    """An example with its plan."""
    return build_classic(load_model(EXAMPLES / name / "model.yaml"), settings)


def test_functions_of_the_tank() -> None:
    """The flow follows from the depth, the depth from its past and the measured flow, as figures 7.12 and 7.13 need."""
    formulas = dict(built("tank")[1].formulas)
    assert formulas["state pressure"] == "measured"
    assert formulas["output flow"].startswith("flow_0 = sqrt(K2*sqrt(-((pressure_0 - K8)/(K1 + K2 + K7**2*")
    assert formulas["output pressure"].startswith(
        "pressure_0 = dt*(K3*(sqrt(flow_0**2*5.08e11/K2) - K4*u_out_0 - K6)) + pressure_1"
    )
    assert built("tank")[1].algebraic == (True, False)


def test_functions_of_the_motor() -> None:
    """The current follows from two speeds, and the speed from past states and the voltage (thesis figure 4.4, 4.5)."""
    spec, plan = built("dc_motor")
    formulas = dict(plan.formulas)
    assert formulas["state armature.f"] == "armature.f_0 = (C*omega_0 + J*(omega_0 - omega_1)/dt)/K"
    assert "V_0" in formulas["output omega"]
    assert formulas["law of R"] == "R.e_0 - R*armature.f_0 = 0; R.e_0 = V_0 - L*L.rate_0 - K*omega_0"
    assert formulas["law of C"] == "C.e_0 - C*omega_0 = 0; C.e_0 = K*armature.f_0 - J*J.rate_0"
    assert plan.algebraic == (False,)
    assert [item.name for item in spec.parameters] == ["R", "L", "K", "J", "C"]


def test_states_are_not_differentiated() -> None:
    """No output and no state from one sample is found by a store's rate from its state."""
    for name in ("tank", "dc_motor", "dc_motor_current", "rlc", "rc", "cascaded_tanks"):
        network = network_of(name)
        sums = {state.sum: (state.signal, 0) for state in network.states}
        asked = [expected(network, output) for output in network.outputs]
        for state, item in zip(network.states, from_samples(network), strict=True):
            asked.append(from_before(network, state.signal, read_by(network, item)))
        for _, route in asked:
            assert all(step.finds == sums[step.equation] for step in route.steps if step.equation in sums)


def test_printed_states_use_inputs_only() -> None:
    """As printed, no output enters the prediction of another."""
    assert (
        dict(built("dc_motor_current")[1].formulas)["output omega"] == "omega_0 = (J*omega_1 + dt*(K*i_0))/(C*dt + J)"
    )
    _, plan = built("dc_motor_current", Settings(printed=frozenset({Erratum.INPUTS})))
    found = dict(plan.formulas)["output omega"]
    assert "i_0" not in found
    assert "V_0" in found


def results(batch: Programs, environment: list[FloatArray]) -> dict[int, float]:
    """What each row of a batch gives, of one lane."""
    with np.errstate(all="ignore"):
        found = [
            (rows, solve_torn(item, environment, 1) if isinstance(item, NewtonTape) else run_program(item, environment))
            for item, rows in batch
        ]
    return {row: float(value[0]) for rows, values in found for row, value in zip(rows, values, strict=True)}


@pytest.mark.parametrize("name", ["tank", "dc_motor", "dc_motor_current", "rlc", "rc", "cascaded_tanks", "emps"])
def test_functions_agree_with_a_backward_euler_plant(name: str) -> None:
    """On a record of the nominal plant every function gives what was simulated, and no law has a misfit."""
    graph = load_model(EXAMPLES / name / "model.yaml")
    network = network_of(name)
    spec, plan = built(name)
    numbers = plant_of(graph)
    start = {state.signal: 1.5 + k for k, state in enumerate(network.states)}
    values = {key: float(value) for key, value in numbers.values.items()}
    inputs = {key: tuple(map(float, item)) for key, item in random_inputs(numbers, ROWS, 4).items()}
    record = simulate_frames(network, values, inputs, float(numbers.sample_time), start, ROWS)
    environment = [np.array([np.nan])] * len(plan.names)
    known = {"dt": float(numbers.sample_time), **{item.name: item.nominal for item in spec.parameters}}
    for signal, series in record.items():
        known |= {f"{signal}_{frame}": float(series[-1 - frame]) for frame in range(4)}
    for place, key in enumerate(plan.names):
        environment[place] = np.array([known[key]])
    for batch, wanted in (
        (plan.from_samples, plan.states),
        (plan.from_before, plan.states),
        (plan.expected, network.outputs),
    ):
        found = results(batch, environment)
        assert sorted(found) == list(range(len(wanted)))
        for k, value in found.items():
            assert value == pytest.approx(known[f"{wanted[k]}_0"], rel=1e-6)
    misfits = results(plan.misfits, environment)
    assert sorted(misfits) == list(range(len(plan.sides)))
    size = max(abs(known[key]) for key in known if key.endswith("_0"))
    assert max(map(abs, misfits.values())) < 1e-6 * size


def test_relations_are_independent() -> None:
    """The tank has two equations to spare: line with meter, vessel with meter; line with vessel is no third."""
    network = network_of("tank")
    line, vessel = {"pump", "pipe", "valve", "line"}, {"tank", "vessel", "outlet", "leak"}
    meter = {"orifice", "flow"}
    assert set(independent_relations(network)) == {frozenset(line | meter), frozenset(vessel | meter)}
    without = frozenset(line | vessel | {"orifice"})
    candidates = [frozenset(line | meter), frozenset(vessel | meter), without]
    assert independent(network, candidates) == tuple(candidates[:2])
    assert independent(network, candidates[::-1]) == tuple(candidates[:0:-1])


def test_largest_sets_are_tested() -> None:
    """Of 28 hypotheses of the tank its 21 pairs are tested, and each is estimated from the laws of its members."""
    spec, plan = built("tank")
    assert len(spec.hypotheses) == 28
    assert len(plan.tested) == 21
    names = [item.name for item in spec.parameters]
    laws = {
        tuple(names[k] for k in chosen): [plan.sides[k].equation for k in used]
        for chosen, used in zip(plan.tested, plan.uses, strict=True)
    }
    assert laws["K8", "K1"] == ["pump"]  # one relation, one law left over
    assert laws["K1", "K6"] == ["pipe", "leak"]
    assert laws["K3", "K6"] == ["tank"]
    assert laws["K2", "K4"] == ["orifice", "orifice"]  # K2 is in both relations
    for k, hypothesis in enumerate(spec.hypotheses):
        assert plan.contains[k].sum() == {1: 6, 2: 1}[len(hypothesis)]
    assert largest_sets([(0,), (1,), (2,), (0, 1)]) == ((2,), (0, 1))


def test_singles_alone_if_asked() -> None:
    """With `largest` 1 the seven single suspects are the hypotheses and the tests, as in thesis 7.3."""
    spec, plan = built("tank", Settings(largest=1))
    assert plan.tested == spec.hypotheses == tuple((k,) for k in range(7))


def test_dry_friction_is_left_to_newton() -> None:
    """With tanh in a loop nothing is in closed form: the speed is guessed, from where it was, and all else follows."""
    _, plan = built("emps")
    searches = [item for item, _ in (*plan.from_before, *plan.expected) if isinstance(item, NewtonTape)]
    assert len(searches) == 3
    for item in searches:
        assert [plan.names[place] for place in item.guessed] == ["axis.f_0"]
        assert [plan.names[place] for place in item.starts] == ["axis.f_1"]
    assert dict(plan.formulas)["output q_meas_m"].startswith("by Newton's method for axis.f_0")


def test_a_torn_function_gives_what_its_closed_form_gives() -> None:
    """The motor's speed, torn although it has a closed form, comes out the same for many plants at once."""
    graph = load_model(EXAMPLES / "dc_motor" / "model.yaml")
    network = network_of("dc_motor")
    _, plan = built("dc_motor")
    torn = tear(network, expected(network, "omega")[1], plant_of(graph), prefer=("omega_0",))
    assert torn.guessed == ("omega_0",)
    search = compile_torn(torn, "omega_0", {name: k for k, name in enumerate(plan.names)})
    generator = np.random.default_rng(2)
    environment = [generator.uniform(0.5, 4.0, 30) for _ in plan.names]
    with np.errstate(all="ignore"):
        found = solve_torn(search, environment, 30)
    ((program, _),) = plan.expected
    assert isinstance(program, Program)
    assert found[0] == pytest.approx(run_program(program, environment)[0], rel=1e-8)


def test_a_long_chain_is_followed_by_the_model_alone() -> None:
    """Of the pipe's 21 temperatures those that would take many differences of one reading have no A."""
    network = network_of("pipe")
    found = dict(zip(state_signals(network), from_samples(network), strict=True))
    assert {name for name, item in found.items() if item is not None} == {"node18.e", "node19.e", "node20.e", "probe.e"}
    assert len(found) == 21
    assert read_by(network, found["node1.e"]) == frozenset()
    assert read_by(network, found["node20.e"]) == {"water_out_degC"}


def test_what_has_no_time_is_refused() -> None:
    """A static network has no states to follow."""
    graph = load_model(EXAMPLES / "thesis" / "fig_6_1.yaml")
    with pytest.raises(StructureError, match="follows a plant in time"):
        build_classic(graph)
