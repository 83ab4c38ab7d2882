"""The systems of the thesis: what healthy ones give, and that the faults of the thesis explain what was seen."""

import json
from collections.abc import Mapping
from math import sqrt
from pathlib import Path
from runpy import run_path

import casadi as ca
import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.cli import main
from faultbond.equations.plant import build_plant
from faultbond.io import Row, columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model

EXAMPLES = Path(__file__).parents[2] / "examples"
THESIS = EXAMPLES / "thesis"
FIGURES = ("fig_3_4", "fig_3_7", "fig_3_12", "fig_3_14", "fig_3_18", "fig_6_1", "fig_6_13")


def seen(figure: str) -> tuple[BondGraph, list[Row]]:
    """Give a system and its observations."""
    graph = load_model(THESIS / f"{figure}.yaml")
    return graph, list(read_rows(THESIS / f"{figure}.csv", columns_of(graph)))


def given(figure: str, parameters: Mapping[str, float]) -> FloatArray:
    """Give what the sensors read with these parameters, else nominal ones, for each observation."""
    graph, rows = seen(figure)
    plant = build_plant(graph)
    readings = ca.Function("readings", [plant.u, plant.theta], [plant.readings])
    theta = [parameters.get(item.name, item.nominal) for item in graph.parameters]
    return np.array([readings(row.u, theta).full()[:, 0] for row in rows])


def observed(figure: str) -> FloatArray:
    """Give what the sensors did read."""
    return np.array([row.y for row in seen(figure)[1]])


@pytest.mark.parametrize(
    ("figure", "healthy"),
    [
        ("fig_3_4", [[24]]),
        ("fig_3_7", [[0, 1]]),
        ("fig_3_12", [[8], [7]]),
        ("fig_3_14", [[65], [44]]),
        ("fig_6_1", [[46], [37], [19]]),
        ("fig_6_13", [[11, 180]]),
    ],
)
def test_what_the_healthy_system_gives(figure: str, healthy: list[list[float]]) -> None:
    """The nominal system gives what the thesis expects, which is not what was observed."""
    assert given(figure, {}).tolist() == healthy
    assert observed(figure).shape == np.shape(healthy)
    assert not np.array_equal(observed(figure), healthy)


@pytest.mark.parametrize(
    ("figure", "parameters"),
    [
        ("fig_3_4", {"ii": 4}),
        ("fig_3_4", {"i": 8 / 3}),
        ("fig_3_12", {"M2": 4}),
        ("fig_3_14", {"M1": 2, "M3": 15}),
        ("fig_3_14", {"M1": 6, "M3": -81}),
        ("fig_3_14", {"M2": (-1 + sqrt(30)) / 2, "M3": 63 / 2 - sqrt(30)}),
        ("fig_6_1", {"B": 3}),
        ("fig_6_1", {"A": 6 / 5, "C": 2}),
    ],
)
def test_the_faults_of_the_thesis_explain_all_observations(figure: str, parameters: Mapping[str, float]) -> None:
    """With the parameters of a diagnosis the system gives what was observed, in every row."""
    assert given(figure, parameters) == pytest.approx(observed(figure), rel=1e-12)


@pytest.mark.parametrize(("parameters", "row"), [({"M1": 8 / 3}, 0), ({"M1": -16 / 3}, 0), ({"M3": 29}, 1)])
def test_single_faults_of_the_square_explain_one_observation(parameters: Mapping[str, float], row: int) -> None:
    """The diagnoses of tables 3.4 and 3.5 explain their own observation and not the other."""
    found, wanted = given("fig_3_14", parameters)[:, 0], observed("fig_3_14")[:, 0]
    assert found[row] == pytest.approx(wanted[row], rel=1e-12)
    assert abs(found[1 - row] - wanted[1 - row]) > 1


def test_rows_without_a_time_column_are_numbered() -> None:
    """Observations have no time column; the number of the row stands for it."""
    assert [row.time for row in seen("fig_6_1")[1]] == [0.0, 1.0, 2.0]


def test_a_time_column_is_used_where_it_is(tmp_path: Path) -> None:
    """The column `time` of a static network is read if a recording has one."""
    path = tmp_path / "seen.csv"
    path.write_text("Vo,time,Vi\n34,10,4\n27,12.5,3\n")
    rows = list(read_rows(path, columns_of(load_model(THESIS / "fig_6_1.yaml"))))
    assert [(row.time, row.u[0], row.y[0]) for row in rows] == [(10.0, 4.0, 34.0), (12.5, 3.0, 27.0)]


@pytest.mark.parametrize("figure", FIGURES)
def test_every_system_can_be_checked(figure: str, tmp_path: Path) -> None:
    """`check` understands every system, static or not, numbers or logic."""
    path = tmp_path / "check.json"
    assert main(["check", str(THESIS / f"{figure}.yaml"), "--json", str(path)]) == 0
    record = json.loads(path.read_text())
    assert {item["type"] for item in record["components"]} == {"block"}
    assert record["sample_time"] == (0.1 if figure == "fig_3_18" else None)


def test_check_names_signals_and_suspects(capsys: pytest.CaptureFixture[str]) -> None:
    """The listing of a static network says what its signals and suspects are, and nothing of bonds or filters."""
    assert main(["check", str(THESIS / "fig_3_7.yaml")]) == 0
    text = capsys.readouterr().out
    assert "x, y, z, s, c" in text
    assert "X1, A1, A2, X2, O1" in text
    assert "each is an observation by itself" in text
    assert not [word for word in ("junctions", "warm-up", "CUSUM", "filters") if word in text]


def test_logic_is_simulated(tmp_path: Path) -> None:
    """The adder adds: all eight rows of its table."""
    rows = [(a, b, c) for a in (0, 1) for b in (0, 1) for c in (0, 1)]
    inputs, output = tmp_path / "inputs.csv", tmp_path / "output.csv"
    inputs.write_text("\n".join(["A,B,C", *(f"{a},{b},{c}" for a, b, c in rows)]) + "\n")
    assert main(["simulate", str(THESIS / "fig_3_7.yaml"), "--inputs", str(inputs), "-o", str(output)]) == 0
    table = np.loadtxt(output, delimiter=",", skiprows=1)
    assert (table[:, 4] + 2 * table[:, 5]).tolist() == [sum(row) for row in rows]


def test_the_recording_of_the_store_is_what_its_script_makes(tmp_path: Path) -> None:
    """The script writes the file that is there; its numbers are those of figure 3.19."""
    made = run_path(str(THESIS / "make_fig_3_18.py"))
    made["main"].__globals__["OUT"] = tmp_path
    made["main"]()
    table = np.loadtxt(tmp_path / "fig_3_18.csv", delimiter=",", skiprows=1)
    assert table == pytest.approx(np.loadtxt(THESIS / "fig_3_18.csv", delimiter=",", skiprows=1), rel=1e-5, abs=1e-6)
    time, x, y = table.T
    assert np.std(x - 1) == pytest.approx(0.01, rel=0.2)
    assert y == pytest.approx(time / 4, abs=0.05)


def test_a_dynamic_network_runs_from_file_to_verdict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A healthy recording of the store gives no alarm; one whose P doubled gives P, with a report."""
    model, healthy, faulty = THESIS / "fig_3_18.yaml", THESIS / "fig_3_18.csv", tmp_path / "faulty.csv"
    assert main(["run", str(model), str(healthy)]) == 0
    common = ["simulate", str(model), "--inputs", str(healthy), "--seed", "1", "-o", str(faulty)]
    assert main([*common, "--fault", "P=8@10"]) == 0
    page, records = tmp_path / "report.html", tmp_path / "records.jsonl"
    arguments = ["run", str(model), str(faulty), "--report", str(page), "--json", str(records)]
    assert main(arguments) == 1
    last = [json.loads(line) for line in records.read_text().splitlines()][-2]
    best = last["candidates"][0]
    assert best["components"] == ["store"]
    assert best["parameters"]["P"]["estimate"] == pytest.approx(8.0, rel=0.02)
    assert "Block network" in page.read_text()
    assert "store" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "folder"), [("rc", "rc"), ("motor", "dc_motor"), ("motor_current", "dc_motor_current")]
)
def test_plants_of_the_thesis_are_those_of_the_other_examples(name: str, folder: str) -> None:
    """The R-C circuit and the motor are the models that have recordings of their own."""
    assert load_model(THESIS / f"{name}.yaml").text == load_model(EXAMPLES / folder / "model.yaml").text


def test_every_file_is_in_the_list() -> None:
    """The list in the folder names every model, and every figure has its observations."""
    listed = (THESIS / "README.md").read_text()
    assert [path.name for path in THESIS.glob("*.yaml") if f"`{path.name}`" not in listed] == []
    assert {path.stem for path in THESIS.glob("fig_*.yaml")} == set(FIGURES) == {p.stem for p in THESIS.glob("*.csv")}
