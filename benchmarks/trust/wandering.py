"""A tank that empties through a pipe that wanders: quiet where that is declared, and a fault beyond it is found.

    python -m benchmarks.trust.wandering [--seeds 20] [--first-seed 1000] [--samples 8000] [--markdown FILE]

Recordings are made by scipy alone: the pipe's resistance wanders by 5 % over an hour, and tank and pipe are off as
declared. Of each healthy run it is asked whether the models with and without `wander` alarm; of each faulty one, in
which the resistance is 30 % larger from row 2000 on, whether that is found within 300 rows, told alone, and how well.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.shared.page import arguments, note, publish, seeds_of
from faultbond.arrays import FloatArray
from faultbond.contract.findings import Detection, Diagnosis
from faultbond.contract.samples import Samples
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.synthesis.engine import build_engine

STEP, HELD = 10.0, 90  # s; rows for which the inflow is held
C, R = 2e-4, 2e6  # m^3/Pa, Pa*s/m^3
NOISES = np.array([50.0, 5e-5])  # Pa, m^3/s
WANDER = "wander: 5 % over 1 h"

MODEL = """\
name: tank with a pipe
sample_time: 10 s
inputs: {inflow: {unit: l/s}}
components:
  pump: {type: Sf, law: f = inflow}
  tank: {type: C, parameters: {C: {nominal: 2e-4 m^3/Pa, accuracy: 2 %}}}
  pipe: {type: R, parameters: {R: {nominal: 2e6 Pa*s/m^3, accuracy: 3 %}}}
junctions: {node: 0}
bonds: [pump -> node, node -> tank, node -> pipe]
sensors:
  pressure: {reads: tank.e, unit: Pa, noise: 50 Pa}
  flow: {reads: pipe.f, unit: l/s, noise: 0.05 l/s}
"""
WANDERING = MODEL.replace("accuracy: 3 %", f"accuracy: 3 %, {WANDER}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """What a tank showed, and what was true: usual, the resistance about which it wanders; resistance (n,)."""

    samples: Samples
    usual: float
    resistance: FloatArray


def course(
    seed: int,
    rows: int = 4000,
    *,
    size: float = 0.05,
    memory: float = 3600.0,
    factor: float = 1.0,
    at: int = 0,
    plant: int | None = None,
) -> Course:
    """Give a tank whose pipe wanders by `size`, and has `factor` times its resistance from row `at` on.

    plant: which one it is of all that are off as declared; None: another for each seed
    """
    off = np.random.default_rng([seed if plant is None else plant, 1]).standard_normal(2)
    usual, content, random = R * (1.0 + 0.03 * off[0]), C * (1.0 + 0.02 * off[1]), np.random.default_rng(seed)
    decay, path = np.exp(-STEP / memory), size * random.standard_normal(rows)
    for k in range(1, rows):
        path[k] = decay * path[k - 1] + np.sqrt(1.0 - decay**2) * path[k]
    resistance = usual * (path + np.where(np.arange(rows) < (at if factor != 1.0 else rows), 1.0, factor))
    inflow = np.repeat(random.uniform(4e-3, 12e-3, rows // HELD + 1), HELD)[:rows]
    time, pressure = np.asarray(STEP * np.arange(rows), dtype=np.float64), np.zeros(rows)
    pressure[0] = inflow[0] * resistance[0]
    for first in range(0, rows - 1, HELD):
        last = min(first + HELD, rows - 1)
        part = slice(first, last + 1)
        solved = solve_ivp(
            lambda t, p, inflow=inflow[first]: (inflow - p / np.interp(t, time, resistance)) / content,
            (time[first], time[last]),
            pressure[first : first + 1],
            t_eval=time[part],
            max_step=STEP,
            rtol=1e-6,
        )
        pressure[part] = solved.y[0]
    shown = np.column_stack([pressure, pressure / resistance]) + NOISES * random.standard_normal((rows, 2))
    steps = np.concatenate([[0.0], np.full(rows - 1, STEP)])
    return Course(
        samples=Samples(time=time, dt=steps, u=inflow[:, None], y=shown), usual=usual * factor, resistance=resistance
    )


def part(samples: Samples, first: int, last: int | None = None) -> Samples:
    """Give some of the samples."""
    rows = slice(first, last)
    return Samples(time=samples.time[rows], dt=samples.dt[rows], u=samples.u[rows], y=samples.y[rows])


def watched(monitor: Monitor, samples: Samples) -> tuple[Detection | None, Diagnosis | None, FloatArray]:
    """Give the first alarm, the last diagnosis, and how far the pipe is off before, in its declared size."""
    first, taken, off = None, 0, [np.zeros((0, len(monitor.spec.slow_errors)))]
    while taken < len(samples):
        reports = monitor.take(part(samples, taken))
        taken += len(reports.status)
        off += [reports.slow] if first is None else []
        first = first or reports.detection
    return first, monitor.finish(), np.concatenate(off)


def quiet_row(text: str, core: Core, runs: Sequence[Samples]) -> tuple[str, ...]:
    """Give in how many healthy runs a model alarms, and how far the wander is off at the most."""
    alarms, farthest = 0, 0.0
    for samples in runs:
        alarm, _, off = watched(Monitor(core), samples)
        alarms += alarm is not None
        farthest = max(farthest, float(np.nanmax(np.abs(off), initial=0.0)))
    return text, f"{alarms} of {len(runs)}", f"{farthest:.2f}" if core.spec.slow_errors else ""


def fault_row(core: Core, seed: int) -> tuple[bool, bool, float, float]:
    """Give of one fault whether it is found in time, whether it is told alone, the error in parts, and in its sd."""
    plant = course(seed, 2300, factor=1.3, at=2000)
    alarm, found, _ = watched(Monitor(core), plant.samples)
    if alarm is None or alarm.sample < 2000 or found is None:
        return False, False, np.nan, np.nan
    (first, *others) = found.candidates[0].suspects
    error = first.estimate - plant.usual
    return True, first.parameter == "R" and not others, error / plant.usual, error / first.sd


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen = arguments("A parameter that wanders.", argv, seeds=20, first_seed=1000, samples=8000)
    seeds = list(seeds_of(chosen))
    runs = [course(seed, chosen.samples).samples for seed in seeds]
    plain, moving = (build_engine(parse_model(text))[1] for text in (MODEL, WANDERING))
    healthy = [quiet_row("without `wander`", plain, runs), quiet_row(f"`{WANDER}`", moving, runs)]
    faults = [fault_row(moving, seed) for seed in seeds]
    errors = np.array([item[2:] for item in faults if item[1]])
    size, spread = np.sqrt(np.mean(errors**2, axis=0)) if len(errors) else (np.nan, np.nan)
    found, alone = (f"{sum(item[k] for item in faults)} of {len(seeds)}" for k in range(2))
    publish(
        "trust.wandering",
        chosen,
        note(f"{chosen.samples} samples each"),
        (("model", "healthy runs with an alarm", "farthest, in the declared size"), healthy),
        (
            ("30 % more: found", "R alone", "error", "in its sd"),
            [(found, alone, f"{100 * size:.1f} %", f"{spread:.2f}")],
        ),
    )


if __name__ == "__main__":
    main()
