"""`run` says where samples of an alarm take longer than the time between them."""

from pathlib import Path

import pytest

from faultbond.app import course
from faultbond.cli import main

TANK = Path("examples/tank")


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A clock that goes on by so many seconds, its only item, whenever somebody looks at it."""
    step, now = [0.0], [0.0]

    def looked() -> float:
        now[0] += step[0]
        return now[0]

    monkeypatch.setattr(course, "monotonic", looked)
    return step


@pytest.mark.parametrize(
    ("recording", "seconds", "said"), [("leak", 1e7, True), ("leak", 0.5, False), ("healthy", 1e7, False)]
)
def test_samples_that_take_too_long_are_told(
    recording: str, seconds: float, said: bool, clock: list[float], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of those after the alarm alone: before it there is nothing to be slow at."""
    clock[0] = seconds
    made = tmp_path / "made.csv"
    fault = ["--fault", "K6=x8@600"] if recording == "leak" else []
    inputs = TANK / "healthy.csv"
    assert (
        main(["simulate", str(TANK / "model.yaml"), "--inputs", str(inputs), *fault, "--seed", "1", "-o", str(made)])
        == 0
    )
    capsys.readouterr()
    assert main(["run", str(TANK / "model.yaml"), str(made)]) == (recording == "leak")
    told = " ".join(capsys.readouterr().out.split())
    assert ("While there was an alarm a sample took" in told) is said
    assert ("and one comes every 1 s: beside the plant it would fall behind" in told) is said
