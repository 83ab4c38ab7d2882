"""A plant fitted to healthy recordings: parameters, noise of the sensors, and how sure both are.

Maximum of the posterior: the likelihood of the innovations of all recordings, with the declared accuracies as prior.
Where the data contradict an accuracy, it is widened until both agree (the evidence of the data at its largest), and
with it those of all parameters that the data cannot tell from this one. So a nominal value that is far off does no
harm, and what the data do not tell stays where it was.

Source: Ljung 1999, chapter 7 (likelihood of innovations); MacKay, Neural Computation 4 (1992) 415 (width of the prior).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from typing import NamedTuple

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.errors import NoVerdictError, RecordingError
from faultbond.fit.ascent import START_PRIOR, TO_THE_TOP, TURNS, Finish, Summit, ascend, spread_noise
from faultbond.fit.certainty import PARTNER, Certainty, certainty_of, together
from faultbond.fit.constancy import Change, changes_of
from faultbond.fit.objective import FitPoint, FittedPlant, Scored, follow_alone, score_recordings
from faultbond.fit.samples import HealthyRecording
from faultbond.fit.whiteness import Whiteness, test_whiteness
from faultbond.types import STEP

WIDE = 30.0  # accuracies: the prior of the search from several starts
ROUNDS = 8  # of the width of the prior
WIDER = 1.05  # times an accuracy is widened that is worth telling
LEAST_TOLD = 0.3  # parameters of a group; data that tell less say nothing about its accuracies
CAUTION = 1.5  # times the widening of a group of several: which of them is off is not known
STEADY = 0.02  # relative change of the width at which it stands
START_SPREAD = 0.7  # sd of further starts, logarithms or parts of the scale
WILD = 8.0  # standard deviations; a reading farther off is none
FEW_WILD = 0.01  # of all readings; more of them are no accident
WILD_ROUNDS = 4
ALIKE = 1.0  # nats; starts that end so close have found the same


class Prior(Enum):
    """What declared accuracies count for."""

    WIDENED = "widened"
    DECLARED = "declared"
    NONE = "none"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """What was found.

    prior: what declared accuracies counted for; widths: (n_theta,), factors on them; reached: how many of `starts`
    ended at the best summit; courses and simulated, (N, n_outputs), of each recording: innovations of the filter, and
    the plant alone under the inputs.
    """

    plant: FittedPlant
    records: tuple[HealthyRecording, ...]
    summit: Summit
    certainty: Certainty
    prior: Prior
    widths: FloatArray
    starts: int
    reached: int
    before: float
    courses: tuple[Scored, ...]
    simulated: tuple[FloatArray, ...]
    whiteness: tuple[Whiteness, ...]
    changes: tuple[Change, ...]

    @property
    def wild(self) -> tuple[tuple[str, float, int], ...]:
        """Readings that were left out since they lie far off all others: recording, time (s), number of the sensor."""
        return tuple(
            (item.name, float(item.time[k]), int(j))
            for item in self.records
            if item.wild is not None
            for k, j in np.argwhere(item.wild)
        )

    @property
    def contradicted(self) -> dict[str, float]:
        """How many times as large declared accuracies must be for the data to agree with them, by parameter."""
        if self.prior is Prior.NONE:
            return {}
        parameters = self.plant.unknowns.parameters
        return {item.name: float(x) for item, x in zip(parameters, self.widths, strict=True) if x > WIDER}


class Reached(NamedTuple):
    """The best summit, how many starts ended there, and of how many."""

    best: Summit
    alike: int
    starts: int


class Halted(KeyboardInterrupt):
    """A fit that was stopped after a climb had ended; `__cause__` is what stopped it.

    fit : gives what was found by then
    """

    def __init__(self, fit: Callable[[], Fit]) -> None:
        super().__init__()
        self.fit = fit


def fit_plant(
    plant: FittedPlant,
    records: Sequence[HealthyRecording],
    begin: FitPoint,
    *,
    prior: Prior = Prior.WIDENED,
    believed: frozenset[str] = frozenset(),
    starts: int = 4,
    agreeing: int | None = None,
    near: float = 0.0,
    finish: Finish = TO_THE_TOP,
    shaken: bool = True,
    seed: int = 0,
    tell: Callable[[str], None] = lambda text: None,
) -> Fit:
    """Fit a plant to healthy recordings.

    Parameters
    ----------
    plant : likelihood and unknowns
    records : the recordings
    begin : nominal values, and the starts of the recordings
    prior : what declared accuracies count for
    believed : parameters whose accuracies are not widened
    starts : how many starts the search has, the nominal values among them
    agreeing : the search ends where so many of them have ended at the same best values; None: all are tried
    near : part of the least that a climb has gained, so close to the best end those that have found the same
    finish : what a further step of a climb has to bring, and whether there is time for it, or for another start
    shaken : whether it goes on from places around where a climb is stuck
    seed : of the other starts
    tell : takes what is being done

    Raises
    ------
    NoVerdictError
        Where the recordings have no more readings than there are unknowns.
    RecordingError
        Where the plant has no course along the recordings.
    Halted
        Where somebody stops it, once the climb from the first start has ended.
    """
    unknown, readings = len(plant.unknowns.places) + plant.n_own * len(records), sum(item.readings for item in records)
    if readings <= unknown:
        names = ", ".join(record.name for record in records)
        raise NoVerdictError(
            f"{names}: {readings} readings can be used, and {unknown} values are to be found; give a longer recording"
        )
    turns = None if shaken else TURNS
    climbs = _climbs(plant, records, begin, starts, agreeing or starts, near, finish, seed, tell)
    reached = next(climbs)
    try:
        for further in climbs:
            reached = further
        finish = replace(finish, nats=finish.least(reached.best.gained))  # what follows begins near the top
        if shaken and not reached.best.settled:
            reached = reached._replace(best=_on_from(plant, records, begin, reached.best, finish, tell))
        records, best = _without_wild(plant, records, reached.best, finish, tell)
        tell("weighing the declared accuracies")
        told = _steps(tell, "weighing the declared accuracies")
        best, widths = _weigh(plant, records, begin, best, prior, believed, finish, turns, told)
        tell("asking how sure they are")
        return _fit(plant, records, begin, best, prior, np.maximum(widths, 1.0), reached)
    except KeyboardInterrupt as stopped:
        raise Halted(partial(fit_at, plant, records, begin, reached.best.point, prior, reached)) from stopped


def fit_at(
    plant: FittedPlant,
    records: Sequence[HealthyRecording],
    begin: FitPoint,
    point: FitPoint,
    prior: Prior,
    reached: Reached | None = None,
) -> Fit:
    """Give what healthy recordings say of values to which something else has led; nothing is sought.

    Parameters
    ----------
    plant, records : what is fitted to what
    begin : what was known before
    point : the values
    prior : what declared accuracies count for; those to be widened are as wide as the values are away
    reached : the search that led there; None: none did
    """
    unknowns, n = plant.unknowns, plant.unknowns.n_theta
    away = np.abs(point.values - unknowns.nominal)[:n] / unknowns.prior[:n]
    widest = {Prior.WIDENED: np.clip(away, 1.0, WIDE), Prior.DECLARED: np.ones(n), Prior.NONE: np.full(n, WIDE)}
    widths: FloatArray = widest[prior]
    there = ascend(plant, records, point, unknowns.widened(widths), anchor=begin.starts, turns=0)
    return _fit(plant, records, begin, there, prior, widths, reached or Reached(there, 1, 1))


def _fit(
    plant: FittedPlant,
    records: Sequence[HealthyRecording],
    begin: FitPoint,
    best: Summit,
    prior: Prior,
    widths: FloatArray,
    reached: Reached,
) -> Fit:
    """Give all that is asked of a summit."""
    courses, found = _certainty(plant, records, best, widths)
    return Fit(
        plant=plant,
        records=tuple(records),
        summit=best,
        certainty=found,
        prior=prior,
        widths=widths,
        starts=reached.starts,
        reached=reached.alike,
        before=sum(item.value for item in score_recordings(plant, records, begin)),
        courses=courses,
        simulated=tuple(follow_alone(plant, record, best.point, r) for r, record in enumerate(records)),
        whiteness=tuple(
            test_whiteness(name, [item.standardised[:, j] for item in courses]) for j, name in enumerate(plant.sensors)
        ),
        changes=changes_of(plant, records, courses),
    )


def _steps(tell: Callable[[str], None], what: str) -> Callable[[str], None]:
    """Give what tells the steps of a search, where each of them is told."""
    return lambda step: tell(f"{what}{STEP}{step}")


def _after(tell: Callable[[str], None], words: str) -> Callable[[str], None]:
    """Give what tells a step with words after it."""
    return lambda step: tell(f"{step}{words}")


def _certainty(
    plant: FittedPlant, records: Sequence[HealthyRecording], best: Summit, widths: FloatArray
) -> tuple[tuple[Scored, ...], Certainty]:
    """Give what each recording says at the summit, and how sure that is."""
    unknowns = plant.unknowns
    courses = score_recordings(plant, records, best.point)
    full = np.concatenate([unknowns.widened(widths), np.full(best.point.starts.size, START_PRIOR)])
    n, n_theta = len(unknowns.places), unknowns.n_theta
    return courses, certainty_of(best.evaluation.information, full, courses, n, n_theta, unknowns.prior[:n_theta])


def _climbs(
    plant: FittedPlant,
    records: Sequence[HealthyRecording],
    begin: FitPoint,
    starts: int,
    agreeing: int,
    near: float,
    finish: Finish,
    seed: int,
    tell: Callable[[str], None],
) -> Iterator[Reached]:
    """Climb from several starts under a wide prior until so many agree; give what was reached after each.

    None goes on from places around where it is stuck, nor where it is behind the best and would stay so: most do.
    """
    rng = np.random.default_rng(seed)
    unknowns, summits = plant.unknowns, list[Summit]()
    prior = unknowns.widened(WIDE)
    for k in range(starts):
        start = f"start {k + 1} of {starts}"
        tell(start)
        values = begin.values.copy()
        values[: unknowns.n_theta] += START_SPREAD * rng.standard_normal(unknowns.n_theta) if k else 0.0
        point = replace(begin, values=np.clip(values, unknowns.lower, unknowns.upper)) if k else begin
        point = spread_noise(plant, records, point)
        told, rival = _steps(tell, start), max(summits, key=lambda item: item.posterior, default=None)
        summits.append(ascend(plant, records, point, prior, turns=TURNS, finish=finish, rival=rival, tell=told))
        best = max(summits, key=lambda item: item.posterior)
        if np.isfinite(best.posterior):
            close = max(ALIKE, finish.least(best.gained), near * min(item.gained for item in summits))
            alike = sum(item.posterior > best.posterior - close for item in summits)
            yield Reached(best, alike, len(summits))
            if alike >= agreeing or not finish.in_time():
                return
    if not np.isfinite(best.posterior):
        raise RecordingError(_without_course(plant, records, begin))


def _on_from(
    plant: FittedPlant,
    records: Sequence[HealthyRecording],
    begin: FitPoint,
    stuck: Summit,
    finish: Finish,
    tell: Callable[[str], None],
) -> Summit:
    """Climb on from where the best start is stuck, and from places around."""
    told, prior = _steps(tell, "going on from the best start"), plant.unknowns.widened(WIDE)
    return ascend(plant, records, stuck.point, prior, anchor=begin.starts, finish=finish, tell=told)


def _without_course(plant: FittedPlant, records: Sequence[HealthyRecording], begin: FitPoint) -> str:
    """Say where the plant with its nominal values has no value: which sensor, in which recording, when."""
    for r, record in enumerate(records):
        none = record.use & ~np.isfinite(follow_alone(plant, record, begin, r))
        if not none.any():
            continue
        row = int(np.argmax(none.any(axis=1)))
        where = f"{record.name}: at {record.time[row]:.10g} s"
        if none[row].sum() == record.use[row].sum() > 1:
            return f"{where} the plant with its nominal values has no finite course any more; check units and values"
        names = ", ".join(name for name, lost in zip(plant.sensors, none[row], strict=True) if lost)
        return (
            f"{where} what the sensor {names} reads has no finite value with the nominal values, as a quotient by a "
            "flow of 0 has none. State by `valid_when` of the sensor when it reads as its law says, or write the law "
            "so that it always has a value"
        )
    names = ", ".join(record.name for record in records)
    return f"{names}: the plant with its nominal values has no finite course along it; check units and nominal values"


def _without_wild(
    plant: FittedPlant,
    records: Sequence[HealthyRecording],
    best: Summit,
    finish: Finish,
    tell: Callable[[str], None],
) -> tuple[tuple[HealthyRecording, ...], Summit]:
    """Leave out readings that lie far off, as long as they are few, and climb on without them."""
    kept = tuple(records)
    for _ in range(WILD_ROUNDS):
        far = [np.abs(item.standardised) > WILD for item in score_recordings(plant, kept, best.point)]
        count = sum(int(item.sum()) for item in far)
        if not count or count > FEW_WILD * sum(item.readings for item in kept):
            break
        fewer = tuple(item.without(wild) for item, wild in zip(kept, far, strict=True))
        begin = spread_noise(plant, fewer, best.point)
        wide = plant.unknowns.widened(WIDE)
        told = _steps(tell, "leaving out readings that lie far off")
        found = ascend(plant, fewer, begin, wide, anchor=best.point.starts, turns=TURNS, finish=finish, tell=told)
        if not np.isfinite(found.posterior):  # without them the filter goes astray
            break
        kept, best = fewer, found
    return kept, best


def _weigh(
    plant: FittedPlant,
    records: Sequence[HealthyRecording],
    begin: FitPoint,
    best: Summit,
    prior: Prior,
    believed: frozenset[str],
    finish: Finish,
    turns: int | None,
    tell: Callable[[str], None],
) -> tuple[Summit, FloatArray]:
    """Climb on with the declared accuracies, as wide as the data ask; give the summit and the factors."""
    unknowns, n = plant.unknowns, plant.unknowns.n_theta
    if prior is Prior.NONE or not n:
        return best, np.full(n, WIDE)
    accuracies = unknowns.prior[:n]
    groups: BoolArray = together(best.evaluation.information, unknowns.widened(WIDE), n)
    alone = groups.sum(axis=1) == 1
    widths, most = np.ones(n), np.full(n, WIDE)
    if prior is Prior.WIDENED:
        # What the data fix less well than declared, a scale that all have in common say, they fix by what the model
        # gets a little wrong: there they count less, as their errors are alike for long, and no accuracy is widened.
        sure = _certainty(plant, records, best, np.full(n, WIDE))[1]
        for row in np.abs(sure.faint):
            most = np.where(row > PARTNER * row.max(), 1.0 / sure.inflation[:n], most)
        most = np.minimum(most, [1.0 if item.name in believed else WIDE for item in unknowns.parameters])
        # From a narrow prior the widening may not get away, where this outweighs data that are clear. So it begins at
        # how many times as wide as declared accuracies must be for what the data say almost alone.
        known = accuracies**2 + np.diag(np.linalg.inv(best.precision))[:n]
        away = (best.point.values - unknowns.nominal)[:n] ** 2 / known
        widths = np.minimum(np.clip(np.sqrt(groups @ away / groups.sum(axis=1)), 1.0, WIDE), most)
    rounds = 1 if prior is Prior.DECLARED else ROUNDS
    for k in range(rounds):
        wide, each = unknowns.widened(widths), _after(tell, f", round {k + 1} of at most {rounds}")
        turns = TURNS if k else turns  # places around were tried, and the widths hardly change any more
        best = ascend(plant, records, best.point, wide, anchor=begin.starts, turns=turns, finish=finish, tell=each)
        away = ((best.point.values - unknowns.nominal)[:n] / accuracies) ** 2
        left = np.diag(np.linalg.inv(best.precision))[:n] / (widths * accuracies) ** 2
        told = 1.0 - np.clip(left, 0.0, 1.0)
        wanted = np.sqrt(groups @ away / np.maximum(groups @ told, 1e-3))
        wanted = np.clip(np.where(alone, wanted, 1.0 + CAUTION * (wanted - 1.0)), 1.0, WIDE)
        if prior is Prior.DECLARED:
            break
        wanted = np.where(groups @ told < LEAST_TOLD, np.minimum(wanted, widths), wanted)
        wanted = np.minimum(wanted, most)
        if np.all(np.abs(wanted - widths) <= STEADY * widths):
            break
        widths = wanted
    return best, widths
