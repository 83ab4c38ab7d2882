"""Closed forms as text, Python, C and LaTeX: the printed code computes what the closed form does."""

import ctypes
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from solved import example, route_to, static

from faultbond.algebra.solving.branches import Condition
from faultbond.algebra.solving.formula import (
    C_HEADER,
    PYTHON_HEADER,
    Formula,
    common_parts,
    formulas,
    identifiers,
    to_c,
    to_lines,
    to_one_line,
    to_python,
)
from faultbond.algebra.solving.latex import condition_latex, expression_latex, name_latex, to_latex
from faultbond.algebra.solving.solution import Line, Solution
from faultbond.algebra.solving.solve import solve
from faultbond.equations.component_network import ComponentNetwork
from faultbond.equations.numeric import numeric_value
from faultbond.model.expression import Binary, Call, Expression, Name, Number
from faultbond.model.parser import parse_expression, to_text

CASES = [
    ("dc_motor", ("R", "L")),
    ("dc_motor", ("K",)),
    ("dc_motor", ("J", "K")),
    ("tank", ("K1",)),
    ("tank", ("K7", "K2")),
    ("cascaded_tanks", ("K_pump",)),
    ("emps", ("Fc",)),
]
EVERY_FUNCTION = (
    "abs(x - y)*sign(y) + sqrt(x)*exp(-y)/log(x + 2) + min(x, y, 0.5) - max(x, y)**3 + where(x > y, x**-2, tan(y))"
    " + sin(x)*cos(y) - tanh(x)**2 + x**0.5 - 2e11*y/1e10 + (x + y)**5 + (-x)**2 - (y**2)**3"
)


def solution_of(folder: str, targets: tuple[str, ...]) -> tuple[ComponentNetwork, Solution]:
    """The solution for some parameters of an example."""
    network, plant = example(folder)
    return network, solve(network, route_to(network, *targets), plant)


def values_of(formula: Formula) -> dict[str, float]:
    """Values for the arguments, all different, so that a mixed-up argument shows."""
    found = {}
    for k, name in enumerate(formula.arguments):
        found[name] = 9.0 / (1.0 + 0.37 * k + 0.011 * k * k)
    return found


def expected(formula: Formula, values: Mapping[str, float]) -> float:
    """The value of a formula, line by line."""
    known: dict[str, float | Fraction] = {**values}
    for line in formula.lines:
        known[line.name] = numeric_value(line.value, known)
    return float(known[formula.target])


def formula_of(expression: Expression) -> Formula:
    """A formula of one line in x and y."""
    lines = (Line(name="z", value=expression),)
    return Formula(target="z", arguments=("x", "y"), lines=lines, conditions=(), number=1, count=1)


def python_function(text: str, name: str) -> Callable[..., float]:
    """The function that printed Python defines."""
    namespace: dict[str, Callable[..., float]] = {}
    exec(compile(PYTHON_HEADER + text, "printed", "exec"), namespace)  # noqa: S102 - text of our own making
    return namespace[name]


def compiler() -> list[str] | None:
    """The command of a C compiler, if there is one."""
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        if name and shutil.which(name):
            return [name]
    return [sys.executable, "-m", "ziglang", "cc"] if find_spec("ziglang") else None


def c_function(text: str, name: str, n_arguments: int, folder: Path) -> Callable[..., float]:
    """The function that printed C defines, compiled as strict C99 without a warning."""
    command = compiler()
    if command is None:
        pytest.skip("no C compiler on this machine")
    arguments = ", ".join(f"double x{k}" for k in range(n_arguments))
    passed = ", ".join(f"x{k}" for k in range(n_arguments))
    source = folder / "printed.c"
    source.write_text(f"{C_HEADER}{text}\ndouble call({arguments}) {{ return {name}({passed}); }}\n")
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O0", "-shared", "-fPIC"]
    subprocess.run([*command, *flags, str(source), "-o", str(folder / "printed.so"), "-lm"], check=True)
    function = ctypes.CDLL(str(folder / "printed.so")).call
    function.restype = ctypes.c_double
    function.argtypes = [ctypes.c_double] * n_arguments
    return lambda *values: float(function(*values))


@pytest.mark.parametrize(("folder", "targets"), CASES)
def test_python_computes_the_closed_form(folder: str, targets: tuple[str, ...]) -> None:
    """The printed function of Python gives the value of the closed form."""
    network, solution = solution_of(folder, targets)
    for formula in formulas(solution, network.parameters):
        values = values_of(formula)
        wanted = expected(formula, values)
        name = f"{formula.target}_of" + (f"_{formula.number}" if formula.number > 1 else "")
        function = python_function(to_python(formula), name)
        if math.isnan(wanted):
            with pytest.raises(ValueError, match="math domain"):
                function(*values.values())
        else:
            assert function(*values.values()) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize(("folder", "targets"), CASES)
def test_c_computes_the_closed_form(folder: str, targets: tuple[str, ...], tmp_path: Path) -> None:
    """The printed function of C gives the value of the closed form."""
    network, solution = solution_of(folder, targets)
    formula = formulas(solution, network.parameters)[0]
    values = values_of(formula)
    function = c_function(to_c(formula), f"{formula.target}_of", len(values), tmp_path)
    assert function(*values.values()) == pytest.approx(expected(formula, values), rel=1e-12, nan_ok=True)


def test_every_function_in_every_language(tmp_path: Path) -> None:
    """All functions and powers of the law syntax mean the same in Python and C."""
    formula = formula_of(parse_expression(EVERY_FUNCTION))
    python, c = python_function(to_python(formula), "z_of"), c_function(to_c(formula), "z_of", 2, tmp_path)
    for x, y in ((0.7, 1.9), (3.1, -0.4), (2.0, 2.0)):
        wanted = expected(formula, {"x": x, "y": y})
        assert python(x, y) == pytest.approx(wanted, rel=1e-13)
        assert c(x, y) == pytest.approx(wanted, rel=1e-13)


def test_exact_arithmetic_in_python() -> None:
    """Printed Python keeps fractions where the closed form does."""
    network, solution = solution_of("dc_motor", ("R",))
    (formula,) = formulas(solution, network.parameters)
    values = {name: Fraction(k + 2, 3) for k, name in enumerate(formula.arguments)}
    found = python_function(to_python(formula), "R_of")(*values.values())
    assert isinstance(found, Fraction)


def test_text_of_the_motor() -> None:
    """R of the motor reads like the laws it comes from, the current on the way with its own line."""
    _, solution = solution_of("dc_motor", ("R",))
    (root,) = solution.roots
    assert to_lines(root, ("R",)) == (
        "armature.f_0 = (C*omega_0 + J*(omega_0 - omega_1)/dt)/K",
        "R = (V_0 - L*(armature.f_0 - (C*omega_1 + J*(omega_1 - omega_2)/dt)/K)/dt - K*omega_0)/armature.f_0",
    )


def test_text_of_a_quadratic() -> None:
    """K of the motor has two closed forms, plus and minus one root, over a denominator without minus sign."""
    _, solution = solution_of("dc_motor", ("K",))
    last = [to_lines(root, ("K",))[-1] for root in solution.roots]
    assert all(line.endswith("/(2*(dt*omega_0)))") or line.endswith("/(2*(dt*omega_0))") for line in last)
    assert ["- sqrt(" in line or "+ sqrt(" in line for line in last] == [True, False]
    assert to_lines(solution.roots[1], ("K",))[:2] == (
        "K.e2_0 = C*omega_0 + J*(omega_0 - omega_1)/dt",
        "b1 = -(dt*V_0)",
    )


def test_one_line() -> None:
    """Lines, closed forms and conditions go into one line; none gives None."""
    _, solution = solution_of("tank", ("K8",))
    assert to_one_line(solution) == (
        "orifice.e_0 = flow_0**2*5.08e11; line.f_0 = sqrt(orifice.e_0/K2); "
        "K8 = pressure_0 + (K1*line.f_0**2 + orifice.e_0 + K7**2*(100 - u_in_0)**4*line.f_0**2) "
        "where flow_0 >= 0 and line.f_0 >= 0"
    )
    _, solution = solution_of("rc", ("R", "C"))
    assert to_one_line(solution) is None


def test_text_parses() -> None:
    """The right-hand sides are laws: they parse to the same tree."""
    for folder, targets in CASES:
        _, solution = solution_of(folder, targets)
        for root in solution.roots:
            for line in to_lines(root, targets):
                text = line.partition(" = ")[2]
                assert to_text(parse_expression(text)) == text


def test_common_parts_are_computed_once() -> None:
    """What occurs twice gets a line, and what is inside it does not get another."""
    lines = (Line(name="z", value=parse_expression("(x*y + 1)**2 + sqrt(x*y + 1)*(x*y + 1)")),)
    found = common_parts(lines, lambda: "t1")
    assert [(line.name, to_text(line.value)) for line in found] == [("t1", "x*y + 1"), ("z", "t1**2 + sqrt(t1)*t1")]


def test_identifiers() -> None:
    """Names become identifiers that are neither reserved nor alike."""
    found = identifiers(("a.b_0", "a_b_0", "double", "x"), frozenset({"double"}))
    assert found == {"a.b_0": "a_b_0", "a_b_0": "a_b_0_", "double": "double_", "x": "x"}


def test_reserved_words_in_c(tmp_path: Path) -> None:
    """A parameter called like a word of C does no harm."""
    network, plant = static({"law": "y - double*u - y0"}, ["u"], ["y"], {"double": 2.0, "y0": 1.0})
    (formula,) = formulas(solve(network, route_to(network, "double"), plant), network.parameters)
    function = c_function(to_c(formula), "double__of", 3, tmp_path)
    assert function(2.0, 7.0, 1.0) == 3.0


@pytest.mark.parametrize("name", ["NAN", "INFINITY", "M_PI", "linux"])
def test_macros_of_c(name: str, tmp_path: Path) -> None:
    """A parameter called like a macro of math.h or of the compiler does no harm."""
    network, plant = static({"law": f"y - {name}*u"}, ["u"], ["y"], {name: 2.0})
    (formula,) = formulas(solve(network, route_to(network, name), plant), network.parameters)
    assert c_function(to_c(formula), f"{name}__of", 2, tmp_path)(2.0, 6.0) == 3.0


def test_broken_power_of_a_negative_number() -> None:
    """It has no real value: code says so, as it does of a root, and gives no complex number."""
    line = Line(name="z", value=parse_expression("x**0.25 + x**-2"))
    text = to_python(Formula(target="z", arguments=("x",), lines=(line,), conditions=(), number=1, count=1))
    space: dict[str, Any] = {}
    exec(PYTHON_HEADER + text, space)  # noqa: S102 - code of ours
    assert space["z_of"](16.0) == 2.0 + 1.0 / 256.0
    with pytest.raises(ValueError, match="math domain error"):
        space["z_of"](-16.0)


def test_latex_names() -> None:
    """Greek letters, indices and parts of the plant."""
    assert [name_latex(name) for name in ("omega_0", "K1", "line.f_0", "V_C_1", "pressure")] == [
        r"\omega_{0}",
        "K_{1}",
        r"f_{\mathrm{line},0}",
        "V_{C,1}",
        r"\mathrm{pressure}",
    ]


def test_latex_expressions() -> None:
    """Fractions, roots, sizes, cases, and brackets only where they are needed."""
    texts = {
        "(a - b)*c/d": r"\frac{\left(a - b\right) c}{d}",
        "-(a + b)**2": r"-\left(a + b\right)^{2}",
        "(a/b)**2": r"\left(\frac{a}{b}\right)^{2}",
        "sqrt(abs(x))*2": r"\sqrt{\left|x\right|} \cdot 2",
        "2.5e11*x - (y - z)": r"2.5 \cdot 10^{11} x - \left(y - z\right)",
        "exp(x)*sign(y)": r"\exp\left(x\right) \operatorname{sign}\left(y\right)",
    }
    assert {text: expression_latex(parse_expression(text)) for text in texts} == texts
    where = Call("where", (Binary(">", Name("x"), Number(0.0)), Name("a"), Name("b")))
    assert expression_latex(where) == r"\begin{cases}a & \text{if } x > 0 \\ b & \text{else}\end{cases}"


def test_latex_conditions() -> None:
    """Conditions show both sides, turned so that no minus sign is left."""
    shown = [condition_latex(Condition(expression=parse_expression(text))) for text in ("x", "-x", "x - y")]
    assert shown == [r"x \ge 0", r"x \le 0", r"x \ge y"]


def test_latex_of_a_closed_form() -> None:
    """A closed form is a block of aligned lines."""
    _, solution = solution_of("rc", ("R",))
    (root,) = solution.roots
    assert to_latex(root, ("R",)) == (
        "\\begin{aligned}\n"
        "R &= \\frac{\\left(V_{0} - V_{C,0}\\right) \\mathrm{dt}}{C \\left(V_{C,0} - V_{C,1}\\right)}\n"
        "\\end{aligned}\n"
    )
