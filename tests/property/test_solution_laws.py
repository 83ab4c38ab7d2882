"""Random plants: a route that is found and solved computes what the plant was simulated with."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from strategies import Mapping, as_text, plants
from sympy.polys.rings import PolyElement

from faultbond.algebra.route import Question, Route
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.solving.backward_euler import NumericPlant, misfit, plant_of, random_inputs, simulate_frames
from faultbond.algebra.solving.polynomial import (
    Ratio,
    divide,
    limited_power,
    limited_product,
    primitive,
    quotient,
    quotient_expression,
    space_of,
    specialise,
)
from faultbond.algebra.solving.problem import Fixed, fixes, prepare
from faultbond.algebra.solving.roots import find_roots
from faultbond.algebra.solving.solution import SolutionKind, conditions_hold, evaluate_root, solve_samples
from faultbond.algebra.solving.solve import SolvingLimits, solve
from faultbond.algebra.solving.tidy import fold
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, build_components
from faultbond.equations.constraint_network import build_network
from faultbond.equations.numeric import Real, exact, numeric_value, slopes, solve_linear
from faultbond.errors import CausalityError, StructureError
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model

slow = [HealthCheck.too_slow, HealthCheck.filter_too_much, HealthCheck.data_too_large]
some = settings(max_examples=25, deadline=None, suppress_health_check=slow)
many = settings(max_examples=50, deadline=None)
SPACE = space_of(["x", "y", "z"])


def network_of(plant: Mapping) -> tuple[BondGraph, ComponentNetwork, NumericPlant]:
    """The component network of a random plant and its numbers; plants that have none are passed over.

    Nominal values range over twelve decades in `plants`: here they get one digit and stay near 1, so that no equation
    drowns in another.
    """
    graph = parse_model(as_text(plant))
    try:
        network = build_components(graph, build_network(graph, assign_causality(graph)))
    except (CausalityError, StructureError):
        assume(False)
        raise
    numbers = plant_of(graph, 0.5)
    tame = {name: Fraction(2 + k % 7, 3) for k, name in enumerate(numbers.values)}
    ranges = {name: (Fraction(1), Fraction(10)) for name in numbers.inputs}
    return graph, network, replace(numbers, values=tame, inputs=ranges)


def question_route(network: ComponentNetwork, target: str) -> Route:
    """The route to a parameter; networks in which there is none are passed over."""
    try:
        return find_route(network, Question(targets=(target,), observed=network.observed, unknown=(target,), frames=4))
    except StructureError:
        assume(False)
        raise


@given(plants(), st.data())
@some
def test_solved_route_computes_the_true_value(plant: Mapping, data: st.DataObject) -> None:
    """On backward-Euler data of a changed plant one closed form, or one numeric root, is the changed value.

    Data that cross a kink within the samples of the route lie where no closed form is said to hold.
    """
    _, network, numbers = network_of(plant)
    target = data.draw(st.sampled_from(network.parameters))
    route = question_route(network, target)
    assume(len(route.steps) <= 40)
    solution = solve(network, route, numbers, SolvingLimits(seconds=2.0, terms=2000))
    assume(solution.kind is not SolutionKind.UNDETERMINED)
    problem = prepare(network, route, numbers)
    values = dict(numbers.values) | {target: numbers.values[target] * Fraction(9, 8)}
    n = problem.frames + 5
    start = {state.signal: Fraction(5 + k, 2) for k, state in enumerate(network.states)}
    try:
        record = simulate_frames(network, values, random_inputs(numbers, n, seed=17), Fraction(1, 2), start, n)
    except StructureError:
        assume(False)
    true: dict[str, Real] = {name: record[signal][n - 1 - k] for name, (signal, k) in problem.signals.items()}
    true |= {**values, "dt": Fraction(1, 2)}
    assume(fixes(problem.residuals, problem.unknown, true) is Fixed.WELL)  # these samples excite
    known = {name: value for name, value in true.items() if name not in problem.unknown}
    sides = [conditions_hold(root, {**evaluate_root(root, known), **true}) for root in solution.roots]
    assume(any(sides) or not solution.roots)
    found = [root[target] for root in solve_samples(solution, known)]
    if not solution.roots:
        found = [root[target] for root in find_roots(problem, known, true).roots]
    assert any(abs(float(value / values[target]) - 1.0) < 1e-5 for value in found)


@given(plants())
@some
def test_record_satisfies_every_equation(plant: Mapping) -> None:
    """What backward Euler gives for a random plant satisfies the equations of the network."""
    _, network, numbers = network_of(plant)
    try:
        record = simulate_frames(network, numbers.values, random_inputs(numbers, 3, seed=5), Fraction(1, 2), n=3)
    except StructureError:
        assume(False)
    values: dict[str, Real] = {**numbers.values, "dt": Fraction(1, 2)}
    values |= {signal: record[signal][2] for signal in network.signals}
    values |= {f"{signal}@1": record[signal][1] for signal in network.signals}
    assert misfit([item.residual for item in network.equations], values) < 1e-8


coefficients = st.integers(-6, 6)
monomials = st.tuples(*[st.integers(0, 3)] * 3)
polynomials = st.dictionaries(monomials, coefficients.filter(bool), max_size=6).map(SPACE.ring.from_dict)
points = st.fixed_dictionaries({name: st.fractions(-3, 3, max_denominator=5) for name in SPACE.place})


def at(polynomial: PolyElement, values: dict[str, Fraction]) -> Fraction:
    """The value of a polynomial."""
    total = Fraction(0)
    for monomial, coefficient in polynomial.items():
        term = Fraction(coefficient)
        for name, exponent in zip(SPACE.place, monomial, strict=True):
            term *= values[name] ** exponent
        total += term
    return total


@given(polynomials, polynomials, points)
@many
def test_polynomial_arithmetic(one: PolyElement, two: PolyElement, values: dict[str, Fraction]) -> None:
    """Sums, products and powers have the values of sums, products and powers."""
    assert at(one - 2 * two, values) == at(one, values) - 2 * at(two, values)
    assert at(limited_product(one, two, SPACE), values) == at(one, values) * at(two, values)
    assert at(limited_power(one, 3, SPACE), values) == at(one, values) ** 3


@given(polynomials, polynomials.filter(bool), coefficients)
@many
def test_division_undoes_a_product(one: PolyElement, two: PolyElement, rest: int) -> None:
    """A product divided by a factor is the other; one that leaves something over is not divided."""
    product = one * two
    assert divide(product, two, SPACE) == one
    found = divide(product + rest, two, SPACE)
    assert found is None or found * two == product + rest


@given(polynomials.filter(bool), points)
@many
def test_primitive_part(polynomial: PolyElement, values: dict[str, Fraction]) -> None:
    """The primitive part is the polynomial without a number and a monomial."""
    assume(all(values.values()) and at(polynomial, values) != 0)
    found = primitive(polynomial, SPACE, SPACE.place)
    ratio = divide(polynomial, found, SPACE)
    assert ratio is not None
    assert len(ratio) == 1


@given(polynomials, points, st.sampled_from([(), ("x",), ("x", "y")]))
@many
def test_polynomials_as_expressions(
    polynomial: PolyElement, values: dict[str, Fraction], outer: tuple[str, ...]
) -> None:
    """A polynomial written as an expression, grouped or not, has its value, and reads back as itself."""
    written = quotient_expression(Ratio(numerator=polynomial, denominator=SPACE.ring.one, space=SPACE), outer)
    assert numeric_value(written, values) == at(polynomial, values)
    assert quotient(written, SPACE) == (polynomial, 1)


@given(polynomials, polynomials.filter(bool), points)
@many
def test_quotients_as_expressions(one: PolyElement, two: PolyElement, values: dict[str, Fraction]) -> None:
    """A quotient written as an expression has its value."""
    assume(at(two, values) != 0)
    written = quotient_expression(Ratio(numerator=one, denominator=two, space=SPACE), ("x",))
    assert numeric_value(written, values) == at(one, values) / at(two, values)


@given(polynomials, points)
@many
def test_specialised_polynomials(polynomial: PolyElement, values: dict[str, Fraction]) -> None:
    """Numbers for some names give a polynomial in the others that is the same up to a factor."""
    into = space_of(["x"])
    found = specialise(polynomial, SPACE, {name: values[name] for name in "yz"}, into)
    other = values | {"x": values["x"] + 1}
    here, there = (sum(c * v["x"] ** m for (m,), c in found.items()) for v in (values, other))
    assert here * at(polynomial, other) == there * at(polynomial, values)


def trees() -> st.SearchStrategy[Expression]:
    """Expressions with values at positive points."""
    leaves = st.sampled_from("xyz").map(Name) | st.sampled_from([0.0, 1.0, 2.0, 0.5]).map(Number)
    return st.recursive(leaves, _larger, max_leaves=12)


def _larger(inner: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    pairs = st.tuples(st.sampled_from("+-*/"), inner, inner).map(lambda item: Binary(*item))
    calls = st.tuples(st.sampled_from(["abs", "sqrt", "exp", "tanh"]), inner).map(
        lambda item: Call(item[0], (item[1],))
    )
    squares = inner.map(lambda item: Binary("**", item, Number(2.0)))
    return pairs | calls | squares | inner.map(Negative)


positive = st.fixed_dictionaries({name: st.floats(0.5, 2.0) for name in SPACE.place})


@given(trees(), positive)
@many
def test_folding_keeps_the_value(tree: Expression, values: dict[str, float]) -> None:
    """An expression without needless parts has the value of the whole."""
    known: dict[str, Real] = {**values}
    before = float(numeric_value(tree, known))
    assume(np.isfinite(before) and abs(before) < 1e9)
    after = float(numeric_value(fold(tree), known))
    assert np.isclose(after, before, rtol=1e-6, atol=1e-6)


@given(trees(), positive)
@many
def test_slopes_are_derivatives(tree: Expression, values: dict[str, float]) -> None:
    """Slopes agree with differences."""
    known: dict[str, Real] = {**values}
    value, by = slopes(tree, known, SPACE.place)
    assume(np.isfinite(float(value)) and abs(float(value)) < 1e3)
    for name in SPACE.place:
        step = 1e-6
        above, below = (float(numeric_value(tree, known | {name: values[name] + sign * step})) for sign in (1, -1))
        far = [float(numeric_value(tree, known | {name: values[name] + sign * 2 * step})) for sign in (1, -1)]
        rough = (far[0] - far[1]) / (4 * step)
        difference = (above - below) / (2 * step)
        assume(np.isfinite(difference) and np.isclose(rough, difference, rtol=1e-5, atol=1e-5))  # no kink nearby
        assert np.isclose(float(by.get(name, 0)), difference, rtol=1e-3, atol=1e-3)


@given(st.integers(1, 5), st.data())
@many
def test_linear_systems(size: int, data: st.DataObject) -> None:
    """Fractions solve a system exactly, or find that it is singular as the determinant does."""
    entries = st.lists(st.fractions(-3, 3, max_denominator=4), min_size=size, max_size=size)
    rows = [data.draw(entries) for _ in range(size)]
    right: list[Real] = [*data.draw(entries)]
    sparse: list[dict[int, Real]] = [{k: value for k, value in enumerate(row) if value} for row in rows]
    found = solve_linear(sparse, right)
    determinant = np.linalg.det(np.array(rows, dtype=float))
    if found is None:
        assert abs(determinant) < 1e-9
    else:
        assert [sum(a * x for a, x in zip(row, found, strict=True)) for row in rows] == right


@given(st.floats(-1e12, 1e12, allow_nan=False))
@many
def test_exact_is_the_shortest_decimal(value: float) -> None:
    """The fraction of a number is that of its decimal, and rounds back to it."""
    assert float(exact(value)) == value
    assert exact(value) == Fraction(repr(value))
