"""The core of a model as a program, by `tests/fuzz/drive.c`: runs with sanitizers, other compilers and widths."""

import subprocess
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from benchmarks.shared.ladders import ladder_text

from compiled_once import compiled_once
from faultbond.contract.samples import Sample
from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model, parse_model
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.model_text import core_text
from faultbond.synthesis.specify import build_spec
from plants import LAMP

TESTS = Path(__file__).parents[1]
EXAMPLES = TESTS.parent / "examples"
CORE = TESTS.parent / "src" / "faultbond" / "core"
DRIVE = TESTS / "fuzz" / "drive.c"

NO_INPUT = """\
name: cooling
sample_time: 1 s
max_faults: 1
components:
  body: {type: C, parameters: {C1: 2 F}, start: {q: 6 C, sd: 1 C}}
  air: {type: R, parameters: {R1: 40 ohm}}
junctions: {node: 0}
bonds: [node -> body, node -> air]
sensors: {e: {reads: node.e, unit: V, noise: 2 mV}, f: {reads: air.f, unit: A, noise: 1 mA}}
"""
NO_STATE = """\
name: divider
sample_time: 0.1 s
max_faults: 1
inputs: {V: {unit: V, noise: 5 mV}}
components:
  source: {type: Se, law: e = V}
  upper: {type: R, parameters: {R1: 10 ohm}}
  lower: {type: R, parameters: {R2: 20 ohm}}
junctions: {loop: 1}
bonds: [source -> loop, loop -> upper, loop -> lower]
sensors: {v: {reads: lower.e, unit: V, noise: 10 mV}, i: {reads: loop.f, unit: A, noise: 1 mA}}
"""


@cache
def graph_of(name: str) -> BondGraph:
    """A built-in plant, or one with something special."""
    linear = LAMP.replace("noise: 1 mV}", "noise: 1 mV, hold: linear, lag: 0.5 s}")
    smooth = LAMP.replace("noise: 1 mV}", "noise: 1 mV, noise_of: record}")
    made = {
        "loop": LAMP,
        "linear": linear,
        "smooth": smooth,
        "no input": NO_INPUT,
        "no state": NO_STATE,
        "ladder": ladder_text(3),
    }
    if name in made:
        return parse_model(made[name])
    if name == "tied":  # the motor, whose parameters go together
        text = (EXAMPLES / "dc_motor_current" / "model.yaml").read_text()
        return parse_model(f"{text}correlations: {{K: {{J: 0.95, L: 0.9}}, L: {{J: 0.9}}, R: {{C: -0.5}}}}\n")
    return load_model(EXAMPLES / ("dc_motor_current" if name == "reserve" else name) / "model.yaml")


@cache
def text_of(name: str) -> tuple[EngineSpec, str]:
    """The specification of a plant, and its core as one text."""
    plant = build_plant(graph_of(name))
    spec = build_spec(build_step_model(plant))
    if name == "reserve":  # all pairs and triples wait
        later = tuple(chosen for chosen in spec.hypotheses if len(chosen) > 1)
        begun = tuple(chosen for chosen in spec.hypotheses if len(chosen) == 1)
        spec = replace(spec, hypotheses=begun, reserve=later)
        assert spec.reserve
    return spec, core_text(spec, build_step_model(plant, all_inputs=True))


def program(name: str, folder: Path, command: Sequence[str], *flags: str) -> Path:
    """The core of a plant as a program."""
    words = [*command, *flags, f"-I{CORE}", f"-I{DRIVE.parent}"]
    return compiled_once(text_of(name)[1] + '#include "drive.c"\n', folder / "drive", words)


def ran(driver: Path, *words: object) -> str:
    """Run a program to its end, and give what it says; nothing may be wrong."""
    environment = {"ASAN_OPTIONS": "detect_leaks=0:abort_on_error=0", "UBSAN_OPTIONS": "print_stacktrace=1"}
    done = subprocess.run([str(driver), *map(str, words)], capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, (done.stdout[-300:], done.stderr[:4000])
    return done.stdout


def write_recording(path: Path, samples: Sequence[Sample]) -> Path:
    """Write samples as the program reads them."""
    rows = np.array([[item.time, item.dt, *item.u, *item.y] for item in samples], dtype="<f8")
    path.write_bytes(np.array([len(rows)], dtype="<i8").tobytes() + rows.tobytes())
    return path


@cache
def made(name: str, rows: int, fault: Fault | None = None, seed: int = 2) -> tuple[Sample, ...]:
    """Samples of a plant with noise, inputs stepping at random, and perhaps a fault."""
    graph, generator = graph_of(name), np.random.default_rng(seed + 4)
    dt = graph.sample_time or 1.0
    time = np.asarray(np.arange(rows) * dt, dtype=np.float64)
    ranges = {"percent": (30.0, 90.0, 30.0)}  # by unit: lowest, highest, shortest step, s
    columns = []
    for item in graph.inputs:
        low, high, shortest = ranges.get(item.unit.text, (2.0, 12.0, 20.0 * dt))
        columns.append(random_steps(time, generator, low=low, high=high, shortest=shortest, longest=3.0 * shortest))
    inputs = Inputs(time=time, values=np.array(columns).reshape(-1, rows).T)
    start = {"tank.q": 0.2} if name == "tank" else None
    found = simulate(graph, inputs, [fault] if fault else [], seed=seed, start=start)
    steps = np.diff(time, prepend=time[0])
    return tuple(
        Sample(time=float(time[k]), dt=float(steps[k]), u=found.inputs[k], y=found.outputs[k]) for k in range(rows)
    )
