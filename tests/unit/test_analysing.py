"""`analyse`: the record of the motor, the recording of the tank, the trace, the code, and what is refused."""

import json
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.ladders import components_of, ladder_text

from faultbond.app.analysis import _Progress
from faultbond.app.answers import _largest, answers
from faultbond.app.wishes import Wishes
from faultbond.cli import main
from faultbond.errors import StructureError
from faultbond.model.text import load_model, parse_model

EXAMPLES = Path(__file__).parents[2] / "examples"
MOTOR = EXAMPLES / "dc_motor" / "model.yaml"


@pytest.fixture(scope="module")
def motor(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Give the record of the motor."""
    target = tmp_path_factory.mktemp("analysis") / "motor.json"
    assert main(["analyse", str(MOTOR), "--json", str(target)]) == 0
    (line,) = target.read_text(encoding="utf-8").splitlines()
    record: dict[str, Any] = json.loads(line)
    return record


def test_keys_of_the_contract(motor: dict[str, Any]) -> None:
    """One object with the keys that programs rely on."""
    wanted = (
        "model states hypotheses groups near_groups detectable isolable routes smallest_fault sensor_advice "
        "input_advice"
    )
    assert set(wanted.split()) <= set(motor)
    assert motor["model"] == "DC motor"
    assert motor["states"] == ["armature.f", "omega"]


@pytest.mark.parametrize("alarms", [0, 2])
def test_a_model_that_alarms_on_healthy_data_says_so_first(
    alarms: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also what comes of it: `run` claims nothing."""
    model, record = tmp_path / "model.yaml", tmp_path / "record.json"
    text = (EXAMPLES / "rc" / "model.yaml").read_text(encoding="utf-8")
    model.write_text(text + (f"false_alarms: {alarms}\n" if alarms else ""), encoding="utf-8")
    assert main(["analyse", str(model), "--closed", "0", "--json", str(record)]) == 0
    head = " ".join(capsys.readouterr().out.split("What the sensors")[0].split())
    told = f"known it is known to alarm on healthy data (`false_alarms: {alarms}`), so `run` claims no fault by it"
    assert (told in head) == (alarms > 0)
    assert json.loads(record.read_text(encoding="utf-8"))["false_alarms"] == alarms


def test_the_longest_part_comes_last(capsys: pytest.CaptureFixture[str]) -> None:
    """Routes and formulas of many sets would stand before all else."""
    assert main(["analyse", str(MOTOR), "--closed", "0"]) == 0
    told = capsys.readouterr().out
    assert max(told.index(title) for title in ("Smallest faults", "Further sensors", "Test inputs")) < told.index(
        "How it follows"
    )


def test_hypotheses_of_the_motor(motor: dict[str, Any]) -> None:
    """Fifteen of 31 sets are testable; {R, C} and {L, J} have two solutions each (table 6.5, erratum E9)."""
    sets = {frozenset(item["parameters"]): item for item in motor["hypotheses"]}
    testable = {chosen for chosen, item in sets.items() if item["testable"]}
    assert testable == {frozenset(chosen) for size in (1, 2) for chosen in combinations("RLKJC", size)}
    assert len(sets) == 31
    several = {chosen for chosen, item in sets.items() if item["roots"] == 2}
    assert several == {frozenset("RC"), frozenset("LJ")}
    assert sets[frozenset("RLJ")]["identifiable"]
    assert not sets[frozenset("RLJ")]["falsifiable"]
    assert not sets[frozenset("RLKJ")]["identifiable"]


def test_routes_of_the_motor(motor: dict[str, Any]) -> None:
    """Singles take 15 equations and 3 samples, pairs 25 and 4 (G15); singles have a closed form."""
    routes = {item["target"]: item for item in motor["routes"]}
    assert {(routes[name]["equations"], routes[name]["observations"]) for name in "RLKJC"} == {(15, 3)}
    pairs = [item for name, item in routes.items() if item["question"].startswith("parameters")]
    assert {(item["equations"], item["observations"]) for item in pairs} == {(25, 4)}
    assert len(pairs) == 10
    assert all(routes[name]["closed_form"] for name in "RLKJC")
    assert all(item["closed_form"] is None for item in pairs)
    assert set(routes["R, L"]["samples"]) == {"V_0", "V_1", "omega_0", "omega_1", "omega_2", "omega_3"}


def test_structure_and_smallest_faults_of_the_motor(motor: dict[str, Any]) -> None:
    """By structure every fault shows and none is isolable; every fault has a smallest size with its time."""
    assert motor["detectable"] == dict.fromkeys("RLKJC", True)
    assert not any(value for row in motor["isolable"].values() for value in row.values())
    for name in "RLKJC":
        item = motor["smallest_fault"][name]
        assert item["value"] > 0.0
        assert item["within"] == pytest.approx(300 * 0.02)


def test_the_current_is_good_advice(motor: dict[str, Any]) -> None:
    """A sensor of the armature current is among the advice, and shows all five parameters."""
    advice = {tuple(item["sensors"]): item for item in motor["sensor_advice"]}
    assert advice["armature.f",]["rank"] == 5
    assert motor["sensors_now"]["rank"] == 3


def test_a_recording_is_judged_beside(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With constant valves K4 and K6 look alike on the recording, and moving the outlet is what tells them apart."""
    rows = [f"{k},60,35,2.4e-4,6500" for k in range(500)]
    recording = tmp_path / "still.csv"
    recording.write_text("\n".join(["time,u_in,u_out,flow,pressure", *rows]) + "\n")
    model = str(EXAMPLES / "tank" / "model.yaml")
    assert main(["analyse", model, "--data", str(recording), "--closed", "0", "--json", "-"]) == 0
    record = json.loads(capsys.readouterr().out)
    groups = [{name for chosen in group for name in chosen} for group in record["on_data"]["groups"]]
    assert {"K4", "K6"} in groups
    assert record["groups"] == []
    pair = next(item for item in record["hypotheses"] if item["parameters"] == ["K4", "K6"])
    assert pair["testable"]
    assert not pair["on_data"]["identifiable"]
    advice = next(item for item in record["input_advice"] if item["sets"] == [["K4"], ["K6"]])
    assert advice["choices"][0]["input"] == "u_out"
    assert all(len(chosen) == 1 for item in record["input_advice"] for chosen in item["sets"])
    assert "K4" not in record["isolable"]["K4"]


def test_a_recording_begins_at_the_declared_start(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A full tank, as declared, that drains shows how fast it does, K**2/A, though its sensor comes late."""
    model = tmp_path / "tank.yaml"
    model.write_text(
        "name: draining tank\nsample_time: 1 s\ninputs: {u: {unit: percent}}\ncomponents:\n"
        "  tank: {type: C, law: e = q/A, parameters: {A: 2 m^2}, start: {q: 4 m^3, sd: 0.01 m^3}}\n"
        "  valve: {type: R, law: f = K*u*sqrt(e), parameters: {K: 0.001 m^2.5/s/percent}}\n"
        "junctions: {node: 0}\nbonds: [node -> tank, node -> valve]\n"
        "sensors: {flow: {reads: valve.f, unit: m^3/s, noise: 0.0001 m^3/s}}\n"
    )
    depths = [2.0]
    for _ in range(99):
        depths.append(max(depths[-1] - 0.025 * depths[-1] ** 0.5, 0.0))
    rows = [f"{k},50,{0.05 * depth**0.5 if k >= 20 else ''}" for k, depth in enumerate(depths)]
    recording = tmp_path / "rows.csv"
    recording.write_text("\n".join(["time,u,flow", *rows]) + "\n")
    assert main(["analyse", str(model), "--data", str(recording), "--closed", "0", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["on_data"]["rank"] == 1


def test_an_input_is_sought_for_what_is_nearly_alike(capsys: pytest.CaptureFixture[str]) -> None:
    """In the recording of the tank the leak and the outlet are nearly alike; moving the outlet parts them."""
    folder = EXAMPLES / "tank"
    options = ["--data", str(folder / "healthy.csv"), "--closed", "0", "--json", "-"]
    assert main(["analyse", str(folder / "model.yaml"), *options]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["on_data"]["groups"] == []
    (advice,) = record["input_advice"]
    assert advice["sets"] == [["K4"], ["K6"]]
    assert advice["choices"][0]["input"] == "u_out"


def test_the_search_of_the_thesis(capsys: pytest.CaptureFixture[str]) -> None:
    """`--trace` prints the lists U, K and C step by step, and the record tells the order of the components."""
    assert main(["analyse", str(MOTOR), "--trace", "R,L"]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("To find R, L:")
    assert "Propagating through R_0." in shown
    assert "25 equations in 3 frames" in shown
    assert main(["analyse", str(MOTOR), "--trace", "R,L", "--json", "-"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["steps"][:3] == ["R_0", "armature_0", "K.1_0"]
    assert len(record["steps"]) == 25


def test_code_that_runs(capsys: pytest.CaptureFixture[str]) -> None:
    """`--code python` prints functions; that of R gives 3 ohm on a backward-Euler record."""
    assert main(["analyse", str(MOTOR), "--code", "python"]) == 0
    text = capsys.readouterr().out
    space: dict[str, Any] = {}
    exec(compile(text, "formulas", "exec"), space)  # noqa: S102 - our own output
    dt, omega, current, volts = 0.02, [0.0], [0.0], [10.0, 10.0, 12.0, 7.0, 11.0]
    for volt in volts:
        a, b, c, d = 3 + 2.5 / dt, 2.0, -2.0, 0.4 + 1.5 / dt
        one, two = volt + 2.5 / dt * current[-1], 1.5 / dt * omega[-1]
        current.append((d * one - b * two) / (a * d - b * c))
        omega.append((a * two - c * one) / (a * d - b * c))
    samples = {"V_0": volts[-1], "omega_0": omega[-1], "omega_1": omega[-2], "omega_2": omega[-3], "dt": dt}
    assert space["R_of"](**samples, C=0.4, J=1.5, K=2.0, L=2.5) == pytest.approx(3.0, rel=1e-9)


@pytest.mark.parametrize(("form", "opening"), [("python", "def "), ("c", "static double ")])
def test_each_function_has_a_name_of_its_own(form: str, opening: str, capsys: pytest.CaptureFixture[str]) -> None:
    """J alone and J beside C are two functions; so are the two closed forms of K."""
    assert main(["analyse", str(MOTOR), "--code", form, "--closed", "2"]) == 0
    text = capsys.readouterr().out
    names = [line.removeprefix(opening).partition("(")[0] for line in text.splitlines() if line.startswith(opening)]
    assert len(names) == len(set(names)) > 30
    assert {"J_of", "J_of_parameters_J_C", "K_of", "K_of_2"} <= set(names)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--trace", "R,Q"], "no parameter Q; there are R, L, K, J, C"),
        (["--separate", "R", "Q"], "no parameter Q"),
        (["--separate", "R"], "expected two sets or more, no two alike"),
        (["--separate", "R,L", "L,R"], "expected two sets or more, no two alike"),
        (["--separate", "R,R", "L"], "'R,R': a name stands there twice"),
        (["--within", "1e9 s"], "give at most 2000 s"),
        (["--closed", "9"], "expected a whole number from 0 to 5"),
        (["--trace", "R,,L"], "expected names with commas between"),
        (["--data", "nowhere.csv"], "nowhere.csv"),
    ],
)
def test_mistakes(options: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A mistake of the user is one line and exit code 2."""
    assert main(["analyse", str(MOTOR), *options]) == 2
    shown = capsys.readouterr()
    assert message in shown.err
    assert len(shown.err.splitlines()) == 1


def test_gates_have_nothing_to_analyse(capsys: pytest.CaptureFixture[str]) -> None:
    """A logic network is refused, with what to do."""
    assert main(["analyse", str(EXAMPLES / "thesis" / "fig_3_7.yaml")]) == 2
    assert "`run` gives all its diagnoses" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("suspects", "wanted", "size"), [(5, 2, 2), (20, 2, 2), (24, 2, 2), (25, 2, 1), (5, 9, 5), (60, 3, 1)]
)
def test_sets_that_get_a_route(suspects: int, wanted: int, size: int) -> None:
    """Sets as large as asked for, as long as there are at most three hundred."""
    assert _largest(suspects, wanted) == size


def test_closed_forms_end_with_the_patience(capsys: pytest.CaptureFixture[str]) -> None:
    """Without time every route is given, none with a closed form or its noise, and how many are missing is said."""
    assert main(["analyse", str(MOTOR), "--patience", "0 s", "--json", "-"]) == 0
    record = json.loads(capsys.readouterr().out)
    routes = [item for item in record["routes"] if item["equations"]]
    assert len(routes) > 20
    assert [item for item in routes if item["closed_form"] or item["noise"]] == []
    assert record["closed_forms_left_out"] > 10


def test_a_plant_that_is_too_large_for_routes_says_what_to_raise() -> None:
    """Of a ladder of 40 sections no route is told, and the message has the budget; no search is begun."""
    graph = parse_model(ladder_text(40))
    with pytest.raises(StructureError, match=r"200 equations, .* up to 150; raise --budget to 2"):
        answers(graph, components_of(graph), Wishes())


def test_routes_end_with_their_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without time no route is told, and all are counted."""
    monkeypatch.setattr("faultbond.app.answers.ROUTE_SECONDS", 0.0)
    graph = load_model(MOTOR)
    told = answers(graph, components_of(graph), Wishes(patience=0.0))
    assert told.found == ()
    assert told.routes_left_out > 10


def test_a_long_analysis_says_what_it_does(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing on standard error at first; after a while each part is named there."""
    progress = _Progress()
    assert progress.through("one", lambda: 1) == 1
    assert capsys.readouterr().err == ""
    progress.begun -= 90.0
    progress.through("two", lambda: 2)
    assert capsys.readouterr().err == "analyse: two, after 90 s\n"
