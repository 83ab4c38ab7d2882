"""The residuals of the three tanks against the code that the toolbox generates for them, where it is installed."""

import warnings
from pathlib import Path
from runpy import run_path

import numpy as np
import pytest
from benchmarks.peers import three_tank

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of the toolbox and of what it imports
    toolbox = pytest.importorskip("faultdiagnosistoolbox")

pytestmark = pytest.mark.filterwarnings("ignore")

# Number of the minimal set, equation that is left over, first samples that are not used.
CHOICES = ((1, 4, 2), (1, 6, 0), (0, 1, 1))


def test_residuals_are_those_of_the_generated_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All three, on a noisy run with a fault, to rounding."""
    monkeypatch.chdir(tmp_path)  # the toolbox writes into the working folder
    model = toolbox.models.three_tank
    minimal = model.MSO()
    recording = three_tank.record("V2", seed=3)
    known = np.column_stack([recording.outputs, recording.inputs])
    constants = dict.fromkeys(("Rv1", "Rv2", "Rv3", "CT1", "CT2", "CT3"), 1.0)
    ours = three_tank.residuals(recording)
    for number, (chosen, left_over, unused) in enumerate(CHOICES):
        used = [equation for equation in minimal[chosen] if equation != left_over]
        model.SeqResGen(model.Matching(used), left_over, "generated", batch=True, language="Python")
        start = {"p1": 0.0, "p2": 0.0, "p3": 0.0}
        theirs = run_path("generated.py")["generated"](known, start, constants, three_tank.STEP)
        np.testing.assert_allclose(ours[unused:, number], theirs[unused:], rtol=0, atol=1e-9)
