"""The figures of thesis 7.4 and 7.5: two faults considered, and two faults made."""

from benchmarks.thesis import tank
from benchmarks.thesis.chart import Curve, Panel, panel
from benchmarks.thesis.page import Parts, figure, row, set_text, short
from benchmarks.thesis.watch import Curves

WITH_PIPE = ("K1, K8", "K1, K2", "K1, K7", "K1, K3", "K1, K4", "K1, K6")
SINGLES = ("K1", "K8", "K2", "K7", "K6", "K4", "K3")
FOUR = ("K1, K6", "K1, K4", "K3, K8", "K6, K8")  # of figure 7.40, in the order of the thesis
PRINTED_RULE = (
    "erratum: by the printed sum the lowest single is always below every pair "
    "as long as all indices are below a quarter"
)


def _of_size(found: Curves, size: int) -> list[int]:
    """Give the hypotheses of a size."""
    return [k for k, item in enumerate(found.spec.hypotheses) if len(item) == size]


def _hitting(found: Curves, size: int, count: int) -> dict[str, float]:
    """Give the hypotheses of a size with the lowest hitting indices, by their means from 5 min after the alarm on."""
    wanted = {found.hypotheses[k] for k in _of_size(found, size)}
    values = tank.usually(found, "hitting", found.hypotheses)
    return {key: values[key] for key in [key for key in values if key in wanted][:count]}


def _best(found: Curves, count: int) -> str:
    """Give the best of the last diagnosis of `classic`."""
    best = found.diagnosis.candidates[:count] if found.diagnosis is not None else ()
    return " ".join(set_text(sorted(item.parameters)) for item in best)


def _panel(found: Curves, size: int, title: str, leading: tuple[str, ...]) -> Panel:
    chosen = _of_size(found, size)
    labels = [found.hypotheses[k] for k in chosen]
    return tank.many(found, found["hitting"][:, chosen], labels, title, leading, low=None)


@figure("7.4", columns=1)
def figure_7_34() -> Parts:
    """The error indices of two components, a restriction in the pipe."""
    found = tank.run("pipe", tank.PAIRS)
    values = tank.usually(found, "errors", found.tested)
    low = [key for key, value in values.items() if value < 1.5 * min(values.values())]
    yield "All 21 pairs are tested, no singles."
    yield tank.many(found, found["errors"], found.tested, "error index, average of both outputs", WITH_PIPE, high=0.15)
    yield row(
        "pairs tested, hypotheses reasoned about | 21, 28",
        f"{len(found.tested)}, {len(found.hypotheses)}",
        same=(len(found.tested), len(found.hypotheses)) == (21, 28),
    )
    yield row(
        "pairs whose index is within one and a half times the lowest | many, none stands out",
        f"{len(low)}",
        same=len(low) > 3,
        otherwise="few fit",
    )
    yield row("how many of them hold K1", f"{sum('K1' in key for key in low)}")


@figure("7.4", columns=1)
def figure_7_35() -> Parts:
    """The hitting indices of two components, a restriction in the pipe."""
    found = tank.run("pipe", tank.PAIRS)
    values = list(_hitting(found, 2, 21).values())
    yield _panel(found, 2, "hitting index of pairs", WITH_PIPE)
    yield row(
        "lowest, second and highest, means from 5 min after the alarm on | none substantially lower than the rest",
        f"{values[0]:.2f}, {values[1]:.2f}, {values[-1]:.2f}",
        same=values[1] - values[0] < 0.1,
        otherwise="one pair fits better",
    )


@figure("7.4")
def figure_7_36() -> Parts:
    """The hitting indices of single components from tests of pairs, a restriction in the pipe."""
    found = tank.run("pipe", tank.PAIRS)
    lowest, pairs = _hitting(found, 1, 7), _hitting(found, 2, 1)
    names = list(lowest)
    yield _panel(found, 1, "hitting index of singles", SINGLES)
    yield tank.bank_panel("pipe", ("K1", "K8", "K2", "K1, K2", "K1, K8"))
    yield row(
        "lowest two | K1, K8",
        ", ".join(names[:2]),
        tank.banked("pipe").ranking(2),
        same=names[:2] == ["K1", "K8"],
        otherwise="several faults of the flow fit almost as well",
    )
    yield row(
        "lowest of the singles and of the pairs | substantially lower than any pair",
        f"{min(lowest.values()):.2f}, {min(pairs.values()):.2f}",
        remark=PRINTED_RULE,
    )
    yield row(
        "best by the reading that works | K1",
        _best(found, 3),
        tank.banked("pipe").ranking(3),
        same=_best(found, 1) == "{K1}",
        otherwise="see figure 7.21",
    )


@figure("7.4", columns=1)
def figure_7_37() -> Parts:
    """The average parameter estimate for K1, a restriction in the pipe."""
    found, alone = tank.run("pipe", tank.PAIRS), tank.run("pipe", tank.SINGLES)
    begin = (found.alarm or 0, alone.alarm or 0)
    column = [item.name for item in found.spec.parameters].index("K1")
    mean = found["averages"][:, column]
    single = alone["estimates"][:, 0, alone.tested.index("K1")]
    other = tank.banked("pipe")
    yield "The mean over the six pairs that hold K1."
    yield panel(
        "K1, 1e11 Pa s2/m6",
        Curve("average", found.time[begin[0] :] / 60, mean[begin[0] :] / 1e11),
        Curve("K1 alone", alone.time[begin[1] :] / 60, single[begin[1] :] / 1e11, 1, dashed=True),
        Curve("bank", other.times / 60, other.estimate("K1") / 1e11, 2, dashed=True),
        below="min",
        low=0.0,
        high=8.0,
    )
    yield row(
        "at the end: average, K1 alone | very similar; 4.45e11 alone",
        f"{short(mean[-1])}, {short(single[-1])}",
        short(other.estimate("K1")[-1]),
        same=bool(abs(mean[-1] / single[-1] - 1) < 0.1),
        otherwise="in some pairs the other parameter takes a part of the fault",
    )


@figure("7.5")
def figure_7_38() -> Parts:
    """Measurements and expected outputs, leak and restriction at once."""
    found = tank.run("both", tank.PAIRS)
    moment = tank.onset("both")
    before, after = ([tank.relative(found, k, *times) for k in (0, 1)] for times in ((5.0, moment), (moment, 41.0)))
    yield "K1 and K6 change at 10 min as in 7.2.2."
    yield from tank.inputs("both")
    yield from (tank.predicted("both", k, found) for k in (0, 1))
    yield row(
        "error over signal, 90 % of the time, before: flow, depth | little difference",
        f"{before[0]:.3f}, {before[1]:.3f}",
        same=max(before) < 0.05,
        otherwise="the valves' curves",
    )
    yield row(
        "after: flow, depth | an error of the flow, then of the depth",
        f"{after[0]:.3f}, {after[1]:.3f}",
        same=after[0] > before[0] and after[1] > before[1],
        otherwise="the flow of our recipe is small at first",
    )


@figure("7.5")
def figure_7_39() -> Parts:
    """The error index and its limit, leak and restriction at once."""
    found, other = tank.run("both", tank.PAIRS), tank.banked("both")
    alarm = found.detection
    same = alarm is not None and abs(alarm.time / tank.MINUTE - 13.2) < 1.0
    yield from tank.index_panels("both", found)
    yield row(
        "alarm | 13 min 12 s", tank.when(alarm), tank.when(other.detection), same=same, otherwise="another recipe"
    )


@figure("7.5")
def figure_7_40() -> Parts:
    """The hitting indices of all sets of one and two components, leak and restriction at once."""
    found, other = tank.run("both", tank.PAIRS), tank.banked("both")
    lowest = list(_hitting(found, 2, 4))
    first = list(tank.usually(found, "hitting", found.hypotheses))[:3]
    yield tank.many(found, found["hitting"], found.hypotheses, "hitting index", FOUR, low=None)
    yield tank.bank_panel("both", FOUR)
    yield row(
        "lowest of all | {K1, K6}",
        " ".join(f"{{{item}}}" for item in first),
        other.ranking(1),
        same=first[0] == "K1, K6",
        remark=PRINTED_RULE,
    )
    yield row(
        "lowest four pairs | {K1, K6} {K1, K4} {K3, K8} {K6, K8}",
        " ".join(f"{{{item}}}" for item in lowest),
        other.ranking(4),
        same=set(lowest) == set(FOUR),
        otherwise="pairs with one flow parameter and one of the vessel are alike in what they do",
    )
    yield row(
        "best by the reading that works | {K1, K6}",
        _best(found, 4),
        other.ranking(1),
        same=_best(found, 1) == "{K1, K6}",
        otherwise="least squares on blended states tell pairs worse than likelihoods do",
    )
