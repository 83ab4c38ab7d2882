"""The lines of the table of trust, of the runs that were played."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from benchmarks.shared.page import Row
from benchmarks.trust.cases import DISTURBED, EXPECTED, PLAIN, SMALL, SMALL_MOVED
from benchmarks.trust.plants import MOTOR
from benchmarks.trust.play import Run

HEADER = ("figure", "asked", "`bank`", "verdict", "`classic`")
POINTS = 2.0  # by which a disturbed run may be worse than the plain one
LEAK_SECONDS, SMALL_SECONDS = 50.0, 600.0
FIVE_MINUTES, TEN_MINUTES = 1, 2  # looks at the tank
FIVE_SECONDS, TEN_SECONDS, TWENTY_SECONDS = 1, 2, 3  # looks at the motor
Runs = Mapping[str, Sequence[Run]]
Both = tuple[list[Run], list[Run]]  # plain and disturbed, of the same seeds

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


def cells(bank: Runs, classic: Runs) -> list[tuple[str, str, str, str, str]]:
    """Give what is printed of both methods side by side; nothing is asked of `classic`."""
    beside = {row.figure: row.got for row in rows(classic)}
    return [(*row.cells, beside.get(row.figure, "")) for row in rows(bank)]


def rows(runs: Runs) -> list[Row]:
    """Give the lines of the table for the cases that were played."""
    found: list[Row] = []
    found += _alarms(runs, "tank.healthy", "tank healthy, 82 min")
    found += _alarms(runs, "moved.healthy", "tank healthy, valves moving, 70 to 80 min")
    found += _alarms(runs, "tank.rough", "tank healthy, parameters and curves off by up to 5 %, 82 min")
    found += _alarms(runs, "motor.healthy", "motor healthy, 300 s")
    found += _alarms(runs, "current.healthy", "motor with current healthy, 300 s")
    found += _delays(runs, "tank.K6", "tank, leak K6", LEAK_SECONDS)
    found += _delays(runs, "small.K6", "tank, smallest leak, 0.010 l/s", SMALL_SECONDS)
    found += _sets(runs, "tank", "tank, recipe") + _sets(runs, "moved", "tank, valves moving")
    found += [row for name in SMALL for row in _small(runs, "small", "tank, recipe", name)]
    found += [row for name in SMALL_MOVED for row in _small(runs, "moved.small", "tank, valves moving", name)]
    found += _motors(runs) + _biases(runs) + _drift(runs) + _disturbed(runs) + _instruments(runs)
    figure = "one parameter, any, stepped as its prior expects"
    found += _ranks(runs, [f"{EXPECTED}.tank"], f"tank, recipe, {figure}, 10 min after the alarm", TEN_MINUTES, None, 1)
    return found + _ranks(runs, [f"{EXPECTED}.motor"], f"motor, {figure}, 5 s after the alarm", FIVE_SECONDS, None, 1)


def _sets(runs: Runs, first: str, plant: str) -> list[Row]:
    """Give the lines of the nine sets of faults of the tank."""
    keys = [key for key in runs if key.startswith(f"{first}.K")]
    figure = f"{plant}, nine sets of faults, 10 min after the alarm"
    found = _ranks(runs, keys, figure, TEN_MINUTES, 0.97, 1)
    found += _ranks(runs, keys, f"{figure}: in the first three", TEN_MINUTES, 1.0, 3)
    for key in keys:
        name = f"{key.removeprefix(f'{first}.')}, {plant.removeprefix('tank, ')}"
        found += _ranks(runs, [key], f"  of these {name}", TEN_MINUTES, None, 1)
    found += _errors(runs, f"{first}.K1", f"{plant}, K1: error", TEN_MINUTES, 0.07)
    return found + _errors(runs, f"{first}.K6", f"{plant}, K6: error", TEN_MINUTES, 0.03)


def _motors(runs: Runs) -> list[Row]:
    singles = [f"motor.{name}.{word}" for name in MOTOR for word in ("up", "down")]
    figure = "motor, every single x1.5 and /1.5, 5 s after the alarm"
    found = _ranks(runs, singles, figure, FIVE_SECONDS, 0.97, 1)
    figure = "motor, pairs in the same direction, 20 s after the alarm"
    found += _ranks(runs, ["motor.pairs.alike"], figure, TWENTY_SECONDS, 0.85, 1)
    figure = "motor, pairs in any direction, 20 s: truth in the group"
    found += _groups(runs, ["motor.pairs.any"], figure, TWENTY_SECONDS, 0.97)
    figure = "motor with current, triples"
    found += _ranks(runs, ["current.triples"], f"{figure}, 10 s after the alarm", TEN_SECONDS, 0.95, 1)
    return found + _errors(runs, "current.triples", f"{figure}: error", TEN_SECONDS, 0.03)


def _biases(runs: Runs) -> list[Row]:
    found: list[Row] = []
    for key, what, look in (
        ("bias.flow", "tank, recipe, flow reads 5 sd wrong, 5 min", FIVE_MINUTES),
        ("moved.bias.flow", "tank, valves moving, flow reads 5 sd wrong, 5 min", FIVE_MINUTES),
        ("bias.pressure", "tank, recipe, pressure reads 5 sd wrong, 5 min", FIVE_MINUTES),
        ("moved.bias.pressure", "tank, valves moving, pressure reads 5 sd wrong, 5 min", FIVE_MINUTES),
        ("bias.omega", "motor, speed reads 5 sd wrong, 10 s", TEN_SECONDS),
        ("bias.current.omega", "motor with current, speed reads 5 sd wrong, 10 s", TEN_SECONDS),
        ("bias.current.i", "motor with current, current reads 5 sd wrong, 10 s", TEN_SECONDS),
    ):
        found += _ranks(runs, [key], f"{what} after the alarm", look, 0.97, 1)
    return found


def _instruments(runs: Runs) -> list[Row]:
    """Give the lines of what else may be wrong with sensors and inputs, of which nothing is asked."""
    sensors = [
        (f"{kind}.{sensor}", f"{plant}, {sensor}: {wrong}", look, after)
        for kind, wrong in _WRONG.items()
        for sensor, plant, look, after in (
            ("flow", "tank, recipe", FIVE_MINUTES, "5 min"),
            ("pressure", "tank, recipe", FIVE_MINUTES, "5 min"),
            ("omega", "motor", TEN_SECONDS, "10 s"),
        )
    ]
    inputs = [
        (f"bias.{name}", f"{plant}, {name}: 15 % of its largest value more or less acts than is recorded", look, after)
        for name, plant, look, after in (
            ("u_in", "tank, recipe", FIVE_MINUTES, "5 min"),
            ("u_out", "tank, recipe", FIVE_MINUTES, "5 min"),
            ("V", "motor", TEN_SECONDS, "10 s"),
        )
    ]
    found: list[Row] = []
    for key, wrong, look, after in sensors + inputs:
        chosen = runs.get(key, [])
        if chosen:
            total = len(chosen)
            first, grouped = _first(chosen, look), _in_group(chosen, look)
            got = f"{_part(first, total)}, in the group {_part(grouped, total)}"
            got += f"; detected in {_part(sum(run.delay is not None for run in chosen), total)}, {_quantiles(chosen)}"
            found.append(Row(figure=f"{wrong}, {after} after the alarm: true set first", asked="", got=got, met=None))
    return found


def _disturbed(runs: Runs) -> list[Row]:
    """Give the lines of runs that are plain ones but for what is missing, late or interrupted."""
    found: list[Row] = []
    for word in DISTURBED:
        for name, plant, look, after in (
            ("K6", "tank, leak K6", TEN_MINUTES, "10 min"),
            ("R", "motor, R x2", FIVE_SECONDS, "5 s"),
        ):
            both = _both(runs.get(PLAIN[name], []), runs.get(f"{word}.{name}", []))
            if both[1]:
                figure = f"{plant}, {_DISTURBANCE[word]}"
                found.append(_compared(f"{figure}: true set first after {after}", both, partial(_first, look=look)))
                if name == "K6":
                    found.append(_compared(f"{figure}: detected within {LEAK_SECONDS:g} s", both, _soon))
                found.append(_delays_compared(f"{figure}: detected in 95 % within", both))
    return found


def _both(plain: Sequence[Run], changed: Sequence[Run]) -> Both:
    """Give the runs of the seeds of which there are both."""
    seeds = {run.seed for run in plain} & {run.seed for run in changed}
    return [run for run in plain if run.seed in seeds], [run for run in changed if run.seed in seeds]


def _compared(figure: str, both: Both, count: Callable[[Sequence[Run]], int]) -> Row:
    """Give the line of a share, of plain and of disturbed runs."""
    plain, changed = (count(chosen) for chosen in both)
    points = 100.0 * (changed - plain) / len(both[1])
    got = f"{_part(changed, len(both[1]))}, {points:+.1f} points"
    return Row(figure=figure, asked=f"worse by less than {POINTS:g} points", got=got, met=points > -POINTS)


def _delays_compared(figure: str, both: Both) -> Row:
    plain, changed = (_quantiles(chosen) for chosen in both)
    return Row(figure=figure, asked="", got=f"{changed}; undisturbed {plain}", met=None)


def _first(chosen: Sequence[Run], look: int, best: int = 1) -> int:
    """Count the runs in which the true set is among the first ones."""
    return sum(bool(run.looks) and run.looks[look].rank <= best for run in chosen)


def _in_group(chosen: Sequence[Run], look: int) -> int:
    """Count the runs in which the true set is in the group."""
    return sum(bool(run.looks) and run.looks[look].group for run in chosen)


def _soon(chosen: Sequence[Run]) -> int:
    """Count the runs in which a leak is seen as soon as is asked."""
    return sum(run.delay is not None and run.delay <= LEAK_SECONDS for run in chosen)


def _chosen(runs: Runs, keys: Sequence[str]) -> list[Run]:
    return [run for key in keys for run in runs.get(key, [])]


def _alarms(runs: Runs, key: str, figure: str) -> list[Row]:
    chosen = runs.get(key, [])
    if not chosen:
        return []
    alarms = sum(run.early for run in chosen)
    got = f"{alarms} of {len(chosen)}; largest CUSUM {max(run.cusum for run in chosen):.1f}"
    return [Row(figure=f"{figure}: runs with a false alarm", asked="0", got=got, met=alarms == 0)]


def _delays(runs: Runs, key: str, figure: str, limit: float) -> list[Row]:
    chosen = runs.get(key, [])
    if not chosen:
        return []
    met = quantile(_ordered_delays(chosen), 0.95) <= limit
    figure = f"{figure}: detected in 95 % within"
    return [Row(figure=figure, asked=f"{limit:g} s", got=_quantiles(chosen), met=met)]


def _quantiles(chosen: Sequence[Run]) -> str:
    """Give the delay of 95 % of some runs in words, and the median."""
    delays = _ordered_delays(chosen)
    return f"{_seconds(quantile(delays, 0.95))} (median {_seconds(quantile(delays, 0.5))})"


def _ordered_delays(chosen: Sequence[Run]) -> list[float]:
    return sorted(math.inf if run.delay is None else run.delay for run in chosen)


def _small(runs: Runs, first: str, plant: str, name: str) -> list[Row]:
    chosen = _chosen(runs, [f"{first}.{name}.up", f"{first}.{name}.down"])
    if not chosen:
        return []
    within = sum(run.delay is not None and run.delay <= SMALL_SECONDS for run in chosen)
    return [_share(f"{plant}, {name} up or down by 10 %: detected within 10 min", within, len(chosen), 0.95)]


def _ranks(runs: Runs, keys: Sequence[str], figure: str, look: int, part: float | None, best: int) -> list[Row]:
    chosen = _chosen(runs, keys)
    if not chosen:
        return []
    figure = figure if best > 1 else f"{figure}: true set first"
    return [_share(figure, _first(chosen, look, best), len(chosen), part)]


def _groups(runs: Runs, keys: Sequence[str], figure: str, look: int, part: float) -> list[Row]:
    chosen = _chosen(runs, keys)
    return [_share(figure, _in_group(chosen, look), len(chosen), part)] if chosen else []


def _share(figure: str, count: int, total: int, part: float | None) -> Row:
    asked = "" if part is None else f"{100 * part:g} %"
    met = None if part is None else count >= part * total - 1e-9
    return Row(figure=figure, asked=asked, got=_part(count, total), met=met)


def _part(count: int, total: int) -> str:
    return f"{count} of {total} ({100 * count / total:.0f} %)"


def _errors(runs: Runs, key: str, figure: str, look: int, limit: float) -> list[Row]:
    claims = [run.looks[look] for run in runs.get(key, []) if run.looks]
    return _quantile_row(figure, [claim.error for claim in claims], limit) if claims else []


def _drift(runs: Runs) -> list[Row]:
    last = [run.claims[-1] for run in runs.get("drift.K1", []) if run.claims]
    if not last:
        return []
    total = len(runs["drift.K1"])
    figure = "tank, K1 doubles over an hour"
    found = [_share(f"{figure}: K1 first at the end", sum(claim.right for claim in last), total, 0.95)]
    found += _quantile_row(f"{figure}: value", [claim.error for claim in last], 0.08)
    found += _quantile_row(f"{figure}: rate", [math.inf if c.rate is None else c.rate for c in last], 0.20)
    found.append(_share(f"{figure}: forecast covers the truth", sum(c.covered is True for c in last), total, 0.90))
    return found


def _quantile_row(figure: str, values: Sequence[float], limit: float) -> list[Row]:
    worst, middle = quantile(sorted(values), 0.9), quantile(sorted(values), 0.5)
    got = "none" if math.isinf(worst) else f"{100 * worst:.2g} % (median {100 * middle:.2g} %)"
    return [Row(figure=f"{figure}, 90 % quantile", asked=f"{100 * limit:g} %", got=got, met=worst <= limit)]


def quantile(ordered: Sequence[float], part: float) -> float:
    """Give the smallest of some ordered values that a part of them does not exceed."""
    return ordered[max(math.ceil(part * len(ordered) - 1e-9) - 1, 0)]


def _seconds(value: float) -> str:
    return "never" if math.isinf(value) else f"{value:.3g} s" if value < 100 else f"{value:.0f} s"
