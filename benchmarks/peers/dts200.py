"""Twelve faults of a laboratory rig, made by others: what comes first, how large it is said to be, and when.

    FAULTBOND_DATA=FOLDER python -m benchmarks.peers.dts200 [--only 02,07] [--markdown FILE]

FOLDER/three_tanks/ holds `healthy.csv` and `fault01.csv` to `fault12.csv`; see examples/dts200/README.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import fill

from benchmarks.peers.recordings import Outcome, Rig, build_rig, data_folder
from benchmarks.shared.page import arguments, note, publish, selected
from benchmarks.shared.plants import EXAMPLES
from faultbond.contract.findings import Candidate

MODEL = EXAMPLES / "dts200" / "model.yaml"
FIRST_MODEL = EXAMPLES / "dts200" / "first.yaml"
FOLDER = "three_tanks"
BEGIN = 200.0  # s after the first row, when each fault begins
SURE = 0.95
CLOSE = 0.03  # part by which a value may be off
CM, CM2, CM3 = 1e-2, 1e-4, 1e-6  # SI
WIDTH = 120  # of a page
HEADER = ("recording", "what was done", "alarm after", "first", "probability", "change", "true", "off by", "group")


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """A fault as its makers document it.

    name: the parameter, or the sensor or input, that is at fault. rate: by what it changes each second, in `unit`, from
    BEGIN on. at_once: by what it changes there. part: whether these are parts of its nominal value.
    """

    number: str
    words: str
    name: str
    rate: float
    at_once: float = 0.0
    unit: float = 1.0
    symbol: str = ""
    part: bool = False


MADE = (
    Made(number="01", words="both pumps swing by 6 cm3/s", name="", rate=0.0),
    Made(number="02", words="pump 1 gives ever more", name="Q1", rate=0.02, unit=CM3, symbol=" cm3/s"),
    # That pump 2 gives 4 cm3/s more at once nobody states; the volumes of the recording do, to 0.1 cm3/s.
    Made(
        number="03",
        words="pump 2 gives ever more, and swings",
        name="Q2",
        rate=0.005,
        at_once=4.0,
        unit=CM3,
        symbol=" cm3/s",
    ),
    Made(number="04", words="level 1 reads ever less", name="h1", rate=-0.005, unit=CM, symbol=" cm"),
    Made(number="05", words="level 2 reads ever more", name="h2", rate=0.005, unit=CM, symbol=" cm"),
    Made(number="06", words="level 3 reads ever more", name="h3", rate=0.008, unit=CM, symbol=" cm"),
    Made(number="07", words="leak of tank 1", name="L1", rate=5e-5, unit=CM2, symbol=" cm2"),
    Made(number="08", words="leak of tank 2", name="L2", rate=5e-5, unit=CM2, symbol=" cm2"),
    Made(number="09", words="leak of tank 3", name="L3", rate=5e-5, unit=CM2, symbol=" cm2"),
    Made(number="10", words="pipe 1-3 clogs", name="a1", rate=-0.02, unit=1e-2, symbol=" %", part=True),
    Made(number="11", words="outlet of tank 2 clogs", name="a2", rate=-0.03, unit=1e-2, symbol=" %", part=True),
    Made(number="12", words="pipe 3-2 clogs", name="a3", rate=-0.05, unit=1e-2, symbol=" %", part=True),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What a run brought; s after BEGIN. change, true: of what came first at the end, in the unit of the fault."""

    made: Made
    alarm: float | None
    best: tuple[str, ...] = ()
    probability: float = 0.0
    change: float | None = None
    true: float | None = None
    group: tuple[tuple[str, ...], ...] = ()
    unexplained: bool = False

    @property
    def first(self) -> bool:
        """Whether the truth came first; of an instrument whatever its kind of fault."""
        return _names(self.best) == {self.made.name}

    @property
    def grouped(self) -> bool:
        """Whether the truth is among what cannot be told from what came first."""
        return any(_names(item) == {self.made.name} for item in self.group)

    @property
    def error(self) -> float | None:
        """By which part the change is wrong; None where another thing came first."""
        return None if self.change is None or self.true is None else abs(self.change / self.true - 1.0)

    @property
    def sure_and_wrong(self) -> bool:
        """Whether another thing was said with more than SURE, and not that nothing explains the data."""
        return bool(self.best) and not self.first and self.probability > SURE and not self.unexplained


def watch(rig: Rig, recording: Path, made: Made) -> Run:
    """Run one recording."""
    points = rig.read(recording)
    return judged(rig.watch(points), made, points[0].time + BEGIN, points[-1].time)


def judged(found: Outcome, made: Made, begin: float, end: float) -> Run:
    """Tell what a run is worth; the fault began at `begin`, the last row is at `end`."""
    if found.alarm is None or not found.diagnoses:
        return Run(made=made, alarm=None if found.alarm is None else found.alarm - begin)
    last = found.diagnoses[-1]
    best = last.candidates[0]
    run = Run(
        made=made,
        alarm=found.alarm - begin,
        best=best.parameters,
        probability=best.probability,
        group=tuple(item.parameters for item in last.candidates if item.group),
        unexplained=last.unexplained is not None,
    )
    return replace(run, change=_change(best, made), true=made.at_once + made.rate * (end - begin)) if run.first else run


def _change(best: Candidate, made: Made) -> float | None:
    """Give the change of the only suspect in the unit of the fault; None of a kind that has no size, such as noise."""
    suspect = best.suspects[0]
    _, _, kind = suspect.parameter.partition(".")
    if kind not in {"", "bias"}:
        return None
    nominal = suspect.nominal or 0.0
    return (suspect.estimate - nominal) / (nominal if made.part else 1.0) / made.unit


def cells(run: Run) -> tuple[str, ...]:
    """Give a row of the table."""
    alarm = "-" if run.alarm is None else f"{run.alarm:.0f} s" + (" (too early)" if run.alarm < 0.0 else "")
    return (
        run.made.number,
        run.made.words,
        alarm,
        ", ".join(run.best) + (" (unexplained)" if run.unexplained else "") or "-",
        f"{run.probability:.3f}" if run.best else "-",
        "-" if run.change is None else f"{run.change:.3g}{run.made.symbol}",
        "-" if run.true is None else f"{run.true:.3g}{run.made.symbol}",
        "-" if run.error is None else f"{100.0 * run.error:.1f} %",
        "; ".join(", ".join(names) for names in run.group) or "-",
    )


def summary(runs: Sequence[Run]) -> str:
    """Say in a few sentences what came of it."""
    named = [run for run in runs if run.made.name]
    close = [run for run in named if run.error is not None and run.error <= CLOSE]
    first, grouped = sum(run.first for run in named), sum(run.grouped for run in named)
    return (
        f"Of {len(named)} recordings in which one thing is at fault it came first in {first}, was in the group in "
        f"{grouped}, and its value was within {100.0 * CLOSE:.0f} % in {len(close)}. Another thing with more than "
        f"{100.0 * SURE:.0f} %: {sum(run.sure_and_wrong for run in runs)} of {len(runs)}. Alarms before the fault: "
        f"{sum(run.alarm is not None and run.alarm < 0.0 for run in runs)}."
    )


def _names(parameters: Sequence[str]) -> set[str]:
    """Give what is named, an instrument whatever its kind of fault."""
    return {name.partition(".")[0] for name in parameters}


def healthy_words(rig: Rig, recording: Path) -> str:
    """Say what the healthy recording brings."""
    points = rig.read(recording)
    found = rig.watch(points, to_alarm=True)
    if found.alarm is not None:
        return f"Healthy: alarm after {found.alarm - points[0].time:.0f} s."
    lasted, limit = points[-1].time - points[0].time, rig.spec.thresholds.cusum_limit
    return f"Healthy: no alarm in {lasted:.0f} s; largest CUSUM {found.cusum.max():.1f} of {limit:.3g}."


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen, data = arguments("Twelve faults of a laboratory rig.", argv, only=""), data_folder()
    if data is None:
        return
    rig, folder = build_rig(MODEL), data / FOLDER
    wanted = selected([made.number for made in MADE], chosen.only)
    runs = []
    for made in (made for made in MADE if made.number in wanted):
        runs.append(watch(rig, folder / f"fault{made.number}.csv", made))
        print("  ".join(cells(runs[-1])), flush=True)
    words = fill(f"{summary(runs)} {healthy_words(rig, folder / 'healthy.csv')}", WIDTH)
    publish("peers.dts200", chosen, note(), (HEADER, [cells(run) for run in runs]), words)


if __name__ == "__main__":
    main()
