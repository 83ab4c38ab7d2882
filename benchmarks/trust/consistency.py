"""Whether the filters are consistent: their errors in their own covariance, and their innovations, on drawn plants.

    python -m benchmarks.trust.consistency [--seeds 20] [--first-seed 0] [--samples 10000] [--only NAME,...]
        [--markdown FILE]

Plants are drawn as their model declares them: parameters within their accuracy, noise of sensors and inputs, process
noise, and slow errors at work or absent, since a declared size is a bound. They are advanced by the model's own step,
so that what is measured is the filter alone. Of a consistent filter the squared error in its own covariance (NEES) is 1
per parameter on average, and so is the square of a normalised innovation (NIS): Bar-Shalom, Li, Kirubarajan,
*Estimation with Applications to Tracking and Navigation*, 2001, 5.4. Errors of parameters that cannot be negative are
taken in logarithms: where data show a product only, what is equally likely lies on a line there, and on a curve else.
"""

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
from scipy.signal import lfilter
from scipy.stats import chi2

from benchmarks.shared.page import arguments, note, publish, seeds_of, selected
from benchmarks.shared.plants import EXAMPLES
from benchmarks.shared.told import relinearised, told_lane, without_slow_errors
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.samples import Sample
from faultbond.contract.spec import EngineSpec, root_of, unpack
from faultbond.equations.step import StepModel
from faultbond.io.grid import Grid, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.synthesis.engine import build_engine, build_model

DATA = Path(os.environ.get("FAULTBOND_DATA") or "no recordings")
START_SAMPLES = round(core_settings()["START_SAMPLES"])
SPREAD = 0.35  # sd of a faulty factor where its lane begins, in factors
ONSET = 0.4  # part of the samples after which the fault comes
HEADER = ("model", "slow errors", "NEES, healthy", "NIS of each sensor", "fault", "NEES, its lane", "band of 95 %")


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A model, a recording whose inputs are fed to it, and a fault for the lane that knows of it: (name, factor)."""

    model: Path
    recording: Path
    fault: tuple[str, float]


def example(name: str, fault: tuple[str, float], recording: str = "") -> Case:
    """Give an example with its healthy recording, or one of a real rig."""
    folder = EXAMPLES / name
    return Case(
        model=folder / "model.yaml", recording=DATA / recording if recording else folder / "healthy.csv", fault=fault
    )


def stranger(name: str, recording: str, fault: tuple[str, float]) -> Case:
    """Give a model that somebody else wrote."""
    return Case(model=DATA / "strangers" / f"{name}.yaml", recording=DATA / "strangers" / recording, fault=fault)


CASES = {
    "tank": example("tank", ("K1", 1.85)),
    "dc_motor": example("dc_motor", ("R", 2.0)),
    "dc_motor_current": example("dc_motor_current", ("J", 1.5)),
    "rlc": example("rlc", ("C", 1.34)),
    "rc": example("rc", ("C", 1.5)),
    "three_tank": example("three_tank", ("V1", 1.3)),
    "emps": example("emps", ("M", 1.3), "emps/emps.csv"),
    "skab": example("skab", ("K_valve", 1.5), "skab/valve1_0.csv"),
    "cascaded_tanks": example("cascaded_tanks", ("k_2", 0.7), "cascaded_tanks/estimation.csv"),
    "pipe": example("pipe", ("UA", 1.3), "pipe/ULg151202.csv"),
    "car": stranger("car", "car_inputs.csv", ("ms", 1.15)),
    "car_tyre_nonsense": stranger("car_tyre_nonsense", "car_h1.csv", ("c", 1.3)),
    "bat": stranger("bat", "bat_h3.csv", ("R0", 1.3)),
    "bat_m2": stranger("bat_m2", "bat_h3.csv", ("R0", 1.3)),
    "hyd": stranger("hyd", "ps_2.csv", ("ps", 0.8)),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stand:
    """A model, packed samples (n, n_sample) that still lack readings, and the states with which its plants begin."""

    core: Core
    model: StepModel
    samples: FloatArray
    start: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Consistency:
    """Means over all seeds: NEES per parameter at the end, NIS of each sensor; `band`: 95 % of such means of NEES."""

    nees: float
    band: tuple[float, float]
    nis: tuple[float, ...]


def stand_of(case: Case, n: int) -> Stand:
    """Give a model with n samples of inputs, its recording's, again and again."""
    graph = load_model(case.model)
    _, core = build_engine(graph)
    samples = _packed(core, _inputs(graph, case.recording, n))
    start = _start(graph, core, samples, case.recording)
    return Stand(core=core, model=build_model(graph), samples=samples, start=start)


def _inputs(graph: BondGraph, recording: Path, n: int) -> FloatArray:
    rows = read_rows(str(recording), columns_of(graph, sensors=False))
    found, last = [], np.full(len(graph.inputs), np.nan)
    for point in on_grid(rows, Grid(graph.sample_time, steady=True)):
        last = np.where(np.isfinite(point.u), point.u, last)
        if np.all(np.isfinite(last)):
            found.append(last)
        if len(found) == n:
            break
    return np.resize(np.array(found), (n, len(graph.inputs)))


def _packed(core: Core, inputs: FloatArray) -> FloatArray:
    """Pack samples as the monitor does; their readings are there, and 0."""
    spec, monitor = core.spec, Monitor(core)
    packed, dt = np.zeros((len(inputs), spec.n_sample)), spec.sample_time or 1.0
    for row, u in enumerate(inputs):
        packed[row] = monitor.pack(Sample(time=row * dt, dt=dt, u=u, y=np.zeros(len(spec.outputs))))
    return packed


def _start(graph: BondGraph, core: Core, samples: FloatArray, recording: Path) -> FloatArray:
    """Give the states from which the recording began, as its first rows show them."""
    first, place = samples[:START_SAMPLES].copy(), core.spec.sample_fields
    points = on_grid(read_rows(str(recording), columns_of(graph)), Grid(graph.sample_time, steady=True))
    for row, point in zip(first, points, strict=False):
        row[place["y"]], row[place["use"]] = np.nan_to_num(point.y), np.isfinite(point.y)
    return core.solve_start(first)[0]


def draw(
    stand: Stand, seed: int, *, slow: float, fault: tuple[str, float] | None = None
) -> tuple[FloatArray, FloatArray]:
    """Draw a plant: the factors of its parameters over time, (n, n_parameters), and packed samples with its readings.

    slow : size of its slow errors in those declared. A fault comes after the part `ONSET`.
    """
    spec, generator, n = stand.core.spec, np.random.default_rng(seed), len(stand.samples)
    place, dt = spec.sample_fields, stand.samples[:, spec.sample_fields["dt"]]
    root = root_of(np.array([item.accuracy for item in spec.parameters]), spec.correlations)
    off = root @ generator.standard_normal(len(spec.parameters))
    healthy = [np.clip(item.healthy + x, item.lower, item.upper) for item, x in zip(spec.parameters, off, strict=True)]
    factors = np.tile(np.array(healthy), (n, 1))
    if fault is not None:
        factors[round(ONSET * n) :, [item.name for item in spec.parameters].index(fault[0])] *= fault[1]
    begin = spec.slow_sizes * generator.standard_normal(len(spec.slow_errors))
    left = np.exp(-dt / np.array([item.memory for item in spec.slow_errors]))  # 1 at the first sample, then all alike
    gained = np.sqrt(spec.slow_sizes**2 * (1.0 - left**2) + stand.samples[:, place["kick"]])
    pushed = gained * generator.standard_normal(gained.shape)
    errors = np.zeros_like(pushed)
    for k, part in enumerate(left[-1]):
        errors[:, k] = slow * lfilter([1.0], [1.0, -part], pushed[:, k], zi=begin[k : k + 1])[0]
    sizes = np.array([spec.inputs[k].noise for k in spec.noisy_inputs])
    rest = np.hstack([errors, factors, sizes * generator.standard_normal((n, len(sizes)))])
    unknown = np.array([item.noise for item in spec.states]) * generator.standard_normal((n, len(spec.states)))
    unknown[0] = 0.0
    stated = np.array([item.start_sd or 0.0 for item in spec.states])
    first = np.concatenate([stand.start + stated * generator.standard_normal(len(stated)), spec.loops])
    before, u = stand.samples[:, place["u_before"]], stand.samples[:, place["u"]]
    _, y = _course(stand.model, n)(first, rest[[0, *range(n - 1)]].T, rest.T, before.T, u.T, dt.T, unknown.T)
    samples = stand.samples.copy()
    samples[:, place["y"]] = y.full().T + spec.output_noise * generator.standard_normal((n, len(spec.outputs)))
    return factors, samples


@cache
def _course(model: StepModel, n: int) -> ca.Function:
    """Give n times (states and implicit signals, rest of v before and now, inputs, dt, noise) -> (after, readings)."""
    n_x, n_u, n_z = len(model.states), model.u.numel(), model.z.numel()
    x, before, now, noise = (
        ca.SX.sym(name, size)
        for name, size in (("x", n_x), ("before", model.v.numel() - n_x), ("now", model.v.numel() - n_x), ("w", n_x))
    )
    held, u, z, dt = ca.SX.sym("held", n_u), ca.SX.sym("u", n_u), ca.SX.sym("z", n_z), ca.SX.sym("dt")
    after, _, solved = model.predict(ca.vertcat(x, before), held, z, dt)
    y, _, solved = model.measure(ca.vertcat(after + noise, now), u, solved)
    course = ca.Function(
        "course", [ca.vertcat(x, z), before, now, held, u, dt, noise], [ca.vertcat(after + noise, solved), y]
    )
    return course.mapaccum(n)


def knowing(spec: EngineSpec, lane: FloatArray, fault: tuple[str, float]) -> FloatArray:
    """Give the lane of the true hypothesis at the onset, begun at the true factor as a renewed lane is."""
    name, factor = fault
    return told_lane(spec, without_slow_errors(spec, lane[:, 0]), name, factor, SPREAD * factor)


def nees(spec: EngineSpec, lane: FloatArray, factors: FloatArray) -> float:
    """Give the squared error of the parameters of a lane (n_numbers,) in its own covariance, per parameter."""
    place = spec.parameter_slice
    found, full = lane[place], unpack(spec, lane[spec.covariance_slice])[place, place]
    positive = np.array([item.healthy > 0.0 and item.lower > 0.0 for item in spec.parameters])
    safe = np.where(positive, found, 1.0)
    error = np.where(positive, np.log(safe / np.where(positive, factors, 1.0)), found - factors)
    full = full / np.outer(safe, safe)
    return float(error @ np.linalg.solve(full, error) / len(error))


def consistency(
    stand: Stand, seeds: Sequence[int], *, slow: float, fault: tuple[str, float] | None = None
) -> Consistency:
    """Give how consistent the healthy filter is, or from the onset of a fault on the lane that knows of it."""
    core, spec, n = stand.core, stand.core.spec, len(stand.samples)
    known = all(item.start_sd is not None for item in spec.states)
    errors, squares = [], []
    for seed in seeds:
        factors, samples = draw(stand, seed, slow=slow, fault=fault)
        lane = core.healthy_lane(*core.solve_start(samples[: 1 if known else START_SAMPLES]))
        if fault is not None:
            onset = round(ONSET * n)
            lane, _ = core.advance(lane, samples[:onset])
            lane, samples = knowing(spec, lane, fault), relinearised(spec, samples[onset:])
        lane, innovations = core.advance(lane, samples)
        errors.append(nees(spec, lane[:, 0], factors[-1]))
        squares.append(_squares(spec, samples, innovations[:, :, 0]))
    freedom = len(errors) * len(spec.parameters)
    low, high = chi2.ppf([0.025, 0.975], freedom) / freedom
    return Consistency(nees=float(np.mean(errors)), band=(low, high), nis=tuple(np.mean(squares, axis=0).tolist()))


def _squares(spec: EngineSpec, samples: FloatArray, innovations: FloatArray) -> FloatArray:
    """Give the mean square of the normalised innovations of each sensor, while it is not blanked, once warm."""
    n_y, warm = len(spec.outputs), spec.thresholds.warm_up_samples
    settled = samples[warm:, spec.sample_fields["scale"]] < spec.thresholds.blank_factor
    squares = np.where(settled, innovations[warm:, :n_y] ** 2 / innovations[warm:, n_y:], 0.0)
    return np.asarray(squares.sum(axis=0) / settled.sum(axis=0))


def rows_of(name: str, case: Case, seeds: Sequence[int], n: int) -> list[tuple[str, ...]]:
    """Give the lines of one model."""
    stand = stand_of(case, n)
    rows: list[tuple[str, ...]] = []
    for slow in (1.0, 0.0) if stand.core.spec.slow_errors else (1.0,):
        told = ("as declared" if slow else "absent") if stand.core.spec.slow_errors else "none"
        healthy = consistency(stand, seeds, slow=slow)
        true = consistency(stand, seeds, slow=slow, fault=case.fault)
        low, high = healthy.band
        nis = ", ".join(f"{value:.3f}" for value in healthy.nis)
        lane = f"{case.fault[0]} x{case.fault[1]:g}"
        rows.append((name, told, f"{healthy.nees:.2f}", nis, lane, f"{true.nees:.2f}", f"{low:.2f} to {high:.2f}"))
        print("  ".join(rows[-1]), file=sys.stderr, flush=True)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    words = "Whether the filters err as much as they say."
    chosen = arguments(words, argv, seeds=20, first_seed=0, samples=10_000, only="")
    rows = []
    for name in selected(CASES, chosen.only):
        if CASES[name].recording.exists():
            rows += rows_of(name, CASES[name], seeds_of(chosen), chosen.samples)
        else:
            print(f"{name}: no recording: FAULTBOND_DATA is not set", file=sys.stderr)
    publish("trust.consistency", chosen, note(f"{chosen.samples} samples each"), (HEADER, rows))


if __name__ == "__main__":
    main()
