"""The core as a program under sanitizers: whole runs, wild samples, forged states, calls in any order."""

import os
import shutil
from functools import cache
from pathlib import Path

import pytest

from driven import made, program, ran, write_recording
from faultbond.simulate import Fault
from faultbond.synthesis.compile import TIDY
from in_c import SANITIZERS

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")

GCC = ("gcc", "-x", "c", "-std=gnu99", "-march=native")
RUNS_LONG, RUNS_SHORT = ("-Og", TIDY), ("-O0",)  # with -O1 and -g sanitizers take thrice as long to compile
FAULTS = {
    "tank": Fault(parameter="K1", factor=3.0, start=230.0),
    "reserve": Fault(parameter="K", factor=0.6, start=4.0),
    "no input": Fault(parameter="R1", factor=1.7, start=60.0),
    "no state": Fault(parameter="R1", factor=1.7, start=10.0),
    "smooth": Fault(parameter="R1", factor=1.6, start=20.0),
}
WILD = {  # of each plant a fault, and seeds; at those of the last two a number or a covariance was lost once
    "tank": (Fault(parameter="K1", factor=3.0, start=230.0), (1,)),
    "three_tank": (Fault(parameter="V1", value=0.3, start=6.0), (2, 3)),
    "dc_motor_current": (Fault(parameter="K", factor=0.6, start=4.0), (1, 3)),
}
CORPUS = [line.split() for line in (Path(__file__).parent / "corpus.txt").read_text(encoding="utf-8").splitlines()]


@cache
def driver(name: str, folder: Path) -> tuple[Path, Path]:
    """The core of a plant with both sanitizers, and a recording of the plant with a fault."""
    place = folder / name.replace(" ", "_")
    place.mkdir()
    recording = write_recording(place / "recording", made(name, 900, FAULTS[name]))
    level = RUNS_SHORT if name.startswith("no ") else RUNS_LONG  # what compiles for longer than it runs
    return program(name, place, GCC, *level, *SANITIZERS), recording


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where programs of this module are."""
    return tmp_path_factory.mktemp("driven")


@pytest.mark.parametrize("name", FAULTS)
def test_nothing_undefined_happens_in_a_whole_run(name: str, folder: Path) -> None:
    """Start, alarm, renewals, a rejected and an accepted candidate, saved and restored at each diagnosis."""
    executable, recording = driver(name, folder)
    alarms, diagnoses, decisions = map(int, ran(executable, "whole", recording, folder / "out").split())
    assert alarms >= 1
    assert diagnoses >= 14
    assert decisions == 2


def test_nothing_undefined_happens_in_a_fleet(tmp_path: Path) -> None:
    """Assets side by side in two threads leave with an alarm, each, and come back some hundred samples later."""
    name = "no state"
    recording = write_recording(tmp_path / "recording", made(name, 900, FAULTS[name]))
    executable = program(name, tmp_path, GCC, *RUNS_SHORT, *SANITIZERS, "-DFB_FLEETS", "-DFB_LANES=4", "-pthread")
    left, back = map(int, ran(executable, "fleet", recording, "-").split())
    assert left >= back == 5


@pytest.mark.parametrize("name", WILD)
def test_what_is_reported_of_wild_samples_is_a_number_or_none(name: str, tmp_path: Path) -> None:
    """Through values without end, denormal, the largest there are, or none, and time that jumps: nothing is undefined.

    What is reported is finite, or nan where there is nothing yet; the healthy filter is finite, its covariance
    definite, whatever is accepted. The plant is found again between bursts of such values, and alarms are raised.
    """
    fault, seeds = WILD[name]
    executable = program(name, tmp_path, GCC, "-O1", TIDY)
    recording = write_recording(tmp_path / "recording", made(name, 900, fault))
    for seed in seeds:
        *counts, alarms = map(int, ran(executable, "wild", recording, 8_000, seed).split())
        assert sum(counts) == 8_000
        assert counts[3] > 300  # watching
        assert counts[5] == 0  # lost
        assert alarms > 1


@pytest.mark.parametrize("name", FAULTS)
def test_cases_drawn_at_random(name: str, folder: Path) -> None:
    """Samples, saved states and the order of calls, changed at random from a seed; `make fuzz` takes longer."""
    seconds, seed = os.environ.get("FAULTBOND_FUZZ", "2 1").split()
    assert ran(*driver(name, folder)[:1], "fuzz", driver(name, folder)[1], seconds, seed).split()


@pytest.mark.parametrize(("name", "seed"), [(line[0].replace("_", " "), int(line[1])) for line in CORPUS])
def test_cases_that_once_failed(name: str, seed: int, folder: Path) -> None:
    """Cases in which something was wrong once."""
    executable, recording = driver(name, folder)
    ran(executable, "case", recording, seed)
