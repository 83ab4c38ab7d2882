"""Measured curves in laws: what they are between and beyond their points, their slopes, units, and files."""

from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from faultbond.app.plant import find_plant
from faultbond.app.wishes import Wanted
from faultbond.arrays import FloatArray
from faultbond.cli import main
from faultbond.equations.evaluate import evaluate
from faultbond.equations.plant import build_plant
from faultbond.equations.tables import with_curves
from faultbond.errors import ModelError
from faultbond.model.builder import ModelBuilder
from faultbond.model.expression import TABLE, Call, Name
from faultbond.model.graph import BondGraph, Curve, Unit
from faultbond.model.text import load_model, parse_model
from faultbond.runtime.core import Core
from faultbond.simulate import Fault, Inputs, Simulation, simulate
from faultbond.synthesis.engine import build_engine
from made import run, samples_of

PLANT = """\
name: pump and valve
sample_time: 1 s
max_faults: 1
tables:
  head: {points: [[0, 30], [0.1, 28], [0.2, 22], [0.3, 12]], x: m^3/s, y: kPa, between: monotone, beyond: linear}
  valve: {points: [[0, 0], [20, 0.08], [50, 0.4], [80, 0.9], [100, 1]], x: percent}
inputs: {u: {unit: percent}}
components:
  pump: {type: Se, law: "e = H*table(line.f, head)", parameters: {H: 1}}
  tank: {type: C, law: e = q/C, parameters: {C: 5e-4 m^3/Pa}}
  pipe: {type: R, law: e = R*f*abs(f), parameters: {R: 2e5 Pa*s^2/m^6}}
  outlet: {type: R, law: "f = K*table(u, valve)*sqrt(e)", parameters: {K: 2e-3 m^3/s/Pa^0.5}}
junctions: {line: 1, node: 0}
bonds: [pump -> line -> pipe, line -> node -> tank, node -> outlet]
sensors:
  flow: {reads: line.f, unit: m^3/s, noise: 0.002 m^3/s}
  level: {reads: node.e, unit: kPa, noise: 50 Pa}
"""
BLOCKS = """\
name: one store
sample_time: 1 s
tables: {curve: {points: [[-1, 2], [0, 3], [2, -1], [3, -1], [5, 4]], x: m, y: m/s}}
inputs: {u: {unit: m}}
blocks: {store: {law: "der(y) = table(u, curve)", start: {y: 0 m, sd: 1 mm}}}
sensors: {y: {reads: y, unit: m, noise: 1 mm}}
"""
X, Y = (-1.0, 0.0, 2.0, 3.0, 5.0), (2.0, 3.0, -1.0, -1.0, 4.0)
SHAPES = [
    (X, Y),
    ((0.0, 1.0), (1.0, 3.0)),
    ((0.0, 1.0, 4.0), (0.0, 2.0, 1.0)),
    (tuple(range(30)), tuple(np.sin(range(30)))),
]


def looked_up(curve: Curve, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values and slopes of a curve, as the equations have them."""
    x = ca.SX.sym("x")
    value = evaluate(with_curves(Call(f"{TABLE}c", (Name("x"),)), {"c": curve}), {"x": x})
    found = ca.Function("found", [x], [value, ca.jacobian(value, x)])
    values, slopes = zip(*(found(item) for item in at), strict=True)
    return np.array(values, dtype=float).ravel(), np.array(slopes, dtype=float).ravel()


def curve_of(x: tuple[float, ...], y: tuple[float, ...], *, monotone: bool, continues: bool) -> Curve:
    """A curve without units."""
    bare = Unit("")
    return Curve(name="c", x=x, y=y, x_unit=bare, y_unit=bare, monotone=monotone, continues=continues)


@pytest.mark.parametrize(("x", "y"), SHAPES)
def test_between_its_points(x: tuple[float, ...], y: tuple[float, ...]) -> None:
    """It is straight, or PCHIP; so are its slopes, which at a point are those on the right of it."""
    at = np.unique([*np.linspace(x[0], x[-1], 77), *x])[:-1]
    values, slopes = looked_up(curve_of(x, y, monotone=False, continues=False), at)
    right = np.searchsorted(x, at, side="right")
    assert values == pytest.approx(np.interp(at, x, y), abs=1e-12)
    assert slopes == pytest.approx(np.diff(y)[right - 1] / np.diff(x)[right - 1], abs=1e-12)
    values, slopes = looked_up(curve_of(x, y, monotone=True, continues=False), at)
    smooth = PchipInterpolator(x, y)
    assert values == pytest.approx(smooth(at), abs=1e-12)
    assert slopes == pytest.approx(smooth(at, 1), abs=1e-10)


@pytest.mark.parametrize("monotone", [False, True])
@pytest.mark.parametrize(("x", "y"), SHAPES)
def test_beyond_its_ends(x: tuple[float, ...], y: tuple[float, ...], monotone: bool) -> None:
    """It stays, or goes on with the slope at the end."""
    at = np.array([x[0] - 7.0, x[-1] + 5.0])
    values, slopes = looked_up(curve_of(x, y, monotone=monotone, continues=False), at)
    assert values.tolist() == [y[0], y[-1]]
    assert slopes.tolist() == [0.0, 0.0]
    smooth = PchipInterpolator(x, y)
    ends = smooth([x[0], x[-1]], 1) if monotone else (np.diff(y) / np.diff(x))[[0, -1]]
    values, slopes = looked_up(curve_of(x, y, monotone=monotone, continues=True), at)
    assert slopes == pytest.approx(ends)
    assert values == pytest.approx([y[0] - 7.0 * ends[0], y[-1] + 5.0 * ends[1]])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("table(u, valve)", "table(u, valv)", ":12: law of outlet: no table `valv`; did you mean `valve`"),
        ("table(u, valve)", "u/(100)", ":6: table valve: no law and no sensor looks into it; write `table(x, valve)`"),
        ("table(u, valve)", "table(u)", "`table` takes an expression and the name of a table"),
        ("table(u, valve)", "table(u, 3)", "`table` takes an expression and the name of a table"),
        ("table(u, valve)", "table(e, valve)", "`outlet.e` is in Pa, but x of the table valve is in percent"),
        ("x: percent", "x: percent, y: m", "law of outlet: the two sides disagree"),
        ("[20, 0.08], ", "[20, 0.08], [20, 0.1], ", "points: x must grow from point to point, but 20 follows 20"),
        ("[20, 0.08], ", "[20], ", "points: a point is `[x, y]`, and this has 1 numbers"),
        ("[20, 0.08], ", "[20 percent, 0.08], ", "`20 percent` is no number; units of the points stand under `x`"),
        ("[20, 0.08], ", "[20, nan], ", "`nan` is no number"),
        (
            "points: [[0, 0], [20, 0.08], [50, 0.4], [80, 0.9], [100, 1]], ",
            "",
            "state either `points: [[x, y], ..]` or",
        ),
        (
            "[[0, 0], [20, 0.08], [50, 0.4], [80, 0.9], [100, 1]]",
            "[[0, 0]]",
            "points has 1 point; a table has 2 to 200",
        ),
        ("x: percent", "between: cubic", "between is `linear` or `monotone`, not `cubic`"),
        ("x: percent", "beyond: nothing", "beyond is `constant` or `linear`, not `nothing`"),
        ("x: percent", "slope: 3", "table valve: unknown key `slope`"),
        ("x: percent", "file: c.csv", "state either `points: [[x, y], ..]` or `file: curve.csv`"),
    ],
)
def test_mistakes(old: str, new: str, message: str) -> None:
    """Each is told by line, name and what was expected."""
    assert old in PLANT
    with pytest.raises(ModelError) as caught:
        parse_model(PLANT.replace(old, new, 1))
    assert message in str(caught.value)


def test_static_networks_have_none() -> None:
    """There laws are solved exactly."""
    text = (
        BLOCKS.replace("sample_time: 1 s", "sample_time: none")
        .replace("der(y)", "y")
        .replace(", start: {y: 0 m, sd: 1 mm}", "")
    )
    with pytest.raises(
        ModelError, match="tables: with `sample_time: none` laws are solved exactly, and a curve is not"
    ):
        parse_model(text)


def test_the_text_reads_back() -> None:
    """The canonical text holds the points in their units; the builder gives the same."""
    graph = parse_model(BLOCKS)
    assert parse_model(graph.text).text == graph.text
    assert "table(u, curve)" in graph.text
    assert "points: [[-1, 2], [0, 3], [2, -1], [3, -1], [5, 4]], x: m, y: m/s" in graph.text
    built = ModelBuilder("one store", sample_time="1 s").input("u", unit="m")
    built.table("curve", points=list(zip(X, Y, strict=True)), x="m", y="m/s")
    built.block("store", "der(y) = table(u, curve)", start={"y": "0 m", "sd": "1 mm"})
    assert built.sensor("y", "y", unit="m", noise="1 mm").build().text == graph.text
    other = parse_model(PLANT)
    assert parse_model(other.text).text == other.text
    assert other.tables[0].y == (30e3, 28e3, 22e3, 12e3)
    assert (other.tables[0].monotone, other.tables[0].continues) == (True, True)
    assert (other.tables[1].monotone, other.tables[1].continues) == (False, False)
    assert {("between of valve", "linear"), ("beyond of valve", "constant")} <= set(other.defaults)


def with_file(folder: Path, rows: str) -> Path:
    """A model whose curve stands in a file beside it."""
    (folder / "curve.csv").write_text(rows)
    path = folder / "model.yaml"
    path.write_text(BLOCKS.replace("points: [[-1, 2], [0, 3], [2, -1], [3, -1], [5, 4]]", "file: curve.csv"))
    return path


@pytest.mark.parametrize("header", ["", "place,speed\n", "\ufeffx,y\n"])
def test_points_of_a_file(header: str, tmp_path: Path) -> None:
    """The first two columns count, with or without a header; the canonical text is as if they stood in the model."""
    rows = "\n".join(f"{x},{y},other" for x, y in zip(X, Y, strict=True))
    assert load_model(with_file(tmp_path, f"{header}{rows}\n\n")).text == parse_model(BLOCKS).text


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("x,y\n1,2\n", "table curve: file has 1 point"),
        ("1\n2\n", "row 1 of `curve.csv` has one column"),
        ("1,2\n3,high\n", "`high` is no number"),
        ("1,2\n0,3\n", "file: x must grow from point to point, but 0 follows 1"),
    ],
)
def test_files_that_hold_no_curve(rows: str, message: str, tmp_path: Path) -> None:
    """They are refused by name."""
    with pytest.raises(ModelError) as caught:
        load_model(with_file(tmp_path, rows))
    assert message in str(caught.value)


def test_files_elsewhere(tmp_path: Path) -> None:
    """A file that is not there, or not beside the model, is refused."""
    path = with_file(tmp_path, "1,2\n3,4\n")
    text = path.read_text()
    path.write_text(text.replace("curve.csv", "other.csv"))
    with pytest.raises(ModelError, match=r"model.yaml:3: table curve: file: `other.csv` cannot be read: No such file"):
        load_model(path)
    path.write_text(text.replace("curve.csv", "../curve.csv"))
    with pytest.raises(ModelError, match=r"`../curve.csv` lies elsewhere; name a file beside the model file"):
        load_model(path)


def test_a_changed_file_is_another_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the cache keeps of a model file by its bytes is not believed where a curve stands in another file."""
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "cache"))
    path = with_file(tmp_path, "-1,2\n0,3\n2,-1\n")
    recording = tmp_path / "r.csv"
    recording.write_text("time,u,y\n" + "".join(f"{k},{k % 3 - 1},0\n" for k in range(30)))
    main(["run", str(path), str(recording)])
    assert find_plant(path, Wanted()).prepared is None
    path.write_text(BLOCKS)
    main(["run", str(path), str(recording)])
    assert find_plant(path, Wanted()).prepared is not None


def test_the_plant_follows_the_curve() -> None:
    """A store that fills by a curve of an input is the sum of what the curve gives."""
    time, values = np.arange(8.0), np.array([-3.0, -1.0, -0.5, 1.0, 2.5, 4.0, 9.0, 0.0])
    made = simulate(parse_model(BLOCKS), Inputs(time=time, values=values[:, None]), seed=None)
    assert made.outputs[:, 0] == pytest.approx([0.0, *np.cumsum(np.interp(values, X, Y))[:-1]], abs=1e-9)


@cache
def engine() -> tuple[BondGraph, Core]:
    """The pump, whose curve stands in a loop, with its core."""
    graph = parse_model(PLANT)
    return graph, build_engine(graph)[1]


def recorded(*faults: Fault) -> Simulation:
    """A recording of it, its valve moving."""
    time = np.arange(400.0)
    values = np.repeat([30.0, 70.0, 45.0, 85.0, 20.0, 60.0, 95.0, 50.0], 50)[:, None]
    return simulate(engine()[0], Inputs(time=time, values=values), faults, seed=5, start={"tank.q": 10.0})


def test_a_curve_in_a_loop_is_solved() -> None:
    """The flow of the simulated plant is where the head of the pump is that of pipe and tank."""
    made = simulate(engine()[0], Inputs(time=np.arange(60.0), values=np.full((60, 1), 50.0)), seed=None)
    flow, level = made.outputs.T
    head = PchipInterpolator([0.0, 0.1, 0.2, 0.3], [30e3, 28e3, 22e3, 12e3])
    inside = (flow > 0.0) & (flow < 0.3)
    assert inside.sum() > 20
    assert head(flow[inside]) == pytest.approx(2e5 * flow[inside] ** 2 + level[inside], rel=1e-6)
    assert build_plant(engine()[0]).implicit


def test_a_curve_that_is_scaled_is_found() -> None:
    """The healthy plant is quiet; a pump that has lost a tenth of its head is named with its factor."""
    _, core = engine()
    made = recorded()
    _, reports = run(core, samples_of(made.time, made.inputs, made.outputs))
    assert not any(report.detection for report in reports)
    made = recorded(Fault(parameter="H", factor=0.9, start=200.0))
    monitor, _ = run(core, samples_of(made.time, made.inputs, made.outputs))
    best = monitor.conclude().candidates[0]
    assert [item.parameter for item in best.suspects] == ["H"]
    assert best.suspects[0].estimate == pytest.approx(0.9, abs=4.0 * best.suspects[0].sd)
    assert best.probability > 0.9
