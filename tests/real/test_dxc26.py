"""Circuits and scenarios of the diagnosis competition DXC'26."""

import os
from pathlib import Path

import pytest

from faultbond.networks.logic.diagnoses import explains, minimum_diagnoses
from faultbond.networks.logic.dxc import read_circuit, read_scenario

DATA = os.environ.get("FAULTBOND_DATA")
FOLDER = Path(DATA or "") / "dxc26"

pytestmark = pytest.mark.skipif(not DATA, reason="FAULTBOND_DATA is not set")


def test_the_truth_of_74182() -> None:
    """All 50 scenarios: exactly the diagnoses of the file."""
    network = read_circuit(FOLDER / "74182.xml")
    assert (len(network.suspects), len(network.inputs), len(network.outputs)) == (19, 9, 5)
    paths = sorted((FOLDER / "74182").glob("*.scn"))
    assert len(paths) == 50
    for path in paths:
        scenario = read_scenario(path)
        found = minimum_diagnoses(network, [item.values for item in scenario.observations])
        assert set(found) == set(scenario.diagnoses or ()), path.name


def test_the_truth_of_74181() -> None:
    """Of 54 scenarios 30 as in the file; in the others the file leaves out sets that explain the observation.

    In those the answer is no larger than the file's sets, holds all of them that are as small, and its first 20 sets
    explain the observation; so do the injected faults, which the file calls impossible in 21 of them.
    """
    network = read_circuit(FOLDER / "74181.xml")
    assert len(network.suspects) == 65
    equal = impossible = 0
    for path in sorted((FOLDER / "74181").glob("*.scn")):
        scenario = read_scenario(path)
        rows = [item.values for item in scenario.observations]
        truth, found = set(scenario.diagnoses or ()), set(minimum_diagnoses(network, rows))
        size = min(map(len, found))
        equal += found == truth
        impossible += found != truth and scenario.injected not in truth
        assert all(explains(network, item, rows) for item in (*sorted(found, key=sorted)[:20], scenario.injected)), (
            path.name
        )
        assert size <= min(scenario.cardinality or 0, len(scenario.injected)), path.name
        assert {item for item in truth if len(item) == size} <= found, path.name
    assert (equal, impossible) == (30, 21)
