"""The core in C: any compiler takes it without a word, and however many lanes it computes at a time, digits agree."""

import platform
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.ladders import ladder_text

from compiled_once import compiled_once
from dense_filter import dense_filter
from driven import CORE, EXAMPLES, made, program, ran, text_of, write_recording
from faultbond.arrays import FloatArray
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec, covariance_place
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.io.cache import loadable
from faultbond.model.text import load_model, parse_model
from faultbond.simulate import Fault
from faultbond.synthesis.compile import TIDY, ZIG, ZIG_FLAGS, compile_core, required_compiler
from faultbond.synthesis.engine import build_engine
from faultbond.synthesis.model_text import core_text, model_text
from faultbond.synthesis.specify import build_spec
from lanes import relinearised, slot_lanes
from plants import NINE_SENSORS

# All but that wide lanes are handed on otherwise where the processor has no such registers.
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wno-psabi", "-Werror")
LANGUAGES = {"gcc": ("gcc", "-x", "c", "-std=c99"), "g++": ("g++", "-x", "c++", "-std=c++17")}
# In one text with the model, what the model does not need is unused; clang says so of inline functions too.
CLANG = (*ZIG, *ZIG_FLAGS, "-Wno-unused-function")
LANGUAGES |= {"zig": (*CLANG, "-x", "c", "-std=c99"), "zig, C++": (*CLANG, "-x", "c++", "-std=c++17")}
PLANTS = ("tank", "three_tank", "loop", "no input", "no state", "reserve")
FAULTS = {
    "tank": Fault(parameter="K1", factor=3.0, start=230.0),
    "loop": Fault(parameter="R1", factor=2.0, start=20.0),
}
# What has the digits of one lane in C: each width and language by one of these plants, vectors by both.
WIDTHS = {"tank": (("gcc", 2), ("gcc", 8)), "loop": (("gcc", 4), ("g++", 8))}

needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None or shutil.which("g++") is None, reason="no gcc")
needs_zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")


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
    samples[:, place["fresh"]] = spec.input_variance
    return relinearised(spec, samples)


in_each_language = pytest.mark.parametrize(
    "language", [pytest.param(name, marks=needs_zig if "zig" in name else needs_gcc) for name in LANGUAGES]
)
# That of zig has to write something, too: what it has read; zig itself adds an option that nothing needs then.
READ = {
    name: ("-O0", "-S", "-emit-llvm", "-Wno-unused-command-line-argument") if "zig" in name else ("-fsyntax-only",)
    for name in LANGUAGES
}


@in_each_language
@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("width", [1, 8])
def test_no_compiler_has_a_word_to_say(name: str, language: str, width: int, tmp_path: Path) -> None:
    """The core of every sort of model is C99 that is C++17 too, without a warning, also where inputs or states lack.

    What only an optimising compiler sees, gcc sees in each language and width of one model, and in each model once; the
    others are read only. Clang warns of what it reads.
    """
    once = "zig" not in language and (name == "tank" or (language, width) == ("gcc", 8))
    flags = (*(("-O1", "-S") if once else READ[language]), f"-DFB_LANES={width}", "-march=native")
    compiled_once(text_of(name)[1], tmp_path / "core.s", [*LANGUAGES[language], *WARNINGS, *flags, f"-I{CORE}"])


@in_each_language
@pytest.mark.parametrize("name", ["loop", "no input", "no state"])
@pytest.mark.parametrize("width", [1, 8])
def test_no_compiler_has_a_word_to_say_of_fleets(name: str, language: str, width: int, tmp_path: Path) -> None:
    """A core that serves fleets, with its threads in the same text, is C99 that is C++17 too, without a warning."""
    flags = (*READ[language], "-DFB_FLEETS", f"-DFB_LANES={width}", "-march=native")
    text = text_of(name)[1] + '#include "threads.c"\n'
    compiled_once(text, tmp_path / "core.s", [*LANGUAGES[language], *WARNINGS, *flags, f"-I{CORE}"])


@needs_gcc
@pytest.mark.skipif(platform.machine() != "x86_64", reason="its options are of this processor")
@pytest.mark.parametrize(("option", "width"), [("-mno-avx", 2), ("-mavx2", 4), ("-mavx512f", 8)])
def test_lanes_are_as_many_as_a_register_holds(option: str, width: int) -> None:
    """Registers of 128, 256 and 512 bits hold 2, 4 and 8 of them."""
    command = ["gcc", "-march=x86-64", option, "-dM", "-E", str(CORE / "port.h")]
    told = subprocess.run(command, capture_output=True, text=True, check=True)
    assert f"#define FB_LANES {width}\n" in told.stdout


@needs_gcc
@pytest.mark.parametrize(("name", "others"), WIDTHS.items())
def test_every_width_and_language_has_the_same_digits(
    name: str, others: tuple[tuple[str, int], ...], tmp_path: Path
) -> None:
    """Where products and sums are not fused, a whole run has the same reports, diagnoses and states to the last bit.

    With 1, 2, 4 and 8 lanes at a time, as C and as C++: start, alarm, renewals, a rejected and an accepted candidate.
    """
    recording, found = write_recording(tmp_path / "recording", made(name, 600, FAULTS[name])), []
    for language, width in (("gcc", 1), *others):
        out = tmp_path / f"{language}{width}"
        flags = ("-Og", TIDY, "-march=native", "-ffp-contract=off", f"-DFB_LANES={width}")
        command = [word.replace("std=c", "std=gnu") for word in LANGUAGES[language]]
        said = ran(program(name, tmp_path, command, *flags), "whole", recording, out)
        alarms, diagnoses, decisions = map(int, said.split())
        assert alarms >= 1
        assert diagnoses >= 14
        assert decisions == 2
        found.append(np.frombuffer(out.read_bytes(), dtype="<f8"))  # whole numbers are compared as bits
    assert len(found[0]) > 10**5
    assert np.isfinite(found[0]).mean() > 0.9
    assert [np.array_equal(content, found[0], equal_nan=True) for content in found] == [True] * len(found)


STACK = """\
import ctypes, sys, threading
core, (n_u, n_y) = ctypes.CDLL(sys.argv[1]), map(int, sys.argv[2:])
kept = []
def room(name):
    size = getattr(core, f"fb_{name}_size")
    size.restype = ctypes.c_int64
    kept.append((ctypes.c_char * (size() + 64))())
    return ctypes.c_void_p(ctypes.addressof(kept[-1]) + 63 & -64)
state, work, report, found = map(room, ("state", "work", "report", "diagnosis"))
def run():
    core.fb_init(state, ctypes.c_double(0.0), ctypes.c_int64(0))
    for k in range(30):
        sample = (ctypes.c_double * (2 + n_u + n_y))(k, 1.0, *[1.0] * n_u, *[0.5] * n_y)
        core.fb_step(state, work, sample, report, found)
    print(ctypes.cast(report, ctypes.POINTER(ctypes.c_int64))[0], core.fb_work_size())
threading.stack_size(2**18)
thread = threading.Thread(target=run)
thread.start()
thread.join()
"""


def test_a_large_model_needs_no_large_stack() -> None:
    """Twenty stores run in a thread with a stack of a quarter of a megabyte; a call needs many times as much memory."""
    plant = build_plant(parse_model(ladder_text(20).replace("1 s", "1 s\nmax_faults: 1", 1)))
    spec, wide = build_spec(build_step_model(plant)), build_step_model(plant, all_inputs=True)
    with loadable([compile_core(model_text(spec, wide), required_compiler())]) as (library,):
        command = [sys.executable, "-c", STACK, str(library.resolve()), str(len(spec.inputs)), str(len(spec.outputs))]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    status, size = map(int, done.stdout.split())
    assert status >= 2
    assert size > 2**21


def test_lanes_know_nothing_of_each_other() -> None:
    """A lane has the same numbers whichever lanes are computed beside it, and where it stands among them."""
    spec, core = build_engine(load_model(EXAMPLES / "tank" / "model.yaml"))
    samples, n_x, plan = samples_of(spec, 50), len(spec.states), plan_slots(spec)
    healthy = core.healthy_lane(np.full(n_x, 0.5), np.diag(np.full(n_x, 0.1)))[:, 0]
    readings = np.ones(len(spec.outputs))
    inputs = np.ones(len(spec.inputs))
    lanes = slot_lanes(spec, plan, range(plan.n_lanes), healthy, inputs, readings, inputs)
    order = np.random.default_rng(1).permutation(lanes.shape[1])
    whole, shuffled = core.slot.advance(lanes, samples)[0], core.slot.advance(lanes[:, order], samples)[0]
    assert np.array_equal(whole[:, order], shuffled, equal_nan=True)
    assert np.array_equal(core.slot.advance(lanes[:, 5:6], samples)[0][:, 0], whole[:, 5], equal_nan=True)


def test_a_course_is_what_samples_give_one_by_one() -> None:
    """The numbers of a lane after each sample, and its innovations, are those of lanes side by side, one by one."""
    spec, core = build_engine(load_model(EXAMPLES / "tank" / "model.yaml"))
    samples, n_x = samples_of(spec, 50), len(spec.states)
    lane = core.healthy_lane(np.full(n_x, 0.5), np.diag(np.full(n_x, 0.1)))
    now = np.repeat(lane, 2, axis=1)
    end, numbers, innovations = core.course(lane, samples, spec.slow_slice)
    assert len(numbers[0])
    for k in range(len(samples)):
        now, found = core.advance(now, samples[k : k + 1])
        assert np.array_equal(numbers[k], now[spec.slow_slice, 0]), k
        assert np.array_equal(innovations[k], found[0, :, 0]), k
    assert np.array_equal(end[:, 0], now[:, 0])
    assert np.array_equal(core.advance(lane, samples)[0], end)
    assert core.course(lane, samples[:0], spec.slow_slice)[1].shape == (0, len(numbers[0]))


def test_many_precise_sensors_tell_what_they_tell_one_by_one() -> None:
    """From a start a hundred million times as wide as the noise, nine sensors end as in the textbook filter."""
    graph = parse_model(NINE_SENSORS)
    spec, core = build_engine(graph)
    _, dense = dense_filter(graph)
    samples, place = samples_of(spec, 40), spec.sample_fields
    samples[:, place["u"]] = samples[:, place["u_before"]] = 1.0
    samples[:, place["use"]] = samples[:, place["again"]] = samples[:, place["y"]] = 0.0
    expected = -dense.advance(core.healthy_lane(np.full(2, 0.5), np.eye(2) * 1e-20), samples)[1][:, :9, 0]
    samples[:, place["y"]] = expected + spec.output_noise * np.random.default_rng(0).standard_normal((40, 9))
    samples[:, place["use"]] = 1.0
    lane = core.healthy_lane(np.full(2, 0.5), np.eye(2) * 1e10)
    one, two = core.advance(lane, samples)[0], dense.advance(lane, samples)[0]
    variances = [covariance_place(spec, k, k) for k in range(spec.n_joint)]
    assert one[variances] == pytest.approx(two[variances], rel=0.01)
    assert np.max(np.abs(one[: spec.n_joint] - two[: spec.n_joint]) / np.sqrt(two[variances])) < 0.02


def test_steps_of_different_length_in_a_linear_plant() -> None:
    """What is worked out once for a length of step is so anew for another, and at the first sample of a block."""
    graph = load_model(EXAMPLES / "three_tank" / "model.yaml")
    spec, core = build_engine(graph)
    _, dense = dense_filter(graph)
    assert "#define RATES_ARE_LINEAR 1" in text_of("three_tank")[1]
    samples, n_x = samples_of(spec, 24), len(spec.states)
    samples[:, spec.sample_fields["dt"]] *= np.resize([1.0, 0.3, 2.5, 2.5, 0.0, 1.0], (24, 1))
    one = two = core.healthy_lane(np.full(n_x, 0.5), np.diag(np.full(n_x, 0.1)))
    for block in np.split(samples, 4):
        one, two = core.advance(one, block)[0], dense.advance(two, block)[0]
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
    text = (EXAMPLES / "tank" / "model.yaml").read_text(encoding="utf-8")
    graph = parse_model(re.sub(r"^name: .*$", 'name: "*/ int x; /*"', text, flags=re.MULTILINE))
    plant = build_plant(graph)
    text = core_text(build_spec(build_step_model(plant)), build_step_model(plant, all_inputs=True))
    assert "int x;" not in text
    assert text == text_of("tank")[1]


def test_the_page_of_the_core_names_all_files() -> None:
    """Who reads from its first line on comes by each of them."""
    page = (CORE / "core.c").read_text(encoding="utf-8").partition("*/")[0]
    names = {path.name for path in CORE.iterdir() if path.suffix in {".c", ".h"}} - {"core.c"}
    assert {name for name in names if name not in page} == set()
