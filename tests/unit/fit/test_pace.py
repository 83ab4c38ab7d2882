"""How fast a plant moves beside how often it is sampled."""

from pathlib import Path

import numpy as np
import pytest

from faultbond.cli import DONE, main
from faultbond.fit.pace import slower_step
from faultbond.model.text import parse_model
from faultbond.synthesis.engine import build_model

TANK = (Path(__file__).parents[3] / "examples" / "tank" / "model.yaml").read_text()


@pytest.mark.parametrize(("rows", "expected"), [(1, None), (10, 1.0), (100, 1.0)])
def test_the_tank_is_to_be_sampled_once_a_second(rows: int, expected: float | None) -> None:
    """However often it is recorded: its valves settle in 12 s, and no time in which something moves is shorter."""
    model = build_model(parse_model(TANK.replace("sample_time: 1 s", f"sample_time: {1 / rows} s")))
    valves = np.repeat(np.array([[50.0, 30.0], [60.0, 30.0], [60.0, 45.0], [40.0, 20.0]]), 40 * rows, axis=0)
    found = slower_step(model, [valves])
    assert found == (expected if expected is None else pytest.approx(expected))


def test_an_input_that_moves_all_the_time_asks_for_every_sample() -> None:
    """Of a course that changes from sample to sample a slower one would lose what it does."""
    model = build_model(parse_model(TANK.replace("sample_time: 1 s", "sample_time: 0.1 s")))
    course = np.random.default_rng(1).uniform(20.0, 80.0, (500, 2))
    assert slower_step(model, [course]) is None
    averaged = TANK.replace("sample_time: 1 s", "sample_time: 1 s\nrow_time: 0.1 s")
    assert slower_step(build_model(parse_model(averaged)), [np.full((500, 2), 50.0)]) is None


def test_check_proposes_means_of_rows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`check --data` says what to write where a plant is sampled far too often, and nothing of the one that is not."""
    for rows, told in ((10, "`sample_time: 1 s` with `row_time: 0.1 s` finds slow faults sooner"), (1, "")):
        model, recording = tmp_path / f"{rows}.yaml", tmp_path / f"{rows}.csv"
        model.write_text(TANK.replace("sample_time: 1 s", f"sample_time: {1 / rows} s"), encoding="utf-8")
        inputs = tmp_path / "inputs.csv"
        inputs.write_text("time,u_in,u_out\n0,50,30\n60,60,30\n120,60,45\n199,60,45\n", encoding="utf-8")
        assert main(["simulate", str(model), "--inputs", str(inputs), "--seed", "1", "-o", str(recording)]) == DONE
        capsys.readouterr()
        assert main(["check", str(model), "--data", str(recording)]) == DONE
        text = " ".join(capsys.readouterr().out.split())
        assert told in text
        assert ("far faster than anything here moves" in text) == bool(told)
