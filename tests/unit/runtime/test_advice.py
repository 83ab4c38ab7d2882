"""What to check next: what a check tells, which moves part candidates, and what it costs."""

from dataclasses import replace
from functools import cache
from math import log2
from pathlib import Path

import numpy as np
import pytest

from faultbond.contract.findings import Advice, Candidate, Diagnosis
from faultbond.contract.spec import CheckSpec
from faultbond.model.text import parse_model
from faultbond.runtime.advice import APART, LEAST, WORTH, _Inputs, _values, advise
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, simulate
from faultbond.synthesis.engine import build_engine
from faultbond.synthesis.probe import build_probe
from faultbond.types import CheckKind
from made import TANK_START, plant, recorded, run, samples_of, spec_of

TANK = (Path(__file__).parents[3] / "examples" / "tank" / "model.yaml").read_text(encoding="utf-8")
FAULT = Fault(parameter="K6", factor=9.0, start=230.0)


@cache
def leaking() -> tuple[Monitor, Diagnosis]:
    """A tank some time after a leak was detected; the outlet has stood still, so several parts could be the cause."""
    graph, _, core = plant("tank")
    time = np.arange(420.0)
    u = np.stack([np.where(time % 120.0 < 60.0, 80.0, 50.0), np.full(time.shape, 50.0)], axis=1)
    made = simulate(graph, Inputs(time=time, values=u), [FAULT], seed=2, start={"tank.q": TANK_START})
    monitor, _ = run(core, samples_of(time, made.inputs, made.outputs))
    assert monitor.number("clock.alarm") >= 0
    return monitor, monitor.conclude()


def with_check(check: CheckSpec) -> Monitor:
    """The same, with one check in the model file."""
    core = leaking()[0].core
    return Monitor(replace(core, spec=replace(core.spec, checks=(check,))), leaking()[0].save())


def outlet() -> float:
    """Where the outlet valve stands, percent."""
    return float(leaking()[0].numbers("inputs.held")[1])


def with_probabilities(diagnosis: Diagnosis, **parts: float) -> Diagnosis:
    """The diagnosis with these single components as its only candidates that matter."""
    chosen: list[Candidate] = []
    for name, probability in sorted(parts.items(), key=lambda item: -item[1]):
        candidate = next(item for item in diagnosis.candidates if item.components == (name,))
        chosen.append(replace(candidate, probability=probability))
    return replace(diagnosis, candidates=tuple(chosen))


def looks(found: tuple[Advice, ...]) -> dict[str, Advice]:
    """Advice to look at a part, by part."""
    return {item.target: item for item in found if item.kind is CheckKind.COMPONENT}


def entropy(*parts: float) -> float:
    """Entropy in bits."""
    return -sum(part * log2(part) for part in parts if part > 0)


def test_a_look_tells_whether_the_part_is_among_the_faulty() -> None:
    """Looking at a part tells as many bits as its probability has, and parts the candidates that hold it."""
    monitor, diagnosis = leaking()
    made = with_probabilities(diagnosis, leak=0.5, outlet=0.3, tank=0.2)
    found = looks(advise(monitor, made))
    assert set(found) == {"leak", "outlet", "tank"}
    for name, part in (("leak", 0.5), ("outlet", 0.3), ("tank", 0.2)):
        assert found[name].gain == pytest.approx(entropy(part, 1.0 - part))
        assert found[name].separates[0] == ((name,),)
        assert len(found[name].separates[1]) == 2


def test_a_candidate_alone_needs_no_advice() -> None:
    """Nothing is advised while one candidate has all but the least probability."""
    monitor, diagnosis = leaking()
    assert advise(monitor, with_probabilities(diagnosis, leak=1.0 - LEAST / 2, outlet=LEAST / 2)) == ()


def test_costs_order_the_advice() -> None:
    """What tells more for its cost comes first; a part that is dear to look at goes back."""
    made = with_probabilities(leaking()[1], leak=0.5, outlet=0.3, tank=0.2)
    found = advise(with_check(CheckSpec(name="leak", kind=CheckKind.COMPONENT, cost=100.0)), made)
    worth = [item.gain / item.cost for item in found]
    assert worth == sorted(worth, reverse=True)
    assert looks(found)["leak"].cost == 100.0
    assert found[-1].target == "leak"


def test_moving_the_outlet_parts_leak_and_outlet() -> None:
    """A leak and a wider outlet look alike until the outlet valve moves; moving the inlet valve does not part them."""
    monitor, diagnosis = leaking()
    made = with_probabilities(diagnosis, leak=0.5, outlet=0.5)
    moves = {item.target: item for item in advise(monitor, made) if item.kind is CheckKind.INPUT}
    assert set(moves) == {"u_out"}
    move = moves["u_out"]
    assert move.gain == pytest.approx(1.0)
    assert move.value is not None
    assert 0.0 <= move.value <= 100.0
    assert abs(move.value - outlet()) > 5.0
    assert move.within == 300.0


def test_a_stated_move_is_the_one_that_is_tried() -> None:
    """Where the model file says how far an input may be moved, no other move is advised; a small one helps nobody."""
    made = with_probabilities(leaking()[1], leak=0.5, outlet=0.5)
    for size in (40.0, 0.5):
        stated = with_check(CheckSpec(name="u_out", kind=CheckKind.INPUT, cost=1.0, move=size))
        moves = [item for item in advise(stated, made) if item.kind is CheckKind.INPUT]
        assert [abs((item.value or 0.0) - outlet()) for item in moves] == ([40.0] if size > 1.0 else [])


@pytest.mark.parametrize(
    ("unit", "offset", "seen", "now", "move", "expected"),
    [
        ("percent", 0.0, (20.0, 30.0), 30.0, None, [50.0, 10.0, 70.0, 0.0, 90.0]),
        ("V", 0.0, (2.0, 10.0), 10.0, None, [8.0, 6.0, 4.0]),  # never beyond 10, never turned round
        ("V", 0.0, (-10.0, 10.0), 4.0, None, [6.0, 2.0, 8.0, 0.0, 10.0, -2.0]),
        ("degC", 273.15, (280.0, 300.0), 290.0, None, [294.0, 286.0, 298.0, 282.0, 300.0, 280.0]),
        ("degC", 273.15, (290.0, 290.0), 290.0, None, []),  # where it has never moved nobody knows how far it may
        ("degC", 273.15, (290.0, 290.0), 290.0, 5.0, [295.0, 285.0]),
        ("percent", 0.0, (20.0, 30.0), 85.0, 20.0, [100.0, 65.0]),
        ("percent", 0.0, (20.0, 30.0), 95.0, 20.0, [75.0]),  # to the end it would be a quarter of the move only
    ],
)
def test_where_an_input_may_be_moved(
    unit: str, offset: float, seen: tuple[float, float], now: float, move: float | None, expected: list[float]
) -> None:
    """Within where it has been and zero, but for degC; of a stated move as far as stated; percentages from 0 to 100."""
    spec = spec_of("dc_motor")
    spec = replace(spec, inputs=(replace(spec.inputs[0], unit=unit, unit_offset=offset),))
    inputs = _Inputs(*(np.array([value]) for value in (now, *seen)))
    check = None if move is None else CheckSpec(name="V", kind=CheckKind.INPUT, cost=1.0, noise=0.0, move=move)
    assert _values(spec, inputs, 0, check) == pytest.approx(expected)


def test_a_measurement_by_hand_parts_what_expects_other_values() -> None:
    """A flow that can be measured by hand tells a wrong flow sensor from a narrower pipe, unless it is too coarse."""
    for noise, parted in ((2e-6, True), (2e-3, False)):
        check = f"checks: {{inflow: {{reads: line.f, unit: m^3/s, noise: {noise} m^3/s, cost: 2}}}}\n"
        graph = parse_model(TANK + check)
        own, core = build_engine(graph)
        monitor, _ = run(core, recorded("tank", 330, Fault(parameter="K2", factor=1.5, start=230.0)))
        diagnosis = with_probabilities(monitor.conclude(), flow=0.5, pipe=0.5)
        found = advise(monitor, diagnosis, build_probe(own, graph))
        signals = [item for item in found if item.kind is CheckKind.SIGNAL]
        assert [item.target for item in signals] == (["inflow"] if parted else [])
        assert all(item.cost == 2.0 and item.gain == pytest.approx(1.0) for item in signals)


def test_every_piece_of_advice_is_worth_something() -> None:
    """No check that tells next to nothing is advised, and each names groups that hold all candidates."""
    monitor, diagnosis = leaking()
    found = advise(monitor, diagnosis)
    assert found
    assert APART > 0
    for item in found:
        assert item.gain >= WORTH
        assert len(item.separates) > 1
        assert len({tuple(sorted(group)) for group in item.separates}) == len(item.separates)
    assert np.all(np.isfinite([item.gain for item in found]))
