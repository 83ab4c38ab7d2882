"""The figures of thesis 5.4: the error index of the R-L-C circuit and its limit, without a fault and with one."""

import numpy as np

from benchmarks.thesis.chapter5 import (
    EXACT,
    INPUT_ERRORS,
    ONSET,
    ROUGH,
    banked,
    model,
    recording,
    run,
    true_output,
    when,
)
from benchmarks.thesis.chart import Curve, Panel, panel
from benchmarks.thesis.page import DIFFERS, Figure, Line, Parts, figure, row
from benchmarks.thesis.watch import bank
from faultbond.arrays import FloatArray
from faultbond.contract.findings import Detection
from faultbond.thesis.online.settings import Erratum


def figures() -> tuple[Figure, ...]:
    """Give the figures of 5.4."""
    return figure_5_11(), figure_5_12(), figure_5_13(), figure_5_14(), figure_5_15()


@figure("5.4")
def figure_5_11() -> Parts:
    """The difference between measured and estimated output."""
    found = run(ROUGH, 0.93)
    size = found["measured"][:, 0]
    percent = 100 * np.abs(size - found["expected"][:, 0]) / np.abs(size)
    peaks, crossings = _peaks(percent, found.time)
    near = float(np.median(percent[np.abs(size) > 4 * 1.5]))
    yield Panel("error, % of the measured output", low=0.0, high=200.0, curves=(Curve("error", found.time, percent),))
    yield row(
        "peaks, where the output crosses zero",
        "5",
        f"{peaks} at {crossings} zero crossings",
        same=peaks == 5,
        otherwise="our input and noise are others",
    )
    yield row("between them, median", "-", f"{near:.0f} %")
    yield row(
        "E in the error index",
        "corresponds to this figure",
        "in volts",
        same=False,
        remark="erratum: the index divides by the output itself; in per cent it would divide twice",
    )


def _peaks(percent: FloatArray, time: FloatArray) -> tuple[int, int]:
    """Count the zero crossings at which the error passes five times its median, and all zero crossings."""
    made = recording()
    output = true_output(made)
    crossings = made.time[np.flatnonzero(output[1:] * output[:-1] < 0)]
    high = time[percent > 5.0 * float(np.median(percent))]
    return sum(bool(np.any(np.abs(high - moment) < 0.2)) for moment in crossings), crossings.size


def _indices(capacitance: float | None, title: str) -> tuple[Panel, ...]:
    found, printed = (run(ROUGH, 0.93, *item, capacitance=capacitance) for item in ((), (Erratum.LIMIT,)))
    return (
        panel(
            title,
            Curve("index", found.time, found["index"][:, 0]),
            Curve("limit as printed", printed.time, printed["limit"][:, 0], 1, dashed=True),
            Curve("limit", found.time, found["limit"][:, 0], 2, dashed=True),
            low=0.0,
            high=1.0,
            mark=None if capacitance is None else ONSET,
        ),
    )


@figure("5.4")
def figure_5_12() -> Parts:
    """The error index and its limit."""
    found, printed = run(ROUGH, 0.93), run(ROUGH, 0.93, Erratum.LIMIT)
    late = found["index"][found.time >= 1.0, 0]
    weight = run(ROUGH, 0.93, Erratum.WEIGHT)["index"][-1, 0]
    yield "L = 6 H in the model, n = 0.93, no fault."
    yield from _indices(None, "error index")
    yield row(
        "error index after the first second",
        "0.10 to 0.18",
        f"{late.min():.2f} to {late.max():.2f}",
        same=late.min() > 0.05 and late.max() < 0.2,
        otherwise="the start is another; after 2 s ours is "
        f"{found['index'][found.time >= 2.0, 0].min():.2f} to {found['index'][found.time >= 2.0, 0].max():.2f}",
    )
    yield row(
        "limit at 0 s and at the end",
        "1 and 0.15",
        f"{printed['limit'][0, 0]:.2f} and {printed['limit'][-1, 0]:.2f}",
        same=abs(float(printed["limit"][-1, 0]) - 0.15) < 0.02,
        remark="how it falls is not told; ours is exponential with 95 samples",
    )
    yield row("limit that allows for model errors at the end", "-", f"{found['limit'][-1, 0]:.2f}")
    yield row(
        "alarm",
        "none",
        when(printed.detection),
        bank=when(banked().detection),
        same=printed.detection is None and banked().detection is None,
        remark="limit as printed",
    )
    yield row(
        "index at the end with the weight W as printed",
        "W slightly above 0 at the limit",
        f"{weight:.3f}, else {found['index'][-1, 0]:.3f}",
        same=False,
        remark="erratum: W as printed begins at 1/4; (O - limit)/(3 limit) begins at 0",
    )


def _faulty(capacitance: float) -> tuple[Panel, ...]:
    found = run(ROUGH, 0.93, Erratum.LIMIT, capacitance=capacitance)
    outputs = panel(
        "V_R, V",
        Curve("measured", found.time, found["measured"][:, 0]),
        Curve("estimated", found.time, found["expected"][:, 0], 1, dashed=True),
        mark=ONSET,
    )
    return (outputs, *_indices(capacitance, "error index"))


def _alarms(capacitance: float) -> dict[str, Detection | None]:
    """Give the alarms of all readings."""
    return {
        "printed": run(ROUGH, 0.93, Erratum.LIMIT, capacitance=capacitance).detection,
        "working": run(ROUGH, 0.93, capacitance=capacitance).detection,
        "exact": run(EXACT, 0.98, Erratum.LIMIT, capacitance=capacitance).detection,
        "bank": banked(capacitance).detection,
        "bank, L = 5 H": bank(model(), recording(capacitance)).detection,
    }


def _right_model(alarms: dict[str, Detection | None]) -> Line:
    """Give the line of the alarms where the model is right."""
    return row(
        "alarm, model right, n = 0.98",
        "-",
        when(alarms["exact"]),
        bank=when(alarms["bank, L = 5 H"]),
        remark="`bank` with 3 %",
    )


@figure("5.4")
def figure_5_13() -> Parts:
    """A fault in the circuit: C from 50 mF to 67 mF."""
    found, healthy = run(ROUGH, 0.93, Erratum.LIMIT, capacitance=0.067), run(ROUGH, 0.93)
    alarms = _alarms(0.067)
    at = int(np.argmin(np.abs(found.time - 3.0)))
    alarm = alarms["printed"]
    same = alarm is not None and abs(alarm.time - 6.7) < 1.0
    yield "At 2.5 s; L = 6 H in the model, n = 0.93."
    yield from _faulty(0.067)
    yield row(
        "error index at 3 s against that without the fault",
        "higher",
        f"{found['index'][at, 0]:.3f} against {healthy['index'][at, 0]:.3f}",
        same=bool(found["index"][at, 0] > healthy["index"][at, 0]),
        remark="" if found["index"][at, 0] > healthy["index"][at, 0] else INPUT_ERRORS,
    )
    yield row(
        "alarm",
        "6.7 s",
        when(alarm),
        bank=when(alarms["bank"]),
        same=same,
        remark=""
        if same
        else f"{DIFFERS}n = 0.93 corrects most of this fault, and L C of the wrong model, "
        "0.30, is almost that of the faulty plant, 0.335",
    )
    yield _right_model(alarms)


@figure("5.4")
def figure_5_14() -> Parts:
    """A fault in the circuit: C from 50 mF to 333 mF."""
    alarms = _alarms(0.333)
    alarm = alarms["printed"]
    peaks = [float(run(ROUGH, 0.93, capacitance=item)["index"][-1, 0]) for item in (0.333, 0.067)]
    same = alarm is not None and abs(alarm.time - 5.5) < 0.75
    yield "At 2.5 s; L = 6 H in the model, n = 0.93."
    yield from _faulty(0.333)
    yield row(
        "error index at the end against that of figure 5.13",
        "much larger",
        f"{peaks[0]:.2f} against {peaks[1]:.2f}",
        same=peaks[0] > 1.5 * peaks[1],
    )
    yield row("alarm", "5.5 s", when(alarm), bank=when(alarms["bank"]), same=same, remark="" if same else INPUT_ERRORS)
    yield row("alarm, with the limit that allows for model errors", "-", when(alarms["working"]))
    yield _right_model(alarms)


@figure("5.4")
def figure_5_15() -> Parts:
    """Error indices with and without a prefilter."""
    panels, rows = [], []
    for letter, capacitance in (("A", None), ("B", 0.333)):
        raw, smooth = (run(ROUGH, 0.93, capacitance=capacitance, length=length) for length in (1, 17))
        panels.append(
            panel(
                f"{letter}: error index, {'no fault' if capacitance is None else 'C to 333 mF'}",
                Curve("prefiltered", smooth.time, smooth["index"][:, 0]),
                Curve("not", raw.time, raw["index"][:, 0], 1, dashed=True),
                Curve("limit", smooth.time, smooth["limit"][:, 0], 2, dashed=True),
                low=0.0,
                high=0.6,
                mark=None if capacitance is None else ONSET,
            )
        )
        late = [item["index"][item.time >= 1.0, 0] for item in (smooth, raw)]
        if capacitance is None:
            rows += [
                row(
                    "A: mean after the first second, prefiltered and not",
                    "lower",
                    f"{late[0].mean():.3f}, {late[1].mean():.3f}",
                    same=bool(late[0].mean() < late[1].mean()),
                ),
                row(
                    "A: standard deviation of its steps",
                    "more even",
                    f"{np.std(np.diff(late[0])):.4f}, {np.std(np.diff(late[1])):.4f}",
                    same=bool(np.std(np.diff(late[0])) < np.std(np.diff(late[1]))),
                ),
            ]
        else:
            alarms = [item.detection for item in (smooth, raw)]
            later = None not in alarms and alarms[0].time > alarms[1].time  # type: ignore[union-attr]
            rows.append(
                row(
                    "B: alarm, prefiltered and not",
                    "slightly later",
                    f"{when(alarms[0])}, {when(alarms[1])}",
                    same=later,
                    remark="" if later else f"{DIFFERS}with less noise the limit is passed sooner",
                )
            )
    yield "A parabola through 17 samples; the alarm is known 8 samples after the moment that it is about."
    yield from panels
    yield from rows
