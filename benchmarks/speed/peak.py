"""How near the filters of a bank come to what the processor can do: operations counted, and the peak of its FMA units.

Operations are counted by running the text of the filters itself with a number that counts: compiled as C++, one lane
wide, `lanes` being a class whose +, -, *, / and square root each add one. So a product that is added counts two, as an
FMA does; signs, comparisons and choices count nothing, nor does what is worked out once for all lanes.
"""

import ctypes
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.shared.turns import Work
from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.io.cache import loadable
from faultbond.model.graph import BondGraph
from faultbond.runtime.core import at
from faultbond.synthesis.compile import CORE, compile_library, required_compiler
from faultbond.synthesis.model_text import model_text

AT_ONCE = 16  # chains of FMAs that do not wait for each other
TIMES = 2_000_000
LANES_H = CORE / "lanes.h"
LANES_OF = "typedef double lanes;"  # in lanes.h, one lane wide
COUNTED = """
struct lanes {
    double value;
    lanes() = default;
    lanes(double a) : value(a) {}
    explicit operator double() const { return value; }
};
static long long counted;
#define OPERATION(sign) \\
    static inline lanes operator sign(lanes a, lanes b) { counted++; return lanes(a.value sign b.value); } \\
    static inline lanes &operator sign##=(lanes &a, lanes b) { return a = a sign b; }
#define COMPARISON(sign) static inline bool operator sign(lanes a, lanes b) { return a.value sign b.value; }
#define FUNCTION(name) static inline lanes name(lanes a) { counted++; return lanes(name(a.value)); }
OPERATION(+) OPERATION(-) OPERATION(*) OPERATION(/)
COMPARISON(<) COMPARISON(<=) COMPARISON(>) COMPARISON(>=) COMPARISON(==) COMPARISON(!=)
FUNCTION(sqrt) FUNCTION(exp) FUNCTION(log) FUNCTION(sin) FUNCTION(cos) FUNCTION(tan) FUNCTION(tanh)
static inline lanes operator-(lanes a) { return lanes(-a.value); }
static inline lanes pow(lanes a, lanes b) { counted++; return lanes(pow(a.value, b.value)); }
static inline lanes hypot(lanes a, lanes b) { counted++; return lanes(hypot(a.value, b.value)); }
"""
COUNT = """
#define FB_LANES 1
#include "filters.c"

static Filter_plain plain;
static Filter_wide wide;

extern "C" int64_t count(int is_wide, const double *sample, double *numbers, double *innovations)
{
    counted = 0;
    if (is_wide) filter_lanes_wide(1, 1, sample, numbers, innovations, 0, &wide);
    else filter_lanes_plain(1, 1, sample, numbers, innovations, 0, &plain);
    return counted;
}
"""
Count = Callable[[FloatArray, FloatArray], tuple[int, FloatArray]]
FMAS = f"""
typedef double lanes __attribute__((vector_size(64)));

double fmas(long n)
{{
    lanes sum[{AT_ONCE}], factor = {{0.0}}, more = {{0.0}};
    double all = 0.0;
    for (int l = 0; l < 8; l++) factor[l] = 0.999 - 0.001 * l, more[l] = 0.001 * l;
    for (int k = 0; k < {AT_ONCE}; k++) sum[k] = more * k;
    for (long t = 0; t < n; t++)
        for (int k = 0; k < {AT_ONCE}; k++) sum[k] = sum[k] * factor + more;
    for (int k = 0; k < {AT_ONCE}; k++)
        for (int l = 0; l < 8; l++) all += sum[k][l];
    return all;
}}
"""


def fma_peak() -> Work:
    """Give the work of FMAs on vectors as wide as the filters', compiled with their flags; of one operation."""
    with loadable([compile_library(FMAS, required_compiler())]) as (path,):
        fmas = ctypes.CDLL(str(path)).fmas
    fmas.argtypes, fmas.restype = [ctypes.c_long], ctypes.c_double
    return Work(prepare=partial(int, TIMES), run=fmas, count=2 * 8 * AT_ONCE * TIMES)


@contextmanager
def counting(graph: BondGraph, spec: EngineSpec) -> Iterator[Count]:
    """Give what counts the operations of samples in lanes of a model.

    Raises
    ------
    FileNotFoundError
        Where there is no C++ compiler, `c++`.
    subprocess.CalledProcessError
        Where it fails.
    LookupError
        Where the text of the lanes no longer reads as is expected.
    """
    model = model_text(spec, build_step_model(build_plant(graph), all_inputs=True))
    with tempfile.TemporaryDirectory() as folder:
        for item in CORE.iterdir():
            Path(folder, item.name).write_text(item.read_text(encoding="utf-8"), encoding="utf-8")
        lanes = Path(folder, "lanes.h")
        text = lanes.read_text(encoding="utf-8")
        if text.count(LANES_OF) != 1:
            raise LookupError(f"core/lanes.h: {LANES_OF!r} is there {text.count(LANES_OF)} times, not once")
        lanes.write_text(text.replace(LANES_OF, COUNTED), encoding="utf-8")
        Path(folder, "model.h").write_text(model, encoding="utf-8")
        source, built = Path(folder, "count.cpp"), Path(folder, "count.so")
        source.write_text(COUNT, encoding="utf-8")
        command = ("c++", "-std=c++17", "-O1", "-w", "-fPIC", "-shared", str(source), "-o", str(built), "-lm")
        subprocess.run(command, check=True)
        call = ctypes.CDLL(str(built)).count
        call.argtypes, call.restype = [ctypes.c_int, *[ctypes.c_void_p] * 3], ctypes.c_int64
        yield partial(_count, call, spec)


def _count(call: Callable[..., int], spec: EngineSpec, lane: FloatArray, sample: FloatArray) -> tuple[int, FloatArray]:
    after, innovations = lane.copy(), np.empty(2 * len(spec.outputs))
    return call(int(len(lane) != spec.n_numbers), at(sample), at(after), at(innovations)), after
