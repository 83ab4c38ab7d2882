"""`run` on networks without time: records and text, from the thesis' figures and a circuit of two gates."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from faultbond.cli import main

THESIS = Path(__file__).parents[2] / "examples" / "thesis"


def _circuit() -> str:
    """Give a catalogue of two inverters in a row."""
    parts = {"i1": "port", "o1": "port", "first": "inverter", "second": "inverter"}
    parts |= {f"{gate}.{pin}": "wire" for gate in ("first", "second") for pin in ("o", "i1")}
    ties = (("i1", "first.i1"), ("first.o", "second.i1"), ("second.o", "o1"))
    components = "".join(
        f"<component><name>{name}</name><componentType>{kind}</componentType></component>"
        for name, kind in parts.items()
    )
    connections = "".join(f"<connection><c1>{one}</c1><c2>{two}</c2></connection>" for one, two in ties)
    return (
        '<systemCatalog xmlns="urn:org:dx-competition:system"><systems><system><systemName>pair</systemName>'
        f"<components>{components}</components><connections>{connections}</connections>"
        "</system></systems></systemCatalog>"
    )


def run(model: str, recording: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, list[dict[str, Any]]]:
    """Give the exit code and the records of a run."""
    code = main(["run", str(THESIS / f"{model}.yaml"), str(recording), "--json", "-"])
    return code, [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_records_of_two_observations(capsys: pytest.CaptureFixture[str]) -> None:
    """Figure 3.12: after one row both parameters explain it, after two only M2, which is then 4."""
    code, records = run("fig_3_12", THESIS / "fig_3_12.csv", capsys)
    assert code == 1
    assert [record["record"] for record in records] == ["run", "detection", "diagnosis", "diagnosis", "end"]
    assert records[0]["sample_time"] is None
    assert records[1]["time"] == 0.0
    assert records[1]["signals"] == ["y"]
    values = [
        [
            (entry["components"], {name: item["estimate"] for name, item in entry["parameters"].items()})
            for entry in record["candidates"]
        ]
        for record in records[2:4]
    ]
    assert values[0] == [(["M1"], {"M1": 4.0}), (["M2"], {"M2": 4.0})]
    assert values[1] == [(["M2"], {"M2": 4.0})]
    assert [entry["probability"] for entry in records[2]["candidates"]] == [0.5, 0.5]
    assert (records[4]["samples"], records[4]["detections"]) == (2, 1)


def test_full_adder(capsys: pytest.CaptureFixture[str]) -> None:
    """Figure 3.7: gates have no parameters; the one diagnosis of minimum size is X1."""
    code, records = run("fig_3_7", THESIS / "fig_3_7.csv", capsys)
    assert code == 1
    last = [record for record in records if record["record"] == "diagnosis"][-1]
    [found] = last["candidates"]
    assert (found["components"], found["parameters"], found["probability"], found["group"]) == (["X1"], {}, 1.0, True)
    assert (found["kind"], found["kinds"]) == (None, {})  # what a gate does instead is not known


def test_a_healthy_row_says_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a contradiction there is no diagnosis, and the exit code is 0."""
    (tmp_path / "healthy.csv").write_text("Vi,Vo\n4,46\n3,37\n")
    code, records = run("fig_6_1", tmp_path / "healthy.csv", capsys)
    assert (code, [record["record"] for record in records]) == (0, ["run", "end"])
    assert records[-1]["detections"] == 0


def test_rows_without_a_reading_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A row without a value is passed over and counted as missing."""
    (tmp_path / "gap.csv").write_text("Vi,Vo\n4,\n3,27\n1,13\n")
    _, records = run("fig_6_1", tmp_path / "gap.csv", capsys)
    assert records[1]["sample"] == 1
    assert records[-1]["missing"] == 1


def test_what_was_watched(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Rows with a reading are watched, also where another value is missing; without any there is no verdict."""
    (tmp_path / "some.csv").write_text("in1,in2,in3,in4,out1,out2\n2,3,2,4,11,\n2,3,2,4,,180\n2,3,2,4,,\n")
    _, records = run("fig_6_13", tmp_path / "some.csv", capsys)
    assert (records[-1]["samples"], records[-1]["missing"], records[-1]["watched"]) == (3, 3, 2)
    (tmp_path / "none.csv").write_text("Vi,Vo\n4,\n3,\n")
    assert main(["run", str(THESIS / "fig_6_1.yaml"), str(tmp_path / "none.csv")]) == 4
    shown = capsys.readouterr()
    assert "No verdict: no row has a value of a sensor." in shown.out
    assert "Nothing contradicts" not in shown.out
    assert "no verdict" in shown.err


def test_rows_without_a_time_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A row whose time cannot be read is passed over, and the end says so."""
    (tmp_path / "some.csv").write_text("time,x1,x2,y\n0,1,2,8\nbad,2,1,99\n2,2,1,7\n")
    _, records = run("fig_3_12", tmp_path / "some.csv", capsys)
    assert (records[-1]["samples"], records[-1]["untimed"]) == (2, 1)


def test_a_live_row_is_judged_at_once() -> None:
    """Rows on standard input are not held back for sorting: each has its record before the next one comes."""
    command = [sys.executable, "-m", "faultbond", "run", str(THESIS / "fig_6_1.yaml"), "-"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write("Vi,Vo\n4,34\n")
        process.stdin.flush()
        records = [json.loads(process.stdout.readline())["record"] for _ in range(3)]
        process.stdin.close()
    assert records == ["run", "detection", "diagnosis"]


def test_values_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    """The table shows each parameter with its value, and the last line counts what explains the rows."""
    assert main(["run", str(THESIS / "fig_3_4.yaml"), str(THESIS / "fig_3_4.csv")]) == 1
    shown = capsys.readouterr().out
    assert "row 0 contradicts the healthy network: D." in shown
    assert "2.66667" in shown
    assert "2 suspects explain every observation" in shown


def test_a_logic_value_is_0_or_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Any other value is the user's mistake and says its row and column."""
    (tmp_path / "r.csv").write_text("A,B,C,D,E\n1,0,2,0,1\n")
    assert main(["run", str(THESIS / "fig_3_7.yaml"), str(tmp_path / "r.csv")]) == 2
    assert "row 0: C is 2; expected 0 or 1" in capsys.readouterr().err


def test_no_page_without_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`--report` is refused, since there is nothing to draw over time."""
    command = ["run", str(THESIS / "fig_3_4.yaml"), str(THESIS / "fig_3_4.csv"), "--report", str(tmp_path / "r.html")]
    assert main(command) == 2
    assert "leave out --report" in capsys.readouterr().err


def test_a_circuit_and_its_scenario(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Either of two inverters in a row explains a wrong output; times are seconds."""
    (tmp_path / "pair.xml").write_text(_circuit())
    (tmp_path / "s.scn").write_text("sensors @0 { i1 = true, o1 = true };\nsensors @6000 { i1 = true, o1 = false };\n")
    assert main(["run", str(tmp_path / "pair.xml"), str(tmp_path / "s.scn"), "--json", "-"]) == 1
    records = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert records[1] == {
        "record": "detection", "time": 6.0, "sample": 1, "change_time": 6.0, "signals": ["o1"]
    }  # fmt: skip
    assert [entry["components"] for entry in records[2]["candidates"]] == [["first"], ["second"]]
    assert records[-1]["time"] == 6.0
    assert (records[-1]["watched"], records[-1]["missing"]) == (2, 0)


def test_a_scenario_with_missing_values(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An observation that lacks a port is counted as missing, and watched if it has an output."""
    (tmp_path / "pair.xml").write_text(_circuit())
    (tmp_path / "s.scn").write_text("sensors @0 { i1 = true };\nsensors @1000 { o1 = false };\n")
    assert main(["run", str(tmp_path / "pair.xml"), str(tmp_path / "s.scn"), "--json", "-"]) == 0
    end = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (end["samples"], end["missing"], end["watched"]) == (2, 2, 1)


@pytest.mark.parametrize("nominal", ["1e300", "-1e-300", "1e307"])
def test_nominal_values_of_any_size(nominal: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Sets whose solutions lie beyond all measure from nominal are told as any other, in a few digits."""
    model = tmp_path / "m.yaml"
    model.write_text((THESIS / "fig_6_1.yaml").read_text().replace("nominal: 4,", f"nominal: {nominal},"))
    assert main(["run", str(model), str(THESIS / "fig_6_1.csv")]) == 1
    shown = capsys.readouterr()
    assert shown.err == ""
    assert "3 sets of 2 suspects explain every observation" in shown.out or "suspect explains" in shown.out
    assert not re.search(r"\d{20}", shown.out)


def test_readings_of_any_size(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A product of readings beyond floating point is no value, and nothing ends in an internal error."""
    for figure in ("fig_6_13", "fig_3_14", "fig_6_1"):
        header, first, *rest = (THESIS / f"{figure}.csv").read_text().splitlines()
        wild = ",".join(["1e300"] * len(first.split(",")))
        (tmp_path / "r.csv").write_text("\n".join([header, wild, first, *rest]) + "\n")
        assert main(["run", str(THESIS / f"{figure}.yaml"), str(tmp_path / "r.csv")]) in (0, 1)
        assert capsys.readouterr().err.count("\n") <= 1
