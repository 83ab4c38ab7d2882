"""How far parameters seem to change on healthy data, against plants of which that is known."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from faultbond.app.engine import build_watcher
from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample
from faultbond.fit.healthy_changes import Believed, healthy_changes, spread_beyond
from faultbond.fit.samples import HealthyRecording, healthy_recording
from faultbond.model.text import parse_model
from faultbond.model.units import unit
from faultbond.report.fit_result import spread_text
from faultbond.runtime.core import Core
from faultbond.synthesis.compile import find_compiler

MODEL = """name: winding
sample_time: 0.02 s
accuracy: 3 %
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 3 ohm}}
  L: {type: I, parameters: {L: 2 H}, start: {p: 0 V*s, sd: 0.001 V*s}}
junctions: {armature: 1}
bonds: [source -> armature -> R, armature -> L]
sensors: {i: {reads: armature.f, unit: A, noise: 20 mA}}
"""
NOISE, STEP, EACH = 0.02, 0.02, 500
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")


@pytest.fixture(scope="module")
def core() -> Core:
    """The core of a winding."""
    return build_watcher(parse_model(MODEL, file="winding.yaml"))


def recorded(
    core: Core, resistances: Sequence[float] | FloatArray, seed: int, noise: float = NOISE
) -> HealthyRecording:
    """A recording in which the resistance, ohm, is another one every 500 samples."""
    rng = np.random.default_rng(seed)
    points, current = [], 0.0
    course = np.repeat(resistances, EACH)
    voltage = np.repeat(rng.uniform(-6.0, 6.0, len(course) // 25 + 1), 25)[: len(course)]
    for k, resistance in enumerate(course):
        y = np.array([current + noise * rng.standard_normal()])
        points.append(Sample(time=k * STEP, dt=STEP, u=voltage[k : k + 1], y=y))
        decay = np.exp(-resistance / 2.0 * STEP)
        current = decay * current + (1.0 - decay) * voltage[k] / resistance
    return healthy_recording(f"{seed}", points, core)


@needs_compiler
def test_an_exact_model_does_not_seem_to_change(core: Core) -> None:
    """What its parameters are found off by is what their variances allow."""
    found = healthy_changes(core, [recorded(core, [3.0] * 8, seed) for seed in range(3)])
    assert found == {"R": 0.0, "L": 0.0, "i": 0.0, "V": 0.0}


@needs_compiler
def test_what_the_model_leaves_out_is_found(core: Core) -> None:
    """A resistance that is another one at other times seems to change by as much as it does; the inductance less."""
    rng = np.random.default_rng(7)
    courses = [3.0 + 0.3 * rng.standard_normal(12) for _ in range(3)]
    found = healthy_changes(core, [recorded(core, course, seed) for seed, course in enumerate(courses)])
    true = float(np.sqrt(np.mean([np.square(course - 3.0) for course in courses])))
    assert found["R"] == pytest.approx(true, rel=0.25)
    assert found["L"] / 2.0 < 0.5 * found["R"] / 3.0


@needs_compiler
@pytest.mark.parametrize("name", ["V", "i"])
def test_what_an_instrument_is_off_by_is_found(core: Core, name: str) -> None:
    """An input that acts by other volts than recorded, and a sensor that is off, another time by another size."""
    rng, sizes, offs, records = np.random.default_rng(8), {"V": 0.5, "i": 0.06}, list[float](), list[HealthyRecording]()
    for seed in range(3):
        record, off = recorded(core, [3.0] * 12, seed), sizes[name] * rng.standard_normal(12)
        offs += off.tolist()
        told = [
            replace(point, u=point.u - moved) if name == "V" else replace(point, y=point.y + moved)
            for point, moved in zip(record.points, np.repeat(off, EACH), strict=True)
        ]
        records.append(healthy_recording(record.name, told, core))
    found = healthy_changes(core, records)
    assert found[name] == pytest.approx(float(np.sqrt(np.mean(np.square(offs)))), rel=0.3)


@needs_compiler
def test_it_is_asked_of_the_model_as_fitted(core: Core) -> None:
    """Values, accuracies and noise that a fit found hold, not those of the file."""
    records = [recorded(core, [3.6] * 8, seed, noise=0.1) for seed in range(3)]
    assert healthy_changes(core, records)["R"] > 0.3
    believed = Believed(values={"R": 3.6}, accuracies={"R": 0.03}, noise={"i": 5.0})
    assert healthy_changes(core, records, believed)["R"] == 0.0
    without = Believed(values={"R": 3.6}, accuracies={"R": 0.03})
    assert healthy_changes(core, records, without)["R"] > 0.0


@needs_compiler
def test_of_too_few_samples_nothing_is_said(core: Core) -> None:
    """Four windows are the least, of 250 samples the shortest."""
    assert healthy_changes(core, [recorded(core, [3.0], 1)]) == {}
    assert set(healthy_changes(core, [recorded(core, [3.0], seed) for seed in range(4)])) == {"R", "L", "i", "V"}


@pytest.mark.parametrize("true", [0.0, 0.02, 0.1])
def test_the_spread_beyond_known_variances(true: float) -> None:
    """It makes the sum of squares as large as usual, and is 0 where that is not called for."""
    rng = np.random.default_rng(3)
    variance: FloatArray = rng.uniform(0.005, 0.05, 400) ** 2
    off = rng.standard_normal(400) * np.sqrt(variance + true**2)
    found = spread_beyond(off, variance)
    assert found == pytest.approx(true, rel=0.15)
    if found:
        assert np.sum(off**2 / (variance + found**2)) == pytest.approx(400.0, rel=1e-6)


def test_chance_is_no_spread() -> None:
    """Of exact models one in a hundred is taken for one that is not."""
    rng = np.random.default_rng(5)
    found = [spread_beyond(rng.standard_normal(8), np.ones(8)) for _ in range(4000)]
    assert np.mean(np.array(found) > 0.0) == pytest.approx(0.01, abs=0.005)


def test_a_change_of_more_than_the_value_itself_is_written_in_its_unit() -> None:
    """Per cent of a value that came near 0 say nothing, and what is written reads back as what was found."""
    ohm = unit("mohm")
    assert spread_text(0.0421, 3.0, ohm) == "1.5 %"
    assert spread_text(0.0421, 1e-4, ohm) == "43 mohm"
    told = f"{{nominal: 0.1 mohm, healthy_change: {spread_text(0.0421, 1e-4, ohm)}}}"
    text = MODEL.replace("{R: 3 ohm}", f"{{R: {told}}}")
    assert parse_model(text, file="winding.yaml").parameter("R").healthy_change == pytest.approx(0.043)
