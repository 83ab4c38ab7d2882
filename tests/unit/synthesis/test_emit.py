"""The C text of a filter: the same for the same model, and with the meaning of the graph."""

import ctypes
import os
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from faultbond.equations.evaluate import evaluate
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.errors import GenerationError
from faultbond.io.cache import loadable
from faultbond.model.expression import FUNCTIONS
from faultbond.model.parser import parse_expression
from faultbond.model.text import load_model
from faultbond.synthesis.compile import compile_library, required_compiler
from faultbond.synthesis.engine import build_model
from faultbond.synthesis.functions_text import function_text
from faultbond.synthesis.model_text import core_text
from faultbond.synthesis.specify import build_spec

EXAMPLES = Path(__file__).parents[3] / "examples"
CALLS_LAWS = """
void call_laws(const double *y, const double *u, double *found, int n, int count)
{
    for (int first = 0; first < n; first += FB_LANES) {
        lanes v = load(y + first), value[count];
        laws(&v, u, &v, value);
        for (int i = 0; i < count; i++)
            for (int l = 0; l < FB_LANES; l++) memcpy(found + (first + l) * count + i, (double *)&value[i] + l, 8);
    }
}
"""
LAWS = {
    "abs": "abs(x) + abs(s)",
    "sign": "sign(x)*y",
    "sqrt": "sqrt(y) + sqrt(s)",
    "exp": "exp(x) + exp(-s)",
    "log": "log(y) - log(s)",
    "sin": "sin(x*s)",
    "cos": "cos(x) - cos(s)",
    "tan": "tan(x) + tan(s)",
    "tanh": "tanh(x*s) + tanh(s)",
    "min": "min(x, s, y)",
    "max": "max(x, s) + max(s, 2)",
    "where": "where(x < 0.1, y**2, s*y) + where(s >= 2, x, y) + where(y <= x, 1, x) + where(s > y, x, s)",
}
ARITHMETIC = ("x*y - s/x + 1/y - (-x)", "y**s + y**2.5 + x**3 + x**-2", "2*x + x*x - -3*y + 1e-30*s")


def text_of(name: str) -> str:
    """C text of a built-in plant."""
    plant = build_plant(load_model(EXAMPLES / name / "model.yaml"))
    return core_text(build_spec(build_step_model(plant)), build_step_model(plant, all_inputs=True))


def test_what_several_lanes_are_divided_by_is_inverted_once() -> None:
    """Quotients by what all lanes share stay, and so does a single one: of what is alike they are exactly 1."""
    v, u, z = ca.SX.sym("v", 3), ca.SX.sym("u", 1), ca.SX.sym("z", 0)
    value = ca.vertcat(v[0] / v[1], (v[0] + 1) / v[1], 1 / v[1], v[0] / v[2], v[1] / u, v[2] / u)
    text = function_text(ca.Function("laws", [v, u, z], [value]), {"value": "lanes"})
    assert text.count(" / v[1];") == text.count("const lanes by_v_1 = 1.0 / v[1];") == 1
    assert text.count("* by_v_1;") == 2
    assert text.count(" / v[2];") == 1
    assert text.count(" / u[0];") == 2


def test_same_model_same_text() -> None:
    """The text of a model is the same byte for byte each time, also in another process that orders sets otherwise."""
    here = text_of("tank")
    assert text_of("tank") == here
    script = (
        "import sys, hashlib; sys.path.insert(0, sys.argv[1]); from test_emit import text_of; "
        "print(hashlib.sha256(text_of('tank').encode()).hexdigest())"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "12345", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(
        [sys.executable, "-c", script, str(Path(__file__).parent)],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    assert done.stdout.strip() == sha256(here.encode()).hexdigest()


def test_text_depends_on_the_model() -> None:
    """Another model has another text, and its sizes stand in it."""
    model = build_model(load_model(EXAMPLES / "rc" / "model.yaml"))
    spec = build_spec(model)
    text = text_of("rc")
    assert text != text_of("rlc")
    sizes = {
        "N_STATES": spec.states,
        "N_PARAMETERS": spec.parameters,
        "N_INPUTS": spec.inputs,
        "N_OUTPUTS": spec.outputs,
    }
    assert all(f"#define {name} {len(items)}\n" in text for name, items in sizes.items())
    assert f"#define N_SETS {len(spec.hypotheses)}\n" in text


def graph_of(texts: tuple[str, ...]) -> ca.Function:
    """Expressions in y (of a lane), and in x and s (that lanes share), with their slopes."""
    lane, shared = ca.SX.sym("lane", 1), ca.SX.sym("shared", 2)
    values = {"x": shared[0], "y": lane[0], "s": shared[1]}
    found = ca.vertcat(*(evaluate(parse_expression(text), values) for text in texts))
    found = ca.vertcat(found, ca.vec(ca.jacobian(found, ca.vertcat(lane, shared))))
    return ca.Function("laws", [lane, shared, ca.SX(0, 1)], [ca.densify(found)], {"cse": True})


def test_every_function_of_laws_is_tried_here() -> None:
    """No function that a law may use is missing from these tests."""
    assert set(LAWS) == set(FUNCTIONS)


def test_every_function_means_the_same_in_c(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every function of laws, its slopes, and arithmetic on lanes and scalars give the interpreter's numbers."""
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path))
    function = graph_of((*LAWS.values(), *ARITHMETIC))
    text = '#include "maths.h"\n' + function_text(function, {"value": "lanes"}) + CALLS_LAWS
    with loadable([compile_library(text, required_compiler())]) as (library,):
        call = ctypes.CDLL(str(library)).call_laws
    lanes, count = np.random.default_rng(8).uniform(0.2, 2.0, 16), function.numel_out(0)
    for shared in np.array([[-1.1, 0.7], [-1.1, 2.0], [0.6, 3.1]]):
        found = np.empty((len(lanes), count))
        call(*(ctypes.c_void_p(item.ctypes.data) for item in (lanes, shared, found)), len(lanes), count)
        expected = np.array([function(lane, shared, [])[:, 0].full()[:, 0] for lane in lanes])
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-13)


def test_operation_without_a_c_form_is_named() -> None:
    """An operation that has no C form is refused by its name, not written wrongly."""
    lane, shared = ca.SX.sym("lane", 1), ca.SX.sym("shared", 1)
    function = ca.Function("laws", [lane, shared, ca.SX(0, 1)], [ca.atan2(lane, shared)])
    with pytest.raises(GenerationError, match="no C form for OP_ATAN2"):
        function_text(function, {"value": "lanes"})
