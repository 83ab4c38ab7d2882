"""State equations of small plants against formulas derived by hand."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.equations.linear import eliminate
from faultbond.equations.plant import Plant, build_plant
from faultbond.model.text import parse_model

EXAMPLES = Path(__file__).parents[3] / "examples"
TANK = (EXAMPLES / "tank" / "model.yaml").read_text(encoding="utf-8")
MOTOR = (EXAMPLES / "dc_motor_current" / "model.yaml").read_text(encoding="utf-8")


def built(components: str, junctions: str, bonds: str, sensors: str, extra: str = "") -> Plant:
    """A plant with one input V."""
    return build_plant(
        parse_model(
            f"name: plant\nsample_time: 10 ms\ninputs: {{V: {{}}}}\n{extra}components:\n{components}\n"
            f"junctions: {{{junctions}}}\nbonds: [{bonds}]\nsensors: {{{sensors}}}\n"
        )
    )


def at(
    plant: Plant,
    x: Mapping[str, float],
    u: Sequence[float],
    *,
    theta: Mapping[str, float] | None = None,
    b: Sequence[float] | None = None,
    z: Sequence[float] = (),
) -> tuple[dict[str, float], FloatArray, FloatArray]:
    """Rates by state, readings and gap at numbers given by name; parameters that are not named are nominal."""
    symbols = [plant.x, plant.u, plant.theta, plant.b, plant.z]
    function = ca.Function("at", symbols, [plant.rates, plant.readings, plant.gap])
    states = [state.name for state in plant.network.states]
    parameters = [(theta or {}).get(item.name, item.nominal) for item in plant.graph.parameters]
    slow = [0.0] * plant.b.numel() if b is None else list(b)
    rates, readings, gap = function([x[name] for name in states], list(u), parameters, slow, list(z))
    found = dict(zip(states, rates.full()[:, 0].tolist(), strict=True))
    return found, readings.full()[:, 0], gap.full()[:, 0]


@pytest.mark.parametrize("seed", range(5))
def test_motor_equations(seed: int) -> None:
    """The motor obeys L di/dt = V - R i - K omega and J domega/dt = K i - C omega, for any parameters."""
    R, L, K, J, C, p_L, p_J, V = np.random.default_rng(seed).uniform(-3.0, 3.0, 8).tolist()
    plant = build_plant(parse_model(MOTOR))
    rates, readings, _ = at(plant, {"L.p": p_L, "J.p": p_J}, [V], theta={"R": R, "L": L, "K": K, "J": J, "C": C})
    i, omega = p_L / L, p_J / J
    assert rates["L.p"] == pytest.approx(V - R * i - K * omega, rel=1e-12)
    assert rates["J.p"] == pytest.approx(K * i - C * omega, rel=1e-12)
    assert readings == pytest.approx([omega, i], rel=1e-12)


def tank_flow(plant: Plant, pressure: float, u_in: float) -> float:
    """Flow into the tank by hand."""
    K1, K2, K7, K8 = (plant.graph.parameter(name).nominal for name in ("K1", "K2", "K7", "K8"))
    return float(np.sign(K8 - pressure) * np.sqrt(abs(K8 - pressure) / (K1 + K2 + K7**2 * (100.0 - u_in) ** 4)))


@pytest.mark.parametrize(("pressure", "u_in"), [(1e4, 0.0), (3e4, 60.0), (6e4, 100.0), (6.4e4, 85.0), (9e4, 70.0)])
def test_tank_equations(pressure: float, u_in: float) -> None:
    """The tank fills by sqrt((K8 - P)/(K1 + K2 + K7^2 (100 - u)^4)) - K4 u_out - K6, backwards where P > K8."""
    plant = build_plant(parse_model(TANK))
    K2, K3, K4, K6 = (plant.graph.parameter(name).nominal for name in ("K2", "K3", "K4", "K6"))
    rates, readings, _ = at(plant, {"tank.q": pressure / K3}, [u_in, 30.0])
    flow = tank_flow(plant, pressure, u_in)
    assert rates["tank.q"] + K4 * 30.0 + K6 == pytest.approx(flow, rel=1e-9)
    meter = {item.name: item.value for item in plant.graph.constants}["K_meter"]
    assert readings[1] == pytest.approx(pressure, rel=1e-12)
    if flow > 0.0:
        assert readings[0] == pytest.approx(np.sqrt(K2 * flow**2 / meter), rel=1e-9)


def test_tank_at_equal_pressures() -> None:
    """Where both pressures are equal the flow is zero and its slopes are finite."""
    plant = build_plant(parse_model(TANK))
    everything = ca.vertcat(plant.x, plant.u, plant.theta, plant.b)
    slopes = ca.Function("slopes", [everything], [ca.jacobian(ca.vertcat(plant.rates, plant.readings), everything)])
    nominal = [item.nominal for item in plant.graph.parameters]
    x = plant.graph.parameter("K8").nominal / plant.graph.parameter("K3").nominal
    assert np.all(np.isfinite(slopes([x, 60.0, 0.0, *nominal, 0.0, 0.0]).full()))
    rates, _, _ = at(plant, {"tank.q": x}, [60.0, 0.0], theta={"K6": 0.0})
    assert abs(rates["tank.q"]) < 1e-6 * abs(tank_flow(plant, 0.0, 60.0))


def test_inertias_behind_a_transformer() -> None:
    """A second inertia behind a transformer adds to the first one by the square of the ratio."""
    plant = built(
        "  drive: {type: Se, law: e = V}\n  M1: {type: I, parameters: {M1: 2}}\n"
        '  T: {type: TF, law: ["e1 = X*e2", "f2 = X*f1"], parameters: {X: 3}}\n  M2: {type: I, parameters: {M2: 5}}\n'
        "  B: {type: R, parameters: {B: 7}}",
        "one: 1, two: 1",
        "drive -> one -> M1, one -> T -> two -> M2, two -> B",
        "v1: {reads: one.f, noise: 1}, v2: {reads: two.f, noise: 1}, push: {reads: M2.e, noise: 1}",
    )
    assert plant.causality.derivative == ("M2",)
    v = 0.8
    rates, readings, _ = at(plant, {"M1.p": 2.0 * v}, [11.0])
    acceleration = (11.0 - 3.0 * (7.0 * 3.0 * v)) / (2.0 + 3.0**2 * 5.0)
    assert rates["M1.p"] == pytest.approx(2.0 * acceleration, rel=1e-12)
    assert readings == pytest.approx([v, 3.0 * v, 5.0 * 3.0 * acceleration], rel=1e-12)


def test_dependent_store_seen_through_an_iteration() -> None:
    """A linear store beside one whose effort has no closed form shares the flow as their capacitances stand."""
    A, B, V0, C2, current, e = 0.2, 0.05, 0.7, 0.3, 1.9, 1.1
    plant = built(
        "  feed: {type: Sf, law: f = V}\n"
        "  C1: {type: C, law: q = A*e + B*(exp(e/V0) - 1), parameters: {A: 0.2, B: 0.05}}\n"
        "  C2: {type: C, parameters: {C2: 0.3}}",
        "node: 0",
        "feed -> node -> C1, node -> C2",
        "y: {reads: node.e, noise: 1}, i: {reads: C2.f, noise: 1}",
        "constants: {V0: 0.7}\n",
    )
    assert plant.causality.derivative == ("C2",)
    assert len(plant.implicit) == 1
    q = A * e + B * (np.exp(e / V0) - 1.0)
    rates, readings, gap = at(plant, {"C1.q": q}, [current], z=[e])
    assert abs(gap[0]) < 1e-14
    own = A + B / V0 * np.exp(e / V0)
    assert rates["C1.q"] == pytest.approx(own * current / (own + C2), rel=1e-12)
    assert readings == pytest.approx([e, C2 * current / (own + C2)], rel=1e-12)


def test_integrated_signals_are_states() -> None:
    """Reading `shaft.q` adds a state whose rate is the flow, and `node.p` one whose rate is the effort."""
    plant = built(
        "  drive: {type: Se, law: e = V}\n  M: {type: I, parameters: {M: 2}}\n  B: {type: R, parameters: {B: 3}}\n"
        "  S: {type: C, parameters: {S: 4}}",
        "shaft: 1, node: 0",
        "drive -> shaft -> M, shaft -> node -> S, node -> B",
        "place: {reads: shaft.q, noise: 1}, push: {reads: node.p, noise: 1}",
    )
    rates, readings, _ = at(plant, {"M.p": 6.0, "S.q": 8.0, "shaft.q": 0.7, "node.p": 0.4}, [1.0])
    assert rates["shaft.q"] == pytest.approx(6.0 / 2.0)
    assert rates["node.p"] == pytest.approx(8.0 / 4.0)
    assert rates["S.q"] == pytest.approx(3.0 - 2.0 / 3.0)
    assert readings == pytest.approx([0.7, 0.4])


def test_slow_error_acts_behind_the_loop() -> None:
    """A slow error of the tank's flow scales the flow that fills it and the one that is read, and nothing else."""
    plant = build_plant(parse_model(TANK))
    x, u = {"tank.q": 0.3}, [70.0, 40.0]
    K4, K6 = (plant.graph.parameter(name).nominal for name in ("K4", "K6"))
    rates, readings, _ = at(plant, x, u)
    flow = rates["tank.q"] + K4 * 40.0 + K6
    for b_line, b_outlet in ((0.05, 0.0), (0.0, 0.05), (-0.03, 0.04)):
        moved, read, _ = at(plant, x, u, b=[b_line, b_outlet])
        assert moved["tank.q"] == pytest.approx(flow * (1 + b_line) - K4 * 40.0 * (1 + b_outlet) - K6, rel=1e-9)
        assert read == pytest.approx([readings[0] * (1 + b_line), readings[1]], rel=1e-9)


def test_slow_error_is_not_absorbed_by_an_iteration() -> None:
    """The relation that gives a signal by iteration does not see the signal's slow error; what reads it does."""
    plant = built(
        "  supply: {type: Se, law: e = V}\n  R: {type: R, parameters: {R: 2}}\n"
        "  D: {type: R, law: e = f + exp(f) - 1}\n  C: {type: C, parameters: {C: 3}}",
        "line: 1",
        "supply -> line -> R, line -> D, line -> C",
        "i: {reads: line.f, noise: 1}, drop: {reads: R.e, noise: 1}",
        "slow_error: {line.f: 0.1 over 60 s, i: 0.5 over 60 s}\n",
    )
    assert plant.implicit == ("line.f",)
    assert not ca.depends_on(plant.gap, plant.b)
    f = 0.4
    V = 2.0 * f + (f + np.exp(f) - 1.0) + 6.0 / 3.0
    absolute = [not error.relative for error in plant.graph.slow_errors]
    assert absolute == [True, True]
    rates, readings, gap = at(plant, {"C.q": 6.0}, [V], b=[0.05, 0.3], z=[f])
    assert abs(gap[0]) < 1e-14
    assert rates["C.q"] == pytest.approx(f + 0.05, rel=1e-12)
    assert readings == pytest.approx([f + 0.05 + 0.3, 2.0 * (f + 0.05)], rel=1e-12)


def test_slow_errors_of_a_sensor() -> None:
    """A relative slow error of a sensor scales its reading, an absolute one shifts it; the plant sees neither."""
    for size, expected in (("10 %", 2.0 * 1.25), ("0.1 A", 2.0 + 0.25)):
        plant = build_plant(parse_model(MOTOR + f"slow_error: {{i: {size} over 10 s}}\n"))
        L, K = (plant.graph.parameter(name).nominal for name in ("L", "K"))
        rates, readings, _ = at(plant, {"L.p": 2.0 * L, "J.p": 0.0}, [0.0], b=[0.25])
        assert readings == pytest.approx([0.0, expected], rel=1e-12)
        assert rates["J.p"] == pytest.approx(K * 2.0, rel=1e-12)


def test_linear_loop_of_several_tears() -> None:
    """A linear loop that needs several tears is solved without an iteration, as by nodal analysis."""
    ties = {"Rta": "top a", "Rtb": "top b", "Rtc": "top c", "Rab": "a b", "Rbc": "b c", "Rac": "a c"}
    sizes = dict(zip([*ties, "Rg"], [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0], strict=True))
    lines = "\n".join(f"  {name}: {{type: R, parameters: {{{name}: {size}}}}}" for name, size in sizes.items())
    bonds = [f"{tie.split()[0]} -> n{name} -> {tie.split()[1]}, n{name} -> {name}" for name, tie in ties.items()]
    plant = built(
        f"  supply: {{type: Se, law: e = V}}\n{lines}",
        "top: 0, a: 0, b: 0, c: 0, " + ", ".join(f"n{name}: 1" for name in ties),
        "supply -> top, a -> Rg, " + ", ".join(bonds),
        "ea: {reads: a.e, noise: 1}, eb: {reads: b.e, noise: 1}, ec: {reads: c.e, noise: 1}",
    )
    assert plant.implicit == ()
    nodes = {"a": 0, "b": 1, "c": 2}
    conductance, right = np.zeros((3, 3)), np.zeros(3)
    conductance[0, 0] = 1.0 / sizes["Rg"]
    for name, tie in ties.items():
        one, two = tie.split()
        for node, other in ((one, two), (two, one)):
            if node in nodes:
                conductance[nodes[node], nodes[node]] += 1.0 / sizes[name]
                if other in nodes:
                    conductance[nodes[node], nodes[other]] -= 1.0 / sizes[name]
                else:
                    right[nodes[node]] += 12.0 / sizes[name]
    _, readings, _ = at(plant, {}, [12.0])
    assert readings == pytest.approx(np.linalg.solve(conductance, right), rel=1e-12)


def test_co_energy_and_content_are_inverse() -> None:
    """The effort or flow that serves as coordinate gives the content back, also for a store that is not linear."""
    plant = built(
        "  feed: {type: Sf, law: f = V}\n  C: {type: C, law: q = A*sqrt(e), parameters: {A: 3}}\n"
        "  R: {type: R, parameters: {R: 2}}",
        "node: 0",
        "feed -> node -> C, node -> R",
        "y: {reads: node.e, noise: 1}",
    )
    (co,) = plant.co_energy
    assert co is not None
    assert co.name == "node.e"
    there = ca.Function("there", [plant.x, plant.theta], [co.value])
    back = ca.Function("back", [co.symbol, plant.theta], [co.content])
    theta = [item.nominal for item in plant.graph.parameters]
    assert float(there(6.0, theta)) == pytest.approx((6.0 / 3.0) ** 2, rel=1e-9)
    assert float(back(there(6.0, theta), theta)) == pytest.approx(6.0, rel=1e-9)


@pytest.mark.parametrize("size", [1, 2, 4])
def test_elimination_equals_a_dense_solve(size: int) -> None:
    """`eliminate` solves as numpy does, also where zeros on the diagonal need a pivot."""
    generator = np.random.default_rng(size)
    dense = generator.normal(size=(size, size))
    if size > 1:
        dense[0, 0] = 0.0
    right = generator.normal(size=(size, 3))
    found = eliminate(ca.sparsify(ca.SX(ca.DM(dense))), ca.SX(ca.DM(right)))
    assert np.asarray(ca.DM(found)) == pytest.approx(np.linalg.solve(dense, right), rel=1e-9)
