"""Functions of lanes: within a few roundings of exact, and the same digits however many lanes there are."""

import ctypes
from collections.abc import Callable

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.io.cache import loadable
from faultbond.synthesis.compile import compile_library, required_compiler

CALLS = """
#define FB_LANES {lanes}
#include "maths.h"
static lanes all(int64_t which, lanes x, lanes y) {{
    return which == 0 ? v_exp(x) : which == 1 ? v_log(x) : v_pow(x, y);
}}
static double one(int64_t which, double x, double y) {{
    return which == 0 ? exp_one(x) : which == 1 ? log_one(x) : pow_one(x, y);
}}
void call(int64_t which, const double *x, const double *y, double *all_of_them, double *alone, int64_t count) {{
    for (int64_t i = 0; i < count; i += FB_LANES) store(all_of_them + i, all(which, load(x + i), load(y + i)));
    for (int64_t i = 0; i < count; i++) alone[i] = one(which, x[i], y[i]);
}}
"""
ROUNDING = float(np.finfo(float).eps)
Functions = Callable[[str, FloatArray, FloatArray], FloatArray]


@pytest.fixture(scope="module", params=[1, 2, 4, 8])
def functions(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Functions:
    """The functions of so many lanes, of arrays (n,); the same alone."""
    patch = pytest.MonkeyPatch()
    patch.setenv("FAULTBOND_CACHE", str(tmp_path_factory.mktemp("cache")))
    with loadable([compile_library(CALLS.format(lanes=request.param), required_compiler())]) as (library,):
        call = ctypes.CDLL(str(library)).call
    patch.undo()

    def values(name: str, x: FloatArray, y: FloatArray) -> FloatArray:
        room = -(-len(x) // 8) * 8
        padded = [np.resize(np.asarray(item, dtype=float), room) for item in (x, y)]
        found = [np.empty(room) for _ in range(2)]
        which = ctypes.c_int64(["exp", "log", "pow"].index(name))
        call(which, *(ctypes.c_void_p(item.ctypes.data) for item in (*padded, *found)), ctypes.c_int64(room))
        assert np.array_equal(found[0], found[1], equal_nan=True)
        return found[0][: len(x)]

    return values


def off(found: FloatArray, exact: np.ndarray) -> FloatArray:
    """Relative errors, in roundings."""
    return np.asarray(np.abs((found - exact) / exact) / ROUNDING, dtype=float)


def test_exponential_and_logarithm_are_exact_to_a_few_roundings(functions: Functions) -> None:
    """Over all that has a normal result."""
    draw = np.random.default_rng(5)
    for x in (draw.uniform(-700.0, 700.0, 4000), draw.uniform(-1.0, 1.0, 4000), draw.normal(0.0, 1e-9, 400)):
        assert off(functions("exp", x, x), np.exp(x.astype(np.longdouble))).max() < 3.0
    for x in (np.exp(draw.uniform(-700.0, 700.0, 4000)), 1.0 + draw.uniform(-0.3, 0.4, 4000)):
        exact = np.log(x.astype(np.longdouble))
        assert np.max(np.abs(functions("log", x, x) - exact) / np.maximum(np.abs(exact), 0.01)) < 4 * ROUNDING


def test_power_is_exact_to_roundings_of_its_logarithm(functions: Functions) -> None:
    """For bases and exponents such as laws have."""
    draw = np.random.default_rng(6)
    x, y = np.exp(draw.uniform(-20.0, 20.0, 8000)), draw.uniform(-4.0, 4.0, 8000)
    exact = x.astype(np.longdouble) ** y.astype(np.longdouble)
    assert np.max(off(functions("pow", x, y), exact) / (3.0 + np.abs(np.log(exact)))) < 2.0


def test_ends_and_what_has_no_value_are_those_of_the_c_library(functions: Functions) -> None:
    """Zeros, infinities, overflow, underflow, negative bases, and what is no number."""
    ends = np.array([0.0, -0.0, np.inf, -np.inf, np.nan, 709.7, 709.8, 1e9, -744.0, -746.0, -1e9, 1.0])
    with np.errstate(all="ignore"):
        assert functions("exp", ends, ends) == pytest.approx(np.exp(ends), rel=1e-14, nan_ok=True)
        assert functions("log", ends, ends) == pytest.approx(np.log(ends), rel=1e-14, nan_ok=True)
        bases = np.array([0.0, 0.0, 0.0, -2.0, -2.0, -2.0, -2.0, np.inf, np.inf, np.nan, np.nan, 3.0, -1.0, 1e300])
        powers = np.array([2.0, 0.0, -1.5, 3.0, 2.0, -3.0, 0.5, 2.0, -2.0, 2.0, 0.0, np.nan, 1e6, 2.0])
        assert functions("pow", bases, powers) == pytest.approx(bases**powers, rel=1e-13, nan_ok=True)


def test_digits_are_the_same_in_any_number_of_lanes(functions: Functions) -> None:
    """All bits together, as they were once: another processor, compiler or width must give them too."""
    draw = np.random.default_rng(7)
    x, y = draw.uniform(0.01, 20.0, 1000), draw.uniform(-4.0, 4.0, 1000)
    bits = [int(np.bitwise_xor.reduce(functions(name, x, y).view(np.int64))) for name in ("exp", "log", "pow")]
    assert bits == [9088419439876350792, 9168988570358836467, 9209274888801908943]
