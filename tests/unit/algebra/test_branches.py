"""Laws with branches: every side is a case, and a case is the law on its side."""

from itertools import count
from math import isclose

import numpy as np
import pytest

from faultbond.algebra.solving.branches import Branch, Condition, cases, name_functions
from faultbond.equations.numeric import numeric_value
from faultbond.model.expression import Expression, Name
from faultbond.model.parser import parse_expression, to_text

LAWS = [
    "e - K*f*abs(f)",
    "e - sign(f)*f**2",
    "e - min(f, K, 3)",
    "e - max(2*f, K)",
    "e - where(f > K, f**2, -f)",
    "e - where(f <= 0, abs(f - K), max(f, abs(f)))",
]


def all_cases(text: str, unknown: str = "e f") -> list[Branch]:
    """Cases of one law."""
    return list(cases((parse_expression(text),), frozenset(unknown.split()), {}, lambda name: name))


def holds(condition: Condition, values: dict[str, float]) -> bool:
    """Whether a condition holds."""
    value = numeric_value(condition.expression, values)
    return value > 0 or (value == 0 and not condition.strict)


@pytest.mark.parametrize("text", LAWS)
def test_cases_are_the_law_on_their_side(text: str) -> None:
    """At random values at least one case holds, and every case that holds has the value of the law."""
    rng = np.random.default_rng(0)
    found = all_cases(text)
    for _ in range(50):
        values = {name: float(rng.uniform(-5.0, 5.0)) for name in ("e", "f", "K")}
        reached = [case for case in found if all(holds(condition, values) for condition in case.conditions)]
        assert reached
        law = float(numeric_value(parse_expression(text), values))
        assert all(isclose(float(numeric_value(case.residuals[0], values)), law, rel_tol=1e-9) for case in reached)


def test_no_kink_is_left() -> None:
    """Cases hold no kink of an unknown."""
    assert all("abs" not in to_text(case.residuals[0]) for text in LAWS for case in all_cases(text))


def test_kinks_of_known_values_are_values() -> None:
    """The size of a sample is no case."""
    (case,) = all_cases("e - K*abs(u)")
    assert case.conditions == ()
    assert to_text(case.residuals[0]) == "e - K*abs(u)"


def test_equal_conditions_are_shared() -> None:
    """Two laws with the same kink have two cases, not four."""
    residuals = (parse_expression("e - abs(f)"), parse_expression("g - f*abs(f)"))
    found = list(cases(residuals, frozenset({"e", "f", "g"}), {}, lambda name: name))
    assert [[condition.text for condition in case.conditions] for case in found] == [["f >= 0"], ["f <= 0"]]


def test_a_side_holds_in_every_frame() -> None:
    """The same signal in two frames takes one side, with a condition for each frame."""
    residuals = (parse_expression("e_0 - abs(f_0)"), parse_expression("e_1 - abs(f_1)"))
    found = list(cases(residuals, frozenset({"f_0", "f_1"}), {}, lambda name: name.partition("_")[0]))
    assert [[condition.text for condition in case.conditions] for case in found] == [
        ["f_0 >= 0", "f_1 >= 0"],
        ["f_0 <= 0", "f_1 <= 0"],
    ]


def test_a_side_taken_before_stays() -> None:
    """A kink of what is known by now but took a side before is on that side."""
    (case,) = cases((parse_expression("e - abs(f)"),), frozenset({"e"}), {Name("f"): -1}, lambda name: name)
    assert to_text(case.residuals[0]) == "e - -f"


def test_preferred_side_first() -> None:
    """The case of the nominal plant comes first."""
    found = cases((parse_expression("e - abs(f)"),), frozenset({"e", "f"}), {}, lambda name: name, lambda _: False)
    assert [case.conditions[0].text for case in found] == ["f <= 0", "f >= 0"]


def test_conditions_as_text() -> None:
    """Conditions read like the user's own comparisons."""
    found = [case.conditions[0].text for case in all_cases("e - where(f > K, 1, 2) + 0*sign(f)")]
    assert found[0] == "f >= K"
    assert "f > 0" in {case.conditions[1].text for case in all_cases("e - where(f > K, 1, 2) + 0*sign(f)")}


def named(text: str, unknown: str) -> Branch:
    """A case with its functions named."""
    numbers = count(1)
    case = Branch(residuals=(parse_expression(text),))
    return name_functions(case, frozenset(unknown.split()), lambda word: f"{word}{next(numbers)}")


def test_functions_get_names() -> None:
    """What is known becomes a value, a function of an unknown an unknown, inner ones first."""
    case = named("e - exp(sqrt(f)) - log(u)", "e f")
    assert [(item.name, item.function) for item in case.unknown] == [("sqrt1", "sqrt"), ("exp2", "exp")]
    assert [(item.name, to_text(item.value)) for item in case.known] == [("log3", "log(u)")]
    assert to_text(case.residuals[0]) == "e - exp2 - log3"


def test_powers_of_known_sums_stay_together() -> None:
    """A power of a sum of samples is a value: multiplied out nobody would know it again."""
    case = named("e - K*(100 - u)**4*f**2", "e f")
    assert [to_text(item.value) for item in case.known] == ["(100 - u)**4"]
    assert case.unknown == ()


def test_replacement_sees_equal_parts() -> None:
    """A function that occurs twice has one name."""
    case = named("e*tanh(f) - tanh(f)", "f")
    assert to_text(case.residuals[0]) == "e*tanh1 - tanh1"


def expression_of(case: Branch) -> Expression:
    """The only residual of a case."""
    (residual,) = case.residuals
    return residual


def test_roots_of_unknowns_are_unknowns() -> None:
    """A broken power is named too."""
    case = named("e - f**1.5", "f")
    assert [(item.function, item.exponent) for item in case.unknown] == [("**", 1.5)]
    assert to_text(expression_of(case)) == "e - power1"
