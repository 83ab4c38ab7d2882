"""The plant that is simulated on line."""

import asyncio
import json
import threading
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from arriving import Gathered, gathered, n_rows, subscriber, tank_subscriber
from faultbond.app.self_test import records_of
from faultbond.app.simulation import solved_start
from faultbond.arrays import FloatArray
from faultbond.errors import SourceError
from faultbond.io.examples import example
from faultbond.io.faults import FaultRequest, parse_fault
from faultbond.io.recording import columns_of, write_recording
from faultbond.model.text import load_model, parse_model
from faultbond.service.contract.source import Subscriber
from faultbond.service.sources import simulated as module
from faultbond.service.sources.simulated import ROWS, SimulatedPlant, SimulationWishes
from faultbond.synthesis.engine import build_engine

FASTEST = float("inf")


@cache
def start_of_file(text: str, recording: str) -> dict[str, float]:
    """Give the start of a model by a recording."""
    return solved_start(parse_model(text, "model"), recording)


@pytest.fixture(autouse=True)
def _starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the start of a plant be solved once, since that takes seconds."""
    monkeypatch.setattr(module, "solved_start", lambda graph, recording: start_of_file(graph.text, str(recording)))


def made(
    n: int,
    *faults: str,
    cursors: dict[str, str] | None = None,
    seed: int = 1,
    speed: float = FASTEST,
    noise: bool = True,
    item: Subscriber | None = None,
) -> Gathered:
    """Give so many rows of a plant, of the tank if none is given, at least."""
    wishes = SimulationWishes(speed=speed, seed=seed, faults=tuple(map(parse_fault, faults)), noise=noise)
    item = item or tank_subscriber()
    return gathered(SimulatedPlant([item], wishes), n_rows(n, item.asset), cursors, 60.0)


def since(found: Gathered) -> FloatArray:
    """Give all rows of the tank, with times since the first."""
    rows = found.rows("tank")
    return np.column_stack([rows[:, 0] - rows[0, 0], rows[:, 1:]])


def test_the_same_seed_gives_the_same_rows() -> None:
    """Two simulations of one seed agree to a bit, those of another seed do not; inputs move, and time begins now."""
    one, same, other = made(2000), made(2000), made(2000, seed=2)
    np.testing.assert_array_equal(since(one), since(same))
    assert not np.array_equal(since(one), since(other))
    rows = one.rows("tank")
    assert np.diff(rows[:, 0]).tolist() == [1.0] * 1999
    assert abs(rows[0, 0] - time.time()) < 60.0
    assert len(np.unique(rows[:, 1])) > 3
    assert 0.0 < rows[:, 4].min() < rows[:, 4].max() < 2 * 9810


FAULTS = ("K1=x1.3@500..1500", "K6=x3@100,700/300", "flow.stuck@1200", "pressure.bias=200@300")


def test_after_a_stop_the_same_values_come() -> None:
    """Behind a cursor within a stretch or at its end rows go on as if there had been no stop, whatever is wrong."""
    whole = made(4 * ROWS, *FAULTS).rows("tank")
    part = made(300, *FAULTS, speed=2000.0)
    n = len(part.rows("tank"))
    assert 300 <= n < 3 * ROWS
    rest = made(4 * ROWS - n, *FAULTS, cursors=part.cursors)
    joined = np.concatenate([part.rows("tank"), rest.rows("tank")])[: 4 * ROWS]
    np.testing.assert_array_equal(joined[:, 1:], whole[:, 1:])
    assert np.unique(np.diff(joined[:, 0])).tolist() == [1.0]
    assert rest.counts("tank") == {}
    at_end = made(2 * ROWS, *FAULTS)
    assert json.loads(at_end.cursors["tank"])["at"] == ROWS
    behind = made(ROWS, *FAULTS, cursors=at_end.cursors).rows("tank")
    np.testing.assert_array_equal(behind[:ROWS, 1:], whole[2 * ROWS : 3 * ROWS, 1:])


def test_faults_go_on_over_stretches() -> None:
    """One that comes and goes does so at its times for ever; a stuck sensor stays where it was; a plant goes on."""
    quiet = made(3 * ROWS, noise=False).rows("tank")
    bias = made(3 * ROWS, "pressure.bias=500@100,300/400", noise=False).rows("tank")
    there = (np.arange(3 * ROWS) >= 100) & ((np.arange(3 * ROWS) - 100) % 700 < 300)
    np.testing.assert_allclose(bias[:, 4] - quiet[:, 4], 500.0 * there, atol=1e-6)
    stuck = made(3 * ROWS, "flow.stuck@900").rows("tank")[:, 3]
    assert len(np.unique(stuck[:900])) > 800
    assert len(np.unique(stuck[900:])) == 1
    steps = np.abs(np.diff(quiet[:, 4]))
    assert steps[[ROWS - 1, 2 * ROWS - 1]].max() <= steps.max() < 100.0


def test_a_healthy_plant_gets_a_fault_that_is_found() -> None:
    """By itself, the tank's pipe clogs after the alarms are on, a minute of real time at least, and that is found."""
    item = tank_subscriber()
    source = SimulatedPlant([item], SimulationWishes(speed=10.0))
    fastest = SimulatedPlant([item], SimulationWishes(speed=FASTEST))
    graph = item.graph
    quiet = made(600, noise=True).rows("tank")
    usual = gathered(fastest, n_rows(2000, "tank"), None, 60.0).rows("tank")
    begun = int(graph.warm_up) + 60
    np.testing.assert_array_equal(usual[:begun, 1:], quiet[:begun, 1:])
    assert not np.array_equal(usual[begun : begun + 100, 1:], quiet[begun : begun + 100, 1:])
    assert source.address == "sim:"


def test_the_usual_fault_is_found(tmp_path: Path) -> None:
    """The core names the pipe of the tank that gets a fault by itself, and nothing before it."""
    item = tank_subscriber()
    rows = gathered(SimulatedPlant([item], SimulationWishes(speed=FASTEST)), n_rows(1500, "tank"), None, 60.0)
    values = rows.rows("tank").T
    path = tmp_path / "made.csv"
    write_recording(path, dict(zip(("time", "u_in", "u_out", "flow", "pressure"), values, strict=True)))
    _, core = build_engine(item.graph)
    records = [json.loads(line) for line in records_of(item.graph, core, path)[0].splitlines()]
    (detection,) = [record for record in records if record["record"] == "detection"]
    assert detection["sample"] >= int(item.graph.warm_up) + 60
    best = [record for record in records if record["record"] == "diagnosis"][-1]["candidates"][0]
    assert list(best["parameters"]) == ["K1"]
    assert best["parameters"]["K1"]["estimate"] == pytest.approx(1.5 * 2.41e11, rel=0.15)


def test_rows_keep_their_time() -> None:
    """At 100 times real time a second brings 100 s of the plant, in batches of a tenth of a second."""
    begun = time.monotonic()
    found = made(150, speed=100.0)
    assert 1.0 < time.monotonic() - begun < 30.0
    assert max(len(item.rows) for item in found.arrivals[1:4]) < 60


def test_another_model_or_wish_begins_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cursor that is of another simulation is told as a count."""
    monkeypatch.setattr(module, "ROWS", 100)  # of a stretch, of which each beginning computes two
    found = made(10)
    assert made(10, cursors=found.cursors).counts("tank") == {}
    assert made(10, seed=5, cursors=found.cursors).counts("tank") == {"begun anew": 1}
    assert made(10, "K1=x2@5", cursors=found.cursors).counts("tank") == {"begun anew": 1}
    for strange in ("?", "[]", '{"of": 1}', "7"):
        assert made(10, cursors={"tank": strange}).counts("tank") == {"begun anew": 1}


@pytest.mark.parametrize("name", ["dc_motor", "rlc", "three_tank"])
def test_other_examples_are_driven_by_their_recordings(name: str) -> None:
    """All sensors of a built-in plant move, are finite, and stay where its recording has them."""
    graph = load_model(example(name) / "model.yaml")
    item = Subscriber(asset=name, columns=columns_of(graph), graph=graph)
    rows = made(1500, item=item).rows(name)
    assert np.isfinite(rows).all()
    assert (np.ptp(rows[:, 1 + len(graph.inputs) :], axis=0) > 0.0).all()


def test_a_model_without_a_recording_moves_as_usual(tmp_path: Path) -> None:
    """Its inputs are those with which a generated program tries itself."""
    graph = parse_model((example("dc_motor") / "model.yaml").read_text(), str(tmp_path / "motor.yaml"))
    item = Subscriber(asset="motor", columns=columns_of(graph), graph=graph)
    rows = made(2500, item=item).rows("motor")
    assert np.isfinite(rows).all()
    np.testing.assert_allclose(rows[:1200, 1], rows[1200:2400, 1], atol=6 * graph.inputs[0].noise)
    assert np.ptp(rows[:, 2]) > 10 * graph.sensors[0].noise


def test_the_loop_is_not_held_up() -> None:
    """While a stretch is computed, others in the loop go on; assets of one model are different plants."""

    async def play() -> tuple[list[float], Gathered]:
        gaps, found = list[float](), Gathered()

        async def tick() -> None:
            last = time.monotonic()
            while True:
                await asyncio.sleep(0.005)
                gaps.append(time.monotonic() - last)
                last = time.monotonic()

        items = [tank_subscriber("a"), tank_subscriber("b")]
        source = SimulatedPlant(items, SimulationWishes(speed=FASTEST, faults=()))
        ticking = asyncio.create_task(tick())
        async for item in source.arrivals({}):
            assert threading.current_thread() is threading.main_thread()
            found.arrivals.append(item)
            if len(found.arrivals) > 10:
                break
        ticking.cancel()
        return gaps, found

    gaps, found = asyncio.run(asyncio.wait_for(play(), 60.0))
    assert float(np.quantile(gaps, 0.9)) < 0.1
    assert not np.array_equal(found.rows("a")[:ROWS, 3], found.rows("b")[:ROWS, 3])


def test_what_cannot_be_simulated_is_told(tmp_path: Path) -> None:
    """A recording that is not there, or has no inputs, is one line that names it."""
    for text, message in ((None, "No such file"), ("time,u_in\n0,1\n", "u_out"), ("time,u_in,u_out\n0,,1\n", "u_in")):
        path = tmp_path / "drive.csv"
        if text is not None:
            path.write_text(text)
        source = SimulatedPlant([tank_subscriber()], SimulationWishes(inputs=str(path)))
        with pytest.raises(SourceError, match=message):
            gathered(source)


def test_faults_of_other_plants_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fault of a parameter that only another plant of the source has is none of this one."""
    monkeypatch.setattr(module, "ROWS", 100)
    item = subscriber("tank", tank_subscriber().columns)
    fault = FaultRequest(parameter="R_of_another", value=1.0, factor=None, start=1.0, end=1.0)
    source = SimulatedPlant([item], SimulationWishes(speed=FASTEST, faults=(fault,)))
    np.testing.assert_array_equal(
        gathered(source, n_rows(10, "tank")).rows("tank")[:, 1:], made(10).rows("tank")[:, 1:]
    )
