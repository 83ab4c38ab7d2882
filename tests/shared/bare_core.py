"""Cores with calls of a test's own around what their files hold, and the numbers of a state by name."""

import ctypes
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compiled_once import compiled_once
from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec, covariance_place
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.synthesis.compile import CORE, TIDY, ZIG, ZIG_FLAGS, required_compiler
from faultbond.synthesis.model_text import core_text
from faultbond.synthesis.specify import build_spec

CELL = """\
name: cell
sample_time: 0.5 s
max_faults: 1
inputs: {V: {unit: V, settling: 3 s}, W: {unit: A}}
components:
  source: {type: Se, law: e = V}
  more: {type: Sf, law: f = W}
  series: {type: R, parameters: {R1: 10 ohm}}
  cell: {type: C, parameters: {C1: 1 F}}
junctions: {first: 1, node: 0}
bonds: [source -> first, first -> series, first -> node, node -> cell, more -> node]
sensors: {i: {reads: first.f, unit: A, noise: 5 mA}, v: {reads: node.e, unit: V, noise: 10 mV}}
slow_error: {first.f: 1 % over 20 s}
"""
FOLLOWING = CELL.replace(
    "1 % over 20 s}", "1 % over 20 s, v: {size: 1 mV over 6 s, after: [V, W], each: [2 mV/V, 30 mV/A]}}"
)
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
PARTLY = (  # a test takes a part of all; gcc guesses at -O0, and clang does not know of what
    *("-Wno-unused-function", "-Wno-unused-const-variable", "-Wno-psabi"),
    *("-Wno-stringop-overread", "-Wno-unknown-warning-option", "-Wno-ignored-optimization-argument"),
)
FLAGS = ("-Og", TIDY, "-march=native", "-ffp-contract=off", *WARNINGS, *PARTLY, "-shared", "-fPIC", f"-I{CORE}")
IN_C, IN_CPP = ("-x", "c", "-std=c99"), ("-x", "c++", "-std=c++17")
# Of the core's own calls those that tests use; the others are static here, so that what only they need is not compiled.
OFFERED = ("fb_init", "fb_field", "fb_lane", "fb_restore", "fb_state_size", "fb_work_size")
CALL = re.compile(r"^\w+ \*?(fb_\w+)\([^;]*\);", re.MULTILINE)


@cache
def compiled(text: str, *options: str, offered: tuple[str, ...] = OFFERED) -> ctypes.CDLL:
    """The library of a text, such as `core_text` and `in_c`; a word of the compiler's is the failure.

    options : how many lanes at a time, and the language, C unless it is told
    offered : what of the core's own calls the library has
    """
    compiler = required_compiler()
    language = () if "-x" in options else IN_C
    more = ZIG_FLAGS if compiler == ZIG else ()
    if compiler != ZIG and "c++" in options:
        compiler = ("g++",)
    with TemporaryDirectory() as folder:
        command = [*compiler, *language, *FLAGS, *options, *more]
        return ctypes.CDLL(str(compiled_once(_without(offered) + text, Path(folder, "bare.so"), command)))


def in_c(calls: str) -> str:
    """Functions of a test's own, which are called as C in C++ too."""
    return f'#ifdef __cplusplus\nextern "C" {{\n#endif\n{calls}\n#ifdef __cplusplus\n}}\n#endif\n'


def _without(offered: tuple[str, ...]) -> str:
    """All other calls of the core, declared for this text alone."""
    header = (Path(str(CORE)) / "fb.h").read_text(encoding="utf-8")
    hidden = (found[0] for found in CALL.finditer(header) if found[1] not in offered)
    return "#include <stdint.h>\n" + in_c("\n".join(f"static {call}" for call in hidden))


def text_of(model: str | BondGraph, calls: str) -> tuple[EngineSpec, str]:
    """The specification of a model file, and its core with such functions."""
    plant = build_plant(parse_model(model) if isinstance(model, str) else model)
    spec = build_spec(build_step_model(plant))
    return spec, core_text(spec, build_step_model(plant, all_inputs=True)) + in_c(calls)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bare:
    """A library of the core with some calls of a test's own, and a state of it."""

    spec: EngineSpec
    library: ctypes.CDLL
    state: FloatArray
    places: dict[str, slice]
    whole: frozenset[str]

    def __getitem__(self, name: str) -> Any:
        """The numbers of the state under a name, in place."""
        found = self.state[self.places[name]]
        return found.view(np.int64) if name in self.whole else found

    def __setitem__(self, name: str, values: Any) -> None:
        """Other numbers under a name."""
        self[name][:] = np.ravel(values)

    def saved(self) -> FloatArray:
        """All numbers of the state."""
        return self.state.copy()

    def call(self, name: str, *arrays: NDArray[Any] | None) -> int:
        """Call a function of the state and of arrays that it reads or fills."""
        function = self.library[name]
        function.restype = ctypes.c_int64
        return int(function(*map(at, (self.state, *arrays))))

    def restore(self, saved: NDArray[np.uint8]) -> None:
        """Take the state that a monitor of the same model saved."""
        assert self.library.fb_restore(at(self.state), at(saved), ctypes.c_int64(len(saved))) == 0

    def lane(self, number: int) -> FloatArray:
        """A lane of the bank; see `Monitor.lane`."""
        found = np.zeros(self.spec.slotted.n_numbers)
        self.library.fb_lane(at(self.state), ctypes.c_int64(number), at(found))
        return found

    def begin(self, x: FloatArray) -> None:
        """Let the healthy filter begin: states `x` (n_states,), known well, and nominal parameters."""
        spec, n_x = self.spec, len(self.spec.states)
        lane = np.zeros(spec.n_numbers)
        lane[:n_x], lane[spec.parameter_slice] = x, [item.healthy for item in spec.parameters]
        sd = [
            *(item.noise + 1e-3 for item in spec.states),
            *spec.slow_sizes,
            *(item.accuracy for item in spec.parameters),
        ]
        sd += [spec.inputs[k].noise for k in spec.noisy_inputs]
        for k, size in enumerate(sd):
            lane[covariance_place(spec, k, k)] = size**2
        self["healthy.lane"], self["clock.running"] = lane, 1


@cache
def _built(text: str, calls: str, *options: str) -> tuple[EngineSpec, ctypes.CDLL]:
    spec, source = text_of(text, calls)
    return spec, compiled(source, *options)


def bare(calls: str, text: str = CELL, *options: str) -> Bare:
    """The core of a model file with `calls`, functions in C, and a state before the first sample; see `compiled`."""
    spec, library = _built(text, calls, *options)
    name, found = ctypes.c_char_p(), [ctypes.c_int64() for _ in range(3)]
    places: dict[str, slice] = {}
    whole: set[str] = set()
    while library.fb_field(ctypes.c_int64(len(places)), ctypes.byref(name), *map(ctypes.byref, found)):
        (offset, count, is_whole), key = (item.value for item in found), (name.value or b"").decode()
        places[key] = slice(offset // 8, offset // 8 + count)
        whole |= {key} if is_whole else set()
    library.fb_state_size.restype = ctypes.c_int64
    made = Bare(
        spec=spec, library=library, state=aligned(library.fb_state_size()), places=places, whole=frozenset(whole)
    )
    library.fb_init(at(made.state), ctypes.c_double(0.0), ctypes.c_int64(0))
    return made


def aligned(size: int) -> FloatArray:
    """Memory of so many bytes that begins where a cache line does."""
    raw = np.zeros(size // 8 + 8)
    return raw[-raw.ctypes.data % 64 // 8 :][: size // 8]


def at(array: NDArray[Any] | None) -> ctypes.c_void_p:
    """Where an array begins; None is NULL."""
    return ctypes.c_void_p(None if array is None else array.ctypes.data)
