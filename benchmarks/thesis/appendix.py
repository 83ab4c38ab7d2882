"""Appendix A of the thesis: the search for R and L step by step, table A.1, and the closed form it ends with."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache

import sympy as sp

from benchmarks.thesis.motor import HALF, NOMINAL, in_figure_a_2, record_of, samples, short, system
from benchmarks.thesis.page import Line, Parts, equal, number, numbers, table, words
from benchmarks.thesis.routes import at_50_hz, formulas
from faultbond.algebra.route import Question, Target
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.routes.questions import parameters
from faultbond.algebra.routes.unroll import contained
from faultbond.algebra.solving.solution import closed_form, solve_samples
from faultbond.algebra.solving.symbols import to_sympy
from faultbond.equations.component_network import ComponentNetwork, frame_name
from faultbond.equations.numeric import Real
from faultbond.errors import StructureError
from faultbond.model.parser import parse_expression
from faultbond.thesis.search import Passage, RouteSearch, search_route

STEPS = (  # A.3: numbers of the steps, the component, and U when what is known has been removed and U is sorted
    ("1", "R0", "c0 h0 L"),
    ("2", "Ab0", "b0 d0 h0 L"),
    ("3 to 5", "Kb0", "d0 h0 L"),
    ("6, 7", "L0", "e0 h0 L"),
    ("8 to 10", "Sb0", "h0 h1 L"),
    ("11, 12", "Ka0", "i0 h1 L"),
    ("13", "Aa0", "k0 j0 h1 L"),
    ("14, 15", "J0", "l0 j0 h1 L"),
    ("16, 17", "Sa0", "j0 h1 L"),
    ("18 to 20", "C0", "h1 L"),
    ("21a", "Ka1", "i1 L"),
    ("22", "Aa1", "k1 j1 L"),
    ("", "", ""),
    ("23", "Sa1", "j1 L"),
    ("24, 25", "C1", "L"),
    ("26", "L1", "d1 e1"),
)
CHOICE = "Ka1 R1 Sb1"  # step 21
KNOWN = "erratum: l1 and i1 belong there, and j1 once"
LEFT = "erratum: J1 is no longer there"
MISSING = "erratum: the step is missing; k1 is found through J1"

TABLE_A_1 = {  # unknown: component, known values
    "R": ("R0", "c0 h0"),
    "c0": ("Ab0", "V0 b0 d0"),
    "b0": ("Kb0", "Kb omega0"),
    "d0": ("L0", "L e0"),
    "l2": ("Sa2", "omega2 omega3"),
    "j2": ("C2", "omega2 C"),
}

NUMERATOR_L = """dt**2*K*(C*dt*omega_1*V_0 - C*dt*V_1*omega_0 + omega_2*J*K*omega_0 - omega_2*J*V_0 - J*K*omega_1**2
    + J*omega_1*V_1 + J*omega_1*V_0 - J*V_1*omega_0)"""
NUMERATOR_R = """-dt*K*(C*omega_2*dt*K*omega_0 - C*omega_2*dt*V_0 - C*dt*K*omega_1**2 + C*dt*omega_1*V_1
    + C*dt*omega_1*V_0 - C*dt*V_1*omega_0 + omega_2*J*K*omega_1 + 2*omega_2*J*K*omega_0 - omega_2*J*V_1
    - 2*omega_2*J*V_0 - omega_3*J*K*omega_0 + omega_3*J*V_0 - 2*J*K*omega_1**2 + 2*J*omega_1*V_1 + J*omega_1*V_0
    - J*V_1*omega_0)"""
DENOMINATOR = """C**2*omega_2*dt**2*omega_0 - C**2*dt**2*omega_1**2 + C*omega_2*dt*J*omega_1
    + 2*C*omega_2*dt*J*omega_0 - C*omega_3*dt*J*omega_0 - 2*C*dt*J*omega_1**2 - omega_2**2*J**2
    + omega_2*J**2*omega_1 + omega_2*J**2*omega_0 + omega_3*J**2*omega_1 - omega_3*J**2*omega_0 - J**2*omega_1**2"""


@cache
def search() -> RouteSearch:
    """Give the thesis' search for R and L, in its letters."""
    network = in_figure_a_2()
    return search_route(network, parameters(network, ("R", "L")))


@table("A.3, figure A.2, pages 208 to 216")
def section_a_3() -> Parts:
    """Section A.3: the search step by step."""
    found = search()
    passages = found.passages
    lines = [_line(step, passages[k]) for k, step in enumerate(STEPS)]
    lines += [
        words(f"through {_place(item)}", "", _targets(item.unknown) or "empty", "" if k else "from here on not printed")
        for k, item in enumerate(passages[len(STEPS) :])
    ]
    yield (
        "`faultbond analyse examples/thesis/motor.yaml --trace R,L` prints all three lists; here they are in the "
        "letters of figure A.2. Compared is U after each component, as a set, when what is known has been removed."
    )
    yield from lines
    yield from _lists(found)


def _lists(found: RouteSearch) -> tuple[Line, ...]:
    """Compare what A.3 says of choices, of K and C, and of the end."""
    passages, route = found.passages, found.route
    if route is None:
        raise LookupError(found.message)
    names = [_place(item) for item in passages]
    choices = short(frame_name(place) for place in passages[names.index("Ka1")].choices)
    known = [_targets([item.finds]) for item in passages[: names.index("C1") + 1] if item.place[1] == 1]
    left = _left(found, names.index("L1") + 1)
    end = f"erratum: U must be empty, as A.2.1 says; C still holds {_left(found, len(names))}"
    return (
        equal("components for h1, step 21", CHOICE, choices, same={*choices.split()} == {*CHOICE.split()}),
        equal("K after step 25, of period 1", "j1 k1 j1 h1", " ".join(reversed(known)), KNOWN),
        equal("C after step 26", "R1 Kb1 J1 Ab1 Sb1", left, LEFT),
        equal("it ends when this is empty", "C", "U" if not passages[-1].unknown else "C", end),
        equal("samples used", "omega0 omega1 omega2 omega3 V0 V1", _samples(route.samples)),
        number("consecutive periods", "3", route.frames, f"{route.observations} observations"),
        words("equations", "", str(len(names))),
    )


def _line(step: tuple[str, str, str], passage: Passage) -> Line:
    numbers_, component, unknown = step
    ours = f"{_place(passage)}: {_targets(passage.unknown)}"
    if not component:
        return Line(what="between 22 and 23", printed="", ours=ours, same=None, remark=MISSING)
    same = component == _place(passage) and set(unknown.split()) == set(_targets(passage.unknown).split())
    return Line(what=f"step {numbers_}", printed=f"{component}: {unknown}", ours=ours, same=same)


def _place(passage: Passage) -> str:
    return short([frame_name(passage.place)])


def _targets(targets: Sequence[Target]) -> str:
    return short(item if isinstance(item, str) else frame_name(item) for item in targets)


def _samples(given: Sequence[tuple[str, int]]) -> str:
    return short(frame_name(item) for item in sorted(given, key=lambda item: (item[0] == "V", item[1])))


def _left(found: RouteSearch, count: int) -> str:
    """Give the components of open frames that the first passages have left."""
    passed = found.passages[:count]
    frames = range(passed[-1].frames)
    used = {item.place for item in passed}
    every = [(item.name, frame) for frame in frames for item in found.network.equations]
    return short(frame_name(place) for place in every if place not in used)


@table("A.3, page 216")
def table_a_1() -> Parts:
    """Table A.1: all of the components needed to solve in order of propagation."""
    lines = []
    for passage in search().passages:
        unknown = _targets([passage.finds])
        name, frame = passage.place
        ours = [item for item in contained(search().network.equation(name), frame) if item != passage.finds]
        text = f"{_place(passage)}; {_targets(ours)}"
        printed = TABLE_A_1.get(unknown)
        if printed is None:
            lines.append(words(unknown, "", text))
            continue
        same = printed[0] == _place(passage) and set(printed[1].split()) == set(_targets(ours).split())
        lines.append(equal(unknown, "; ".join(printed), text, same=same))
    yield "Unknown: the component that it is found by, and from which values. The thesis prints six of the lines."
    yield from lines


def printed_forms() -> Mapping[str, sp.Expr]:
    """Give L = A/B and R = C/D as the thesis prints them; D is B."""
    above, other, below = (
        to_sympy(parse_expression(" ".join(text.split()))) for text in (NUMERATOR_L, NUMERATOR_R, DENOMINATOR)
    )
    return {"L": above / below, "R": other / below}


@table("A.3, pages 216 and 217")
def closed_forms() -> Parts:
    """Appendix A: the closed form of L and R."""
    _, solution = system("motor").parameters(("R", "L"))
    lines = []
    for name, printed in printed_forms().items():
        form = closed_form(solution.roots[0], name)
        gap = sp.nan if form is None else sp.cancel(sp.together(to_sympy(form) - printed))
        text = {"L": "A/B", "R": "C/D"}[name]
        lines.append(equal(f"{name}: the printed formula less ours", "0", str(gap), f"{text}, to the last term"))
    exact: dict[str, Real] = {**NOMINAL, "dt": HALF, **samples(record_of(NOMINAL))}
    (found,) = solve_samples(solution, exact)
    record = at_50_hz((10.0, 10.0, 12.0, 7.0, 11.0))
    fifty: dict[str, Real] = {**NOMINAL, "dt": 0.02, **{name: float(x) for name, x in samples(record).items()}}
    (floating,) = solve_samples(solution, fifty)
    for name in ("L", "R"):
        values = [_value(printed_forms()[name], exact), Fraction(found[name])]
        lines.append(numbers(f"{name}, printed formula and ours, from the exact record", [], values))
    lines += [
        words(f"{name} from samples in floating point at 50 Hz", "", f"{floating[name]:.7g}") for name in ("L", "R")
    ]
    yield (
        "`faultbond analyse examples/thesis/motor.yaml --closed 2`. The records are backward Euler, for "
        "which the formula is exact: R = 3, L = 5/2, J = 3/2, C = 2/5, K = 2, dt = 1/2, V = 10, 4, 6, -2, 8 from rest; "
        "at 50 Hz V = 10, 10, 12, 7, 11."
    )
    yield from lines
    yield "Ours, computed in this order:\n\n" + formulas(solution)


def _value(form: sp.Expr, known: Mapping[str, Real]) -> sp.Expr:
    """Evaluate a formula in fractions."""
    return form.subs({symbol: sp.Rational(Fraction(known[str(symbol)])) for symbol in form.free_symbols})


@table("A.2.1, page 207")
def voltage_alone() -> Parts:
    """Section A.2.1: R from the voltage alone."""
    network: ComponentNetwork = replace(in_figure_a_2(), outputs=())
    question = Question(targets=("R",), unknown=("R",), observed=network.observed)
    found = search_route(network, question)
    try:
        find_route(network, question)
        refusal = "a route"
    except StructureError as error:
        refusal = f"no route: {str(error).partition(': ')[2]}"  # without the path of the file
    yield "The motor without its sensor."
    yield equal("R from V", "no route", "a route" if found.route else "no route", f"after {found.expanded} states")
    yield words("the same by matching", "", refusal)
