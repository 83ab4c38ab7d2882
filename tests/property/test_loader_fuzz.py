"""Hostile model texts: the loader answers each with a ModelError or a graph, on one line and at once."""

import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from strategies import as_text, gates, networks, plants

from faultbond.errors import ModelError
from faultbond.model.expression import FUNCTIONS, LOGIC, NOT, Binary, Call, Expression, Name, Negative, Number
from faultbond.model.parser import parse_expression, parse_relation, to_text
from faultbond.model.quantities import quantity, spread, spread_over
from faultbond.model.text import load_model, parse_model
from faultbond.model.units import unit

TANK = (Path(__file__).parents[2] / "examples" / "tank" / "model.yaml").read_text()
MOTOR = (Path(__file__).parents[2] / "examples" / "dc_motor" / "model.yaml").read_text()
ADDER = (Path(__file__).parents[2] / "examples" / "thesis" / "fig_3_7.yaml").read_text()
STORE = (Path(__file__).parents[2] / "examples" / "thesis" / "fig_3_18.yaml").read_text()
MACHINE = (Path(__file__).parents[2] / "examples" / "structures" / "electric_motor.yaml").read_text()
fuzz = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])

NAMES = st.sampled_from(["K1", "f", "pipe.e", "u_in", "x_9", "a.b"])
NUMBERS = st.floats(0, 1e300).map(Number) | st.integers(0, 10**7).map(lambda value: Number(float(value)))
EXPONENTS = st.floats(-16, 16).map(lambda value: Negative(Number(-value)) if value < 0 else Number(abs(value)))


def _larger(inner: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    pair = st.tuples(inner, inner)
    comparison = st.tuples(st.sampled_from(["<", "<=", ">", ">="]), inner, inner).map(lambda item: Binary(*item))
    plain = [name for name, number in FUNCTIONS.items() if number == 1]
    return st.one_of(
        st.tuples(st.sampled_from(["+", "-", "*", "/"]), inner, inner).map(lambda item: Binary(*item)),
        st.tuples(inner, EXPONENTS | NAMES.map(Name)).map(lambda item: Binary("**", *item)),
        inner.map(Negative),
        st.tuples(st.sampled_from(plain), inner).map(lambda item: Call(item[0], (item[1],))),
        st.tuples(st.sampled_from(["min", "max"]), pair).map(lambda item: Call(*item)),
        st.tuples(comparison, inner, inner).map(lambda item: Call("where", item)),
    )


def _larger_in_blocks(inner: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    gate = st.tuples(st.sampled_from(LOGIC), inner, inner).map(lambda item: Binary(*item))
    return st.one_of(_larger(inner), gate, inner.map(lambda item: Call(NOT, (item,))))


EXPRESSIONS = st.recursive(NUMBERS | NAMES.map(Name), _larger, max_leaves=20)
IN_BLOCKS = st.recursive(NUMBERS | NAMES.map(Name), _larger_in_blocks, max_leaves=20)
LAW_LETTERS = st.text("Kfeu1.9+-*/()=<>, _^&|~%'\"\\\n\t\x00é", max_size=60)
UNIT_LETTERS = st.text("PamskgV^*/()-.0519 %°µ", max_size=40)


def outcome(read: Callable[[], object]) -> str:
    """Give the message of a refusal, checked to be one short line; empty if there is none."""
    try:
        read()
    except ModelError as error:
        message = str(error)
    else:
        return ""
    assert message
    assert "\n" not in message
    assert len(message) < 500
    return message


def attempt(text: str) -> None:
    """Load a text: it is refused with the file's name, or its canonical text is a fixed point."""
    message = outcome(lambda: parse_model(text))
    if message:
        assert message.startswith("model.yaml:")
    else:
        canonical = parse_model(text).text
        assert parse_model(canonical).text == canonical


@given(EXPRESSIONS)
@fuzz
def test_text_of_an_expression_reads_back_as_the_same_tree(expression: Expression) -> None:
    """Text with as few parentheses as possible still gives exactly the tree it was made from."""
    assert parse_expression(to_text(expression)) == expression


@given(IN_BLOCKS)
@fuzz
def test_text_of_logic_reads_back_as_the_same_tree(expression: Expression) -> None:
    """The same holds with the operators of logic, wherever they stand."""
    assert parse_expression(to_text(expression), blocks=True) == expression


@given(LAW_LETTERS | st.text(max_size=40))
@example("9**9**9")
@example("(" * 1999)
@example("-" * 1999 + "1")
@example("1if 2else 3")
@example("f" + "**f" * 600)
@example("().__class__.__base__.__subclasses__()")
@fuzz
def test_any_text_as_a_law(text: str) -> None:
    """A law from random letters is read or refused, never anything else."""
    for read in (parse_expression, parse_relation):
        outcome(partial(read, text))
        outcome(partial(read, text, blocks=True))


@given(UNIT_LETTERS | st.text(max_size=40))
@example("9**9**9")
@example("m^9999999999")
@example("m" + "^16" * 30)
@example("(" * 100)
@example("km" * 500_000)
@example("1e99999999 m")
@example("__import__('os')")
@fuzz
def test_any_text_as_a_unit_or_quantity(text: str) -> None:
    """A unit from random letters is read or refused, never anything else."""
    for read in (unit, quantity, spread, spread_over, lambda word: quantity(f"3 {word}")):
        outcome(partial(read, text))


@given(st.data())
@fuzz
def test_model_with_one_piece_replaced(data: st.DataObject) -> None:
    """A good model with a piece cut out, doubled or replaced is read or refused."""
    text = data.draw(st.sampled_from([TANK, MOTOR, ADDER, STORE, MACHINE]))
    start = data.draw(st.integers(0, len(text)))
    end = min(len(text), start + data.draw(st.integers(0, 30)))
    piece = data.draw(st.sampled_from(["", text[start:end] * 2]) | LAW_LETTERS | st.sampled_from(text.split()))
    attempt(text[:start] + piece + text[end:])


@given(plants() | networks() | gates(), st.data())
@fuzz
def test_model_with_one_value_replaced(plant: dict[str, object], data: st.DataObject) -> None:
    """A random model in which one value is another value, list or table is read or refused."""
    words = ["", "1", "-3 V", "V", "2 %", "n0", "n0.e", "none", "any", "x -> y", "inf", "1e308 kV", "u", "x2", "logic"]
    values = st.sampled_from([*words, "x2 = u", "der(u) = 1", "x9 = u & ~x2", "0 = der(x2)", "sd", "no"])
    odd = st.recursive(values, lambda inner: st.lists(inner, max_size=2) | st.dictionaries(values, inner, max_size=2))
    place: object = plant
    while isinstance(place, dict | list) and place:
        keys = sorted(place) if isinstance(place, dict) else range(len(place))
        key = data.draw(st.sampled_from(list(keys)))
        inner = place[key]
        if not isinstance(inner, dict | list) or not inner or data.draw(st.booleans()):
            place[key] = data.draw(odd)
            break
        place = inner
    attempt(as_text(plant))


@given(st.binary(max_size=300) | st.text("{}[]:,-?&*!|>'\"%@`#ab \n\t", max_size=80).map(str.encode))
@example(b"\xff\xfe")
@example(b"[" * 100_000)
@example(b"{a: " * 100_000)
@example(b"- " * 100_000)
@example(b"a: &a [*a, *a]")
@example(b'"\\ud800"')
@example(b'a: "\\U00110000"')
@example(b"x" * (2**20 + 1))
@settings(max_examples=150, deadline=None)
def test_any_bytes_as_a_file(data: bytes) -> None:
    """A file of any bytes is refused in one line."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "model.yaml")
        path.write_bytes(data)
        assert outcome(lambda: load_model(path)).startswith(str(path))


def test_ten_thousand_elements_are_refused_at_once() -> None:
    """A model far above the limit of parts is refused before its laws are read."""
    components = {f"R{i}": {"type": "R", "parameters": {f"P{i}": "3 ohm"}} for i in range(10_000)}
    text = json.dumps({"sample_time": "1 s", "components": components, "bonds": [], "sensors": {}}, indent=0)
    begun = time.process_time()
    attempt(text)
    assert time.process_time() - begun < 5.0
