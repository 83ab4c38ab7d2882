"""Chapter 4 of the thesis, and the stores of chapter 3: routes through time and what is computed along them."""

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import combinations

import numpy as np
import sympy as sp

from benchmarks.thesis.chart import Curve, panel
from benchmarks.thesis.motor import FIGURE_4_4, HYPOTHESES, THESIS, in_figure_4_4, signals_of, system
from benchmarks.thesis.page import Line, Parts, equal, figure, number, row, table, words
from faultbond.algebra.route import Question, Route
from faultbond.algebra.routes import questions
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.solving.backward_euler import FrameRecord, simulate_frames
from faultbond.algebra.solving.formula import to_lines
from faultbond.algebra.solving.solution import Solution, closed_form, evaluate_root
from faultbond.algebra.solving.symbols import to_sympy
from faultbond.equations.component_network import ComponentNetwork, in_frame
from faultbond.equations.inversion import linear_solution
from faultbond.equations.numeric import Real
from faultbond.errors import StructureError
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.expression import Expression
from faultbond.model.parser import parse_expression, to_text
from faultbond.model.text import load_model

STORE_RATE = 10.0  # samples a second
SIZES = ("one parameter", "two parameters", "three parameters", "four parameters", "all five parameters")


def code(lines: Iterable[str]) -> str:
    """Give lines as a block of code."""
    return "\n".join(("```text", *lines, "```"))


def formulas(*solutions: Solution) -> str:
    """Give the first closed form of each of some solutions as a block of code."""
    return code(line for item in solutions for line in to_lines(item.roots[0], item.targets))


@table("3.1, figures 3.1 and 3.2, page 19")
def table_3_1() -> Parts:
    """Table 3.1: structure and function of the R-C circuit."""
    network = system("rc").network
    laws = {item.name: to_text(in_frame(item, 0)) + " = 0" for item in network.equations}
    printed = ("I_R = I_C = I_source", "V + V_R + V_C = 0", "V_R = I_R R", "V_C = 1/C integral of I_C dt")
    ours = ("one signal: loop.f", laws["loop"], laws["R"], f"{laws['C']}, {laws['C.sum']}")
    remark = "each voltage is counted round the loop; with the half arrows of figure 3.2 two signs turn"
    yield (
        "`examples/thesis/rc.yaml`. `_0` is the newest sample, `_1` the one before; backward Euler. "
        "R.e is V_R, loop.f the current."
    )
    yield from (
        equal(f"equation {k}", *texts, remark, same=True) if k == 2 else words(f"equation {k}", *texts)
        for k, texts in enumerate(zip(printed, ours, strict=True), start=1)
    )


def through_a_store() -> tuple[Solution, Solution, tuple[np.ndarray, ...]]:
    """Give both ways through the store of figure 3.18, and x, y, y from x, x from y as figure 3.19 has them."""
    store = system("fig_3_18")
    (output,) = questions.outputs(store.network)
    _, forward = store.ask(output)
    _, backward = store.ask(Question(targets=(("x", 0),), observed=frozenset({"y"})))
    x, y = _recorded("fig_3_18")
    ahead = [_follow(forward, "y_0", x_0=x[k], y_1=y[k - 1]) for k in range(1, len(x))]
    back = [_follow(backward, "x_0", y_0=y[k], y_1=y[k - 1]) for k in range(1, len(x))]
    return forward, backward, (x, y, np.array(ahead), np.array(back))


@table("3.9, pages 48 and 49")
def figures_3_18_and_3_19() -> Parts:
    """Figures 3.18 and 3.19: noise through a store."""
    forward, backward, (_, y, ahead, back) = through_a_store()
    off = np.std(ahead - y[1:])
    yield (
        "`examples/thesis/fig_3_18.yaml` and `.csv`: y sums x/P, P = 4, x = 1 with 1 % noise, ten samples a "
        "second. The noise of y is not told; ours is 0.01."
    )
    yield words("y from x and the last y, figure (C)", "very close to the measured y", f"{off:.3f} off (rms)")
    yield words("x from y and the last y, figure (D): mean", "about 1", f"{np.mean(back):.3f}")
    yield words("the same: standard deviation", "very bad, very noisy", f"{np.std(back):.2f}, that of x is 0.01")
    yield formulas(forward, backward)


@figure("3.9")
def figure_3_19() -> Parts:
    """Propagating noise through dynamic components."""
    _, _, (x, y, ahead, back) = through_a_store()
    time = np.arange(x.size) / STORE_RATE
    off, ratio = float(np.std(ahead - y[1:])), float(np.std(back) / np.std(x))
    yield "The numbers are in the table of figures 3.18 and 3.19 above."
    yield panel("A: measured input", Curve("value", time, x))
    yield panel("B: measured output", Curve("value", time, y))
    yield panel("C: output from the input and the last output", Curve("value", time[1:], ahead))
    yield panel("D: input from the output and the last output", Curve("value", time[1:], back))
    yield row("(C) against (B), rms | very close", f"{off:.3f}", same=off < 0.05, otherwise="more noise")
    yield row("noise of (D) over that of (A) | very bad", f"{ratio:.0f}", same=ratio > 5.0, otherwise="less noise")


def _recorded(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Give the input and the output of a recording."""
    rows = list(read_rows(THESIS / f"{name}.csv", columns_of(load_model(THESIS / f"{name}.yaml"))))
    return np.array([row.u[0] for row in rows]), np.array([row.y[0] for row in rows])


def _follow(solution: Solution, target: str, **values: float) -> float:
    plant = system("fig_3_18").plant
    known: dict[str, Real] = {**plant.values, "dt": plant.sample_time, **values}
    return float(evaluate_root(solution.roots[0], known)[target])


@table("4.1, figure 4.2, pages 58 to 60")
def section_4_1() -> Parts:
    """Section 4.1: what one observation tells."""
    both = system("motor_current").network
    wanted = [name for name in both.signals if name not in both.observed]
    found = [name for name in wanted if _is_found(both, name)]
    all_of = "all" if found == wanted else f"{len(found)} of {len(wanted)}"
    current = "found" if _is_found(system("motor").network, "armature.f") else "not found"
    route = find_route(both, questions.parameters(both, ("R",)))
    yield "`examples/thesis/motor.yaml` and `motor_current.yaml`."
    yield equal("current h from V and omega of one observation", "not found", current)
    yield equal("signals found from V, omega and the current of one observation", "all", all_of)
    yield equal(
        "the same with one component suspended, such as R",
        "more than one observation",
        "more than one observation" if route.observations > 1 else "one observation",
        f"{route.observations} observations",
    )


def _is_found(network: ComponentNetwork, signal: str) -> bool:
    """Whether a signal follows from the newest observation alone."""
    older = frozenset((name, 1) for name in network.observed)
    try:
        find_route(network, Question(targets=((signal, 0),), observed=network.observed, hidden=older, frames=1))
    except StructureError:
        return False
    return True


@table("4.2.1, figures 4.4 and 4.6, pages 64 and 65")
def section_4_2_1() -> Parts:
    """Section 4.2.1: the states."""
    motor = system("motor")
    now, start, rates = (
        next(motor.ask(item) for item in ask(motor.network) if item.targets[0][0] == "armature.f")
        for ask in (questions.states, questions.states_at_start, questions.states_from_rates)
    )
    yield (
        "`examples/thesis/motor.yaml`. The thesis' letters for the signals are those of figure 4.4: a is the "
        "voltage and b the speed now, d the speed and m the current one sample before. The other state, the speed, is "
        "measured."
    )
    yield equal("h, the current: signals on the route", "b, c, d, e, f, g, h", signals_of(now[0]))
    yield equal("h from the changes l and e: signals on the route", "a, b, h, i, j, k, l", signals_of(rates[0]))
    yield equal("m, the current at the start: measured values used", "V1, omega1, omega2", _measured(start[0]))
    yield number("the same: observations", "2", start[0].observations)
    yield (
        "In the order of these lines; the newest sample has index 0, and `L.rate` is l/dt:\n\n"
        + formulas(now[1], rates[1], start[1])
    )


def _measured(route: Route) -> str:
    """Give the samples that a route uses, numbered as in chapter 4."""
    return ", ".join(f"{name}{frame + 1}" for name, frame in sorted(route.samples))


@table("4.2.2, figure 4.7, pages 66 and 67")
def section_4_2_2() -> Parts:
    """Section 4.2.2: parameters."""
    one, both, friction = (find_route(system("motor").network, _of(names)) for names in ("R", "RL", "C"))
    lines = [
        number("R: observations", "3", one.observations),
        number("L and R: observations", "4", both.observations),
        equal("R: how it is solved", "one after the other", _how(one)),
        equal("C: how it is solved", "simultaneously", _how(friction), f"{friction.largest_block} equations at once"),
        words("R: periods of time in the model", "3", str(one.frames), "of the oldest observation only omega is used"),
        words("L and R: periods of time in the model", "4", str(both.frames), "likewise; 3 in appendix A"),
    ]
    for name, seen in (("motor", "V, omega"), ("motor_current", "V, omega, current")):
        lines += [
            words(f"{SIZES[size - 1]} from {seen}", "", "; ".join(_sizes(system(name).network, size)))
            for size in range(1, 6)
        ]
    blocks = [
        f"{''.join(names)} {find_route(system('motor').network, _of(names)).largest_block}" for names in HYPOTHESES
    ]
    lines.append(words("most equations solved together, from V, omega", "", ", ".join(blocks)))
    yield (
        "`examples/thesis/motor.yaml` and `motor_current.yaml`. Every set of one to five parameters, with the "
        "number of equations that have to be solved; those of four and five from V and omega have enough equations, "
        "yet no solution, see section 6.5."
    )
    yield from lines


def _of(names: Sequence[str]) -> Question:
    return questions.parameters(system("motor").network, tuple(names))


def _how(route: Route) -> str:
    return "one after the other" if route.largest_block == 1 else "simultaneously"


def _sizes(network: ComponentNetwork, size: int) -> list[str]:
    """Give what sets of a size take; sets that take the same in one text."""
    groups: dict[str, list[str]] = {}
    for names in combinations(network.suspects, size):
        route = find_route(network, questions.parameters(network, names))
        periods = "1 period" if route.frames == 1 else f"{route.frames} periods"
        text = f"{route.observations} observations, {len(route.steps)} equations of {periods}"
        groups.setdefault(text, []).append("".join(names))
    largest = max(groups, key=lambda text: len(groups[text]))
    return [text if text == largest else f"{', '.join(groups[text])}: {text}" for text in (largest, *groups)][
        : len(groups)
    ]


@table("4.2.3, page 68")
def section_4_2_3() -> Parts:
    """Section 4.2.3: rates of change of the states."""
    motor = system("motor").network
    now, before = next(pair for pair in questions.rates(motor) if pair[0].targets[0][0] == "armature.f")
    yield "The change l of the current is h - m, each by the route to a state."
    yield equal("h: measured values used", "omega1, omega2", _measured(find_route(motor, now)))
    yield equal("m: measured values used", "omega2, omega3", _measured(find_route(motor, before)))


TABLE_4_1 = (  # our equation, the signal that the thesis finds by it, and how
    ("armature", "k", "a - j - i"),
    ("L", "l", "k*dt/L"),
    ("L.sum", "h", "l + m"),
    ("R", "i", "h*R"),
    ("K.2", "g", "h*K"),
    ("shaft", "f", "g - c"),
    ("J", "e", "f*dt/j"),
    ("J.sum", "b", "e + d"),
    ("C", "c", "b*C"),
    ("K.1", "j", "b*K"),
)
TABLE_4_2 = (("K.1", "j", "b*K"), ("L", "k", "L/dt*l"), ("armature", "i", "a - k - j"), ("R", "h", "1/R*i"))
SECTION_4_3 = "(a - l*L/dt - K*b)/R"


@table("4.2 and 4.2.4, figure 4.5, page 63")
def table_4_1() -> Parts:
    """Table 4.1: the constraints of the system."""
    motor = system("motor")
    (question,) = questions.outputs(motor.network)
    route, solution = motor.ask(question)
    remark = "erratum: dt/J is meant; j is another signal"
    known = sorted(FIGURE_4_4[signal] for signal in (*route.samples, *route.known))
    yield "What the speed b takes along causality from a, m and d, in the letters of figure 4.4."
    yield from _constraints(TABLE_4_1, route, {"e": remark})
    yield number("number of equations", "10", len(route.steps))
    yield equal("signals known", "a, d, m", ", ".join(known))
    yield equal("how they are solved", "simultaneously", _how(route))
    yield "Solved for the speed:\n\n" + formulas(solution)


def _constraints(
    printed: Sequence[tuple[str, str, str]], route: Route, remarks: Mapping[str, str] | None = None
) -> list[Line]:
    """Compare printed equations with those of a route, each solved for the signal that the thesis finds by it."""
    network = system("motor").network
    places = {step.equation: step.frame for step in route.steps}
    lines = []
    for k, (name, letter, text) in enumerate(printed, start=1):
        if name not in places:
            raise LookupError(f"the route does not pass {name}")
        law = in_figure_4_4(in_frame(network.equation(name), places[name]))
        ours = _solved(law, letter)
        same = sp.cancel(ours - to_sympy(parse_expression(text))) == 0
        lines.append(equal(f"{k}. {letter}", text, str(ours), (remarks or {}).get(letter, ""), same=same))
    return lines


def _solved(law: Expression, letter: str) -> sp.Expr:
    found = linear_solution(law, letter)
    if found is None:
        raise LookupError(f"{to_text(law)} does not give {letter}")
    return sp.cancel(to_sympy(found))


@table("4.3 and 4.4, pages 72 and 74")
def section_4_3() -> Parts:
    """Section 4.3 and table 4.2: the current as one line of code."""
    motor = system("motor")
    question = next(item for item in questions.states_from_rates(motor.network) if item.targets[0][0] == "armature.f")
    route, solution = motor.ask(question)
    form = closed_form(solution.roots[0], "armature.f_0")
    if form is None:
        raise LookupError("no closed form of the current")
    ours = in_figure_4_4(form)
    gap = sp.cancel(to_sympy(ours) - to_sympy(parse_expression(SECTION_4_3)))
    record = at_50_hz((10.0, 10.0, 12.0, 7.0, 11.0))
    known = {name: record[signal][4] for name, signal in (("V_0", "V"), ("omega_0", "omega"))}
    current = record["armature.f"][4]
    change = (current - record["armature.f"][3]) / motor.plant.sample_time
    values = {**motor.plant.values, "dt": motor.plant.sample_time, **known, "L.rate_0": change}
    found = evaluate_root(solution.roots[0], values)["armature.f_0"]
    yield (
        "The route from the change l of the current and one observation, figure 4.6. The motor is that of table "
        "6.3, by backward Euler at 50 Hz, V = 10, 10, 12, 7, 11 from rest."
    )
    yield from _constraints(TABLE_4_2, route)
    yield number("number of constraints", "4", len(route.steps))
    yield equal("h", SECTION_4_3, to_text(ours), same=gap == 0)
    yield words(
        "h by this line", "", f"{float(found):.12g}", f"in the simulation {float(record['armature.f'][4]):.12g}"
    )
    yield formulas(solution)


def at_50_hz(volts: Sequence[float]) -> FrameRecord:
    """Give the exact backward-Euler record of the motor at 50 samples a second, from rest."""
    motor = system("motor")
    inputs = {"V": tuple(Fraction(value) for value in volts)}
    return simulate_frames(motor.network, motor.plant.values, inputs, motor.plant.sample_time)
