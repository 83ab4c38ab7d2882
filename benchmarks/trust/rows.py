"""The lines of the table of trust, of the runs that were played."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial

from benchmarks.shared.page import Row, quantile, seconds, share
from benchmarks.trust.cases import DISTURBED, EXPECTED, PLAIN, SMALL, SMALL_MOVED
from benchmarks.trust.plants import MOTOR
from benchmarks.trust.play import Claim, Run

HEADER = ("figure", "asked", "`bank`", "verdict", "`classic`")
POINTS = 2.0  # by which a disturbed run may be worse than the plain one
LEAK_SECONDS, SMALL_SECONDS = 50.0, 600.0
FIVE_MINUTES, TEN_MINUTES = 1, 2  # looks at the tank
FIVE_SECONDS, TEN_SECONDS, TWENTY_SECONDS = 1, 2, 3  # looks at the motor
Runs = Mapping[str, Sequence[Run]]
Count = Callable[[Sequence[Run]], int]

_HEALTHY = {
    "tank.healthy": "tank healthy, 82 min",
    "moved.healthy": "tank healthy, valves moving, 70 to 80 min",
    "tank.rough": "tank healthy, parameters and curves off by up to 5 %, 82 min",
    "motor.healthy": "motor healthy, 300 s",
    "current.healthy": "motor with current healthy, 300 s",
}
_BIASES = (
    ("bias.flow", "tank, recipe, flow reads 5 sd wrong, 5 min", FIVE_MINUTES),
    ("moved.bias.flow", "tank, valves moving, flow reads 5 sd wrong, 5 min", FIVE_MINUTES),
    ("bias.pressure", "tank, recipe, pressure reads 5 sd wrong, 5 min", FIVE_MINUTES),
    ("moved.bias.pressure", "tank, valves moving, pressure reads 5 sd wrong, 5 min", FIVE_MINUTES),
    ("bias.omega", "motor, speed reads 5 sd wrong, 10 s", TEN_SECONDS),
    ("bias.current.omega", "motor with current, speed reads 5 sd wrong, 10 s", TEN_SECONDS),
    ("bias.current.i", "motor with current, current reads 5 sd wrong, 10 s", TEN_SECONDS),
)
_DISTURBANCE = {
    "missing": "5 % of all values missing",
    "late": "live, 5 % of the rows 1 to 5 samples late",
    "restored": "watching interrupted twice, state kept in a file",
}
_WRONG = {
    "noise": "noise x3",
    "gain": "reading 15 % too high",
    "stuck": "stuck",
    "intermittent": "10 sd off for 30 of 120 samples",
}
_DISOBEYED = "15 % of its largest value more or less acts than is recorded"


def cells(bank: Runs, classic: Runs) -> list[tuple[str, str, str, str, str]]:
    """Give what is printed of both methods side by side; nothing is asked of `classic`."""
    beside = {row.figure: row.got for row in rows(classic)}
    return [(*row.cells, beside.get(row.figure, "")) for row in rows(bank)]


def rows(runs: Runs) -> list[Row]:
    """Give the lines of the table for the cases that were played."""
    return [row for row in _rows(runs) if row is not None]


def _rows(runs: Runs) -> Iterator[Row | None]:
    """Give all lines in their order, None for those whose cases were not played."""
    for key, figure in _HEALTHY.items():
        yield _alarms(runs.get(key, ()), figure)
    yield _delays(runs.get("tank.K6", ()), "tank, leak K6", LEAK_SECONDS)
    yield _delays(runs.get("small.K6", ()), "tank, smallest leak, 0.010 l/s", SMALL_SECONDS)
    yield from _sets(runs, "tank", "recipe")
    yield from _sets(runs, "moved", "valves moving")
    for names, first, plant in ((SMALL, "small", "recipe"), (SMALL_MOVED, "moved.small", "valves moving")):
        for name in names:
            figure = f"tank, {plant}, {name} up or down by 10 %: detected within 10 min"
            keys = (f"{first}.{name}.{word}" for word in ("up", "down"))
            yield _share(figure, _chosen(runs, keys), partial(_soon, limit=SMALL_SECONDS), 0.95)
    yield from _motors(runs)
    for key, what, look in _BIASES:
        yield _ranks(runs, [key], f"{what} after the alarm", look, 0.97)
    yield from _drift(runs.get("drift.K1", ()))
    yield from _disturbed(runs)
    yield from _instruments(runs)
    figure = "one parameter, any, stepped as its prior expects"
    yield _ranks(runs, [f"{EXPECTED}.tank"], f"tank, recipe, {figure}, 10 min after the alarm", TEN_MINUTES)
    yield _ranks(runs, [f"{EXPECTED}.motor"], f"motor, {figure}, 5 s after the alarm", FIVE_SECONDS)


def _sets(runs: Runs, first: str, plant: str) -> Iterator[Row | None]:
    """Give the lines of the nine sets of faults of the tank."""
    keys = [key for key in runs if key.startswith(f"{first}.K")]
    figure = f"tank, {plant}, nine sets of faults, 10 min after the alarm"
    yield _ranks(runs, keys, figure, TEN_MINUTES, 0.97)
    three = partial(_first, look=TEN_MINUTES, best=3)
    yield _share(f"{figure}: in the first three", _chosen(runs, keys), three, 1.0)
    for key in keys:
        yield _ranks(runs, [key], f"  of these {key.removeprefix(f'{first}.')}, {plant}", TEN_MINUTES)
    yield _errors(runs.get(f"{first}.K1", ()), f"tank, {plant}, K1: error", TEN_MINUTES, 0.07)
    yield _errors(runs.get(f"{first}.K6", ()), f"tank, {plant}, K6: error", TEN_MINUTES, 0.03)


def _motors(runs: Runs) -> Iterator[Row | None]:
    singles = [f"motor.{name}.{word}" for name in MOTOR for word in ("up", "down")]
    yield _ranks(runs, singles, "motor, every single x1.5 and /1.5, 5 s after the alarm", FIVE_SECONDS, 0.97)
    figure = "motor, pairs in the same direction, 20 s after the alarm"
    yield _ranks(runs, ["motor.pairs.alike"], figure, TWENTY_SECONDS, 0.85)
    figure, chosen = "motor, pairs in any direction, 20 s: truth in the group", runs.get("motor.pairs.any", ())
    yield _share(figure, chosen, partial(_in_group, look=TWENTY_SECONDS), 0.97)
    figure = "motor with current, triples"
    yield _ranks(runs, ["current.triples"], f"{figure}, 10 s after the alarm", TEN_SECONDS, 0.95)
    yield _errors(runs.get("current.triples", ()), f"{figure}: error", TEN_SECONDS, 0.03)


def _drift(chosen: Sequence[Run]) -> Iterator[Row | None]:
    last, figure = [run.claims[-1] for run in chosen if run.claims], "tank, K1 doubles over an hour"
    if last:
        right = partial(_last, wanted=lambda claim: claim.right)
        covered = partial(_last, wanted=lambda claim: claim.covered is True)
        yield _share(f"{figure}: K1 first at the end", chosen, right, 0.95)
        yield _quantile_row(f"{figure}: value", [claim.error for claim in last], 0.08)
        yield _quantile_row(f"{figure}: rate", [math.inf if c.rate is None else c.rate for c in last], 0.20)
        yield _share(f"{figure}: forecast covers the truth", chosen, covered, 0.90)


def _disturbed(runs: Runs) -> Iterator[Row]:
    """Give the lines of runs that are plain ones but for what is missing, late or interrupted, of the same seeds."""
    for word in DISTURBED:
        for name, plant, look, after in (
            ("K6", "tank, leak K6", TEN_MINUTES, "10 min"),
            ("R", "motor, R x2", FIVE_SECONDS, "5 s"),
        ):
            both = runs.get(PLAIN[name], ()), runs.get(f"{word}.{name}", ())
            seeds = {run.seed for run in both[0]} & {run.seed for run in both[1]}
            plain, changed = ([run for run in found if run.seed in seeds] for found in both)
            if changed:
                figure = f"{plant}, {_DISTURBANCE[word]}"
                first = partial(_first, look=look)
                yield _compared(f"{figure}: true set first after {after}", plain, changed, first)
                if name == "K6":
                    soon = partial(_soon, limit=LEAK_SECONDS)
                    yield _compared(f"{figure}: detected within {LEAK_SECONDS:g} s", plain, changed, soon)
                got = f"{_quantiles(changed)}; undisturbed {_quantiles(plain)}"
                yield Row(figure=f"{figure}: detected in 95 % within", asked="", got=got, met=None)


def _compared(figure: str, plain: Sequence[Run], changed: Sequence[Run], count: Count) -> Row:
    """Give the line of a share, of plain and of disturbed runs."""
    points = 100.0 * (count(changed) - count(plain)) / len(changed)
    got = f"{share(count(changed), len(changed))}, {points:+.1f} points"
    return Row(figure=figure, asked=f"worse by less than {POINTS:g} points", got=got, met=points > -POINTS)


def _instruments(runs: Runs) -> Iterator[Row]:
    """Give the lines of what else may be wrong with sensors and inputs, of which nothing is asked."""
    wrongs = [(kind, ("flow", "pressure", "omega"), wrong) for kind, wrong in _WRONG.items()]
    for kind, names, wrong in (*wrongs, ("bias", ("u_in", "u_out", "V"), _DISOBEYED)):
        for name in names:
            motor, chosen = name in ("omega", "V"), runs.get(f"{kind}.{name}", ())
            plant, look, after = ("motor", TEN_SECONDS, "10 s") if motor else ("tank, recipe", FIVE_MINUTES, "5 min")
            if chosen:
                total = len(chosen)
                got = f"{share(_first(chosen, look), total)}, in the group {share(_in_group(chosen, look), total)}"
                got += f"; detected in {share(_soon(chosen, math.inf), total)}, {_quantiles(chosen)}"
                figure = f"{plant}, {name}: {wrong}, {after} after the alarm: true set first"
                yield Row(figure=figure, asked="", got=got, met=None)


def _alarms(chosen: Sequence[Run], figure: str) -> Row | None:
    if not chosen:
        return None
    alarms = sum(run.early for run in chosen)
    got = f"{alarms} of {len(chosen)}; largest CUSUM {max(run.cusum for run in chosen):.1f}"
    return Row(figure=f"{figure}: runs with a false alarm", asked="0", got=got, met=alarms == 0)


def _delays(chosen: Sequence[Run], figure: str, limit: float) -> Row | None:
    if not chosen:
        return None
    met, figure = quantile(_delays_of(chosen), 0.95) <= limit, f"{figure}: detected in 95 % within"
    return Row(figure=figure, asked=f"{limit:g} s", got=_quantiles(chosen), met=met)


def _quantiles(chosen: Sequence[Run]) -> str:
    """Give the delay of 95 % of some runs in words, and the median."""
    delays = _delays_of(chosen)
    return f"{seconds(quantile(delays, 0.95))} (median {seconds(quantile(delays, 0.5))})"


def _delays_of(chosen: Sequence[Run]) -> list[float]:
    return [math.inf if run.delay is None else run.delay for run in chosen]


def _chosen(runs: Runs, keys: Iterable[str]) -> list[Run]:
    return [run for key in keys for run in runs.get(key, ())]


def _ranks(runs: Runs, keys: Sequence[str], figure: str, look: int, part: float | None = None) -> Row | None:
    return _share(f"{figure}: true set first", _chosen(runs, keys), partial(_first, look=look), part)


def _share(figure: str, chosen: Sequence[Run], count: Count, part: float | None) -> Row | None:
    if not chosen:
        return None
    number, total = count(chosen), len(chosen)
    asked = "" if part is None else f"{100 * part:g} %"
    met = None if part is None else number >= part * total - 1e-9
    return Row(figure=figure, asked=asked, got=share(number, total), met=met)


def _first(chosen: Sequence[Run], look: int, best: int = 1) -> int:
    """Count the runs in which the true set is among the first ones."""
    return sum(bool(run.looks) and run.looks[look].rank <= best for run in chosen)


def _in_group(chosen: Sequence[Run], look: int) -> int:
    """Count the runs in which the true set is in the group."""
    return sum(bool(run.looks) and run.looks[look].group for run in chosen)


def _soon(chosen: Sequence[Run], limit: float) -> int:
    """Count the runs in which a fault is seen within a time."""
    return sum(run.delay is not None and run.delay <= limit for run in chosen)


def _last(chosen: Sequence[Run], wanted: Callable[[Claim], bool]) -> int:
    """Count the runs whose last claim is as wanted."""
    return sum(bool(run.claims) and wanted(run.claims[-1]) for run in chosen)


def _errors(chosen: Sequence[Run], figure: str, look: int, limit: float) -> Row | None:
    claims = [run.looks[look] for run in chosen if run.looks]
    return _quantile_row(figure, [claim.error for claim in claims], limit) if claims else None


def _quantile_row(figure: str, values: Sequence[float], limit: float) -> Row:
    worst, middle = quantile(values, 0.9), quantile(values, 0.5)
    got = "none" if math.isinf(worst) else f"{100 * worst:.2g} % (median {100 * middle:.2g} %)"
    return Row(figure=f"{figure}, 90 % quantile", asked=f"{100 * limit:g} %", got=got, met=worst <= limit)
