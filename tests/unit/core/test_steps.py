"""Lanes of steps: where they begin, the mixture over onsets, what a sample does, and renewals."""

from dataclasses import dataclass

import numpy as np
import pytest

from faultbond.arrays import FloatArray, IntArray
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.spec import covariance_place, pack, unpack
from faultbond.synthesis.compile import find_compiler
from motor_core import BEGUN, CHANGE, GROWN, OLDEST, ROWS, Core, core

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")


@dataclass(frozen=True)
class Start:
    """Suspects with their starts and how far these may be off, in healthy factors; stores that jump with a suspect."""

    values: dict[int, float]
    sds: dict[int, float]
    jumps: tuple[tuple[int, int, float], ...]  # (state, parameter, exponent)
    tied: bool = False


def planned(motor: Core, lane: int, *, tied: bool = False) -> Start:
    """The start of a lane of the plan."""
    plan, states = plan_lanes(motor.spec), enumerate(motor.spec.states)
    suspects = [int(k) for k in np.flatnonzero(plan.suspected[:, lane])]
    jumps = [(x, *jump) for x, item in states for jump in item.jumps if plan.jumps[lane, x] and jump[0] in suspects]
    values, sds = ({k: float(table[k, lane]) for k in suspects} for table in (plan.values, plan.sds))
    return Start(values=values, sds=sds, jumps=tuple(jumps), tied=tied)


def found(motor: Core, start: Start, lane: FloatArray) -> Start:
    """The start from where a lane of this start now stands."""
    first = motor.spec.parameter_slice.start
    values = {k: float(lane[first + k] / motor.lanes[0, first + k]) for k in start.values}
    return Start(values=values, sds={k: min(0.35 * v, 2.0) for k, v in values.items()}, jumps=start.jumps, tied=True)


def dense_start(motor: Core, start: Start, healthy: FloatArray) -> FloatArray:
    """A start by matrices: contents are freed of their factor, suspects made wide, and contents given to it again."""
    spec, n, first = motor.spec, motor.spec.n_joint, motor.spec.parameter_slice.start
    mean, covariance = healthy[:n].copy(), unpack(spec, healthy[spec.covariance_slice])
    for state, index, power in start.jumps:
        freed = np.eye(n)
        freed[state, first + index] = -power * healthy[state] / healthy[first + index]
        covariance = freed @ covariance @ freed.T
    for index, value in start.values.items():
        k = first + index
        covariance[k, :] = covariance[:, k] = 0.0
        covariance[k, k] = (start.sds[index] * healthy[k]) ** 2
        mean[k] = np.clip(healthy[k] * value, spec.parameters[index].lower, spec.parameters[index].upper)
    for state, index, power in start.jumps:
        scaled, moved, k = np.eye(n), np.eye(n), first + index
        scaled[state, state] = (mean[k] / healthy[k]) ** power
        mean, covariance = scaled @ mean, scaled @ covariance @ scaled.T
        moved[state, k] = power * mean[state] / mean[k]
        if start.tied:
            covariance = moved @ covariance @ moved.T
        else:
            covariance[state, state] += moved[state, k] ** 2 * covariance[k, k]
    return np.concatenate([mean, pack(covariance), healthy[n + spec.n_packed :]])


def dense_run(motor: Core, start: Start, onset: int) -> FloatArray:
    """A start begun half way between a fault of the sample before and one of now, then run over all samples."""
    spec, place, n_x = motor.spec, motor.spec.sample_fields, len(motor.spec.states)
    samples, later = motor.samples[onset:].copy(), motor.lanes[onset - 1].copy()
    samples[:, place["again"]], samples[:, place["bound"]] = 1.0, spec.thresholds.bank_bound
    blind = samples[0].copy()
    blind[place["use"]] = 0.0
    early = dense_start(motor, start, later)
    motor("t_one", blind, early)
    motor("t_one", blind, later)
    late = dense_start(motor, start, later)
    half = np.concatenate([0.5 * (early[:n_x] - late[:n_x]), np.zeros(spec.n_joint - n_x)])
    late[: spec.n_joint] += half
    late[spec.covariance_slice] += pack(np.outer(half, half))
    late[-1] = motor.lanes[onset - 1, -1]
    samples[0, place["dt"]] = 0.0
    for sample in samples:
        motor("t_one", sample, late)
    return late


def dense_mixture(motor: Core, start: Start) -> float:
    """The mean likelihood of a start over all onsets, each of which is run."""
    likelihoods = [dense_run(motor, start, place)[-1] for place in range(1, ROWS)]
    return float(np.logaddexp.reduce(likelihoods) - np.log(motor.spec.thresholds.history_samples))


def is_run(motor: Core, lane: FloatArray, start: Start, onset: int) -> bool:
    """Whether a lane is that of a start begun at an onset, but for rounding and its likelihood."""
    return bool(lane[:-1] == pytest.approx(dense_run(motor, start, onset)[:-1], rel=1e-6, abs=1e-9))


@pytest.mark.parametrize("tied", [False, True])
def test_a_start_is_that_of_matrices(*, tied: bool) -> None:
    """Suspects are wide about their start, and what a store holds goes on or not; in every lane of the plan."""
    motor = core()
    for lane in range(motor.n_planned):
        given = np.zeros(motor.spec.n_numbers)
        motor("t_suspect", lane, int(tied), motor.lanes[7], given)
        expected = dense_start(motor, planned(motor, lane, tied=tied), motor.lanes[7])
        assert given == pytest.approx(expected, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("drift", [0.0, 0.4])
def test_a_lane_begins_between_a_fault_of_before_and_one_of_now(drift: float) -> None:
    """At its onset the states lie half way; then come all samples, the first of them at once. Parameters may drift."""
    motor = core()
    motor.begin_trail()
    motor("t_drift", np.full(5, drift), np.full(5, 0.1 * drift))
    for lane in range(0, motor.n_planned, 7):
        expected = dense_run(motor, planned(motor, lane), ROWS - 6)
        assert motor.begun(lane, ROWS - 6) == pytest.approx(expected, rel=1e-8, abs=1e-12)


def test_a_lane_of_the_bank_began_at_its_best_onset_and_is_as_likely_as_all() -> None:
    """It is the lane of the onset that the bank names, with the mean likelihood over all, though few are tried."""
    motor = core()
    bank, onsets = motor.begin_bank(), motor.onsets()
    led = bank[: motor.n_planned, -1].argmax()
    for lane in {*range(0, motor.n_planned, 11), int(led)}:
        assert is_run(motor, bank[lane], planned(motor, lane), onsets[lane])
    assert abs(onsets[led] - CHANGE) <= 2
    for lane in np.flatnonzero(bank[: motor.n_planned, -1] > bank[led, -1] - 5.0):
        assert bank[lane, -1] == pytest.approx(dense_mixture(motor, planned(motor, int(lane))), abs=1.0)


def test_a_bank_goes_on_with_all_that_has_begun() -> None:
    """One sample more is taken into each lane alone; sets in reserve are zero until they are chosen."""
    motor = core()
    before, innovations, place = motor.begin_bank(), np.zeros((4, motor.n_lanes)), motor.spec.sample_fields
    assert not before[motor.n_planned :].any()
    packed = motor.samples[-1].copy()
    motor("t_advance", motor.n_planned, packed, innovations)
    after, n = motor.bank(), motor.n_planned
    packed[place["again"]], packed[place["bound"]] = 1.0, motor.spec.thresholds.bank_bound
    for lane in range(n):
        motor("t_one", packed, before[lane])
    assert np.array_equal(after[:n], before[:n])
    assert np.all(innovations[2:, :n] > 0.0)
    assert not after[-GROWN:].any()
    assert np.array_equal(innovations[:, motor.n_steps - 1], [0.0, 0.0, 1.0, 1.0])


def best_and_worst(motor: Core, bank: FloatArray) -> tuple[IntArray, IntArray]:
    """The likeliest and the least likely lane of each tested set."""
    plan, likelihood = plan_lanes(motor.spec), bank[: motor.n_planned, -1]
    lanes = [np.flatnonzero(plan.hypothesis == k) for k in range(len(BEGUN))]
    ends = [(item[np.argmax(likelihood[item])], item[np.argmin(likelihood[item])]) for item in lanes]
    return np.array([best for best, _ in ends]), np.array([worst for _, worst in ends])


def test_the_worst_start_is_taken_by_what_the_best_has_found() -> None:
    """A renewal changes at most the least likely lane of each hypothesis, to a likelier one, which is judged anew."""
    motor, n = core(), core().n_planned
    before = motor.begin_bank()
    after, changed = (item[:n] for item in motor.renewed())
    _, worst = best_and_worst(motor, before)
    assert np.array_equal(changed, np.any(after != before[:n], axis=1))
    assert len(BEGUN) - 2 <= changed.sum() <= len(BEGUN)
    assert set(np.flatnonzero(changed)) <= set(worst)
    assert np.all(after[changed, -1] > before[:n][changed, -1])
    before[:, -1] = 0.0  # likelier than anything that begins
    motor("t_put", before)
    assert not motor.renewed()[1][:n].any()


def test_a_renewed_lane_begins_from_what_was_found() -> None:
    """It has the estimates of the best lane as start; where a store jumps it begins again, unless that leads astray."""
    motor, plan, kinds = core(), plan_lanes(core().spec), set()
    before = motor.begin_bank()
    best, worst = best_and_worst(motor, before)
    motor("t_again", 0)
    for _ in range(2):  # groups: single parameters, then pairs
        lanes, began, begins = (np.zeros(8, dtype=np.int64) for _ in range(3))
        motor("t_group", lanes, began, begins)
        after, onsets = motor.bank(), motor.onsets()
        for old, far, near in {
            *zip(lanes.tolist(), (began - OLDEST).tolist(), (begins - OLDEST).tolist(), strict=True)
        }:
            new = worst[plan.hypothesis[old]]
            assert old in best
            if np.array_equal(after[new], before[new]):
                continue
            start = found(motor, planned(motor, old), before[old])
            lane, kind = dense_run(motor, start, far), "still"
            likelihood = lane[-1]
            if plan.jumps[old].any():
                closer = found(motor, start, lane)
                again = max(dense_run(motor, closer, place)[-1] for place in range(1, ROWS))
                kind = "nearer" if again > likelihood - 10.0 else "astray"
                lane = dense_run(motor, closer, near) if kind == "nearer" else lane
            assert after[new, :-1] == pytest.approx(lane[:-1], rel=1e-6, abs=1e-9)
            assert abs(after[new, -1] - lane[-1]) < np.log(ROWS) + 6.0
            assert onsets[new] == (near if kind == "nearer" else far)
            kinds.add(kind)
    assert kinds == {"still", "nearer", "astray"}


def test_all_that_may_lead_begin_again_and_the_rest_follow_the_best() -> None:
    """Lanes alike become one; a lane whose new beginning leads astray stays; far ones keep their likelihood only."""
    motor, plan, led, n = core(), plan_lanes(core().spec), BEGUN.index((0,)), core().n_planned
    before = motor.begin_bank()
    mine = np.flatnonzero(plan.hypothesis == led)
    best, stubborn = mine[np.argmax(before[mine, -1])], 13
    before[: mine[0], -1] -= 2000.0
    before[mine[-1] + 1 : n, -1] -= 2000.0
    before[stubborn, -1] = before[best, -1] + 15.0  # nothing found from here is as likely, by far
    same = mine[np.all(plan.jumps[mine] == plan.jumps[best], axis=1)]
    twin, far, near = same[same != best][:3]
    before[twin], before[near] = before[best], before[best]
    before[twin, -1] -= 5.0
    before[near, -1] -= 7.0
    k = motor.spec.parameter_slice.start
    before[near, k] += 2.0 * np.sqrt(before[best, covariance_place(motor.spec, k, k)])
    before[far, -1] = before[best, -1] - 25.0
    motor("t_put", before)
    after, changed = motor.renewed(last=True)
    onsets = motor.onsets()
    assert np.array_equal(changed[:n], np.any(after != before, axis=1)[:n])
    assert np.array_equal(after[stubborn], before[stubborn])
    assert changed[best]
    assert np.array_equal(after[twin], after[best])
    assert np.array_equal(after[far], [*after[best, :-1], before[far, -1]])
    assert onsets[twin] == onsets[far] == onsets[best]
    assert is_run(motor, after[near], found(motor, planned(motor, near), before[near]), onsets[near])
    assert after[near, k] != after[best, k]


def test_every_width_has_the_same_digits() -> None:
    """A bank begun, renewed and grown has the same numbers one lane at a time, four, and eight."""
    found = []
    for width in (1, 4, 8):
        motor = core(width)
        motor.begin_bank()
        motor.renewed()
        found.append(motor.renewed(last=True)[0])
    assert np.isfinite(found[0]).all()
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])
