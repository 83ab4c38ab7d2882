"""The benchmark of competition circuits: its score, and what it does with a folder."""

import json
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from benchmarks.peers.circuits import main, score, utility

from faultbond.model.logic import GateSet
from faultbond.networks.logic.diagnoses import minimum_diagnoses
from made_circuits import circuit_text, corrector, made_scenario, scenario_text


def sets(*texts: str) -> list[GateSet]:
    """Give diagnoses from `a b`."""
    return [frozenset(text.split()) for text in texts]


@pytest.mark.parametrize(
    ("diagnosis", "truth", "expected"),
    [
        ("a b", "a b", 1.0),
        ("a c", "a b", 1 - 3 / 38 - 18 / 38),  # one false alarm of N = 2, one missed of 17 that were called healthy
        ("", "a", 1 - 20 / 38),  # nothing said: one missed of 19
        ("a b", "", 1 - 2 * 3 / (19 * 3)),  # two false alarms
        ("a b", "c", 1 - 2 * 3 / (19 * 3) - 18 / 38),
    ],
)
def test_utility_of_one_diagnosis(diagnosis: str, truth: str, expected: float) -> None:
    """Worked by hand for 19 components."""
    assert utility(frozenset(diagnosis.split()), frozenset(truth.split()), 19) == pytest.approx(expected, abs=1e-12)


def test_the_truth_is_scored_by_its_own_mean() -> None:
    """Three sets of two gates of which one differs, of 19: the factor that scenario 74182.010 states."""
    truth = sets("a b", "a c", "a d")
    assert score(truth, truth, 19, 1.0) == pytest.approx(0.6315789474, abs=1e-10)
    assert score(truth, truth, 19, 0.6315789474) == pytest.approx(1.0, abs=1e-9)


def test_a_score_is_the_mean_over_all_pairs() -> None:
    """More sets than are scored at once, against pairs one by one; and no set at all is the empty one."""
    names = [f"g{number}" for number in range(40)]
    answer = [frozenset(pair) for pair in pairwise(names)] * 30
    truth = sets("g0 g1", "g7", "g3 x y")
    pairs = [utility(one, other, 50) for one in answer for other in truth]
    assert score(answer, truth, 50, 0.5) == pytest.approx(2 * sum(pairs) / len(pairs), abs=1e-12)
    assert score([], truth, 50, 1.0) == score([frozenset()], truth, 50, 1.0)


def group(diagnoses: list[GateSet]) -> str:
    """Give the statement of the truth."""
    listed = ", ".join("{ " + ", ".join(sorted(item)) + " }" for item in diagnoses)
    return f"ambiguityGroup @7000 size = {len(diagnoses)}, minCardinality = 1, diagnoses = {{ {listed} }};\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Give a folder with a circuit and its scenarios: with truth, without, with a poor truth, and one cut off."""
    network = corrector(4, nands=True)
    text = scenario_text(*made_scenario(network, 1, seed=2))
    _, after, _ = made_scenario(network, 1, seed=2)
    truth = list(minimum_diagnoses(network, [after]))
    (tmp_path / "c.xml").write_text(circuit_text(network), encoding="utf-8")
    (tmp_path / "lonely.xml").write_text("no scenarios, not read", encoding="utf-8")
    (tmp_path / "broken.xml").write_text("not XML", encoding="utf-8")
    for name, content in {
        "c/0.scn": text + group(truth),
        "c/1.scn": text,
        "c/2.scn": text + group(truth[1:]),
        "c/3.scn": text[:50],
        "broken/0.scn": text,
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content, encoding="utf-8")
    return tmp_path


def test_a_folder_is_scored(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Every scenario that can be read has a record; what cannot be read is named and left out."""
    monkeypatch.setattr(sys, "argv", ["circuits", str(folder), "--json", str(folder / "out.json")])
    main()
    told = capsys.readouterr()
    assert "3.scn" in told.err
    assert "broken.xml:1: not XML" in told.err
    assert "lonely" not in told.out
    first, second, third = json.loads((folder / "out.json").read_text(encoding="utf-8"))
    assert (first["circuit"], first["scenario"]) == ("c", "0")
    assert first["score"] == pytest.approx(1.0, abs=1e-12)
    assert len(first["diagnoses"]) > 1
    assert not first["disputed"]
    assert second["score"] is None
    assert second["diagnoses"] == first["diagnoses"] == third["diagnoses"]
    assert third["disputed"]
    assert third["score"] != pytest.approx(1.0, abs=1e-6)
    assert first["seconds"] > 0
    rows = [line.split() for line in told.out.splitlines()]
    (row,) = (row for row in rows if row and row[0] == "c")
    assert row[1] == "3"  # scenarios
    assert row[3:6] == ["1", "1", "1.000"]  # equal to the truth, disputed, score of the others


def test_no_answer_in_time_is_scored_0(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is neither left out nor hidden."""
    monkeypatch.setattr(sys, "argv", ["circuits", str(folder), "--time-limit", "0", "--json", str(folder / "out.json")])
    main()
    assert "0.scn: no answer: the search for the smallest diagnoses did not end in time" in capsys.readouterr().err
    first, *_ = json.loads((folder / "out.json").read_text(encoding="utf-8"))
    assert (first["diagnoses"], first["score"]) == (None, 0.0)


def test_a_circuit_that_cannot_be_diagnosed_says_why(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A scenario that observes what is not there is not taken for one that needs more time."""
    (folder / "c" / "0.scn").write_text("sensors @0 { nowhere = true };", encoding="utf-8")
    monkeypatch.setattr(sys, "argv", ["circuits", str(folder)])
    main()
    (line,) = (line for line in capsys.readouterr().err.splitlines() if "0.scn: no answer: " in line)
    assert "nothing sets signal nowhere" in line


def test_a_folder_that_is_not_there(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is the user's mistake, in one line."""
    monkeypatch.setattr(sys, "argv", ["circuits", str(folder / "away")])
    with pytest.raises(SystemExit):
        main()
    assert "away is no folder" in capsys.readouterr().err
