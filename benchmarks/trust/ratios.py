"""What correlations bring: faults of a ratio that is known better than its scale, with and without them.

`python -m benchmarks.trust.ratios --seeds 18` draws motors of which K, J and L are known to 5 % each and their ratios
to 1 %, lets each be healthy, and lets one of the three change by 6 %, up or down, at once or from the first sample on.
Each recording is watched by the model with its correlations and by the same without them.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from faultbond.contract.findings import Diagnosis
from faultbond.contract.samples import Sample
from faultbond.model.graph import BondGraph, Correlation
from faultbond.model.text import dump_model, load_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, Simulation, random_steps, simulate
from faultbond.synthesis.engine import build_engine

MODEL = Path(__file__).parents[2] / "examples" / "dc_motor" / "model.yaml"
TOGETHER, ACCURACY, RATIO = ("K", "J", "L"), 0.05, 0.01
SIZE, ONSET, SECONDS = 1.06, 20.0, 60.0
SURE = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """What was told of a recording: whether there was an alarm, and what was named with more than `SURE`."""

    alarmed: bool
    named: tuple[str, ...]


def motor() -> BondGraph:
    """Give the motor with what is known of K, J and L, and a promise."""
    graph = load_model(MODEL)
    parameters = tuple(
        replace(item, accuracy=ACCURACY * item.nominal) if item.name in TOGETHER else item for item in graph.parameters
    )
    names = [item.name for item in parameters if item.name in TOGETHER]
    together = 1.0 - RATIO**2 / (2.0 * ACCURACY**2)
    pairs = [(one, other) for k, one in enumerate(names) for other in names[k + 1 :]]
    correlations = tuple(Correlation(one=one, other=other, value=together) for one, other in pairs)
    graph = replace(graph, parameters=parameters, correlations=correlations, time_between_false_alarms=3600.0)
    return replace(graph, text=dump_model(graph))


@cache
def cores() -> dict[str, Core]:
    """Give the core of the model with its correlations, and of the same without them."""
    graph = motor()
    without = replace(graph, correlations=())
    return {"with": build_engine(graph)[1], "without": build_engine(replace(without, text=dump_model(without)))[1]}


def recordings(seed: int) -> Iterator[tuple[str, str, Simulation]]:
    """Give a plant drawn from what is known of it: the case, the parameter that changed, and the recording."""
    graph, generator = motor(), np.random.default_rng(seed)
    prior = cores()["with"].spec.prior
    off = generator.multivariate_normal(np.zeros(len(prior)), prior, method="eigh")
    drawn = zip(graph.parameters, off, strict=True)
    plant = replace(graph, parameters=tuple(replace(item, nominal=item.nominal * (1.0 + x)) for item, x in drawn))
    time = np.asarray(np.arange(0.0, SECONDS, graph.sample_time or 1.0), dtype=np.float64)
    u = random_steps(time, generator, low=2.0, high=12.0, shortest=0.4, longest=1.2)
    inputs = Inputs(time=time, values=u[:, None])
    name, factor = TOGETHER[seed % len(TOGETHER)], SIZE if seed // len(TOGETHER) % 2 == 0 else 1.0 / SIZE
    yield "healthy", "", simulate(plant, inputs, seed=seed)
    for case, start in (("at once", ONSET), ("from the first sample", 0.0)):
        yield case, name, simulate(plant, inputs, [Fault(parameter=name, factor=factor, start=start)], seed=seed)


def watched(core: Core, made: Simulation) -> Told:
    """Watch a recording to its end."""
    monitor, last = Monitor(core), float(made.time[0])
    alarmed = False
    for time, u, y in zip(made.time.tolist(), made.inputs, made.outputs, strict=True):
        report = monitor.step(Sample(time=time, dt=time - last, u=u, y=y))
        alarmed |= report.detection is not None
        last = time
    found = monitor.finish() if alarmed else None
    return Told(alarmed=alarmed, named=_named(found))


def _named(found: Diagnosis | None) -> tuple[str, ...]:
    """Give the best candidate, where it is likelier than all else."""
    if found is None or not found.candidates or found.candidates[0].probability <= SURE:
        return ()
    return tuple(sorted(item.parameter for item in found.candidates[0].suspects))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=18)
    parser.add_argument("--first-seed", type=int, default=200)
    chosen = parser.parse_args()
    counts: Counter[tuple[str, str, str]] = Counter()
    for seed in range(chosen.first_seed, chosen.first_seed + chosen.seeds):
        for case, name, made in recordings(seed):
            for key, core in cores().items():
                told = watched(core, made)
                counts[case, key, "alarm"] += told.alarmed
                counts[case, key, "right"] += told.named == (name,)
                counts[case, key, "wrong"] += told.named not in ((), (name,))
    print(f"| {chosen.seeds} motors | correlations | alarm | named, above 50 % | another named, above 50 % |")
    print("|---|---|---|---|---|")
    for case in ("healthy", "at once", "from the first sample"):
        for key in ("without", "with"):
            row = [counts[case, key, what] for what in ("alarm", "right", "wrong")]
            print(f"| {case} | {key} | {' | '.join(map(str, row))} |")


if __name__ == "__main__":
    main()
