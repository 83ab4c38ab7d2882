"""A model on trial on healthy recordings: would it alarm, how often, where is it wrong, and what must it declare."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.fit.false_alarms import Rate, alarm_rates, between_alarms
from faultbond.fit.innovations import Variant, Watch, watch_recording
from faultbond.fit.lack_of_fit import Moment, Region, moments, wrong_regions
from faultbond.fit.samples import HealthyRecording
from faultbond.runtime.core import Core

FACTORS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0)
MONTH = 30.0 * 86400.0  # s
KINDS = ("accuracy", "noise", "slow")


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclarationTrial:
    """What the detector would do if accuracies, noise or slow errors were declared so many times larger.

    peak: the largest statistic as a part of its limit; between: expected seconds between false alarms.
    """

    kind: str
    factor: float
    peak: float
    between: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Health:
    """A model on healthy recordings. needed: smallest factor of each kind that keeps the promise; None: none does."""

    promise: float
    step: float
    records: tuple[HealthyRecording, ...]
    watches: tuple[Watch, ...]
    rates: tuple[Rate, ...]
    regions: tuple[Region, ...]
    moments: tuple[Moment, ...]
    trials: tuple[DeclarationTrial, ...]

    @property
    def between(self) -> float:
        """Expected seconds between false alarms as declared."""
        return between_alarms(self.rates)

    @property
    def peak(self) -> float:
        """The largest statistic on the recordings as a part of its limit; an alarm above 1."""
        return max((item.peak for item in self.rates), default=0.0)

    @property
    def keeps(self) -> bool:
        """Whether the promise is kept as declared."""
        return self.peak <= 1.0 and self.between >= self.promise

    @property
    def needed(self) -> dict[str, float | None]:
        """The smallest factor of each kind that keeps the promise; None where none of those tried does."""
        found: dict[str, float | None] = {}
        for kind in dict.fromkeys(item.kind for item in self.trials):
            found[kind] = min(
                (
                    item.factor
                    for item in self.trials
                    if item.kind == kind and item.peak <= 1.0 and item.between >= self.promise
                ),
                default=None,
            )
        return found


def on_trial(core: Core, records: Sequence[HealthyRecording], promise: float = MONTH) -> Health:
    """Put a model on trial.

    Parameters
    ----------
    core : of the model, as the monitor runs it
    records : healthy recordings
    promise : seconds between false alarms that are wanted at least
    """
    spec = core.spec
    steps = np.concatenate([item.samples[1:, 0] for item in records])
    step = float(np.median(steps)) if len(steps) else 1.0
    none = {"accuracy": not spec.parameters, "noise": False, "slow": not spec.slow_errors}
    tried = {(kind, factor): Variant(**{kind: factor}) for kind in KINDS if not none[kind] for factor in FACTORS}
    variants = list(dict.fromkeys([Variant(), *tried.values()]))
    seen = list(zip(*(watch_recording(core, item, variants) for item in records), strict=True))
    found = {variant: alarm_rates(spec, watches, step) for variant, watches in zip(variants, seen, strict=True)}
    trials = []
    for (kind, factor), variant in tried.items():
        statistics = found[variant]
        peak = max((item.peak for item in statistics), default=0.0)
        trials.append(DeclarationTrial(kind=kind, factor=factor, peak=peak, between=between_alarms(statistics)))
    return Health(
        promise=promise,
        step=step,
        records=tuple(records),
        watches=seen[0],
        rates=found[Variant()],
        regions=wrong_regions(spec, records, seen[0]),
        moments=moments(spec, records, seen[0]),
        trials=tuple(trials),
    )
