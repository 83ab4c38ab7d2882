"""Routes and closed forms in a report: the column of noise, and code whose functions all have names of their own."""

import ast
import io
from collections import Counter

import pytest
from rich.console import Console

from faultbond.algebra.routes.functions import Function, answer, asked, trial_record
from faultbond.algebra.solving.backward_euler import plant_of
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, build_components
from faultbond.equations.constraint_network import build_network
from faultbond.model.text import parse_model
from faultbond.report.closed_forms import CodeForm, code, print_routes

WORDS = """
name: words
sample_time: none
inputs: {x: {}}
blocks:
  m1: {law: p = a*x, parameters: {a: 2}}
  m2: {law: q = b_c*x + b*x, parameters: {b_c: 3, b: 2}}
  m3: {law: r = c_d*x, parameters: {c_d: 3}}
  m4: {law: s = d*x, parameters: {d: 3}}
sensors: {p: {reads: p}, q: {reads: q}, r: {reads: r}, s: {reads: s}}
"""
LEAK = """
name: leak
sample_time: 2 s
inputs: {u: {unit: m^3/s}}
components:
  pump: {type: Sf, law: f = u}
  tank: {type: C, law: e = q/A, parameters: {A: {nominal: 3 m^5/N}}}
  leak: {type: Sf, law: f = L, parameters: {L: {nominal: 0 m^3/s, accuracy: 0.1 m^3/s, change: 0.5 m^3/s}}}
junctions: {node: 0}
bonds: [pump -> node -> tank, node -> leak]
sensors: {p: {reads: node.e, unit: Pa, noise: 20 mPa}}
"""


def answered(
    text: str, largest: int, tmp_path_factory: pytest.TempPathFactory
) -> tuple[ComponentNetwork, list[Function]]:
    """All questions about a plant, answered in closed form."""
    graph = parse_model(text)
    network, plant = build_components(graph, build_network(graph, assign_causality(graph))), plant_of(graph)
    folder, record = tmp_path_factory.mktemp("forms"), trial_record(network, plant, largest)
    return network, [answer(network, item, plant, record, cache=folder) for item in asked(network, largest)]


def test_no_two_functions_of_one_name(tmp_path_factory: pytest.TempPathFactory) -> None:
    """The sets {a, b_c, d} and {a, b, c_d} make the same words: their functions get a number."""
    network, found = answered(WORDS, 3, tmp_path_factory)
    module = ast.parse(code(found, network.parameters, CodeForm.PYTHON))
    names = Counter(item.name for item in module.body if isinstance(item, ast.FunctionDef))
    assert max(names.values()) == 1
    assert {"a_of", "a_of_parameters_a_b", "a_of_parameters_a_b_c_d"} <= set(names)


def test_noise_of_a_parameter_that_is_zero(tmp_path_factory: pytest.TempPathFactory) -> None:
    """It has no value to be a part of: its noise is in SI, that of another parameter in per cent.

    L = u - A (p - p@1)/dt: of two samples with 20 mPa each it has 3/2*sqrt(2)*0.02 = 0.042 m^3/s.
    """
    network, found = answered(LEAK, 1, tmp_path_factory)
    text = io.StringIO()
    print_routes(Console(file=text, width=100), network, found, 0)
    rows = {line.strip().split("  ")[0]: line for line in reversed(text.getvalue().splitlines())}
    assert " 0.042 " in rows["parameter L"]
    assert " % " not in rows["parameter L"]
    assert " % " in rows["parameter A"]


@pytest.mark.parametrize(("form", "remark"), [(CodeForm.PYTHON, "# 2"), (CodeForm.C, "/* 2"), (CodeForm.LATEX, "% 2")])
def test_code_says_what_it_leaves_out(form: CodeForm, remark: str) -> None:
    """Where there was no time for some closed forms the code ends with a remark; otherwise there is none."""
    assert code([], (), form, late=2).splitlines()[-1].startswith(f"{remark} closed forms left out")
    assert "left out" not in code([], (), form)
