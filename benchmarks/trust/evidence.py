"""How much the data say of a small step, to a filter that is told which parameter steps, when and how far.

    python -m benchmarks.trust.evidence [--seeds 20] [--first-seed 700] [--markdown FILE]

The ratio of its likelihood to that of the healthy filter bounds what any detector can do that thinks of plant and noise
as these filters do: with one false alarm in N samples the delay is, on average, at least what the logarithm of the
ratio needs to reach log N.
Source: Lorden, Annals of Mathematical Statistics 42 (1971) 1897.
"""

from collections.abc import Sequence
from math import log

import numpy as np

from benchmarks.shared.page import arguments, note, publish, seeds_of, share
from benchmarks.shared.play import engine_of
from benchmarks.shared.told import relinearised, told_lane
from benchmarks.trust.arrival import watched
from benchmarks.trust.cases import CASES, SMALL, SMALL_MOVED
from benchmarks.trust.plants import Played
from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.monitor import Monitor

WITHIN = 600.0  # s after the onset
QUIET = 36000  # samples between false alarms: ten hours
TOLD = 1e-3  # sd of the factor that the filter is told
HEADER = ("step of 10 %, told what, when and how far", "in nats after 10 min", "enough at one false alarm in 10 h")


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen = arguments("How much the data say of a small step.", argv, seeds=20, first_seed=700)
    cases = [(f"tank, recipe, {name}", f"small.{name}") for name in SMALL]
    cases += [(f"tank, valves moving, {name}", f"moved.small.{name}") for name in SMALL_MOVED]
    publish("trust.evidence", chosen, note(), (HEADER, [_row(*case, seeds_of(chosen)) for case in cases]))


def _row(title: str, key: str, seeds: Sequence[int]) -> tuple[str, str, str]:
    both = [(CASES[f"{key}.{word}"], seed) for word in ("up", "down") for seed in seeds]
    found = [evidence(case.make(seed), kept=seed % 2 == 0) for case, seed in both]
    low, middle = np.quantile(found, (0.1, 0.5))
    enough = sum(value >= log(QUIET) for value in found)
    return title, f"median {middle:.1f}, a tenth below {low:.1f}", share(enough, len(found))


def evidence(made: Played, *, kept: bool) -> float:
    """Give the largest logarithm of the ratio of likelihoods, fault to no fault, within 10 min after the onset.

    kept : whether stores keep their content at the fault, else effort or flow
    """
    spec, core = engine_of(made.folder)
    before = healthy = told = np.zeros((spec.n_numbers, 0))
    ratios: list[float] = []
    for sample, monitor, _ in watched(Monitor(core, quiet=True), made):
        if sample.time > made.onset + WITHIN:
            break
        if sample.time >= made.onset:
            if not ratios:
                healthy, told = before, told_lane(spec, before[:, 0], *_truth(spec, made, before[:, 0]), kept=kept)
            packed = monitor.row(int(monitor.number("clock.index")) - 1)[0][None, :]
            healthy, told = core.advance(healthy, packed)[0], core.advance(told, relinearised(spec, packed))[0]
            ratios.append(float(told[-1, 0] - healthy[-1, 0]))
        before = monitor.numbers("healthy.lane")[:, None]
    return max(ratios)


def _truth(spec: EngineSpec, made: Played, healthy: FloatArray) -> tuple[str, float, float]:
    """Give the parameter that steps, by which factor of what a lane (n_numbers,) has learned, and its sd."""
    (name,) = made.suspects
    (index,) = (k for k, item in enumerate(spec.parameters) if item.name == name)
    factor = made.values[name] / spec.parameters[index].nominal / healthy[spec.parameter_slice][index]
    return name, float(factor), TOLD


if __name__ == "__main__":
    main()
