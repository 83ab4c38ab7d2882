"""The diagnosis of the core: what does not fit, and what sets that are not tested may hide, next to exact evidence."""

import numpy as np
import pytest

from diagnosed import N_P, RESERVE, SPEC, Diagnosed, raised, share_of, slot_of
from faultbond.arrays import FloatArray
from faultbond.contract.couples import plan_couples
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.spec import pack
from faultbond.runtime.monitor import Monitor
from faultbond.types import FaultKind
from made import plant, recorded, run

WIDE, STEPS, SETTINGS = SPEC.slotted, plan_lanes(SPEC), SPEC.thresholds
SHARE = share_of(400)  # of differences of likelihoods, so many samples after the alarm


@pytest.fixture
def state() -> Diagnosed:
    """A state with an alarm, at which couples are tested; else they count as untested sets."""
    found = Diagnosed()
    found["bank.coupled"] = [0, *[-1] * (len(found["bank.coupled"]) - 1)]
    return found


def test_couples_that_wait_count_as_untested(state: Diagnosed) -> None:
    """As long as none has lanes, and two parameters lead; then there is no bound either."""
    state.far_off()
    pair = next(k for k, members in enumerate(SPEC.hypotheses) if len(members) == 2)
    state.only(int(np.flatnonzero(STEPS.hypothesis == pair)[0]))
    before = state.diagnose()
    assert (before["has_untested"], before["untested_sets"]) == (1, len(RESERVE))
    state["bank.coupled"] = -1
    waiting = sum(item.slot >= len(SPEC.hypotheses) for item in plan_couples(SPEC))
    found = state.diagnose()
    assert (found["untested_sets"], found["untested_probability"]) == (len(RESERVE) + waiting, 1.0)
    state.only(int(np.flatnonzero(STEPS.hypothesis == 0)[0]))
    assert state.diagnose()["untested_sets"] == len(RESERVE)


def test_what_does_not_fit(state: Diagnosed) -> None:
    """The sums of the best lane tell where it is off."""
    lane = slot_of(output=0, kind=FaultKind.BIAS)
    state.only(state.n_steps + lane)
    place = state.n_steps + lane
    shape = (2, len(SPEC.outputs), -1)
    state["bank.since"], state["clock.time"] = 100, 77.0
    state.lane("row", 300)[-1] = 33.0
    state["bank.since"].reshape(shape)[1, 1, place] = 300
    state["bank.sums"].reshape(shape)[1, 1, place] = SETTINGS.cusum_limit
    assert not state.diagnose()["is_unexplained"]
    state["bank.sums"].reshape(shape)[1, 1, place] = 40.0
    found = state.diagnose()
    assert (found["is_unexplained"], found["signal"], found["since"], found["until"]) == (1, 1, 33.0, 77.0)
    assert found["unexplained_sd"] == pytest.approx(40.0 / 200 + SETTINGS.cusum_drift)
    state["bank.sums"] = 0.0
    assert not state.diagnose()["is_unexplained"]


def test_what_is_rejected_has_to_explain_nothing(state: Diagnosed) -> None:
    """Once the best is out, the next one explains the data; sums that began before all rows tell of the oldest row."""
    state.only(0)
    sums, since = (state[f"bank.{name}"].reshape(2, len(SPEC.outputs), -1) for name in ("sums", "since"))
    sums[0, 0, STEPS.hypothesis.tolist().index(0)] = 50.0
    state["clock.index"], since[:] = 5000, 200.0
    state.lane("row", 5000 - SETTINGS.history_samples - 1)[-1] = 12.0
    assert state.diagnose()["since"] == 12.0
    assert state.decide("reject", 0)[0] == 0
    assert not state.diagnose()["is_unexplained"]


def evidence(slopes: FloatArray, y: FloatArray, sd: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Log-likelihood of y = slopes d + noise for d of these sd, and mean and covariance of d."""
    prior, n = np.diag(sd**2), len(y)
    of_y = np.eye(n) + slopes @ prior @ slopes.T
    likelihood = -0.5 * (y @ np.linalg.solve(of_y, y) + np.linalg.slogdet(of_y)[1])
    covariance: FloatArray = np.linalg.inv(np.linalg.inv(prior) + slopes.T @ slopes).astype(np.float64)
    return float(likelihood), covariance @ slopes.T @ y, covariance


def linear(state: Diagnosed, seed: int) -> tuple[FloatArray, dict[tuple[int, ...], float]]:
    """Write what lanes know of a linear plant with two faults; what tested sets are worth, and at most each other."""
    generator = np.random.default_rng(seed)
    healthy = np.array([1.1 * item.healthy for item in SPEC.parameters])
    narrow = np.array([item.accuracy for item in SPEC.parameters])
    wide = np.array([item.change * (1.1 if item.healthy else 1.0) for item in SPEC.parameters])
    slopes = generator.normal(size=(12, N_P)) / wide * 8.0
    y = slopes @ (wide * [0.3, 0.25, 0.05, 0.09]) + generator.normal(size=12)

    def worth(chosen: tuple[int, ...]) -> tuple[float, FloatArray, FloatArray]:
        return evidence(slopes, y, np.where(np.isin(np.arange(N_P), chosen), wide, narrow))

    def written(likelihood: float, mean: FloatArray, covariance: FloatArray) -> FloatArray:
        lane, full = np.zeros(SPEC.n_numbers), np.eye(SPEC.n_joint)
        full[SPEC.parameter_slice, SPEC.parameter_slice] = covariance
        lane[SPEC.parameter_slice], lane[SPEC.covariance_slice] = mean + healthy, pack(full)
        lane[-1] = likelihood
        return lane

    state["bank.healthy"] = written(0.0, np.zeros(N_P), np.diag(narrow**2))
    state.likelihoods(np.full(state.n_steps + state.n_slots, -1e9))
    for lane, hypothesis in enumerate(STEPS.hypothesis):
        state.write("step", lane, written(*worth(SPEC.hypotheses[hypothesis])))
    most = {}
    for chosen in RESERVE:
        parts = [item for item in SPEC.hypotheses if set(item) < set(chosen)]
        inner = [worth(item)[0] for item in parts if len(item) == max(map(len, parts))]
        most[chosen] = np.exp(SHARE * max(worth(chosen)[0], *inner, -np.inf) - SETTINGS.cost_per_suspect * len(chosen))
    tested = [np.exp(SHARE * worth(item)[0] - SETTINGS.cost_per_suspect * len(item)) for item in SPEC.hypotheses]
    return np.array(tested), most


def bound(most: dict[tuple[int, ...], float], tested: FloatArray) -> float:
    """Give the part of sets that are not tested of what these and those that are tested can be worth."""
    rest = sum(most.values())
    return float(rest / (rest + raised(tested).sum()))


@pytest.mark.parametrize("seed", range(4))
def test_where_the_plant_is_linear_the_bound_is_what_untested_sets_are_worth(state: Diagnosed, seed: int) -> None:
    """Of sets with one and two more suspects than are tested it is their evidence, or that of what is tested."""
    tested, most = linear(state, seed)
    found = state.diagnose()
    assert (found["has_untested"], found["untested_sets"]) == (1, len(RESERVE))
    assert found["untested_probability"] == pytest.approx(bound(most, tested), rel=1e-6)
    assert state.decide("reject", len(SPEC.hypotheses) + 1)[0] == 0
    assert state.diagnose()["untested_probability"] == found["untested_probability"]
    assert state.decide("reject", 3)[0] == 0
    left = [chosen for chosen in RESERVE if 3 not in chosen]
    assert state.diagnose()["untested_sets"] == len(left)
    state["bank.grown"] = np.arange(len(RESERVE))
    found = state.diagnose()
    assert (found["untested_sets"], found["untested_probability"]) == (0, 0.0)


def test_what_sums_leave_to_explain_counts_for_each_sensor(state: Diagnosed) -> None:
    """Of a shift of s/n more than the drift, n samples are worth n (k + s/n)^2 / 2; of both sides the larger one is."""
    tested, most = linear(state, 1)
    state["bank.grown"][0] = RESERVE.index((0, 1, 3))
    del most[0, 1, 3]
    sums, since = (state[f"bank.{name}"].reshape(2, len(SPEC.outputs), -1) for name in ("sums", "since"))
    since[:], lanes = 488.0, np.flatnonzero(STEPS.hypothesis == SPEC.hypotheses.index((0, 1)))
    before = state.diagnose()["untested_probability"]
    sums[:, :, : len(STEPS.hypothesis)] = 3.0  # as chance has it
    assert state.diagnose()["untested_probability"] == before
    sums[:, :, lanes] = np.array([[3.6, 0.0], [3.55, 3.5]])[:, :, None]
    nats = sum(12.0 / 2.0 * (SETTINGS.cusum_drift + s / 12.0) ** 2 for s in (3.6, 3.5))
    inner = state.lane("step", int(lanes[0]))[SPEC.n_numbers - 1]
    for chosen in most:
        if {0, 1} < set(chosen):
            most[chosen] = max(most[chosen], np.exp(SHARE * (inner + nats) - SETTINGS.cost_per_suspect * len(chosen)))
    found = state.diagnose()["untested_probability"]
    assert before < found < 0.5
    assert found == pytest.approx(bound(most, tested), rel=1e-6)


def test_when_there_is_no_bound(state: Diagnosed) -> None:
    """Soon after the bank was renewed, where a fault of an instrument is the best, where nothing fits, or is known."""
    linear(state, 1)
    assert state.diagnose()["untested_probability"] < 0.5
    numbers = state.state.copy()
    slot = state.lane("slot", slot_of(output=0, kind=FaultKind.BIAS))

    def lost() -> None:
        for lane in np.flatnonzero(np.isin(STEPS.hypothesis, (0, 3))):
            state.lane("step", int(lane))[SPEC.n_numbers - 1] = np.nan

    def disguised() -> None:
        slot[WIDE.n_numbers - 1] = 1000.0

    for change in (
        lambda: state["job.settled"].fill(475),
        disguised,
        lost,
    ):
        change()
        assert state.diagnose()["untested_probability"] == 1.0
        state.state[:] = numbers
    state["bank.grown"][0], lane = len(RESERVE) - 1, len(STEPS.hypothesis)  # no other set follows from one of these
    state.lane("step", lane)[SPEC.n_numbers - 1] = 1000.0
    assert state.diagnose()["untested_probability"] < 0.5
    state["bank.sums"].reshape(2, len(SPEC.outputs), -1)[:, :, lane] = 30.0
    assert state.diagnose()["untested_probability"] == 1.0


def test_a_tested_set_that_is_no_number_bounds_nothing(state: Diagnosed) -> None:
    """It is passed over where another one tells what a set of the reserve can be worth."""
    tested, most = linear(state, 1)
    state["bank.grown"][0] = RESERVE.index((0, 2, 3))  # which follows from this one alone
    del most[0, 2, 3]
    gone = SPEC.hypotheses.index((0, 2))
    for lane in np.flatnonzero(STEPS.hypothesis == gone):
        state.write("step", int(lane), np.full(SPEC.n_numbers, np.nan))
    tested[gone] = 0.0
    assert state.diagnose()["untested_probability"] == pytest.approx(bound(most, tested), rel=1e-6)


def test_without_an_alarm_there_are_no_candidates() -> None:
    """Before the first sample, and while all is as expected, the diagnosis of now is empty."""
    monitor = Monitor(plant("rc")[2])
    assert monitor.conclude().candidates == ()
    watched = run(plant("rc")[2], recorded("rc", 100))[0]
    assert watched.conclude().candidates == ()
