"""The trial of the promised time between false alarms."""

from dataclasses import replace
from math import inf, log
from pathlib import Path

import numpy as np
import pytest
from benchmarks.trust.promise import PLANTS, Count, circuit, count, main, promised, rows, span


def test_without_an_alarm_the_mean_time_is_known_from_below_only() -> None:
    """No alarm in T: with 95 % confidence the mean time is T / log 20 or more."""
    quiet = Count(watched=100.0)
    assert quiet.least == pytest.approx(100.0 / log(20.0))
    assert quiet.most == inf
    assert (quiet.verdict(33.0), quiet.verdict(34.0)) == ("kept", "open")


@pytest.mark.parametrize("alarms", [1, 4, 20])
def test_bounds_are_those_of_events_at_random(alarms: int) -> None:
    """If the mean time is a bound, as few alarms, or as many, come in 5 % of all runs only."""
    generator = np.random.default_rng(1)
    found = Count(alarms=alarms, watched=1.0)
    few = generator.poisson(1.0 / found.least, 200_000) <= alarms
    many = generator.poisson(1.0 / found.most, 200_000) >= alarms
    assert few.mean() == pytest.approx(0.05, abs=0.003)
    assert many.mean() == pytest.approx(0.05, abs=0.003)
    assert found.verdict(1.1 * found.most) == "broken"
    assert found.verdict(found.least) == "kept"


def test_alarms_are_counted_and_the_monitor_starts_anew() -> None:
    """A sensor that reads wrong from the middle on raises an alarm; only time with the alarms on counts."""
    core = promised("rlc", 600.0)
    made = circuit(3, 20.0, False)
    quiet = count(core, made)
    assert quiet.alarms == 0
    assert quiet.watched == pytest.approx(20.0, abs=0.6)
    outputs = made.outputs.copy()
    outputs[400:] += 6.0
    assert count(core, replace(made, outputs=outputs)).alarms >= 1


def test_every_plant_gives_its_lines(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A line for each promise of a plant as its model, and of one that is off."""
    short = [replace(plant, part=1.0, piece=30.0, promises=(600.0,)) for plant in PLANTS[1:]]
    table = rows(1.0 / 120.0, 1, short)
    assert [row[0] for row in table] == [
        "motor, as its model",
        "motor, off by up to 1.5 %",
        "RLC circuit, as its model",
        "RLC circuit, off by up to 1.5 %",
    ]
    assert {row[1] for row in table} == {"10 min"}
    assert all(row[2].startswith("0.49") for row in table)
    monkeypatch.setattr("benchmarks.trust.promise.PLANTS", short[:1])
    page = tmp_path / "page.md"
    main(["--hours", "0.01", "--first-seed", "2", "--markdown", str(page)])
    text = page.read_text(encoding="utf-8")
    assert "`python -m benchmarks.trust.promise --hours 0.01 --first-seed 2`" in text
    assert text.count("| motor, ") == 2


def test_spans_are_told_in_hours_or_minutes() -> None:
    """Two hours and more are hours."""
    assert [span(7200.0), span(7199.0), span(600.0), span(100 * 3600.0)] == ["2 h", "120 min", "10 min", "100 h"]
