"""Sets of the reserve: their evidence in closed form, which are chosen, where they begin, and what they keep."""

import numpy as np
import pytest
from test_steps import best_and_worst

from faultbond.arrays import FloatArray
from faultbond.contract.spec import covariance_place, unpack
from faultbond.synthesis.compile import find_compiler
from motor_core import BEGUN, GROWN, RESERVE, Core, core

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
N_INSTRUMENTS = 3  # two sensors and the input
PAIR = RESERVE.index((0, 3))  # the true one


def evidence(slopes: FloatArray, y: FloatArray, sds: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Log-density of readings y = slopes @ d + unit noise with d ~ N(0, sds^2); mean and variance of d given y."""
    spread = slopes @ np.diag(sds**2) @ slopes.T + np.eye(len(y))
    gain = np.diag(sds**2) @ slopes.T @ np.linalg.inv(spread)
    _, size = np.linalg.slogdet(2.0 * np.pi * spread)
    rest = np.diag(sds**2) - gain @ slopes @ np.diag(sds**2)
    return float(-0.5 * (y @ np.linalg.solve(spread, y) + size)), gain @ y, np.diag(rest)


def test_the_closed_form_is_exact_where_the_plant_is_linear() -> None:
    """What one more suspect adds to the likelihood of a set is what it adds to the evidence; its change is its own."""
    motor, spec, generator = core(), core().spec, np.random.default_rng(6)
    places = np.arange(spec.parameter_slice.start, spec.parameter_slice.stop)
    diagonal = [covariance_place(spec, int(k), int(k)) for k in places]
    healthy, slopes = motor.lanes[0].copy(), generator.normal(0.0, 8.0, (15, 5))
    healthy[places], healthy[diagonal] = generator.uniform(0.9, 1.1, 5), 0.03**2
    wide = healthy[places] * np.array([item.change for item in spec.parameters])
    y = slopes @ np.array([0.4, 0.01, -0.02, -0.3, 0.0]) + generator.normal(size=15)
    bank, found = motor.begin_bank(), np.zeros(2)
    likelihood, mean, variance = evidence(slopes, y, np.where(np.arange(5) == 0, wide, 0.03))
    bank[0, places], bank[0, diagonal] = healthy[places] + mean, variance
    motor("t_put", bank)
    for index in range(1, 5):
        both, _, _ = evidence(slopes, y, np.where(np.isin(np.arange(5), [0, index]), wide, 0.03))
        free = np.where(np.arange(5) == 0, wide, np.where(np.arange(5) == index, 1e2, 0.03))
        motor("t_gain", 0, index, healthy, found)
        assert found[0] == pytest.approx(both - likelihood, abs=1e-6)
        assert found[1] == pytest.approx(evidence(slopes, y, free)[1][index], rel=1e-5)


def worth(motor: Core, bank: FloatArray) -> FloatArray:
    """Likelihood of each set of the reserve, costs taken off, as the best tested set with one suspect less has it."""
    best, found = best_and_worst(motor, bank)[0], np.zeros(2)
    most = np.full(len(RESERVE), -np.inf)
    for row, chosen in enumerate(RESERVE):
        for index in chosen:
            less = tuple(k for k in chosen if k != index)
            if less in BEGUN:
                lane = int(best[BEGUN.index(less)])
                motor("t_gain", lane, index, motor.lanes[0], found)
                most[row] = max(most[row], bank[lane, -1] + found[0])
    return most - motor.spec.reserve_costs


def test_the_likeliest_sets_are_chosen_and_the_true_one_wins() -> None:
    """Those that the closed form finds likeliest get lanes, but not what a person has ruled out."""
    motor = core()
    motor.begin_bank()
    bank, n = motor.renewed()[0], motor.n_planned
    expected = np.argsort(-worth(motor, bank), kind="stable")
    assert list(motor.grown()) == list(expected[:GROWN])
    assert expected[0] == PAIR
    assert bank[n : n + 3, -1].max() > bank[:n, -1].max() + 5.0
    lane = bank[n + int(np.argmax(bank[n : n + 3, -1]))]
    for index, truth in ((0, 2.0), (3, 1.5)):
        k = motor.spec.parameter_slice.start + index
        assert abs(lane[k] - truth) < 4.0 * np.sqrt(lane[covariance_place(motor.spec, k, k)])
    motor("t_reject", len(BEGUN) + N_INSTRUMENTS + PAIR)
    motor.renewed()
    assert PAIR not in motor.grown()


def test_a_set_that_extends_no_tested_one_is_not_told() -> None:
    """A set of three with two more suspects than any tested set has no likelihood, and the healthy values."""
    motor = core()
    motor.begin_bank()
    for chosen in RESERVE:
        found, first = np.zeros(4), motor.spec.parameter_slice.start
        motor("t_extended", RESERVE.index(chosen), motor.lanes[0], found)
        is_told = any(chosen[:k] + chosen[k + 1 :] in BEGUN for k in range(len(chosen)))
        assert np.isfinite(found[0]) == is_told
        values = motor.lanes[0, [first + index for index in chosen]]
        assert np.array_equal(found[1 : 1 + len(chosen)], values) == (not is_told)
    assert not is_told


@pytest.mark.parametrize("part", range(3))
def test_where_lanes_of_a_set_begin(part: int) -> None:
    """Twice at what was foretold, with what stores hold going on and not, and once at healthy values."""
    motor, spec, healthy = core(), core().spec, core().lanes[3]
    lane, first, value = np.zeros(spec.n_numbers), spec.parameter_slice.start, 1.7
    motor("t_choice", PAIR, value, part, healthy, lane)
    covariance = unpack(spec, lane[spec.covariance_slice])
    for index in RESERVE[PAIR]:
        start = value / healthy[first + index] if part < 2 else 1.0
        assert lane[first + index] == pytest.approx(start * healthy[first + index])
        sd = 0.35 * start if part < 2 else 0.6
        assert np.sqrt(covariance[first + index, first + index]) == pytest.approx(sd * healthy[first + index])
    jumped = lane[:2] / healthy[:2] != pytest.approx(1.0)
    assert jumped == (part == 1)
    if part == 1:  # the shaft keeps its momentum, and runs slower the heavier it is; the coil is no suspect
        assert lane[:2] == pytest.approx([healthy[0], healthy[1] * healthy[first + 3] / value])


@pytest.mark.parametrize("kept", [[2, 0], [3, 2], [0, 3]])
def test_sets_keep_their_lanes_where_these_are_likelier(kept: list[int]) -> None:
    """A set that is chosen again has its lanes, wherever it now stands; new sets stand where they are foretold."""
    motor, n = core(), core().n_planned
    motor.begin_bank()
    bank, _ = motor.renewed()
    first, began = motor.grown(), 20 + np.arange(3 * GROWN).reshape(GROWN, 3)
    for k, place in enumerate(began.ravel()):
        motor("t_put_onset", n + k, int(place))
    rows = bank[n:].reshape(GROWN, 3, -1)
    rows[:, :, -1] = 1e6 + np.arange(3)
    rows[kept, :, -1] += [[40.0], [20.0]]
    bank[n:] = rows.reshape(-1, bank.shape[1])
    bank[:n, -1] += 2e6  # what is foretold leads, lanes that begin are behind by far
    motor("t_put", bank)
    new = np.setdiff1d(np.arange(len(RESERVE)), first)
    for k in new[2:]:
        motor("t_reject", len(BEGUN) + N_INSTRUMENTS + int(k))
    bank, judged = motor.renewed()
    after, again = bank[n:].reshape(GROWN, 3, -1), motor.grown()
    assert set(again[:2]) == set(new[:2])
    assert list(again[2:]) == list(first[kept])
    assert np.array_equal(after[2:], rows[kept])
    assert np.array_equal(motor.onsets()[n:].reshape(GROWN, 3)[2:], began[kept])
    assert np.array_equal(judged[n:].reshape(GROWN, 3)[2:].all(axis=1), np.array(kept) != [2, 3])
    assert np.all(after[:2, :, -1] < 1e5)
