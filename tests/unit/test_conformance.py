"""A generated program says what `run` says, of every built-in plant in time: the same records to the last digit."""

import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from faultbond.cli import main
from faultbond.synthesis.compile import TIDY
from watching import ran, watched

EXAMPLES = Path(__file__).parents[2] / "examples"
PLANTS = {  # rows of the faulty recording: up to some diagnoses
    "rc": 1200,
    "rlc": 1200,
    "dc_motor": 1200,
    "dc_motor_current": 1200,
    "tank": 1700,
    "three_tank": 1700,
}
ONE_BY_ONE = {  # two faults, one after the other, and what a record of them has
    "rc": (("R=x1.06@10", "C=x0.6@32"), "strained"),
    "rlc": (("R=x1.6@10", "C=x0.6@32"), "superseded"),
}

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="there is no make")


def differences(one: object, other: object, where: tuple[object, ...] = ()) -> Iterator[tuple[object, ...]]:
    """Give where two records differ: in keys or their order, texts or numbers."""
    if isinstance(one, dict) and isinstance(other, dict):
        if list(one) != list(other):
            yield (*where, list(one), list(other))
            return
        for key in one:
            yield from differences(one[key], other[key], (*where, key))
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for k, (first, second) in enumerate(zip(one, other, strict=True)):
            yield from differences(first, second, (*where, k))
    elif type(one) is not type(other) or one != other:
        yield (*where, one, other)


def both(plant: str, rows: list[str], program: Path) -> None:
    """Pass rows through `run` and through the program, and compare what they say and their exit codes."""
    recording = "".join(rows).encode()
    told = ran(EXAMPLES / plant / "model.yaml", recording), watched(program, recording)
    assert told[0].code == told[1].code, told[1].err
    here, there = (item.records for item in told)
    assert len(here) == len(there) > 1
    assert list(differences(here, there)) == []


@pytest.mark.parametrize("plant", PLANTS)
def test_the_program_says_what_run_says(plant: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Healthy and faulty recordings give the same records and exit codes, and the self-test passes."""
    folder = tmp_path / "plant"
    assert main(["generate", str(EXAMPLES / plant / "model.yaml"), "-o", str(folder)]) == 0
    options = [] if plant == "rc" else [f"OPTIMISE=-Og {TIDY}"]
    done = subprocess.run(
        ["make", "-s", "-C", str(folder), "all", "check", *options],
        capture_output=True,
        text=True,
        env={"PATH": os.environ["PATH"]},
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "records, as expected" in done.stdout
    assert done.stderr == ""
    for recording in sorted((EXAMPLES / plant).glob("*.csv")):
        rows = recording.read_text().splitlines(keepends=True)[: PLANTS[plant] + 1]
        both(plant, rows, folder / "watch")
    if plant == "rc":
        both(plant, broken(rows), folder / "watch")
    if plant in ONE_BY_ONE:
        (first, second), told = ONE_BY_ONE[plant]
        path, healthy = tmp_path / "one_by_one.csv", str(EXAMPLES / plant / "healthy.csv")
        words = ["simulate", str(EXAMPLES / plant / "model.yaml"), "--inputs", healthy, "-o", str(path), "--seed", "5"]
        assert main([*words, "--fault", first, "--fault", second]) == 0
        rows = path.read_text().splitlines(keepends=True)
        assert any(told in record for record in ran(EXAMPLES / plant / "model.yaml", "".join(rows).encode()).records)
        both(plant, rows, folder / "watch")


def broken(rows: list[str]) -> list[str]:
    """Give rows with columns in another order, and with values missing, late, twice, wild and not a number."""
    turned = [",".join(reversed(row.strip().split(","))) + "\n" for row in rows]
    turned[50] = turned[50].replace(turned[50].split(",")[0], "")
    turned[60] = "nan," + turned[60].partition(",")[2]
    turned[70], turned[71] = turned[71], turned[70]
    turned[80] = turned[79]
    turned[90] = "1e9," + turned[90].partition(",")[2]
    turned[100] = "what is this\n"
    return turned[:110] + turned[130:]


def test_a_difference_is_found() -> None:
    """The comparison above sees keys, their order, texts, and numbers to the last digit."""
    record = {"time": 1.0, "candidates": [{"probability": 0.5, "parameters": {"K": {"estimate": 3.0}}}], "n": 1}
    assert not list(differences(record, json.loads(json.dumps(record))))
    for change in (
        {"time": 1.0, "n": 1, "candidates": record["candidates"]},
        record | {"n": 2},
        record | {"n": 1.0},
        record | {"time": 1.0 + 2.0**-52},
        record | {"candidates": []},
        record | {"candidates": [{"probability": 0.5 + 2.0**-53, "parameters": {"K": {"estimate": 3.0}}}]},
        record | {"candidates": [{"probability": 0.5, "parameters": {"K": {"estimate": 3.0 + 2.0**-51}}}]},
    ):
        assert list(differences(record, change))
