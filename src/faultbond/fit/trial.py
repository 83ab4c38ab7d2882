"""A model on trial on healthy recordings: would it alarm, how often, where is it wrong, and what must it declare."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.fit.false_alarms import SENSOR, Rate, alarm_rates, between_alarms
from faultbond.fit.hints import Early, Late, early_sensors, late_sensors, mirrored_sensors
from faultbond.fit.innovations import LOST, Variant, Watch, strayed_in, take_recordings, watch_recording, watch_taken
from faultbond.fit.lack_of_fit import Moment, Region, moments, wrong_regions
from faultbond.fit.samples import HealthyRecording
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor

FACTORS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0)
MONTH = 30.0 * 86400.0  # s
WIDER = (1.5, 2.0, 3.0)  # times the accuracies that are tried alone
WIDEST = WIDER[-1]  # times as large; a parameter that needs more is no constant
LOOSEST = 10.0  # and of one that is no suspect
RISE = 1.25  # by which noise or slow errors rise at least,
LEAP = RISE**3  # and at most, at once: where a sensor scatters twice as much as declared sums climb without end
MOST_RISES = 40
NEAR = 0.2  # of how far the worst statistic is beyond its limit; noise of sensors that are so far rises with it
LARGEST, LOUDEST = 5.0, 20.0  # times a slow error, and a noise; one that must be larger is none
LASTING = 20.0  # samples; a slow error of a sensor that is shorter is much like its noise
KINDS = ("accuracy", "noise", "slow")
BLIND = 0.25  # standard deviation of scores, below which most of what a sensor shows is let be
ROOM = 0.7  # of every limit: recordings that are as quiet are so on other days too
# The same of how far a parameter may walk in which no fault is sought. That one walks too far only says that the model
# is off, and hides what changes later; and three recordings hardly tell how far it walks in a fourth.
CALM = ROOM / 2.0


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
    """A model on healthy recordings. needed: smallest factor of each kind that keeps the promise; None: none does.

    walk: how far a parameter walked at most as a part of its limit, and walker, which; empty: none was judged;
    strayed: the same from where it started, of each that was ever the farthest; late: sensors that come later than the
    model says; early: that come a row sooner; mirrored: those that move the other way round
    """

    promise: float
    step: float
    records: tuple[HealthyRecording, ...]
    watches: tuple[Watch, ...]
    rates: tuple[Rate, ...]
    regions: tuple[Region, ...]
    moments: tuple[Moment, ...]
    trials: tuple[DeclarationTrial, ...]
    walk: float
    walker: str
    strayed: dict[str, float]
    late: tuple[Late, ...]
    early: tuple[Early, ...]
    mirrored: tuple[str, ...]

    @property
    def between(self) -> float:
        """Expected seconds between false alarms as declared."""
        return between_alarms(self.rates)

    @property
    def at_most(self) -> float:
        """The same, if by chance the recordings show more than is usual, by two standard deviations."""
        return between_alarms([replace(item, between=item.between * item.longer) for item in self.rates])

    @property
    def peak(self) -> float:
        """The largest statistic on the recordings as a part of its limit; an alarm above 1."""
        return max((item.peak for item in self.rates), default=0.0)

    @property
    def lost(self) -> tuple[tuple[str, float], ...]:
        """Recordings in which the filter has lost the plant, and when, s."""
        found = []
        for record, seen in zip(self.records, self.watches, strict=True):
            gone = np.flatnonzero((seen.scores >= LOST).any(axis=1))
            found += [(record.name, float(record.time[k])) for k in gone[:1]]
        return tuple(found)

    @property
    def blind(self) -> tuple[Rate, ...]:
        """Sensors of which nearly all is let be."""
        return tuple(item for item in self.rates if item.kind == SENSOR and item.memory > 0.0 and item.spread < BLIND)

    @property
    def has_room(self) -> bool:
        """Whether the promise is kept and every statistic stays well below its limit."""
        return self.keeps and max(self.peak, self.walk) <= ROOM

    @property
    def keeps(self) -> bool:
        """Whether the promise is kept as declared."""
        return max(self.peak, self.walk) <= 1.0 and self.between >= self.promise

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


def on_trial(
    core: Core, records: Sequence[HealthyRecording], promise: float = MONTH, factors: Sequence[float] = FACTORS
) -> Health:
    """Put a model on trial.

    Parameters
    ----------
    core : of the model, as the monitor runs it
    records : healthy recordings
    promise : seconds between false alarms that are wanted at least
    factors : how many times as large accuracies, noise or slow errors are tried
    """
    spec = core.spec
    step = _step(records)
    none = {"accuracy": not spec.parameters, "noise": False, "slow": not spec.slow_errors}
    tried = {(kind, factor): Variant(**{kind: factor}) for kind in KINDS if not none[kind] for factor in factors}
    variants = list(dict.fromkeys([Variant(), *tried.values()]))
    taken = take_recordings(core, records)
    seen = list(zip(*watch_taken(core, taken, variants, alone=True), strict=True))
    found = {variant: alarm_rates(spec, watches, step) for variant, watches in zip(variants, seen, strict=True)}
    trials = []
    for (kind, factor), variant in tried.items():
        statistics = found[variant]
        peak = max((item.peak for item in statistics), default=0.0)
        trials.append(DeclarationTrial(kind=kind, factor=factor, peak=peak, between=between_alarms(statistics)))
    farthest = max(seen[0], key=lambda item: item.walk)
    return Health(
        promise=promise,
        step=step,
        records=tuple(records),
        watches=seen[0],
        rates=found[Variant()],
        regions=wrong_regions(spec, records, seen[0]),
        moments=moments(spec, records, seen[0]),
        trials=tuple(trials),
        walk=farthest.walk,
        walker=spec.parameters[farthest.walker].name if farthest.walker >= 0 else "",
        strayed=_strayed(core, [item.strayed for item in seen[0]]),
        late=late_sensors(spec, records, seen[0]),
        early=early_sensors(spec, records, seen[0]),
        mirrored=mirrored_sensors(spec, records, seen[0]),
    )


def strayed_on(core: Core, records: Sequence[HealthyRecording]) -> dict[str, float]:
    """Give how far parameters stray from where they start, as `Health.strayed`, for a tenth of what a trial costs."""
    return _strayed(core, [strayed_in(core, item) for item in records])


def _strayed(core: Core, seen: Sequence[FloatArray]) -> dict[str, float]:
    most = np.max(seen, axis=0).tolist()
    return {item.name: x for item, x in zip(core.spec.parameters, most, strict=True) if x > 0.0}


def widest_of(suspect: bool) -> float:
    """Give how many times as large the accuracy of a parameter may be declared as a fit says.

    More of one that is no suspect, as the lag of a sensor: no fault is sought in it.
    """
    return WIDEST if suspect else LOOSEST


def stays_below(core: Core, records: Sequence[HealthyRecording], most: float) -> bool:
    """Tell whether every statistic stays below a part of its limit on every recording, as far as accuracies let it.

    How far a parameter strays from its start is in accuracies, which may be declared WIDEST times as large.
    """
    step = _step(records)
    for record in records:
        (seen,) = watch_recording(core, record)
        strayed = float(np.max(seen.strayed, initial=0.0))
        walk = seen.walk if seen.walk > strayed else strayed / WIDEST
        if max(walk, *(item.peak for item in alarm_rates(core.spec, (seen,), step))) > most:
            return False
    return True


def first_alarm(core: Core, record: HealthyRecording) -> float | None:
    """Give the time, s, at which the monitor itself alarms on a recording; None: it does not."""
    monitor = Monitor(core, only_alarms=True)
    for point in record.points:
        if monitor.push(point) and (found := monitor.report.detection) is not None:
            return found.time
    return None


def alarms_of(core: Core, records: Sequence[HealthyRecording]) -> dict[str, float]:
    """Give when the monitor alarms, s, by the name of the recording; none of those on which it does not."""
    found = {item.name: first_alarm(core, item) for item in records}
    return {name: time for name, time in found.items() if time is not None}


def enough(
    core: Core,
    records: Sequence[HealthyRecording],
    promise: float,
    most: float = ROOM,
    *,
    noise: Sequence[float] | None = None,
) -> Variant | None:
    """Give what must be declared larger for the promise to be kept, as little as that takes; None: nothing is enough.

    All statistics shall stay below `most` of their limits. noise: how many times as large that of each sensor is at
    least.

    First accuracies alone, which cost little, since parameters are learned; then, with accuracies as they are, step by
    step what alarms most often: a slow error, or of a sensor its noise, with that of others that are far beyond their
    limits, or its own slow error, whichever helps more. A step goes half of the way at most, as ratios, since a sum
    falls faster than noise rises. No slow error more than LARGEST times, since a plant that may do anything is quiet
    and deaf, nor noise LOUDEST times.
    """
    step, taken = _step(records), take_recordings(core, records)

    def rates(variant: Variant) -> tuple[Rate, ...]:
        seen = [item for (item,) in watch_taken(core, taken, (variant,))]
        return alarm_rates(core.spec, seen, step)

    def missing(found: tuple[Rate, ...]) -> tuple[float, float]:
        return sum(max(item.peak / most - 1.0, 0.0) for item in found), max(promise - between_alarms(found), 0.0)

    for factor in WIDER if core.spec.parameters and noise is None else ():
        if not any(missing(rates(Variant(accuracy=factor)))):
            return Variant(accuracy=factor)
    now = Variant(noise=tuple(noise or (1.0,) * len(core.spec.outputs)), slow=(1.0,) * len(core.spec.slow_errors))
    found = rates(now)
    for _ in range(MOST_RISES):
        if not any(missing(found)):
            return now
        # First what comes too near to its limit, then what alarms most often.
        worst = min(range(len(found)), key=lambda k: (found[k].peak <= most, found[k].between, -found[k].peak))
        far = np.array([item.peak / most for item in found])
        rises = np.where(far > max(1.0, NEAR * far[worst]), np.clip(np.sqrt(far), RISE, LEAP), 1.0)
        rises[worst] = max(rises[worst], RISE)
        tried = [(larger, rates(larger)) for larger in _larger(core.spec, now, worst, step, rises)]
        if not tried:
            return None
        now, found = min(tried, key=lambda one: (missing(one[1]), max(item.peak for item in one[1])))
    return None


def _larger(spec: EngineSpec, now: Variant, worst: int, step: float, rises: FloatArray) -> list[Variant]:
    """Give what may be declared larger where statistic number `worst` is too large, by so much of each, `rises` (n,).

    What goes with moves of an input has sizes of its own for these, so that stays.
    """
    noise, slow, rise = np.array(now.noise), np.array(now.slow), rises[worst]
    louder = noise * rises[: len(noise)]
    if worst < len(noise):
        own = [
            k
            for k, item in enumerate(spec.slow_errors)
            if item.output == worst and item.memory >= LASTING * step and not item.after
        ]
    else:
        own = [[k for k, item in enumerate(spec.slow_errors) if item.alarms][worst - len(noise)]]
    may_be_louder = worst < len(noise) and louder[worst] <= LOUDEST
    noises = [np.where(louder <= LOUDEST, louder, noise)] if may_be_louder else []
    slows = [np.where(np.arange(len(slow)) == k, rise, 1.0) * slow for k in own]
    return [
        *(replace(now, noise=tuple(sizes.tolist())) for sizes in noises),
        *(replace(now, slow=tuple(sizes.tolist())) for sizes in slows if sizes.max() <= LARGEST),
    ]


def _step(records: Sequence[HealthyRecording]) -> float:
    """Give the usual time between samples, s."""
    steps = np.concatenate([item.samples[1:, 0] for item in records])
    return float(np.median(steps)) if len(steps) else 1.0
