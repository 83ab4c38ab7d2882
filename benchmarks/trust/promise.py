"""Whether the promised mean time between false alarms is kept: healthy plants, watched for long.

    python -m benchmarks.trust.promise [--hours 40] [--first-seed 9000] [--markdown FILE]

`--hours` is how long each tank is watched; motor and circuit, of 50 and 40 samples a second, are for a twentieth of it.
An alarm of a healthy plant is a false one; the monitor then starts anew. The plants are either just as their models, or
off as in the table of trust. Of alarms that come at random, n in a time T, the mean time between two is with 95 % no
less than 2 T / chi2(0.95, 2 n + 2), and no more than 2 T / chi2(0.05, 2 n).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.stats import chi2

from benchmarks.shared.page import arguments, note, publish
from benchmarks.shared.plants import graph_of, recipe_module, tank_start
from benchmarks.shared.play import core_with, samples
from faultbond.arrays import FloatArray
from faultbond.contract.samples import Status
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Effects, Inputs, Policy, Simulation, random_steps, simulate, sines

HOUR = 3600.0
HEADER = ("plant", "promised", "watched", "false alarms", "promised times", "mean time at least", "verdict")
CONFIDENCE = 0.95

Make = Callable[[int, float, bool], Simulation]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """A plant on trial.

    off : how it differs from its model, in words
    make : records it; seed, seconds, whether it is off
    promises : mean times between false alarms, s
    part : of the hours asked for; piece : longest recording, s
    """

    folder: str
    name: str
    off: str
    make: Make
    promises: tuple[float, ...]
    part: float
    piece: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Count:
    """False alarms in a time during which the alarms were on, s."""

    alarms: int = 0
    watched: float = 0.0

    @property
    def least(self) -> float:
        """Mean time between alarms that is exceeded with 95 % confidence, s."""
        return 2.0 * self.watched / float(chi2.ppf(CONFIDENCE, 2 * self.alarms + 2))

    @property
    def most(self) -> float:
        """Mean time between alarms that is not exceeded with 95 % confidence, s."""
        return 2.0 * self.watched / float(chi2.ppf(1.0 - CONFIDENCE, 2 * self.alarms)) if self.alarms else np.inf

    def verdict(self, promise: float) -> str:
        """Say whether a promise is kept, as far as this tells."""
        return "kept" if self.least >= promise else "broken" if self.most < promise else "open"


def tank(seed: int, seconds: float, off: bool) -> Simulation:
    """Record the water tank, which goes through its recipe again and again."""
    module, start = recipe_module("tank"), tank_start(np.random.default_rng([seed, 1]).uniform(0.4, 0.7))
    policy = Policy(time=np.arange(seconds), begin=module.recipe)
    return simulate(graph_of("tank"), policy, (), seed=seed, effects=module.EFFECTS if off else Effects(), start=start)


def motor(seed: int, seconds: float, off: bool) -> Simulation:
    """Record the DC motor under random steps of voltage."""
    time, generator = _times("dc_motor", seconds), np.random.default_rng([seed, 1])
    voltage = random_steps(time, generator, low=2.0, high=12.0, shortest=1.0, longest=4.0)
    return _driven("dc_motor", time, voltage, seed, off)


def circuit(seed: int, seconds: float, off: bool) -> Simulation:
    """Record the RLC circuit under two sines."""
    time = _times("rlc", seconds)
    first, second = np.random.default_rng([seed, 1]).uniform(0.0, 2.0 * np.pi, 2)
    return _driven("rlc", time, sines(time, [(10.0, 0.25, first), (4.0, 0.6, second)]), seed, off)


_SMALL = "off by up to 1.5 %"
_TANK = "off by up to 3 %, valves with lag and wrong curves"
PLANTS = (
    Plant(folder="tank", name="tank", off=_TANK, make=tank, promises=(2 * HOUR, 24 * HOUR), part=1.0, piece=8 * HOUR),
    Plant(folder="dc_motor", name="motor", off=_SMALL, make=motor, promises=(600.0,), part=0.05, piece=900.0),
    Plant(folder="rlc", name="RLC circuit", off=_SMALL, make=circuit, promises=(600.0,), part=0.05, piece=900.0),
)


def _times(folder: str, seconds: float) -> FloatArray:
    dt = graph_of(folder).sample_time or 1.0
    return np.asarray(np.arange(round(seconds / dt)) * dt, dtype=np.float64)


def _driven(folder: str, time: FloatArray, voltage: FloatArray, seed: int, off: bool) -> Simulation:
    effects = recipe_module(folder).EFFECTS if off else Effects()
    return simulate(graph_of(folder), Inputs(time=time, values=voltage[:, None]), (), seed=seed, effects=effects)


@cache
def promised(folder: str, promise: float) -> Core:
    """Give a core that makes a promise; it has no hypotheses, since only the alarm counts here."""
    return core_with(replace(graph_of(folder), time_between_false_alarms=promise), _without_bank)


def _without_bank(spec: EngineSpec) -> EngineSpec:
    inputs = tuple(replace(item, suspect=False) for item in spec.inputs)
    outputs = tuple(replace(item, suspect=False) for item in spec.outputs)
    return replace(spec, hypotheses=(), reserve=(), inputs=inputs, outputs=outputs)


def count(core: Core, recording: Simulation) -> Count:
    """Watch a healthy recording; after each alarm the monitor starts anew."""
    monitor, alarms, watched = Monitor(core), 0, 0.0
    for sample in samples(recording):
        report = monitor.step(sample)
        watched += sample.dt * (report.status is Status.WATCHING or report.detection is not None)
        if report.detection is not None:
            monitor, alarms = Monitor(core), alarms + 1
    return Count(alarms=alarms, watched=watched)


def trial(plant: Plant, hours: float, first: int, off: bool) -> Iterator[tuple[float, Count]]:
    """Give each promise and what became of it."""
    total = plant.part * hours * HOUR
    pieces = max(1, round(total / plant.piece))
    found = dict.fromkeys(plant.promises, Count())
    for k in range(pieces):
        recording = plant.make(first + k, min(plant.piece, total), off)
        for promise, before in found.items():
            new = count(promised(plant.folder, promise), recording)
            found[promise] = Count(alarms=before.alarms + new.alarms, watched=before.watched + new.watched)
    yield from found.items()


def rows(hours: float, first: int, plants: Sequence[Plant]) -> list[tuple[str, ...]]:
    """Give the lines of the table."""
    return [
        (
            f"{plant.name}, {plant.off if off else 'as its model'}",
            span(promise),
            span(found.watched),
            str(found.alarms),
            f"{found.watched / promise:.1f}",
            span(found.least),
            found.verdict(promise),
        )
        for plant in plants
        for off in (False, True)
        for promise, found in trial(plant, hours, first, off)
    ]


def span(seconds: float) -> str:
    """Give a time in hours, or in minutes below two."""
    return f"{seconds / HOUR:.3g} h" if seconds >= 2.0 * HOUR else f"{seconds / 60.0:.3g} min"


def main(argv: Sequence[str] | None = None) -> None:
    """Watch, print, write."""
    words = "Whether the promised time between false alarms is kept."
    chosen = arguments(words, argv, hours=40.0, first_seed=9000)
    table = rows(chosen.hours, chosen.first_seed, PLANTS)
    publish("trust.promise", chosen, note(f"Seeds from {chosen.first_seed} on"), (HEADER, table))


if __name__ == "__main__":
    main()
