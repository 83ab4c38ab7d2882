"""Units that a recording seems to have: with which the plant would be quiet, where it alarms early as declared.

A column in another unit than the model file says is off by a thousand, by sixty, by 273.15 or by the pressure of the
atmosphere, or has the other sign; what the bank makes of that is a fault which may well be sure. So the first samples
are watched again, with one column after the other taken to be in each other unit of its kind, and turned round. Only
one that raises no alarm is told.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from time import thread_time

import numpy as np

from faultbond.app.method_face import Watcher
from faultbond.arrays import FloatArray
from faultbond.contract.findings import Detection
from faultbond.contract.samples import STATUSES, Samples, Status
from faultbond.contract.spec import EngineSpec
from faultbond.io.grid import PointBlock
from faultbond.model.units import measure

EARLY = 400  # samples after the alarms are on in which an alarm may be that of a wrong unit
QUIET = 400  # samples that must be quiet beyond that alarm, where there are so many,
LEAST = 100  # and at least so many
MOST_SIGNALS = 12  # that are tried, those in which the alarm was raised first
MOST_NAMED = 3  # signals; where more would do, any would
FEW = 0.01  # of the values may be refused as wild
PART = 20  # samples that are watched before anyone looks
PATIENCE = 10.0  # s of a processor; who waits for a verdict does not wait longer for a hint
JUDGED = 0.9  # of the samples up to the alarm that were judged must be so: where the model never holds, all is quiet
_LOST, _OUTSIDE = STATUSES.index(Status.LOST), STATUSES.index(Status.OUTSIDE)
PERCENT, FRACTION = "percent", "parts of 1"
TURNED = "turned round"
GAUGE, ABSOLUTE, ATMOSPHERE = "gauge pressure", "absolute pressure", 101_325.0  # Pa
USUAL = (  # units that are mixed up, by kind
    ("Pa", "hPa", "kPa", "MPa", "bar", "psi"),
    ("degC", "K", "degF"),
    ("m^3/s", "m^3/h", "l/s", "l/min", "l/h"),
    ("kg/s", "kg/min", "kg/h", "g/s"),
    ("W", "kW", "MW"),
    ("J", "kJ", "MJ", "kW*h"),
    ("V", "mV", "kV"),
    ("A", "mA", "kA"),
    ("m", "cm", "mm"),
    ("m/s", "km/h", "m/min"),
    ("rad/s", "rpm", "Hz", "deg/s"),
    ("rad", "deg"),
    ("N", "kN"),
    ("N*m", "kN*m"),
    ("m^3", "l"),
    ("kg", "g"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitGuess:
    """A sensor or an input (`role`) that seems to be recorded in another unit than the model says, or turned round.

    samples: of the beginning, in which no alarm is raised if it is read so.
    """

    name: str
    role: str
    declared: str
    like: str
    samples: int

    @property
    def words(self) -> str:
        """What the recording seems to have."""
        if self.like == TURNED:
            return f"the {self.role} {self.name} with the other sign"
        if self.like in (GAUGE, ABSOLUTE):
            return f"the {self.role} {self.name} as {self.like}, not as the model has it"
        return f"the {self.role} {self.name} in {self.like}, not in {self.declared}"

    @property
    def cure(self) -> str:
        """What to do about it."""
        if self.like == TURNED:
            return "multiply the column by -1, or turn the sign round in the model"
        if self.like == FRACTION:
            return "multiply the column by 100"
        if self.like == GAUGE:
            return "add the pressure of the atmosphere to the column, or subtract it in the model"
        if self.like == ABSOLUTE:
            return "subtract the pressure of the atmosphere from the column, or add it in the model"
        return f"state `unit: {self.like}` there"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Other:
    """A signal read in another unit: its SI values become factor * value + shift."""

    place: int
    is_sensor: bool
    factor: float
    shift: float
    guess: UnitGuess


def sentence_of(guesses: Iterable[UnitGuess]) -> str:
    """Say in which unit a signal seems to be recorded, and what to do; empty without a guess."""
    told = list(guesses)
    if not told:
        return ""
    first = told[0]
    listed = " or ".join(item.words for item in told)
    alike = all(item.cure == first.cure for item in told)
    cure = first.cure if alike else "multiply or turn it round, or state the right `unit:` there"
    return (
        f"The recording looks as if it had {listed}: read so, the first {first.samples} samples raise no alarm. "
        f"If it is so, {cure}; what follows is then no fault."
    )


def guess_units(watchers: Iterator[Watcher], points: Iterable[PointBlock], alarm: Detection) -> tuple[UnitGuess, ...]:
    """Give what signals seem to be recorded in, where an alarm was raised early; empty where no other unit is quiet.

    Also where there is no time to try them all: what was not tried may do as well.

    Parameters
    ----------
    watchers : fresh ones of the plant, as many as are asked for, of which an alarm is all that is asked
    points : of the recording, from its beginning
    alarm : the first one
    """
    watcher, begun = next(watchers), thread_time()
    if alarm.sample > watcher.asleep + EARLY:
        return ()
    begin = _beginning(points, alarm.sample + QUIET)
    if len(begin) < alarm.sample + LEAST:
        return ()
    if any(_is_stuck(begin.y[:, k]) for k, item in enumerate(watcher.spec.outputs) if item.name in alarm.signals):
        return ()  # what stands is no matter of units
    until, found = alarm.sample + 1, []
    least = JUDGED * _judged(watcher, begin[:until])
    for other in _others(watcher.spec, alarm.signals, len(begin)):
        if thread_time() > begun + PATIENCE:
            return ()
        u, y = begin.u.copy(), begin.y.copy()
        column = (y if other.is_sensor else u)[:, other.place]
        declared = column.copy()
        column[:] = other.factor * column + other.shift
        if not other.is_sensor and not _is_likelier(column, declared, watcher.spec.inputs[other.place].fitted_range):
            continue
        read = replace(begin, u=u, y=y)
        if _is_quiet(next(watchers), read) and _judged(next(watchers), read[:until]) >= least:
            found.append(other.guess)
    return tuple(found) if len({item.name for item in found}) <= MOST_NAMED else ()


def _is_likelier(read: FloatArray, declared: FloatArray, known: tuple[float, float]) -> bool:
    """Whether an input, (n,), read so, was more often where it was in the recordings of the fit; where known."""
    lower, upper = known
    shares = [float(np.mean((lower <= values) & (values <= upper))) for values in (read, declared)]
    return not np.isfinite(known).all() or shares[0] > shares[1]


def _beginning(points: Iterable[PointBlock], last: int) -> Samples:
    """Give the first points up to the one of this number, as samples; without what follows a gap of unknown length."""
    parts: list[PointBlock] = []
    for block in points:
        if len(block) and block.index[0] > last:
            break
        parts.append(block)
        if len(block) and block.index[-1] >= last:
            break
    arrays = {name: np.concatenate([getattr(block, name) for block in parts]) for name in ("time", "dt", "u", "y")}
    index, resumes = (np.concatenate([getattr(block, name) for block in parts]) for name in ("index", "resumes"))
    ends = np.flatnonzero((index > last) | resumes)
    end = int(ends[0]) if len(ends) else len(index)
    return Samples(**{name: values[:end] for name, values in arrays.items()})


def _is_stuck(readings: FloatArray) -> bool:
    """Whether a sensor (n,) gave the same value again and again."""
    told = readings[np.isfinite(readings)]
    return len(told) > LEAST and bool(np.ptp(told) == 0.0)


def _judged(watcher: Watcher, samples: Samples) -> int:
    """Give how many samples are judged: those at which the model holds."""
    return int(np.sum(watcher.take(samples).status != _OUTSIDE))


def _is_quiet(watcher: Watcher, samples: Samples) -> bool:
    """Whether a watcher raises no alarm, nor loses the plant, nor refuses what it is shown."""
    wild = 0
    for first in range(0, len(samples), PART):
        part = samples[first : first + PART]
        reports = watcher.take(part)
        wild += int(reports.wild.sum())
        if len(reports) < len(part) or reports.detection is not None or wild > FEW * len(samples):
            return False
        if np.any(reports.status == _LOST):
            return False  # a filter that is lost begins anew, again and again, and each start takes long
    return True


def _others(spec: EngineSpec, alarming: Sequence[str], samples: int) -> Iterator[_Other]:
    """Give each signal in each other unit of its kind; those in which there was an alarm first, then sensors."""
    signals = [(k, True, item.name, item.unit) for k, item in enumerate(spec.outputs)]
    signals += [(k, False, item.name, item.unit) for k, item in enumerate(spec.inputs)]
    signals.sort(key=lambda signal: not (signal[1] and signal[2] in alarming))
    for place, is_sensor, name, declared in signals[:MOST_SIGNALS]:
        for like, factor, shift in _readings(declared):
            role = "sensor" if is_sensor else "input"
            guess = UnitGuess(name=name, role=role, declared=declared, like=like, samples=samples)
            yield _Other(place=place, is_sensor=is_sensor, factor=factor, shift=shift, guess=guess)


def _readings(declared: str) -> Iterator[tuple[str, float, float]]:
    """Give other units of the kind of this one, and what becomes of an SI value that was read in the wrong one."""
    if declared == PERCENT:
        yield FRACTION, 100.0, 0.0
        return
    stated = measure(declared)
    own = stated.unit
    yield TURNED, -1.0, 2.0 * own.offset
    if stated.dimension == measure("Pa").dimension:
        yield GAUGE, 1.0, ATMOSPHERE
        yield ABSOLUTE, 1.0, -ATMOSPHERE
    for kind in USUAL:
        known = [measure(text) for text in kind]
        if known[0].dimension != stated.dimension:
            continue
        for text, item in zip(kind, known, strict=True):
            factor = item.unit.factor / own.factor
            shift = item.unit.offset - factor * own.offset
            if abs(factor - 1.0) > 1e-9 or abs(shift) > 1e-9:
                yield text, factor, shift
        return
