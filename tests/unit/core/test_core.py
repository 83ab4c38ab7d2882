"""The core in C: any compiler takes it without a word, and however many lanes it computes at a time, digits agree."""

import ctypes
import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.ladders import ladder_text

from faultbond.arrays import FloatArray
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec, covariance_place
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.text import load_model, parse_model
from faultbond.runtime.library import LANES, load_engine
from faultbond.runtime.slotted import slot_lanes
from faultbond.runtime.start import healthy_lane
from faultbond.runtime.stepped import relinearised
from faultbond.synthesis.compile import compile_library, find_compiler
from faultbond.synthesis.engine import build_engine
from faultbond.synthesis.model_text import core_text, model_text
from faultbond.synthesis.specify import build_spec

EXAMPLES = Path(__file__).parents[3] / "examples"
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-O1")
LANGUAGES = {"gcc": ("gcc", "-x", "c", "-std=gnu99"), "g++": ("g++", "-x", "c++", "-std=gnu++17")}
LOOP = """\
name: lamp
sample_time: 0.1 s
constants: {Vt: 0.1 V}
inputs: {V: {unit: V, noise: 1 mV}}
components:
  source: {type: Se, law: e = V}
  series: {type: R, parameters: {R1: 10 ohm}}
  cell: {type: C, parameters: {C1: 0.1 F}}
  wire: {type: R, parameters: {R2: 5 ohm}}
  lamp: {type: R, parameters: {Is: 1e-6 A}, law: "f = Is*(exp(e/Vt) - 1)"}
junctions: {first: 1, node: 0, branch: 1}
bonds: [source -> first, first -> series, first -> node, node -> cell, node -> branch, branch -> wire, branch -> lamp]
sensors: {i: {reads: branch.f, unit: A, noise: 1 mA}, v: {reads: node.e, unit: V, noise: 10 mV}}
"""
NINE_SENSORS = """\
name: two cells
sample_time: 0.1 s
inputs: {V: {unit: V, noise: 1 mV}}
components:
  source: {type: Se, law: e = V}
  r1: {type: R, parameters: {R1: 10 ohm}}
  c1: {type: C, parameters: {C1: 1 F}}
  r2: {type: R, parameters: {R2: 10 ohm}}
  c2: {type: C, parameters: {C2: 1 F}}
junctions: {a: 1, n: 0, b: 1, m: 0}
bonds: [source -> a, a -> r1, a -> n, n -> c1, n -> b, b -> r2, b -> m, m -> c2]
sensors:
  s0: {reads: a.f, unit: A, noise: 1 mA}
  s1: {reads: n.e, unit: V, noise: 1 mV}
  s2: {reads: m.e, unit: V, noise: 2 mV}
  s3: {reads: b.f, unit: A, noise: 1 mA}
  s4: {reads: r1.e, unit: V, noise: 1 mV}
  s5: {reads: r2.e, unit: V, noise: 1 mV}
  s6: {reads: n.e, unit: V, noise: 5 mV}
  s7: {reads: c1.f, unit: A, noise: 1 mA}
  s8: {reads: m.e, unit: V, noise: 1 mV}
"""

needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None or shutil.which("g++") is None, reason="no gcc")


@cache
def texts(name: str) -> tuple[EngineSpec, str, str]:
    """The specification of a plant, and its core for lanes without and with a slot."""
    graph = parse_model(LOOP) if name == "loop" else load_model(EXAMPLES / name / "model.yaml")
    plant = build_plant(graph)
    spec, wide = build_spec(build_step_model(plant)), build_step_model(plant, all_inputs=True)
    return spec, core_text(spec, wide), core_text(spec.slotted, wide)


def samples_of(spec: EngineSpec, rows: int) -> FloatArray:
    """Packed samples as no plant makes them, some of them wild, some not there."""
    generator, place = np.random.default_rng(3), spec.sample_fields
    samples = np.zeros((rows, spec.n_sample))
    samples[1:, place["dt"]] = spec.sample_time or 1.0
    samples[:, place["u"]] = generator.uniform(1.0, 3.0, (rows, len(spec.inputs)))
    samples[1:, place["u_before"]] = samples[:-1, place["u"]]
    samples[:, place["y"]] = generator.normal(0.1, 1.0, (rows, len(spec.outputs)))
    samples[:, place["use"]] = generator.random((rows, len(spec.outputs))) > 0.2
    samples[:, place["scale"]] = 1.0
    return relinearised(spec, samples)


def slots_of(spec: EngineSpec, samples: FloatArray) -> FloatArray:
    """Lanes of every kind of fault that is no step."""
    n_x, plan = len(spec.states), plan_slots(spec)
    healthy = healthy_lane(spec, np.full(n_x, 0.5), np.diag(np.full(n_x, 0.1)))[:, 0]
    return slot_lanes(spec, plan, range(plan.n_lanes), healthy, samples[:1], np.ones(len(spec.inputs)))


def advanced(library: Path, spec: EngineSpec, lanes: FloatArray, samples: FloatArray) -> FloatArray:
    """Lanes after samples, by a library for any number of lanes; padded to eight, which every width divides."""
    padded = np.ascontiguousarray(np.resize(lanes.T, (-(-lanes.shape[1] // LANES) * LANES, len(lanes))).T)
    innovations = np.empty((len(samples), 2 * len(spec.outputs), padded.shape[1]))
    rows = np.ascontiguousarray(samples)
    counts = (ctypes.c_int64(padded.shape[1]), ctypes.c_int64(len(rows)))
    arrays = (ctypes.c_void_p(item.ctypes.data) for item in (rows, padded, innovations))
    ctypes.CDLL(str(library)).faultbond_advance(*counts, *arrays, None)
    return np.concatenate([padded, innovations.reshape(-1, padded.shape[1])])


def compiled(text: str, folder: Path, name: str, command: Sequence[str]) -> Path:
    """Compile a text with a command; its messages are the failure."""
    source, library = folder / f"{name}.c", folder / f"{name}.so"
    source.write_text(text)
    done = subprocess.run(
        [*command, "-shared", "-fPIC", str(source), "-o", str(library), "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return library


@needs_gcc
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", ["tank", "three_tank", "loop"])
@pytest.mark.parametrize("width", [1, 8])
def test_no_compiler_has_a_word_to_say(name: str, language: str, width: int, tmp_path: Path) -> None:
    """As C99 and as C++17 the core of linear, other and looped plants compiles without a warning, of any width."""
    for text in texts(name)[1:]:
        compiled(text, tmp_path, "core", [*LANGUAGES[language], *WARNINGS, f"-DFB_LANES={width}", "-march=native"])


@needs_gcc
@pytest.mark.parametrize("name", ["dc_motor_current", "loop"])
def test_every_width_has_the_same_digits(name: str, tmp_path: Path) -> None:
    """Where products and sums are not fused, 1, 2, 4 and 8 lanes at a time give the same numbers to the last bit."""
    spec, _, text = texts(name)
    samples = samples_of(spec, 200)
    lanes, found = slots_of(spec, samples), []
    for width in (1, 2, 4, 8):
        flags = ("-O2", "-march=native", "-ffp-contract=off", f"-DFB_LANES={width}")
        library = compiled(text, tmp_path, f"core{width}", [*LANGUAGES["gcc"], *flags])
        found.append(advanced(library, spec.slotted, lanes, samples))
    assert np.isfinite(found[0]).any()
    assert all(np.array_equal(found[0], other, equal_nan=True) for other in found[1:])


@needs_gcc
@pytest.mark.parametrize("name", ["tank", "loop"])
def test_nothing_undefined_happens(name: str, tmp_path: Path) -> None:
    """A build that stops at undefined behaviour runs through values without end, none, and the largest there are."""
    spec, _, text = texts(name)
    flags = ("-O1", "-march=native", "-fsanitize=undefined,float-cast-overflow", "-fno-sanitize-recover=all")
    library = compiled(text, tmp_path, "core", [*LANGUAGES["gcc"], *flags])
    samples = samples_of(spec, 60)
    wild = np.array([np.nan, np.inf, -np.inf, 1e300, -1e300, 5e-324])
    samples[10:40, spec.sample_fields["y"]] = np.resize(wild, (30, len(spec.outputs)))
    samples[20:30, spec.sample_fields["u"]] = np.resize(wild, (10, len(spec.inputs)))
    advanced(library, spec.slotted, slots_of(spec, samples), samples)


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
def test_lanes_know_nothing_of_each_other() -> None:
    """A lane has the same numbers whichever lanes are computed beside it, and where it stands among them."""
    spec, _, text = texts("tank")
    compiler = find_compiler()
    assert compiler is not None
    engine = load_engine(compile_library(text, compiler), 2 * len(spec.outputs), compiler[0])
    samples = samples_of(spec, 50)
    lanes = slots_of(spec, samples)
    order = np.random.default_rng(1).permutation(lanes.shape[1])
    whole, shuffled = engine.advance(lanes, samples)[0], engine.advance(lanes[:, order], samples)[0]
    assert np.array_equal(whole[:, order], shuffled, equal_nan=True)
    assert np.array_equal(engine.advance(lanes[:, 5:6], samples)[0][:, 0], whole[:, 5], equal_nan=True)


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
def test_a_large_model_needs_no_large_stack() -> None:
    """Eighty stores run in a thread with a stack of a megabyte; each sample needs many times as much memory."""
    plant = build_plant(parse_model(ladder_text(80)))
    spec, wide = build_spec(build_step_model(plant)), build_step_model(plant, all_inputs=True)
    compiler = find_compiler()
    assert compiler is not None
    library = compile_library(core_text(spec, wide), compiler)
    script = (
        "import sys, threading, numpy as np\n"
        "from pathlib import Path\n"
        "from faultbond.runtime.library import load_engine\n"
        "engine = load_engine(Path(sys.argv[1]), 2 * int(sys.argv[4]), 'cc')\n"
        "lanes, samples = np.ones((int(sys.argv[2]), 8)), np.ones((2, int(sys.argv[3])))\n"
        "def run(): print(engine.advance(lanes, samples)[0].shape[1], engine.work_size)\n"
        "threading.stack_size(2**20)\n"
        "thread = threading.Thread(target=run)\n"
        "thread.start()\n"
        "thread.join()\n"
    )
    sizes = [str(size) for size in (spec.n_numbers, spec.n_sample, len(spec.outputs))]
    command = [sys.executable, "-c", script, str(library), *sizes]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    lanes, size = map(int, done.stdout.split())
    assert lanes == 8
    assert size > 2**20


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
def test_many_precise_sensors_tell_what_they_tell_one_by_one() -> None:
    """From a start a hundred million times as wide as the noise, nine sensors end as in the filter that needs no C."""
    graph = parse_model(NINE_SENSORS)
    spec, engine = build_engine(graph)
    _, machine = build_engine(graph, compiled=False)
    samples, place = samples_of(spec, 40), spec.sample_fields
    samples[:, place["u"]] = samples[:, place["u_before"]] = 1.0
    samples[:, place["use"]] = samples[:, place["again"]] = samples[:, place["y"]] = 0.0
    expected = -machine.advance(healthy_lane(spec, np.full(2, 0.5), np.eye(2) * 1e-20), samples)[1][:, :9, 0]
    samples[:, place["y"]] = expected + spec.output_noise * np.random.default_rng(0).standard_normal((40, 9))
    samples[:, place["use"]] = 1.0
    lane = healthy_lane(spec, np.full(2, 0.5), np.eye(2) * 1e10)
    one, two = engine.advance(lane, samples)[0], machine.advance(lane, samples)[0]
    variances = [covariance_place(spec, k, k) for k in range(spec.n_joint)]
    assert one[variances] == pytest.approx(two[variances], rel=0.01)
    assert np.max(np.abs(one[: spec.n_joint] - two[: spec.n_joint]) / np.sqrt(two[variances])) < 0.02


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
def test_steps_of_different_length_in_a_linear_plant() -> None:
    """What is worked out once for a length of step is so anew for another, and at the first sample of a block."""
    graph = load_model(EXAMPLES / "three_tank" / "model.yaml")
    spec, engine = build_engine(graph)
    _, machine = build_engine(graph, compiled=False)
    assert "#define RATES_ARE_LINEAR 1" in texts("three_tank")[1]
    samples, n_x = samples_of(spec, 24), len(spec.states)
    samples[:, spec.sample_fields["dt"]] *= np.resize([1.0, 0.3, 2.5, 2.5, 0.0, 1.0], (24, 1))
    one = two = healthy_lane(spec, np.full(n_x, 0.5), np.diag(np.full(n_x, 0.1)))
    for block in np.split(samples, 4):
        one, two = engine.advance(one, block)[0], machine.advance(two, block)[0]
        assert one == pytest.approx(two, rel=1e-8, abs=1e-10 * np.abs(two).max())


def test_the_text_grows_with_the_number_of_laws() -> None:
    """Twice the sections of a ladder make twice the rates and readings; nothing is unrolled over pairs or triples."""
    lengths = []
    for sections in (5, 10, 20):
        plant = build_plant(parse_model(ladder_text(sections)))
        wide = build_step_model(plant, all_inputs=True)
        text = model_text(build_spec(build_step_model(plant)), wide)
        lengths.append(len(text[text.index("static void") :]))
    assert lengths[1] < 2.3 * lengths[0]
    assert lengths[2] < 2.3 * lengths[1]


def test_no_word_of_the_user_stands_in_the_text() -> None:
    """A model whose names would end a comment in C cannot bring code of its own into the engine."""
    graph = parse_model(LOOP.replace("name: lamp", 'name: "*/ int x; /*"'))
    plant = build_plant(graph)
    text = core_text(build_spec(build_step_model(plant)), build_step_model(plant, all_inputs=True))
    assert "int x;" not in text
    assert text == texts("loop")[1]
