"""Solving routes: which closed forms there are, that they are right, and what is said where there are none."""

import json
import time
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from solved import example, route_to, static

from faultbond.algebra.route import Question, Route
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.solving.backward_euler import NumericPlant, plant_of, random_inputs, simulate_frames
from faultbond.algebra.solving.formula import to_one_line
from faultbond.algebra.solving.problem import prepare, trials_of
from faultbond.algebra.solving.roots import find_roots
from faultbond.algebra.solving.solution import (
    Solution,
    SolutionKind,
    closed_form,
    from_record,
    solve_samples,
    to_record,
)
from faultbond.algebra.solving.solve import SolvingLimits, cache_key, solve, solve_cached
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, build_components
from faultbond.equations.constraint_network import build_network
from faultbond.equations.numeric import Real
from faultbond.errors import StructureError
from faultbond.model.expression import Binary, Name
from faultbond.model.parser import to_text
from faultbond.model.text import parse_model

SINGLES = [
    *(("tank", name) for name in ("K1", "K2", "K3", "K4", "K6", "K7", "K8")),
    *(("rlc", name) for name in "RLC"),
    *(("emps", name) for name in ("G", "M", "Fv", "Fc", "F0")),
    *(("cascaded_tanks", name) for name in ("K_pump", "k_1", "k_2")),
    *(("dc_motor_current", name) for name in "RLJCK"),
]


def fresh_data(
    network: ComponentNetwork, plant: NumericPlant, route: Route, factor: Fraction, seed: int
) -> tuple[dict[str, Real], dict[str, Real]]:
    """Samples of a plant with other values of the unknowns, as a route names them, and the true values."""
    problem = prepare(network, route, plant)
    parameters = [name for name in problem.unknown if name in plant.values]
    values = dict(plant.values) | {name: plant.values[name] * factor for name in parameters}
    record = simulate_frames(network, values, random_inputs(plant, problem.frames + 5, seed), plant.sample_time)
    end = problem.frames + 4
    true = {name: record[signal][end - frame] for name, (signal, frame) in problem.signals.items()}
    true |= {**values, "dt": plant.sample_time}
    return {name: value for name, value in true.items() if name not in problem.unknown}, true


def agrees(found: dict[str, Real], true: dict[str, Real], tolerance: float = 1e-6) -> bool:
    """Whether found values are the true ones."""
    return all(abs(float(value - true[name])) <= tolerance * abs(float(true[name])) for name, value in found.items())


@pytest.mark.parametrize(("folder", "name"), SINGLES)
def test_single_faults_of_the_examples(folder: str, name: str) -> None:
    """Every single parameter of the examples has a closed form that computes it on data it was not checked on."""
    network, plant = example(folder)
    route = route_to(network, name)
    solution = solve(network, route, plant)
    assert solution.roots
    known, true = fresh_data(network, plant, route, Fraction(13, 10), seed=99)
    assert any(agrees(found, true) for found in solve_samples(solution, known))


def test_shape_of_a_law_is_kept() -> None:
    """Pure propagation leaves the laws as they were written: R = (V - V_C)/(C*(V_C - V_C@1)/dt)."""
    network, plant = example("rc")
    solution = solve(network, route_to(network, "R"), plant)
    form = closed_form(solution.roots[0], "R")
    assert form is not None
    assert to_text(form) == "(V_0 - V_C_0)/(C*((V_C_0 - V_C_1)/dt))"


def test_singular_samples_are_named() -> None:
    """R of the RC circuit has no value where the current is 0."""
    network, plant = example("rc")
    (item,) = solve(network, route_to(network, "R"), plant).singular
    assert (item.name, to_text(item.expression)) == ("R", "loop.f_0")
    assert "do not excite" in item.words


def test_singular_samples_are_told_by_what_is_measured() -> None:
    """A name that stands for a part of a formula, within another part, says nothing to a reader."""
    network, plant = static({"coil": "f - A*m*u*(1 - exp(-(3/(max(m, 0.1)*3))))"}, ("m", "u"), ("f",), {"A": 2.0})
    told = [to_text(item.expression) for item in solve(network, route_to(network, "A"), plant).singular]
    assert told == ["max(m_0, 0.1)*3", "m_0*u_0*(1 - exp(-(3/(max(m_0, 0.1)*3))))"]


def test_a_root_of_a_size_has_a_value_everywhere() -> None:
    """Of a valve through which either pressure may drive, only what is no size can be too small for its root."""
    for inside, expected in (("abs(p)", []), ("p", ["no real value where this is negative"])):
        network, plant = static({"valve": f"f - K*sqrt({inside}) - p"}, ("p",), ("f",), {"K": 2.0})
        told = [item.words for item in solve(network, route_to(network, "K"), plant).singular]
        assert [words for words in told if "real" in words] == expected


def test_undetermined() -> None:
    """Of the RC circuit only the product of R and C acts: there is no closed form for both, and it is said."""
    network, plant = example("rc")
    solution = solve(network, route_to(network, "R", "C"), plant)
    assert solution.kind is SolutionKind.UNDETERMINED
    assert not solution.roots
    assert "do not fix R, C" in solution.remarks[0]


def test_branch_of_a_flow() -> None:
    """The tank's pressure drop K1*f*abs(f) is taken on the side f >= 0, the one that the sensor reads; this is said."""
    network, plant = example("tank")
    solution = solve(network, route_to(network, "K1"), plant)
    (root,) = solution.roots
    assert [condition.text for condition in root.conditions] == ["flow_0 >= 0", "line.f_0 >= 0"]
    assert (solution.kind, solution.degree, solution.real_roots) == (SolutionKind.LINEAR, 1, 1)
    assert solution.remarks == ("no solution on any test record where flow_0 >= 0 and line.f_0 <= 0",)


def test_root_outside_its_branch_is_discarded() -> None:
    """Samples on the other side of the branch give nothing, not a wrong number."""
    network, plant = example("tank")
    route = route_to(network, "K1")
    solution = solve(network, route, plant)
    known, _ = fresh_data(network, plant, route, Fraction(1), seed=3)
    assert len(solve_samples(solution, known)) == 1
    assert solve_samples(solution, {**known, "flow_0": -1e-4}) == ()


def test_both_signs_of_a_square() -> None:
    """K7 enters as its square: two closed forms, one the negative of the other, the nominal one first."""
    network, plant = example("tank")
    route = route_to(network, "K7")
    solution = solve(network, route, plant)
    known, true = fresh_data(network, plant, route, Fraction(13, 10), seed=5)
    first, second = (float(found["K7"]) for found in solve_samples(solution, known))
    assert first == pytest.approx(float(true["K7"]))
    assert second == pytest.approx(-first)


def squares() -> tuple[ComponentNetwork, NumericPlant]:
    """Thesis 3.7.2: y = (M1 x1 + M2 x2)^2 + M3 x3 with M = (1, 2, 4)."""
    laws = {
        "M1": "p - M1*x1",
        "M2": "q - M2*x2",
        "S1": "s - (p + q)**2",
        "M3": "r - M3*x3",
        "sum": "y - s - r",
    }
    return static(laws, ["x1", "x2", "x3"], ["y"], {"M1": 1.0, "M2": 2.0, "M3": 4.0})


def observations(*rows: tuple[int, int, int, int]) -> dict[str, Real]:
    """Observations x1, x2, x3, y as frames, with the nominal parameters."""
    names = ("x1", "x2", "x3", "y")
    found: dict[str, Real] = {
        f"{name}_{frame}": Fraction(value)
        for frame, row in enumerate(rows)
        for name, value in zip(names, row, strict=True)
    }
    return found | {"M1": Fraction(1), "M2": Fraction(2), "M3": Fraction(4), "dt": Fraction(1)}


FIRST, SECOND = (3, 2, 4, 160), (2, 2, 2, 94)  # G8


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("M1", {Fraction(8, 3), Fraction(-16, 3)}),
        ("M2", {Fraction(9, 2), Fraction(-15, 2)}),
        ("M3", {Fraction(111, 4)}),
    ],
)
def test_square_passed_backwards(name: str, values: set[Fraction]) -> None:
    """Table 3.4: both signs of the square are diagnoses, exactly."""
    network, plant = squares()
    solution = solve(network, route_to(network, name), plant)
    assert {found[name] for found in solve_samples(solution, observations(FIRST))} == values


def test_two_observations_of_the_square() -> None:
    """E3: two observations leave two pairs {M1, M3}: (2, 15) and (6, -81); the printed one is not the only one."""
    network, plant = squares()
    solution = solve(network, _two_observations(network, "M1", "M3"), plant)
    found = solve_samples(solution, observations(FIRST, SECOND))
    assert {(root["M1"], root["M3"]) for root in found} == {(2, 15), (6, -81)}
    assert solution.degree == solution.real_roots == 2


def test_four_solutions_of_two_squares() -> None:
    """G8: two observations leave four pairs {M1, M2}, one for each pair of signs."""
    network, plant = squares()
    route = _two_observations(network, "M1", "M2")
    solution = solve(network, route, plant)
    assert len(solve_samples(solution, observations(FIRST, SECOND))) == len(solution.roots) == 4
    counted = find_roots(prepare(network, route, plant), observations(FIRST, SECOND), {})
    assert (len(counted.roots), counted.degree) == (4, 4)


def _two_observations(network: ComponentNetwork, *names: str) -> Route:
    return find_route(network, Question(targets=names, observed=network.observed, unknown=names, frames=2))


def test_functions_are_inverted() -> None:
    """A diode law, exp of an unknown, is taken backwards by its logarithm."""
    network, plant = static(
        {"diode": "i - I0*(exp(v/Vt) - 1)", "drop": "u - v - r", "R": "r - R*i"},
        ["u"],
        ["r"],
        {"I0": 0.25, "Vt": 2.0, "R": 3.0},
    )
    for name in ("I0", "Vt", "R"):
        route = route_to(network, name)
        solution = solve(network, route, plant)
        known, true = fresh_data(network, plant, route, Fraction(11, 10), seed=4)
        (found,) = solve_samples(solution, known)
        assert agrees(found, true)


def test_no_closed_form_but_roots() -> None:
    """x + x^5 = y has no closed form for P in x = P u: it is said, and the root is found in numbers."""
    network, plant = static({"P": "x - P*u", "sum": "y - x - x**5"}, ["u"], ["y"], {"P": 0.5})
    route = route_to(network, "P")
    solution = solve(network, route, plant)
    assert (solution.kind, solution.degree, solution.real_roots) == (SolutionKind.POLYNOMIAL, 5, 1)
    assert solution.remarks == ("no closed form: a polynomial of degree 5 in x_0 remains",)
    known, true = fresh_data(network, plant, route, Fraction(13, 10), seed=1)
    (root,) = find_roots(prepare(network, route, plant), known, {}).roots
    assert agrees({"P": root["P"]}, true)


def test_newton_where_functions_mix() -> None:
    """x + exp(x) = y cannot be inverted: Newton's method finds the root."""
    network, plant = static({"P": "x - P*u", "sum": "y - x - exp(x)"}, ["u"], ["y"], {"P": 0.5})
    route = route_to(network, "P")
    solution = solve(network, route, plant)
    assert (solution.kind, solution.degree) == (SolutionKind.NUMERIC, None)
    assert "exp has to be solved together" in solution.remarks[0]
    known, true = fresh_data(network, plant, route, Fraction(13, 10), seed=1)
    (root,) = find_roots(prepare(network, route, plant), known, {"x_0": 1.0, "P": 0.5}).roots
    assert agrees({"P": root["P"]}, true)


def test_polynomial_that_factors() -> None:
    """A cubic in the unknown that is a product has closed forms for the factors of degree 1 and 2."""
    network, plant = static({"P": "x - P*u", "law": "(x - y)*(x**2 + y**2 + u)"}, ["u"], ["y"], {"P": 2.0})
    solution = solve(network, route_to(network, "P"), plant)
    assert solution.roots
    assert solution.real_roots == 1


def test_limits_are_kept() -> None:
    """With next to no terms allowed the answer is that there is no closed form within the limit."""
    network, plant = example("dc_motor")
    solution = solve(network, route_to(network, "J", "C"), plant, SolvingLimits(terms=3))
    assert solution.remarks == ("no closed form within the limit",)
    assert solution.real_roots == 1
    solution = solve(network, route_to(network, "J", "C"), plant, SolvingLimits(seconds=-1.0))
    assert solution.remarks == ("no closed form within the limit",)


def test_time_that_others_take_is_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that does something else for longer than the limit takes no closed form away."""
    network, plant = example("dc_motor")
    limits = SolvingLimits(seconds=0.5)

    def interrupted(*words: Any) -> Any:
        time.sleep(1.5 * limits.seconds)
        return trials_of(*words)

    monkeypatch.setattr("faultbond.algebra.solving.solve.trials_of", interrupted)
    assert solve(network, route_to(network, "J"), plant, limits).roots


def test_names_must_differ() -> None:
    """A parameter that is called like a signal in a frame is refused."""
    network, plant = static({"law": "y - x_0*x", "x": "x - u"}, ["u"], ["y"], {"x_0": 2.0})
    with pytest.raises(StructureError, match="x_0 is a parameter, and also x in frame 0; rename"):
        solve(network, route_to(network, "x_0"), plant)


def test_record_and_back() -> None:
    """A solution survives a file."""
    network, plant = example("tank")
    solution = solve(network, route_to(network, "K7"), plant)
    assert from_record(json.loads(json.dumps(to_record(solution)))) == solution


def test_cache(tmp_path: Path) -> None:
    """The second time the solution comes from the folder; a changed parameter or a torn file does not."""
    network, plant = example("rc")
    route = route_to(network, "R")
    first = solve_cached(network, route, plant, tmp_path)
    (file,) = tmp_path.iterdir()
    kept = json.loads(file.read_text())
    kept["remarks"] = ["from the file"]
    file.write_text(json.dumps(kept))
    assert solve_cached(network, route, plant, tmp_path).remarks == ("from the file",)
    file.write_text(file.read_text()[:-20])
    assert solve_cached(network, route, plant, tmp_path) == first
    other = replace(plant, values=dict(plant.values) | {"C": Fraction(7)})
    assert cache_key(network, route, other, SolvingLimits()) != cache_key(network, route, plant, SolvingLimits())


def test_what_took_too_long_is_not_kept(tmp_path: Path) -> None:
    """Without time there is no closed form; with time later there is, so the first is not kept."""
    network, plant = example("tank")
    route = route_to(network, "K1")
    solution = solve_cached(network, route, plant, tmp_path, SolvingLimits(seconds=0.0))
    assert solution.remarks == ("no closed form within the limit",)
    assert list(tmp_path.iterdir()) == []


def test_cache_that_cannot_be_written(tmp_path: Path) -> None:
    """A folder that cannot be made costs time, not the answer."""
    (tmp_path / "file").write_text("in the way")
    network, plant = example("rc")
    assert isinstance(solve_cached(network, route_to(network, "R"), plant, tmp_path / "file"), Solution)


def test_same_result_each_time() -> None:
    """Solving twice gives the same record, to the byte."""
    network, plant = example("dc_motor")
    route = route_to(network, "R", "C")
    texts = {json.dumps(to_record(solve(network, route, plant))) for _ in range(2)}
    assert len(texts) == 1


def test_logic_is_refused() -> None:
    """A logic gate has no closed form in numbers; the message names it."""
    network, plant = static({"gate": "x - u", "P": "y - P*x"}, ["u"], ["y"], {"P": 2.0})
    gate = replace(network.equations[0], residual=Binary("&", Name("x"), Name("u")))
    with pytest.raises(StructureError, match="equation of gate is logic"):
        solve(replace(network, equations=(gate, network.equations[1])), route_to(network, "P"), plant)


def test_many_kinks_are_bounded() -> None:
    """Thirty independent kinks do not mean 2^30 cases: the nominal sides are solved, and what is left out is said."""
    laws = {f"k{k}": f"x{k} + 0.5*abs(x{k} - {k}) - z" for k in range(30)}
    laws |= {"P": "z - P*u", "sum": "y - " + " - ".join(f"x{k}" for k in range(30))}
    network, plant = static(laws, ["u"], ["y"], {"P": 0.5})
    solution = solve(network, route_to(network, "P"), plant)
    assert solution.roots
    assert "left out" in solution.remarks[0]


def test_zero_is_a_root_like_any_other() -> None:
    """P y = P^2 u is satisfied by P = y/u and by P = 0: two roots, the nominal one first."""
    network, plant = static({"law": "P*y - P**2*u"}, ["u"], ["y"], {"P": 2.0})
    solution = solve(network, route_to(network, "P"), plant)
    found = solve_samples(solution, {"y_0": Fraction(6), "u_0": Fraction(2), "dt": Fraction(1)})
    assert [root["P"] for root in found] == [3, 0]
    assert (solution.degree, solution.real_roots) == (2, 2)


def test_each_sign_of_a_root_is_the_answer_somewhere() -> None:
    """P^2 y = P (P^2 u - x), with x = 0 by its own law: P = (y + |y|)/(2 u) for y > 0, (y - |y|)/(2 u) for y < 0."""
    network, plant = static({"law": "y - (P**2*u - x)/P", "x": "x - u + u"}, ["u"], ["y"], {"P": 2.0})
    solution = solve(network, route_to(network, "P"), plant)
    for y in (Fraction(6), Fraction(-6)):
        found = solve_samples(solution, {"y_0": y, "u_0": Fraction(2), "dt": Fraction(1)})
        assert [root["P"] for root in found if root["P"]] == [y / 2]


def test_plant_that_moves_by_itself() -> None:
    """A capacitor that discharges through a resistor has no input: records begin away from rest."""
    text = """
name: discharge
sample_time: 0.5 s
inputs: {V: {unit: V}}
components:
  C: {type: C, parameters: {C: 2 F}}
  R: {type: R, parameters: {R: 3 ohm}}
junctions: {node: 0}
bonds: [node -> C, node -> R]
sensors: {u: {reads: node.e, unit: V, noise: 1 mV}}
"""
    graph = parse_model(text)
    network = build_components(graph, build_network(graph, assign_causality(graph)))
    solution = solve(network, route_to(network, "R"), plant_of(graph))
    assert to_one_line(solution) == "R = -(u_0*dt/(C*(u_0 - u_1)))"


LEAKING = """
name: leaking tank
sample_time: 2 s
inputs: {u: {unit: m^3/s}}
components:
  pump: {type: Sf, law: f = u}
  tank: {type: C, law: e = q/A, parameters: {A: 3 m^5/N}}
  outlet: {type: R, law: f = k*sqrt(e), parameters: {k: 0.8 m^3/s/Pa^0.5}}
  leak: {type: Sf, law: f = L, parameters: {L: {nominal: 0 m^3/s, accuracy: 0.1 m^3/s, change: 0.5 m^3/s}}}
junctions: {node: 0}
bonds: [pump -> node -> tank, node -> outlet, node -> leak]
sensors: {p: {reads: node.e, unit: Pa, noise: 10 mPa}}
"""


def plant_from(text: str) -> tuple[ComponentNetwork, NumericPlant]:
    """The component network of a model file and its numbers."""
    graph = parse_model(text)
    return build_components(graph, build_network(graph, assign_causality(graph))), plant_of(graph)


def test_a_leak_that_is_none() -> None:
    """A leak of 0 comes out as the rounding of the flows that it is the difference of, and that is good enough."""
    network, plant = plant_from(LEAKING)
    solution = solve(network, route_to(network, "L"), plant)
    assert to_one_line(solution) == "L = u_0 - (p_0 - p_1)*A/dt - k*sqrt(p_0)"
    assert (solution.real_roots, solution.remarks) == (1, ())


def test_nothing_is_divided_by_a_parameter_that_is_zero() -> None:
    """A motor without resistance: its current follows though the law of R cannot be turned round."""
    text = """
name: motor
sample_time: 0.5 s
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  L: {type: I, parameters: {L: 2 H}}
  winding: {type: R, law: e = R*f, parameters: {R: {nominal: 0 ohm, accuracy: 1 ohm, change: 2 ohm}}}
  K: {type: GY, parameters: {K: 1.5 V*s/rad}}
  J: {type: I, parameters: {J: 2 kg*m^2}}
junctions: {coil: 1, shaft: 1}
bonds: [source -> coil -> L, coil -> winding, coil -> K -> shaft -> J]
sensors:
  i: {reads: -coil.f, unit: A, noise: 1 mA}
  w: {reads: shaft.f, unit: rad/s, noise: 1 mrad/s}
"""
    network, plant = plant_from(text)
    question = Question(
        targets=(("i", 0),),
        observed=network.observed,
        hidden=frozenset({("i", 0)}),
        known=frozenset({("coil.f", 1)}),
        frames=1,
        causal=True,
    )
    solution = solve(network, find_route(network, question), plant)
    values = {"L": Fraction(2), "R": Fraction(0), "K": Fraction(3, 2), "dt": Fraction(1, 2)}
    (found,) = solve_samples(solution, {"V_0": Fraction(9), "w_0": Fraction(2), "coil.f_1": Fraction(1), **values})
    assert found == {"i_0": Fraction(-5, 2)}  # 1 + (9 - 1.5*2)*0.5/2


def test_both_sides_of_a_tank_outlet() -> None:
    """Test records lie on both sides of a kink: the level of a tank that fills and of one that is sucked empty."""
    outlet = "f = k*sign(e)*sqrt(abs(e))"
    network, plant = plant_from(
        LEAKING.replace("f = k*sqrt(e)", outlet).replace("f = u", "f = g*u, parameters: {g: 1}")
    )
    question = Question(
        targets=(("p", 0),),
        observed=network.observed,
        hidden=frozenset({("p", 0)}),
        known=frozenset({("p", 1)}),
        frames=1,
        causal=True,
    )
    solution = solve(network, find_route(network, question), plant)
    values = {"A": 3.0, "k": 0.8, "L": 0.0, "g": 1.0, "dt": 2.0}
    for flow, level in ((5.2, 4.0), (-5.2, -4.0)):  # 3*(4 - 1.6)/2 + 0.8*sqrt(4) = 5.2
        (found,) = solve_samples(solution, {"u_0": flow, "p_1": 1.6 * level / 4.0, **values})
        assert found["p_0"] == pytest.approx(level)
    assert solution.kind is SolutionKind.LINEAR


def test_small_inputs_reach_inside_a_limit() -> None:
    """A gain before a limiter that the usual inputs always exceed has a closed form all the same."""
    law = {"gain": "s - min(max(g*u, -lim), lim)", "lag": "y - s/T"}
    network, plant = static(law, ["u"], ["y"], {"g": 8.0, "lim": 7.0, "T": 2.0})
    solution = solve(network, route_to(network, "g"), plant)
    (found,) = solve_samples(solution, {"y_0": 1.5, "u_0": 0.5, "lim": 7.0, "T": 2.0, "dt": 1.0})
    assert found["g"] == pytest.approx(6.0)


def test_known_target_is_refused() -> None:
    """What is measured needs no route: it is said, and how to ask."""
    network, plant = example("rc")
    question = Question(targets=(("V_C", 0),), observed=network.observed)
    with pytest.raises(StructureError, match="V_C_0 is known without a route; ask for what is not measured"):
        solve(network, find_route(network, question), plant)


def test_cache_tells_a_constant_from_a_parameter() -> None:
    """A parameter stands by name in a closed form, a constant as a number: the kept one of the other is not used."""
    network, plant = example("rc")
    route = route_to(network, "R")
    constant = replace(network, parameters=("R",), suspects=("R",))
    keys = {cache_key(item, route, plant, SolvingLimits()) for item in (network, constant)}
    assert len(keys) == 2


def test_no_closed_form_for_the_nominal_side() -> None:
    """A closed form that holds for other plants only is none: the first one given must hold at the nominal plant."""
    law = {"law": "y - where(P > 1, exp(P) + P*u, P*u)"}
    network, plant = static(law, ["u"], ["y"], {"P": 1.2})
    solution = solve(network, route_to(network, "P"), plant)
    assert solution.roots == ()
    assert any("none gives back the values" in remark for remark in solution.remarks)


def test_broken_power_of_an_unknown() -> None:
    """y = x**1.5 + x with x = P u is of degree 3 in the root of x, and has one real root: x = 4 for y = 12."""
    network, plant = static({"law": "y - x**1.5 - x", "x": "x - P*u"}, ["u"], ["y"], {"P": 2.0})
    route = route_to(network, "P")
    solution = solve(network, route, plant)
    assert (solution.kind, solution.degree, solution.real_roots) == (SolutionKind.POLYNOMIAL, 3, 1)
    known: dict[str, Real] = {"y_0": Fraction(12), "u_0": Fraction(2), "dt": Fraction(1)}
    (root,) = find_roots(prepare(network, route, plant), known, {"x_0": 1.0, "P": 1.0}).roots
    assert float(root["P"]) == pytest.approx(2.0)
