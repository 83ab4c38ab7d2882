"""Lanes that cannot win any more rest, once none begins again, and go on where a person rules something out."""

import numpy as np
import pytest

from bare_core import bare
from cell_course import cell, course, rows
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.runtime.monitor import Monitor
from faultbond.synthesis.compile import find_compiler
from made import changed

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
SETTINGS, LAST_RENEWAL = core_settings(), 3
GROUP, TO_REST = int(SETTINGS["GROUP"]), SETTINGS["TO_REST"]
N_STEPS, SLOTS = plan_lanes(cell().spec).n_lanes, plan_slots(cell().spec)
ROW = 142  # a diagnosis is due after its sample, and no work is left
CALLS = """
void t_rest(State *state, const double *said)
{
    for (int64_t lane = 0; lane < N_STEPS; lane++) *number_of_step(&state->bank, lane, PLAIN_LIKELIHOOD) = said[lane];
    for (int64_t lane = 0; lane < N_WIDE; lane++)
        *number_of_slot(&state->bank, lane, WIDE_LIKELIHOOD) = said[N_STEPS + lane];
    put_to_rest(&state->bank);
}
"""


def judged(renewals: int) -> Monitor:
    """A monitor at a diagnosis, after so many renewals."""
    monitor = changed(Monitor(cell(), course().saved[ROW]), **{"job.renewals": renewals})
    assert monitor.number("job.kind") == 0
    assert monitor.take(rows()[ROW : ROW + 1]).diagnosis is not None
    return monitor


def far_behind(said: FloatArray) -> list[float]:
    """Which groups lack more than a hundred nats, of steps and of slots, but for pairs that come and go."""
    leads = [lane for lane in range(len(said)) if lane < N_STEPS or not SLOTS.lanes[lane - N_STEPS].sticks]
    least = said[leads].max() - TO_REST
    steps, slots = said[:N_STEPS], said[N_STEPS : N_STEPS + SLOTS.switched]
    return [float(part[k : k + GROUP].max() < least) for part in (steps, slots) for k in range(0, len(part), GROUP)]


def test_after_the_last_renewal_what_is_far_behind_rests() -> None:
    """Each group of which all lanes lack a hundred nats, and no other; while lanes may begin again, none."""
    assert not judged(LAST_RENEWAL - 1).numbers("bank.rests").any()
    monitor = judged(LAST_RENEWAL)
    said = np.array([monitor.lane(lane)[-1] for lane in range(N_STEPS + SLOTS.n_lanes)])
    rests = monitor.numbers("bank.rests").tolist()
    assert rests == far_behind(said)
    assert 0.0 < np.mean(rests) < 1.0


def test_a_group_rests_by_its_likeliest_lane() -> None:
    """A hundred nats are the limit, and a sensor that sticks, however likely, is not what others are compared with."""
    core, n = bare(CALLS), N_STEPS + SLOTS.n_lanes
    said = np.full(n, -TO_REST - 1.0)
    said[0], said[N_STEPS + GROUP], said[N_STEPS + 2 * GROUP] = 0.0, -TO_REST + 1.0, -TO_REST - 0.1
    stuck = next(k for k, lane in enumerate(SLOTS.lanes) if lane.sticks and k >= 3 * GROUP)
    said[N_STEPS + stuck] = 500.0
    core.call("t_rest", said)
    rests = core["bank.rests"].tolist()
    assert rests == far_behind(said)
    n_steps = -(-N_STEPS // GROUP)
    assert [k for k, is_resting in enumerate(rests) if not is_resting] == [0, n_steps + 1, n_steps + stuck // GROUP]


def test_a_rejection_lets_all_go_on() -> None:
    """What rested may be likeliest among what is left."""
    monitor = judged(LAST_RENEWAL)
    monitor.reject(monitor.conclude().candidates[0].hypothesis)
    assert not monitor.numbers("bank.rests").any()


def contradicted(monitor: Monitor) -> Monitor:
    """The same where the likeliest lane does not explain the data."""
    said = np.array([monitor.lane(lane)[-1] for lane in range(N_STEPS + SLOTS.n_lanes)])
    leads = [not SLOTS.lanes[lane - N_STEPS].sticks if lane >= N_STEPS else True for lane in range(len(said))]
    sums = monitor.numbers("bank.sums").reshape(2, -1, len(said))
    sums[0, 0, np.argmax(np.where(leads, said, -np.inf))] = 1e3
    return changed(monitor, **{"bank.sums": sums})


def test_what_led_and_does_not_explain_the_data_any_more_lets_all_go_on() -> None:
    """What the others lacked beside it tells nothing then; what is held against them is what comes from now on."""
    before = judged(LAST_RENEWAL)
    resting = before.numbers("bank.rests").astype(bool)
    row = rows()[ROW + 1 : ROW + 2]
    after = before.copy()
    after.take(row)
    assert after.numbers("bank.rests").astype(bool).tolist() == resting.tolist()
    after = contradicted(before)
    after.take(row)
    assert not after.numbers("bank.rests").any()
    n_steps = -(-N_STEPS // GROUP)
    group = int(np.argmax(resting))
    first = group * GROUP if group < n_steps else N_STEPS + (group - n_steps) * GROUP
    assert np.all(after.numbers("bank.sums").reshape(2, -1, N_STEPS + SLOTS.n_lanes)[:, :, first] == 0.0)


def test_nothing_rests_beside_what_does_not_explain_the_data() -> None:
    """Who is far behind it may be right."""
    monitor = changed(Monitor(cell(), course().saved[ROW]), **{"job.renewals": LAST_RENEWAL})
    monitor = contradicted(monitor)
    assert monitor.take(rows()[ROW : ROW + 1]).diagnosis is not None
    assert not monitor.numbers("bank.rests").any()
