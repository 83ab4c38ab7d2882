"""The C text of a model, kept as a file so that a change of it is seen; `make golden` rewrites it."""

import os
from importlib.metadata import version
from pathlib import Path

import pytest

from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.text import load_model
from faultbond.synthesis.model_text import model_text
from faultbond.synthesis.specify import build_spec

HERE = Path(__file__).parent
EXAMPLES = HERE.parents[1] / "examples"


@pytest.mark.skipif(not version("casadi").startswith("3.8"), reason="another CasADi may order operations differently")
def test_source_of_the_rc_circuit() -> None:
    """The text that the RC circuit adds to the core is the one that was read and kept."""
    plant = build_plant(load_model(EXAMPLES / "rc" / "model.yaml"))
    source = model_text(build_spec(build_step_model(plant)).slotted, build_step_model(plant, all_inputs=True))
    kept = HERE / "rc_model.h"
    if os.environ.get("FAULTBOND_GOLDEN") == "rewrite":
        kept.write_text(source)
    assert source == kept.read_text()
