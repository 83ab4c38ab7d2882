"""Closed forms of the thesis' motor: appendix A to the last term, section 4.3, and how many roots each hypothesis has.

Data are backward Euler with index 0 for the newest sample, in fractions where the golden values are exact.
"""

from collections.abc import Mapping
from fractions import Fraction
from itertools import combinations
from pathlib import Path

import pytest
import sympy

from faultbond.algebra.route import Question, Route
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.solving.backward_euler import FrameRecord, NumericPlant, plant_of, simulate_frames
from faultbond.algebra.solving.problem import prepare
from faultbond.algebra.solving.roots import find_roots
from faultbond.algebra.solving.solution import Solution, SolutionKind, closed_form, evaluate_root, solve_samples
from faultbond.algebra.solving.solve import solve
from faultbond.algebra.solving.symbols import to_sympy
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, build_components, frame_name
from faultbond.equations.constraint_network import build_network
from faultbond.equations.numeric import Real
from faultbond.model.text import load_model

MODEL = Path(__file__).parents[2] / "examples" / "dc_motor" / "model.yaml"
GRAPH = load_model(MODEL)
MOTOR: ComponentNetwork = build_components(GRAPH, build_network(GRAPH, assign_causality(GRAPH)))
PLANT: NumericPlant = plant_of(GRAPH)
NOMINAL = {"R": Fraction(3), "L": Fraction(5, 2), "J": Fraction(3, 2), "C": Fraction(2, 5), "K": Fraction(2)}
HALF = Fraction(1, 2)
VOLTS = (10, 4, 6, -2, 8)  # G1, oldest first
SPEEDS = (  # G1: omega for these volts
    Fraction(25, 39),
    Fraction(6685, 6084),
    Fraction(1442965, 949104),
    Fraction(198611245, 148060224),
    Fraction(35677432645, 23097394944),
)
G2 = {  # four speeds and two voltages at 50 Hz
    "omega_0": 0.030046148420994907,
    "omega_1": 0.020300310799873225,
    "omega_2": 0.01259859634487446,
    "omega_3": 0.0061530383601387335,
    "V_0": 11.0,
    "V_1": 7.0,
}
OTHER_ROOTS = {  # G18: the root beside the one that the data were made with, where there is one
    "K": (3.0593,),
    "RJ": (-20.127, -4.257),
    "RC": (0.8, 2.16),
    "RK": (-25.747, -1.948),
    "LJ": (13.5, 0.4),
    "LC": (-29.458, -9.161),
    "LK": (0.2659, 0.5466),
    "JK": (0.3349, 0.5125),
    "CK": (-53.28, -11.08),
}
HYPOTHESES = [tuple(chosen) for size in (1, 2) for chosen in combinations("RLJCK", size)]


def route_to(*targets: str) -> Route:
    """The route to parameters from V and omega."""
    return find_route(MOTOR, Question(targets=targets, observed=MOTOR.observed, unknown=targets))


def volts(values: tuple[int, ...]) -> dict[str, tuple[Fraction, ...]]:
    """Inputs, oldest first."""
    return {"V": tuple(map(Fraction, values))}


def samples(record: FrameRecord, back: int = 0, frames: int = 4) -> dict[str, Real]:
    """Measured values by name, some samples before the end."""
    end = len(record["omega"]) - 1 - back
    return {frame_name((name, k)): record[name][end - k] for name in ("V", "omega") for k in range(frames)}


def close(one: Mapping[str, Real], other: Mapping[str, float | Fraction], tolerance: float) -> bool:
    """Whether values agree within a relative tolerance."""
    return all(abs(float(one[name]) - float(value)) <= tolerance * abs(float(value)) for name, value in other.items())


@pytest.fixture(scope="module")
def both() -> Solution:
    """R and L from V and omega."""
    return solve(MOTOR, route_to("R", "L"), PLANT)


def test_backward_euler_speeds() -> None:
    """Backward Euler gives the rational speeds of G1."""
    assert simulate_frames(MOTOR, NOMINAL, volts(VOLTS), HALF)["omega"] == SPEEDS


def test_exact_motor(both: Solution) -> None:
    """G1: R = 3 and L = 5/2 exactly, from four speeds and two voltages."""
    record = simulate_frames(MOTOR, NOMINAL, volts(VOLTS), HALF)
    known = {**NOMINAL, "dt": HALF, **samples(record)}
    assert solve_samples(both, known) == ({"R": Fraction(3), "L": Fraction(5, 2)},)


def test_float_motor(both: Solution) -> None:
    """G2: R = 3 and L = 2.5 within 1e-6 from samples in floating point at 50 Hz; the currents on the way as well."""
    known: dict[str, Real] = {**NOMINAL, "dt": 0.02, **G2}
    found = evaluate_root(both.roots[0], known)
    assert close(found, {"R": 3.0, "L": 2.5}, 1e-6)
    assert close(found, {"armature.f_0": 0.3714781404762622, "armature.f_1": 0.2928743542224284}, 1e-9)


def test_state_from_its_change() -> None:
    """G3, section 4.3: h = (a - l L/dt - K b)/R, the law of L, R and K passed once each; l is the change in a step."""
    question = Question(
        targets=(("armature.f", 0),),
        observed=MOTOR.observed,
        known=frozenset({("L.rate", 0)}),
        suspended=frozenset({"K.2"}),
    )
    solution = solve(MOTOR, find_route(MOTOR, question), PLANT)
    form = closed_form(solution.roots[0], "armature.f_0")
    assert form is not None
    a, b, r, k, inductance, rate = (sympy.Symbol(x, real=True) for x in ("V_0", "omega_0", "R", "K", "L", "L.rate_0"))
    assert sympy.simplify(to_sympy(form) - (a - rate * inductance - k * b) / r) == 0
    change = 0.3714781404762622 - 0.2928743542224284
    known: dict[str, Real] = {**NOMINAL, **G2, "L.rate_0": change / 0.02}
    assert close(evaluate_root(solution.roots[0], known), {"armature.f_0": 0.3714781404762622}, 1e-12)


def printed_forms() -> dict[str, sympy.Expr]:
    """L = A/B and R = C/D as appendix A prints them (D is B)."""
    w0, w1, w2, w3, v0, v1 = (
        sympy.Symbol(name, real=True) for name in ("omega_0", "omega_1", "omega_2", "omega_3", "V_0", "V_1")
    )
    dt, k, c, j = (sympy.Symbol(name, real=True) for name in ("dt", "K", "C", "J"))
    a = dt**2 * k * (
        c * dt * w1 * v0 - c * dt * v1 * w0 + w2 * j * k * w0 - w2 * j * v0 - j * k * w1**2 + j * w1 * v1
        + j * w1 * v0 - j * v1 * w0
    )  # fmt: skip
    b = (
        c**2 * w2 * dt**2 * w0 - c**2 * dt**2 * w1**2 + c * w2 * dt * j * w1 + 2 * c * w2 * dt * j * w0
        - c * w3 * dt * j * w0 - 2 * c * dt * j * w1**2 - w2**2 * j**2 + w2 * j**2 * w1 + w2 * j**2 * w0
        + w3 * j**2 * w1 - w3 * j**2 * w0 - j**2 * w1**2
    )  # fmt: skip
    r = -dt * k * (
        c * w2 * dt * k * w0 - c * w2 * dt * v0 - c * dt * k * w1**2 + c * dt * w1 * v1 + c * dt * w1 * v0
        - c * dt * v1 * w0 + w2 * j * k * w1 + 2 * w2 * j * k * w0 - w2 * j * v1 - 2 * w2 * j * v0 - w3 * j * k * w0
        + w3 * j * v0 - 2 * j * k * w1**2 + 2 * j * w1 * v1 + j * w1 * v0 - j * v1 * w0
    )  # fmt: skip
    return {"L": a / b, "R": r / b}


@pytest.mark.parametrize("target", ["L", "R"])
def test_appendix_a(both: Solution, target: str) -> None:
    """Our closed forms of L and R are those printed in appendix A: their difference simplifies to 0."""
    form = closed_form(both.roots[0], target)
    assert form is not None
    assert sympy.cancel(sympy.together(to_sympy(form) - printed_forms()[target])) == 0


@pytest.mark.parametrize("suspects", HYPOTHESES, ids="".join)
def test_roots_of_the_minimal_window(suspects: tuple[str, ...]) -> None:
    """G18: on the least number of samples nine of fifteen hypotheses have a second root, and it is the known one."""
    faulty = NOMINAL | {name: NOMINAL[name] * Fraction(6, 5) for name in suspects}
    record = simulate_frames(MOTOR, faulty, volts(VOLTS), HALF)
    route = route_to(*suspects)
    solution = solve(MOTOR, route, PLANT)
    known = {**NOMINAL, "dt": HALF, **samples(record)}
    found = solve_samples(solution, known)
    true = {name: faulty[name] for name in suspects}
    other = OTHER_ROOTS.get("".join(suspects)) or OTHER_ROOTS.get("".join(reversed(suspects)))
    expected: list[Mapping[str, float | Fraction]] = (
        [true] if other is None else [true, dict(zip(_as_printed(suspects), other, strict=True))]
    )
    assert solution.kind is (SolutionKind.LINEAR if other is None else SolutionKind.QUADRATIC)
    assert solution.degree == len(found) == len(expected)
    assert all(any(close(root, wanted, 1e-3) for root in found) for wanted in expected)
    assert any(root == true for root in found)  # exactly
    numbers = find_roots(prepare(MOTOR, route, PLANT), {**known}, {}).roots
    assert len(numbers) == len(expected)
    assert all(any(close(root, wanted, 1e-3) for root in numbers) for wanted in expected)


def _as_printed(suspects: tuple[str, ...]) -> tuple[str, ...]:
    """The order of names in which the golden value of a pair is written."""
    return suspects if "".join(suspects) in OTHER_ROOTS else suspects[::-1]


def test_second_root_fits_its_own_samples_only() -> None:
    """E9: the second root of {J, K} explains the four samples it was found from, and not a single further one."""
    faulty = NOMINAL | {"J": Fraction(9, 5), "K": Fraction(12, 5)}
    given = volts((*VOLTS, 3, -4, 7))
    record = simulate_frames(MOTOR, faulty, given, HALF)
    solution = solve(MOTOR, route_to("J", "K"), PLANT)
    found = [solve_samples(solution, {**NOMINAL, "dt": HALF, **samples(record, back)}) for back in range(4)]
    true = {"J": Fraction(9, 5), "K": Fraction(12, 5)}
    assert all(true in roots for roots in found)
    others = [root for roots in found for root in roots if root != true]
    assert len(others) == 4
    assert not any(close(one, other, 1e-3) for one, other in combinations(others, 2))


def test_output_from_input_and_states() -> None:
    """E4: with dt/J in place of the printed dt/j, the ten equations of table 4.1 give the next speed."""
    question = Question(
        targets=(("omega", 0),),
        observed=frozenset({"V"}),
        known=frozenset({("omega", 1), ("armature.f", 1)}),
    )
    route = find_route(MOTOR, question)
    assert len(route.steps) == 10
    solution = solve(MOTOR, route, PLANT)
    record = simulate_frames(MOTOR, NOMINAL, volts(VOLTS), HALF)
    known = {**NOMINAL, "dt": HALF, "V_0": Fraction(8), "omega_1": SPEEDS[3], "armature.f_1": record["armature.f"][3]}
    assert solve_samples(solution, known) == ({"omega_0": SPEEDS[4]},)
