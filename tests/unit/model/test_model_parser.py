"""Laws as text: what is read, what is refused, and the text of a tree."""

import pytest

from faultbond.errors import ModelError
from faultbond.model.expression import Binary, Call, Name, Negative, Number
from faultbond.model.parser import number_text, parse_expression, parse_relation, to_text


def test_precedence_is_that_of_arithmetic() -> None:
    """A power binds more than a minus sign, which binds more than a product."""
    tree = parse_expression("-a**2*b + c")
    assert tree == Binary("+", Binary("*", Negative(Binary("**", Name("a"), Number(2.0))), Name("b")), Name("c"))


def test_dotted_names_are_signals() -> None:
    """`part.signal` is one name."""
    assert parse_expression("vessel.e") == Name("vessel.e")


def test_where_takes_a_comparison() -> None:
    """The first argument of where is the only place of a comparison."""
    tree = parse_expression("where(f <= 0, 1, 2)")
    assert tree == Call("where", (Binary("<=", Name("f"), Number(0.0)), Number(1.0), Number(2.0)))


def test_law_has_two_sides() -> None:
    """The `=` of a comparison does not divide a law."""
    left, right = parse_relation("e = where(f >= 0, K, -K)")
    assert left == Name("e")
    assert to_text(right) == "where(f >= 0, K, -K)"


@pytest.mark.parametrize(
    "text",
    [
        *("a - (b - c)", "a - b - c", "a/(b*c)", "a/b*c", "(-a)**2", "-a**2", "a**-b", "(a**b)**c", "a**b**c", "--a"),
        *("a*-b", "-(a + b)", "-(a*b)", "2.41e11*f", "min(a, b - c, 1e-5)", "a + (b + c)", "(a + b)*c", "1e7 + 100"),
    ],
)
def test_text_keeps_only_needed_parentheses(text: str) -> None:
    """Text in canonical form is given back letter by letter."""
    assert to_text(parse_expression(text)) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(100.0, "100"), (0.5, "0.5"), (2.41e11, "2.41e11"), (1e-6, "1e-6"), (1e7, "1e7"), (1234567.0, "1234567")],
)
def test_numbers_are_short(value: float, text: str) -> None:
    """A number is written as a person would."""
    assert number_text(value) == text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"^m:1: an expression is missing"),
        ("a" * 2001, r"^m:1: the expression has 2001 characters; at most 2000"),
        ("a" * 65, r"cannot read"),
        ("+".join("a" * 400), r"more than 50 levels"),
        ("min(" + ", ".join(["a"] * 501) + ")", r"more than 500 numbers, names and operators"),
        ("(" * 60 + "a" + ")" * 60 + "*" + "-" * 60 + "a", r"more than 50 levels"),
        ("a^2", r"write `\*\*` for a power"),
        ("a & b", r"logic belongs to block networks"),
        ("a == b", r"one `=` stands between the two sides"),
        ("a < b", r"only in where\(condition, a, b\)"),
        ("where(a, b, c)", r"one comparison"),
        ("where(a < b < c, 1, 2)", r"one comparison"),
        ("sqrt(a, b)", r"sqrt` takes 1 argument, not 2"),
        ("where(a < b, c)", r"where` takes 3 arguments, not 2"),
        ("max(a)", r"max` takes two or more arguments, not 1"),
        ("sqrtt(a)", r"unknown function `sqrtt`; did you mean `sqrt`"),
        ("ln(a)", r"unknown function `ln`; did you mean `log\(x\)`"),
        ("besselj(a)", r"unknown function `besselj`; known: abs, .* where, table"),
        ("a**17", r"an exponent above 16"),
        ("a**-(8 + 9)", r"an exponent above 16"),
        ("9**9**9", r"an exponent above 16"),
        ("1e999", r"`1e999` is too large"),
        ("lambda", r"`lambda` is a reserved word"),
        ("a.if", r"`if` is a reserved word"),
        ("a b", r"is not an expression"),
        ("a +", r"is not an expression"),
        ("a // b", r"only \+ - \* / \*\*"),
        ("+a", r"only \+ - \* / \*\*"),
        ("a, b", r"only \+ - \* / \*\*"),
        ("sqrt(*a)", r"only \+ - \* / \*\*"),
        ("f(a)(b)", r"only functions may be called"),
        ("a.b(c)", r"only functions may be called"),
        *((text, r"cannot read") for text in ("a.b.c", "1j", "0x1f", "1_0", "'a'", "[a]", "a@b", "é", "_a", "a\\\nb")),
    ],
)
def test_everything_else_is_refused(text: str, message: str) -> None:
    """What the grammar does not know is a ModelError that starts with the place."""
    with pytest.raises(ModelError, match=message) as error:
        parse_expression(text, "m:1: ")
    assert str(error.value).startswith("m:1: ")


@pytest.mark.parametrize("text", ["e", "e = f = g", "e == f", "", "e <= f"])
def test_law_needs_one_equals_sign(text: str) -> None:
    """A law has exactly two sides."""
    with pytest.raises(ModelError, match=r"is not a law; write `left = right`"):
        parse_relation(text)


def test_long_law_is_refused() -> None:
    """A law of more than 2000 characters is not read."""
    with pytest.raises(ModelError, match="2005 characters"):
        parse_relation("e = " + "a" * 2001)
