"""The monitor's healthy filter along a recording, with sizes of noise and accuracies varied.

The monitor itself, its alarms off, says what its filter takes and what its sums count; accuracies, noise and slow
errors enter as data, so that none of the variants needs another core, and each is one call of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.spec import covariance_place
from faultbond.fit.cusum import heights_along
from faultbond.fit.response import raised_inputs, way_between, with_raised
from faultbond.fit.samples import HealthyRecording, trusted
from faultbond.fit.side_by_side import side_by_side
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor

LOST = 1e6  # sd; the score where a filter has lost its variance


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """What is declared, in what the model declares: accuracies, noise of sensors, slow errors (of each, if several)."""

    accuracy: float = 1.0
    noise: float | tuple[float, ...] = 1.0
    slow: float | tuple[float, ...] = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Watch:
    """What the detector saw; nan where it looked at nothing.

    scores (N, n_outputs): innovations in their standard deviations, from the end of the warm-up; climbs (3, N,
    n_outputs): the sums up, down and of the scatter, see `fit.cusum`; height (N, n_outputs): the largest, as the
    monitor itself says where all is as declared; slow (N, n_slow): slow errors in their declared sizes. walk: how far a
    parameter walked at most, with everything as declared; 1: an alarm; walker: the parameter, -1: none was judged;
    strayed (n_parameters,): how far each was from where it started, where none had walked farther. Where asked for:
    alone (N, n_outputs): what the plant alone shows under the inputs, SI; ways (n_outputs, n_inputs): how far each
    output moves on the whole where an input is a little larger, SI, which no controller turns round.
    """

    scores: FloatArray
    climbs: FloatArray
    height: FloatArray
    slow: FloatArray
    walk: float
    walker: int
    strayed: FloatArray
    alone: FloatArray
    ways: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Taken:
    """What the monitor's filter took of a recording of `count` samples: of the n from its start on.

    rows: (n, n_sample), packed; started: how many of them it gathered for its start. use, settling: (n, n_outputs),
    whether the sums take the reading, or forget those before. astray: (n,), whether a gap is felt. height: (count,
    n_outputs), the largest sum of each sensor, as the monitor says. walk, walker, strayed: see `Watch`.
    """

    count: int
    rows: FloatArray
    started: int
    use: BoolArray
    settling: BoolArray
    astray: BoolArray
    height: FloatArray
    walk: float
    walker: int
    strayed: FloatArray


def watch_recording(
    core: Core, record: HealthyRecording, variants: Sequence[Variant] = (Variant(),), *, alone: bool = False
) -> tuple[Watch, ...]:
    """Give what the detector sees of a recording, alarms or not, for each way to declare.

    Parameters
    ----------
    core : of the model, as the monitor runs it
    record : the recording
    variants : what is declared otherwise
    alone : whether it is asked for what the plant shows by itself; each input takes another run
    """
    return watch_taken(core, (take_recording(core, record),), variants, alone=alone)[0]


def watch_taken(
    core: Core, taken: Sequence[Taken], variants: Sequence[Variant] = (Variant(),), *, alone: bool = False
) -> tuple[tuple[Watch, ...], ...]:
    """Give what the detector sees of recordings that the monitor has taken, of each for each way to declare.

    All are summed up side by side, the shorter ones filled up with samples that nothing is read of.
    """
    spec, count = core.spec, max((item.count for item in taken), default=0)
    shape = (len(variants), len(taken), count, len(spec.outputs))
    scores, slow = np.full(shape, np.nan), np.full((*shape[:3], len(spec.slow_errors)), np.nan)
    shown, ways = np.full(shape[1:], np.nan), [np.zeros((0, 0))] * len(taken)
    use, forget, astray = np.zeros((3, *shape[1:]), dtype=bool)
    found = list(side_by_side(lambda item: _runs(replace(core), item, variants, alone=alone), taken))
    for r, item in enumerate(taken):
        first = item.count - len(item.rows)
        warm = first + spec.thresholds.warm_up_samples
        for k, (innovations, errors) in enumerate(found[r][: len(variants)]):
            scores[k, r, first : item.count], slow[k, r, first : item.count] = innovations, errors
        if alone:
            by_itself, ways[r] = found[r][-1]
            shown[r, first : item.count] = np.where(item.use, by_itself, np.nan)
        scores[:, r, :warm], slow[:, r, :warm] = np.nan, np.nan
        use[r, first : item.count], astray[r, first : item.count] = item.use, item.astray[:, None]
        forget[r, first : item.count] = item.settling | item.astray[:, None]
        use[r, :warm], astray[r, :warm], forget[r, :warm] = False, False, False
    along = (np.moveaxis(item, 1, 0)[:, None] for item in (use, forget, astray))
    climbs = np.moveaxis(heights_along(spec.thresholds, np.moveaxis(scores, 2, 0), *along), 1, 3)
    scores[:, ~use] = np.nan
    return tuple(
        tuple(
            Watch(
                scores=scores[k, r, : item.count],
                climbs=climbs[:, k, r, : item.count],
                height=item.height if variant == Variant() else climbs[:, k, r, : item.count].max(axis=0),
                slow=slow[k, r, : item.count],
                walk=item.walk,
                walker=item.walker,
                strayed=item.strayed,
                alone=shown[r, : item.count],
                ways=ways[r],
            )
            for k, variant in enumerate(variants)
        )
        for r, item in enumerate(taken)
    )


def take_recordings(core: Core, records: Sequence[HealthyRecording]) -> list[Taken]:
    """Run the monitor with its alarms off on recordings, each with memory of its own."""
    return list(side_by_side(lambda record: take_recording(replace(core), record), records))


def take_recording(core: Core, record: HealthyRecording) -> Taken:
    """Run the monitor with its alarms off."""
    spec, monitor, started = core.spec, Monitor(core, quiet=True), 0
    rows, known, astray, first = list[FloatArray](), list[bool](), list[bool](), 0
    height = np.zeros((len(record.points), len(spec.outputs)))
    walk, walker, strayed = 0.0, -1, np.zeros(len(spec.parameters))
    waits = int(core_settings()["PENDING"])  # samples for which rows may change, until it is known what an input was
    for number, point in enumerate(record.points):
        monitor.push(point)
        height[number] = monitor.cusum
        if not started and monitor.number("clock.running") > 0:
            first = int(monitor.number("clock.begun"))
            started = number + 1 - first
        if not started:
            continue
        rows += [monitor.row(k)[0] for k in range(first + len(rows), number + 1 - waits)]
        new = number + 1 - first - len(known)
        known += [monitor.knows_inputs] * new
        astray += [bool(monitor.numbers("healthy.astray").any())] * new
        if (walked := monitor.number("healthy.walk")) > 0.0:
            who, from_start = _walker(monitor)
            walk, walker = (walked, who) if walked > walk else (walk, walker)
            strayed[who] = max(strayed[who], walked) if from_start else strayed[who]
    if started:
        rows += [monitor.row(k)[0] for k in range(first + len(rows), len(record.points))]
    packed = np.array(rows).reshape(-1, spec.n_sample)
    use = trusted(spec, packed)
    return Taken(
        count=len(record.time),
        rows=packed,
        started=started,
        use=use & np.array(known, dtype=bool)[:, None],
        settling=(packed[:, spec.sample_fields["use"]] > 0) & ~use,
        astray=np.array(astray, dtype=bool),
        height=np.nan_to_num(height[len(record.points) - len(record.time) :]),
        walk=walk,
        walker=walker,
        strayed=strayed,
    )


def strayed_in(core: Core, record: HealthyRecording) -> FloatArray:
    """Give `Taken.strayed` alone, (n_parameters,), for a third of what it costs to take all of a recording."""
    monitor, strayed = Monitor(core, quiet=True), np.zeros(len(core.spec.parameters))
    for point in record.points:
        monitor.push(point)
        if (walked := monitor.number("healthy.walk")) > 0.0:
            who, from_start = _walker(monitor)
            strayed[who] = max(strayed[who], walked) if from_start else strayed[who]
    return strayed


def _walker(monitor: Monitor) -> tuple[int, bool]:
    """Give which parameter walked farthest after the last sample, and whether that is from where it started."""
    window, who = divmod(int(monitor.number("healthy.walker")), len(monitor.spec.parameters))
    return who, window == core_settings()["WALKS"]


def _runs(core: Core, taken: Taken, variants: Sequence[Variant], *, alone: bool) -> list[tuple[FloatArray, FloatArray]]:
    """Give what filters tell of each variant, see `_filtered`, and perhaps what the plant shows alone and its ways."""
    found = [_filtered(core, taken, variant) for variant in variants]
    if alone:
        by_itself = _alone(core, taken)
        found.append((by_itself, _ways(core, taken, by_itself)))
    return found


def _filtered(core: Core, taken: Taken, variant: Variant) -> tuple[FloatArray, FloatArray]:
    """Give innovations in their sd (n, n_outputs), and slow errors in their declared sizes (n, n_slow)."""
    spec, rows = core.spec, taken.rows.copy()
    place, n_y = spec.sample_fields, len(spec.outputs)
    slow = np.zeros((len(rows), len(spec.slow_errors)))
    if not len(rows):
        return np.zeros((0, n_y)), slow
    rows[:, place["scale"]] *= np.square(variant.noise)
    times = np.broadcast_to(np.asarray(variant.slow, dtype=np.float64), len(spec.slow_errors))
    for k, error in enumerate(spec.slow_errors):
        decay = np.exp(-rows[:, place["dt"]][:, 0] / error.memory)
        more = (times[k] ** 2 - 1.0) * error.sd**2 * (1.0 - decay**2)
        column = place["kick"].start + k
        rows[:, column] = times[k] ** 2 * rows[:, column] + more
    known = _declared(core, variant)
    lane = core.healthy_lane(*core.solve_start(rows[: taken.started], known), known)
    sizes = times * spec.slow_sizes
    _, errors, found = core.course(lane, rows, spec.slow_slice)
    if any(item.alarms for item in spec.slow_errors):
        slow = errors / sizes
    variance = found[:, n_y : 2 * n_y]
    return np.where(variance > 0.0, found[:, :n_y] / np.sqrt(np.maximum(variance, 1e-300)), LOST), slow


def _alone(core: Core, taken: Taken, more: FloatArray | None = None) -> FloatArray:
    """Give what the plant shows if no reading is taken, (n, n_outputs), SI; perhaps with `more` (n_inputs,) put in."""
    place, n_y = core.spec.sample_fields, len(core.spec.outputs)
    rows = taken.rows.copy()
    if not len(rows):
        return np.zeros((0, n_y))
    rows[:, place["use"]] = 0.0
    if more is not None:
        rows = with_raised(rows, place, more)
    known = _declared(core, Variant())
    lane = core.healthy_lane(*core.solve_start(taken.rows[: taken.started], known), known)
    off = core.course(lane, rows)[2][:, :n_y]
    return np.asarray(rows[:, place["y"]] - off)


def _ways(core: Core, taken: Taken, alone: FloatArray) -> FloatArray:
    """Give how far outputs move on the whole where an input is a little larger, (n_outputs, n_inputs), SI."""
    more = raised_inputs(taken.rows[:, core.spec.sample_fields["u"]])
    return np.column_stack([way_between(alone, _alone(core, taken, item)) for item in more])


def _declared(core: Core, variant: Variant) -> FloatArray:
    """Give a healthy lane (n_numbers, 1) with accuracies and sizes of slow errors as a variant declares them."""
    spec, n_x = core.spec, len(core.spec.states)
    lane = core.healthy_lane(np.zeros(n_x), np.zeros((n_x, n_x)))
    for place, factor in ((spec.slow_slice, variant.slow), (spec.parameter_slice, variant.accuracy)):
        own = list(combinations_with_replacement(range(place.start, place.stop), 2))
        wider = np.broadcast_to(factor, place.stop - place.start)
        scale = np.array([wider[i - place.start] * wider[j - place.start] for i, j in own])
        lane[[covariance_place(spec, i, j) for i, j in own]] *= scale[:, None]
    return lane
