"""The tank's filters as an engineer writes them for this one plant: plain loops for numba, laws and slopes by hand.

The same work as our filters do: rates and their slopes at both stages of ROS2 (`core/integrate.h`), readings and their
slopes, the covariance, both readings one after the other, a bound on what counts, the log-likelihood, and the second
update where a sample says much (`core/filter.h`). A number of them in a row, one filter after the other.

x = [pressure, errors of line and outlet, factors of K8 K1 K2 K7 K3 K4 K6; of a wide lane, size and rate of a slot].
"""

import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib import import_module
from math import exp, log, pi, sqrt
from typing import Any

import numpy as np

from benchmarks.shared.turns import Work
from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec, unpack

numba: Any = None
with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of what it imports
    with suppress(ImportError):
        numba = import_module("numba")

N_PLAIN, SIZE, RATE, N_THETA, N_SENSORS = 10, 10, 11, 7, 2
THETA = 3  # the first factor
K8, K1, K2, K7, K3, K4, K6 = 64650.0, 2.41e11, 5.08e11, 255.0, 1.3e5, 2.35e-6, 1.04e-5
STATE_VARIANCE, SLOW_VARIANCE, MEMORY, LOWER, UPPER = 12.96, 0.0004, 600.0, 0.02, 50.0
NOISE = (2.8e-6**2, 180.0**2)
WILDEST, SAYS_MUCH, BLANK, NEVER, ROUNDING = 400.0, 0.1, 1e4, 1e6, 1e-16
GAMMA = 1.0 - sqrt(0.5)
# Of a packed sample: dt, inputs before and now, readings, their use and scale, kicks, gap, again, bound, usual squares.
BEFORE, NOW, READ, USE, SCALE, KICK, GAP, BOUND, USUAL = 1, 3, 5, 7, 9, 11, 13, 15, 16
# Of the roles of a slot: on factors, inputs; whether inputs act as recorded, times the size; how sensors read; noise.
INPUT, OBEYS, INPUT_GAIN, READS, GAIN, BIAS, LOUD = 7, 9, 11, 13, 15, 17, 19

Bank = tuple[FloatArray, FloatArray, FloatArray, FloatArray]  # x, p, roles, likelihood


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Give a function as numba compiles it, or as it is where that is not installed."""
    made: Callable[..., Any] = function if numba is None else numba.njit(function, error_model="numpy")
    return made


@compiled
def added_by_slot(roles: Any, k: Any, recorded: Any) -> Any:
    """Give what the slot adds to input k for each of its size."""
    return roles[INPUT + k] + roles[INPUT_GAIN + k] * recorded


@compiled
def model_of(x: Any, roles: Any, wide: Any, u: Any, at: Any, v: Any) -> None:
    """Put errors, factors and inputs u[at:] into v (12,), with what the slot adds to them."""
    for k in range(N_PLAIN):
        v[k] = x[k]
    for k in range(2):
        v[N_PLAIN + k] = u[at + k]
    if wide:
        for k in range(N_THETA):
            v[THETA + k] = min(max(x[THETA + k] + roles[k] * x[SIZE], LOWER), UPPER)
        for k in range(2):
            v[N_PLAIN + k] = roles[OBEYS + k] * u[at + k] + added_by_slot(roles, k, u[at + k]) * x[SIZE]


@compiled
def flow_of(v: Any, slope: Any) -> Any:
    """Give the flow through pipe, orifice and valve; its slopes by v into slope (12,)."""
    left = 100.0 - v[10]
    valve = (K7 * v[6]) ** 2
    resistance = K1 * v[4] + K2 * v[5] + valve * left**4
    pressure = K8 * v[3] - v[0]
    least = 1e-6 * (K8 * v[3] + abs(v[0]))
    square = pressure * pressure + least * least
    root = 1.0 / sqrt(resistance * sqrt(square))
    flow = pressure * root
    by_pressure, by_resistance = root * (1.0 - 0.5 * pressure * pressure / square), -0.5 * flow / resistance
    for k in range(12):
        slope[k] = 0.0
    slope[0], slope[3] = -by_pressure, K8 * by_pressure
    slope[4], slope[5] = K1 * by_resistance, K2 * by_resistance
    slope[6] = 2.0 * K7 * K7 * v[6] * left**4 * by_resistance
    slope[10] = -4.0 * valve * left**3 * by_resistance
    return flow


@compiled
def rate_of(v: Any, slope: Any) -> Any:
    """Give the rate of the pressure; its slopes by v into slope (12,), those by factors at errors of 0, as ours."""
    flow = flow_of(v, slope)
    inward, stiff, outlet = 1.0 + v[1], K3 * v[7], K4 * v[8]
    net = flow * inward - outlet * v[11] * (1.0 + v[2]) - K6 * v[9]
    for k in range(12):
        slope[k] *= stiff if 3 <= k < 10 else stiff * inward
    slope[1], slope[2], slope[7] = stiff * flow, -stiff * outlet * v[11], K3 * (flow - outlet * v[11] - K6 * v[9])
    slope[8], slope[9] = -stiff * K4 * v[11], -stiff * K6
    slope[11] = -stiff * outlet * (1.0 + v[2])
    return stiff * net


@compiled
def integrate(v: Any, h: Any, slope: Any, first: Any, second: Any) -> None:
    """Take the pressure over a step of ROS2; slope (12,): of the pressure after it, by v before it."""
    k1 = rate_of(v, first)
    inverse = 1.0 / (1.0 - GAMMA * h * first[0])
    k1 *= inverse
    before = v[0]
    v[0] = before + h * k1
    k2 = (rate_of(v, second) - 2.0 * k1) * inverse
    by_pressure = second[0]
    second[0] = 0.0
    for k in range(12):
        first[k] *= inverse
        middle = h * first[k] + (1.0 if k == 0 else 0.0)
        later = (second[k] + by_pressure * middle - 2.0 * first[k]) * inverse
        slope[k] = (1.0 if k == 0 else 0.0) + h * (1.5 * first[k] + 0.5 * later)
    v[0] = before + h * (1.5 * k1 + 0.5 * k2)


@compiled
def predict(x: Any, p: Any, roles: Any, wide: Any, given: Any, v: Any, rows: Any) -> None:
    """Let mean and covariance move on to this sample."""
    n, dt, slope, a, moved = len(x), given[0], rows[0], rows[3], rows[4]
    model_of(x, roles, wide, given, BEFORE, v)
    integrate(v, dt, slope, rows[1], rows[2])
    for k in range(N_PLAIN):
        a[k] = slope[k]
    if wide:
        a[SIZE] = a[RATE] = 0.0
        for k in range(N_THETA):
            a[SIZE] += slope[THETA + k] * roles[k]
        for k in range(2):
            a[SIZE] += slope[N_PLAIN + k] * added_by_slot(roles, k, given[BEFORE + k])
    x[0] = v[0]
    moved[:n] = 0.0
    for i in range(n):
        for j in range(n):
            moved[j] += a[i] * p[i, j]
    total = given[GAP] ** 2 + (STATE_VARIANCE if dt > 0.0 else 0.0)
    for j in range(n):
        total += moved[j] * a[j]
        p[0, j] = p[j, 0] = moved[j]
    p[0, 0] = total
    decay = exp(-dt / MEMORY)
    for k in range(1, 3):
        x[k] *= decay
        for j in range(n):
            p[k, j] *= decay
            p[j, k] *= decay
        p[k, k] += SLOW_VARIANCE * (1.0 - decay * decay) + given[KICK + k - 1]
    if wide:
        x[SIZE] += dt * x[RATE]
        for j in range(n):
            p[SIZE, j] += dt * p[RATE, j]
        for j in range(n):
            p[j, SIZE] += dt * p[j, RATE]


@compiled
def expect(z: Any, p: Any, roles: Any, wide: Any, given: Any, v: Any, expected: Any, slopes: Any, cross: Any) -> None:
    """Give readings at z, expected (2,), their slopes by x, (2, n), and the covariance times these, (2, n)."""
    n, by_v = len(z), slopes[2]
    model_of(z, roles, wide, given, NOW, v)
    flow, inward, root = flow_of(v, by_v), 1.0 + v[1], sqrt(v[5])
    for k in range(12):
        by_v[k] = by_v[k] * (root if 3 <= k < 10 else inward * root) if flow > 0.0 else 0.0
    if flow > 0.0:
        by_v[1] = flow * root
        by_v[5] += 0.5 * flow / root
    expected[0], expected[1] = max(flow, 0.0) * inward * root, v[0]
    for k in range(N_PLAIN):
        slopes[0, k], slopes[1, k] = by_v[k], 0.0
    slopes[1, 0] = 1.0
    if wide:
        total = 0.0
        for k in range(N_THETA):
            total += by_v[THETA + k] * roles[k]
        slopes[0, SIZE], slopes[1, SIZE] = total + by_v[10] * added_by_slot(roles, 0, given[NOW]), 0.0
        for j in range(N_SENSORS):
            factor, plain = roles[READS + j] + roles[GAIN + j] * z[SIZE], expected[j]
            slopes[j, RATE] = 0.0
            for k in range(n):
                slopes[j, k] *= factor
            slopes[j, SIZE] += roles[BIAS + j] + roles[GAIN + j] * plain
            expected[j] = plain * factor + roles[BIAS + j] * z[SIZE]
    for j in range(N_SENSORS):
        for i in range(n):
            cross[j, i] = 0.0
        for k in range(n):
            if slopes[j, k] != 0.0:
                for i in range(n):
                    cross[j, i] += p[k, i] * slopes[j, k]


@compiled
def update(
    given: Any, noise: Any, expected: Any, slopes: Any, cross: Any, weight: Any, shift: Any, n: Any, counted: Any
) -> Any:
    """Take both readings: how x moves, shift (n,), and weights (2, n); give the log-likelihood."""
    gained = 0.0
    bound = given[BOUND] if given[BOUND] > 0.0 else NEVER
    for i in range(n):
        shift[i] = 0.0
    for j in range(N_SENSORS):
        for k in range(j):
            told = 0.0
            for i in range(n):
                told += slopes[j, i] * cross[k, i]
            for i in range(n):
                cross[j, i] -= weight[k, i] * told
        variance, off = noise[j], given[READ + j] - expected[j]
        for i in range(n):
            variance += slopes[j, i] * cross[j, i]
            off -= slopes[j, i] * shift[i]
        most = bound * sqrt(variance)
        step, scale = min(max(off, -most), most), given[USE + j] / variance
        for i in range(n):
            weight[j, i] = cross[j, i] * scale
            shift[i] += weight[j, i] * step
        if counted:
            usual = given[USUAL + j] if given[USUAL + j] > 0.0 else 1.0
            misfit, width = min(off * off / variance, WILDEST), log(variance / NOISE[j])
            gained -= 0.5 * given[USE + j] * (misfit + usual * width + log(2.0 * pi)) / max(usual, 1.0)
    return gained


@compiled
def advance(x: Any, p: Any, roles: Any, given: Any, memory: Any, noise: Any) -> Any:
    """Take a packed sample (n_sample,) into a filter: x (n,), p (n, n), roles (20,); give its log-likelihood."""
    v, rows, expected, slopes, cross, weight, shift, guess = memory
    n = len(x)
    wide = n > N_PLAIN
    predict(x, p, roles, wide, given, v, rows)
    expect(x, p, roles, wide, given, v, expected, slopes, cross)
    much = False
    for j in range(N_SENSORS):
        noise[j] = NOISE[j] * given[SCALE + j] * (roles[LOUD + j] if wide and given[SCALE + j] < BLANK else 1.0)
        foretold = 0.0
        for i in range(n):
            foretold += slopes[j, i] * cross[j, i]
        much = much or given[USE + j] * (foretold - SAYS_MUCH * noise[j]) > 0.0
    gained = update(given, noise, expected, slopes, cross, weight, shift, n, True)
    if much:
        for i in range(n):
            guess[i] = x[i]
        for i in range(THETA, n):
            guess[i] += shift[i]
        for i in range(THETA, N_PLAIN):
            guess[i] = min(max(guess[i], LOWER), UPPER)
        expect(guess, p, roles, wide, given, v, expected, slopes, cross)
        for j in range(N_SENSORS):
            for i in range(n):
                expected[j] += slopes[j, i] * (x[i] - guess[i])
        update(given, noise, expected, slopes, cross, weight, shift, n, False)
    for i in range(n):
        x[i] += shift[i]
        least = p[i, i] * ROUNDING
        for k in range(i, n):
            p[i, k] -= weight[0, i] * cross[0, k] + weight[1, i] * cross[1, k]
            p[k, i] = p[i, k]
        p[i, i] = max(p[i, i], least)
    for i in range(THETA, N_PLAIN):
        x[i] = min(max(x[i], LOWER), UPPER)
    return gained


@compiled
def all_filters(x: Any, p: Any, roles: Any, likelihood: Any, given: Any, memory: Any) -> None:
    """Take samples (n_samples, n_sample), one after the other, into filters x (count, n), p (count, n, n)."""
    noise = np.empty(N_SENSORS)
    for t in range(len(given)):
        for k in range(len(x)):
            likelihood[k] += advance(x[k], p[k], roles[k], given[t], memory, noise)


def by_loops(spec: EngineSpec, lanes: list[FloatArray], given: FloatArray) -> Work | None:
    """Give the work of packed samples (n_samples, n_sample) on lanes; None where numba is not installed."""
    if numba is None:
        return None
    return Work(prepare=partial(banks, spec, lanes), run=partial(run, given), count=len(given))


def banks(spec: EngineSpec, lanes: list[FloatArray]) -> list[Bank]:
    """Give the filters of lanes as `all_filters` takes them: the plain ones, then those with a slot."""
    found = []
    for kind in (spec, spec.slotted):
        rows = np.array([lane for lane in lanes if len(lane) == kind.n_numbers]).reshape(-1, kind.n_numbers)
        n, p = kind.n_joint, np.array([unpack(kind, row[kind.covariance_slice]) for row in rows])
        roles = rows[:, kind.loop_slice.stop : -1].copy() if kind.slot else np.zeros((len(rows), 1))
        found.append((rows[:, :n].copy(), p.reshape(-1, n, n), roles, rows[:, -1].copy()))
    return found


def run(given: FloatArray, filters: list[Bank]) -> None:
    """Take packed samples (n_samples, n_sample) into filters."""
    for bank in filters:
        n = bank[0].shape[1]
        shapes = (12, (5, 12), 2, (3, 12), (2, n), (2, n), n, n)  # numbers of v, rows, expected, slopes, cross, ...
        if len(bank[0]):
            all_filters(*bank, given, tuple(np.zeros(shape) for shape in shapes))
