"""The C text of a filter: the same for the same model, and with the meaning of the graph."""

import os
import subprocess
import sys
from hashlib import sha256
from importlib.resources import files
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from faultbond.equations.evaluate import evaluate
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.errors import GenerationError
from faultbond.fit.library import load_likelihood
from faultbond.io.cache import loadable
from faultbond.model.expression import FUNCTIONS
from faultbond.model.parser import parse_expression
from faultbond.model.text import load_model
from faultbond.synthesis.compile import compile_library, required_compiler
from faultbond.synthesis.emit import emit_filter
from faultbond.synthesis.engine import build_model
from faultbond.synthesis.model_text import core_text
from faultbond.synthesis.specify import build_spec

EXAMPLES = Path(__file__).parents[3] / "examples"
TEMPLATE = files("faultbond.synthesis").joinpath("engine.c.in").read_text()
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


def graph_of(texts: tuple[str, ...], *, slopes: bool) -> ca.Function:
    """A filter function of expressions in x (common), y (of the lane) and s (of the sample); seen: those in x and s."""
    common, lane, sample = ca.SX.sym("common", 1), ca.SX.sym("lane", 1), ca.SX.sym("sample", 1)
    values = {"x": common[0], "y": lane[0], "s": sample[0]}
    found = ca.vertcat(*(evaluate(parse_expression(text), values) for text in texts))
    if slopes:
        found = ca.vertcat(found, ca.vec(ca.jacobian(found, ca.vertcat(common, lane, sample))))
    seen = ca.vertcat(*(item for item in ca.vertsplit(found) if not ca.depends_on(item, lane)))
    results = [common / 2, ca.densify(seen), lane + common**2, ca.densify(found)]
    return ca.Function("filter_step", [common, lane, sample], results, {"cse": True})


def test_every_function_of_laws_is_tried_here() -> None:
    """No function that a law may use is missing from these tests."""
    assert set(LAWS) == set(FUNCTIONS)


def test_every_function_means_the_same_in_c(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every function of laws, its slopes, and arithmetic on lanes and scalars give the interpreter's numbers."""
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path))
    compiler = required_compiler()
    function = graph_of((*LAWS.values(), *ARITHMETIC), slopes=True)
    with loadable([compile_library(emit_filter(function, TEMPLATE), compiler)]) as (library,):
        engine = load_likelihood(library, function)
    for count in (11, 0, 43):  # lanes; more of them than are taken at once
        common, lanes = np.array([-1.1]), np.random.default_rng(8).uniform(0.2, 2.0, (1, count))
        samples = np.array([[0.7], [2.0], [3.1]])
        after = engine.advance(common, lanes, samples)
        for t, sample in enumerate(samples):
            given = common
            for lane in range(count):
                _, _, moved, expected = (item.full()[:, 0] for item in function(given, lanes[:, lane], sample))
                assert after.innovations[t, :, lane] == pytest.approx(expected, rel=1e-12, abs=1e-13)
                lanes[:, lane] = moved
            common, seen = (item.full()[:, 0] for item in function(given, 1.0, sample)[:2])
            assert after.seen[t] == pytest.approx(seen, rel=1e-12, abs=1e-13)
        assert after.common == pytest.approx(common, rel=1e-15)
        assert np.array_equal(after.lanes, lanes)


def test_operation_without_a_c_form_is_named() -> None:
    """An operation that has no C form is refused by its name, not written wrongly."""
    none, lane, sample = ca.SX(0, 1), ca.SX.sym("lane", 1), ca.SX.sym("sample", 1)
    function = ca.Function("filter_step", [none, lane, sample], [none, none, lane, ca.atan2(lane, sample)])
    with pytest.raises(GenerationError, match="no C form for OP_ATAN2"):
        emit_filter(function, TEMPLATE)
