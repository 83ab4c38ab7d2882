"""The C source of an engine, kept as a file so that a change of it is seen; `make golden` rewrites it."""

import os
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

import pytest

from faultbond.model.text import load_model
from faultbond.synthesis.emit import emit_filter
from faultbond.synthesis.engine import build_model
from faultbond.synthesis.filter import build_filter
from faultbond.synthesis.specify import build_spec

HERE = Path(__file__).parent
EXAMPLES = HERE.parents[1] / "examples"


@pytest.mark.skipif(not version("casadi").startswith("3.8"), reason="another CasADi may order operations differently")
def test_source_of_the_rc_circuit() -> None:
    """The generated source of the RC circuit is the one that was read and kept."""
    model = build_model(load_model(EXAMPLES / "rc" / "model.yaml"))
    template = files("faultbond.synthesis").joinpath("engine.c.in").read_text()
    source = emit_filter(build_filter(build_spec(model), model), template)
    kept = HERE / "rc_engine.c"
    if os.environ.get("FAULTBOND_GOLDEN") == "rewrite":
        kept.write_text(source)
    assert source == kept.read_text()
