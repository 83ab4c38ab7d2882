"""Steps in the bank: hypotheses do not see each other, every lane is one of the plant, and the true fault is found."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.special import logsumexp

from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec, unpack
from faultbond.equations.plant import build_plant
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault
from faultbond.synthesis.engine import build_core
from faultbond.types import FaultKind
from made import plant, recorded, run

Groups = list[tuple[list[int], list[int]]]  # lanes of one hypothesis and kind, in one monitor and in another
FAULTS = {
    "tank": Fault(parameter="K1", factor=3.0, start=230.0),
    "dc_motor": Fault(parameter="K", factor=0.6, start=2.4),
    "dc_motor_current": Fault(parameter="K", factor=0.6, start=2.4),
}


@cache
def ended(name: str, rows: int = 330) -> Monitor:
    """The plant after a step of a parameter."""
    return run(plant(name)[2], recorded(name, rows, FAULTS[name]))[0]


def alike(one: Monitor, two: Monitor, groups: Groups, layout: EngineSpec, most: float) -> int:
    """Hypotheses whose lanes of a kind may come to lead are as likely in two monitors, to a nat; how many.

    Their best lanes of steps have found the same, to their sd; what a drift has found hangs on its onset. Which of its
    lanes is the best does so, too: with fewer lanes work is done sooner, and they begin again from what was found then.

    most : log-likelihood of the best lane
    """
    n, seen = 0 if layout.slot else layout.n_joint, 0
    for own, other in groups:
        first, second = (np.array([m.lane(k) for k in lanes]) for m, lanes in ((one, own), (two, other)))
        assert second.shape == first.shape == (len(other), layout.n_numbers)
        assert np.all(np.isfinite(second))
        if second[:, -1].max() < most - 10.0:
            continue
        assert logsumexp(first[:, -1]) == pytest.approx(logsumexp(second[:, -1]), abs=1.0)
        first, second = (lanes[np.argmax(lanes[:, -1])] for lanes in (first, second))
        sd = np.sqrt(np.maximum(np.diag(unpack(layout, second[layout.covariance_slice])), 0.0))
        assert np.all(np.abs(first[:n] - second[:n]) <= sd[:n] + 1e-12)
        seen += 1
    return seen


@pytest.mark.parametrize(
    ("name", "kept"),
    [("tank", (1, 2, 0, 6, 3, 5, 4, 9, 20)), ("dc_motor", (2,)), ("dc_motor_current", (4, 3, 2, 1, 0, 24, 7))],
)
def test_hypotheses_do_not_see_each_other(name: str, kept: tuple[int, ...]) -> None:
    """Adding, removing or reordering hypotheses changes what no other that matters says, over 330 samples.

    They share the onsets that are tried, but for these each goes its own way. Larger sets are tried at the onsets that
    single parameters make likely; so where there are such sets, these stay.
    """
    graph, spec, core = plant(name)
    samples = recorded(name, 330, FAULTS[name])
    less = replace(spec, hypotheses=tuple(spec.hypotheses[k] for k in kept))
    full, reports = run(core, samples)
    part, part_reports = run(build_core(build_plant(graph), less), samples)
    assert 0 <= full.number("clock.alarm") < 290
    assert part.number("clock.alarm") == full.number("clock.alarm")
    assert np.array_equal(part.numbers("healthy.lane"), full.numbers("healthy.lane"))
    assert [r.detection for r in part_reports] == [r.detection for r in reports]
    assert not spec.reserve
    of_less, of_all = (plan_lanes(item).hypothesis for item in (less, spec))
    steps = [
        (np.flatnonzero(of_less == new).tolist(), np.flatnonzero(of_all == old).tolist())
        for new, old in enumerate(kept)
    ]
    most = max(full.lane(k)[-1] for k in range(len(of_all) + plan_slots(spec).n_lanes))
    shift = len(less.hypotheses) - len(spec.hypotheses)
    twins = [*enumerate(kept), *((k + shift, k) for k in range(len(spec.hypotheses), spec.n_hypotheses))]
    slots = [
        ([len(of_less) + k for k in here], [len(of_all) + k for k in there])
        for new, old in twins
        for here, there in zip(slots_of(less, new), slots_of(spec, old), strict=True)
    ]
    assert len(slots) > 5
    assert alike(part, full, steps, spec, most) + alike(part, full, slots, spec.slotted, most) > 0


def slots_of(spec: EngineSpec, hypothesis: int) -> list[list[int]]:
    """The lanes with a slot of a hypothesis, those of each kind."""
    kinds: dict[FaultKind, list[int]] = {}
    for k, lane in enumerate(plan_slots(spec).lanes):
        if lane.hypothesis == hypothesis:
            kinds.setdefault(lane.kind, []).append(k)
    return list(kinds.values())


@pytest.mark.parametrize(("name", "wanted"), [("tank", 3.0 * 2.41e11), ("dc_motor_current", 0.6 * 2.0)])
def test_true_fault_is_found(name: str, wanted: float) -> None:
    """The parameter that changed is the best candidate, with its new value within four standard deviations."""
    best = ended(name).conclude().candidates[0]
    assert best.parameters == (FAULTS[name].parameter,)
    assert best.suspects[0].estimate == pytest.approx(wanted, abs=4.0 * best.suspects[0].sd)
    assert best.suspects[0].sd < 0.3 * wanted


@pytest.mark.parametrize("name", FAULTS)
def test_every_lane_is_one_of_the_plant(name: str) -> None:
    """All numbers of the bank are finite and covariances positive definite; a drift's size may hang on its rate."""
    monitor = ended(name)
    spec, n = monitor.spec, plan_lanes(monitor.spec).n_lanes
    assert monitor.number("clock.alarm") >= 0
    for k in range(n + plan_slots(spec).n_lanes):
        lane, layout = monitor.lane(k), spec if k < n else spec.slotted
        full = unpack(layout, lane[layout.covariance_slice])
        live = np.diag(full) > 0.0  # what a slot does not have, as the rate of what does not move, is known
        assert np.all(np.isfinite(lane))
        assert np.all(np.delete(live, layout.slot_slice if layout.slot else []))
        sd = np.sqrt(np.diag(full)[live])
        values = np.linalg.eigvalsh(full[np.ix_(live, live)] / np.outer(sd, sd))
        if k >= n and plan_slots(spec).lanes[k - n].kind is FaultKind.DRIFT:
            assert values[0] > -1e-12  # one from 0 comes to its rate, times its time
            values = values[1:]
        assert values[0] > 0.0
