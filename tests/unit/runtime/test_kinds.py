"""One recording of each kind of fault: the right part and kind are first, with their value, and a run can be saved."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.findings import Candidate
from faultbond.contract.samples import Sample
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.types import FaultKind
from made import differing, graph_of, plant_in_full, run, samples_of

NAME = "dc_motor_current"
DT, ROWS, ONSET = 0.02, 640, 150  # s; samples; the sample from which the fault is there
START = ONSET * DT
NOISE = {"omega": 0.06, "i": 0.02}  # rad/s, A
RAMP, SHORT, PERIOD, ON = 20.0, 2.0, 2.5, 0.8  # s


@dataclass(frozen=True, kw_only=True)
class Case:
    """A fault, and what should be said of it at the end.

    changed: gives readings and inputs as recorded, from those of the plant; of rows from the onset on
    """

    kind: FaultKind
    component: str
    value: float
    rate: float | None = None
    present: bool = True
    faults: tuple[Fault, ...] = ()
    changed: Callable[[FloatArray, FloatArray, FloatArray], None] | None = None


def _biased(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    y[:, 0] += 8.0 * NOISE["omega"]


def _drifting(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    y[:, 1] += 0.05 * since


def _drifted(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    y[:, 1] += 15.0 * NOISE["i"] * np.minimum(since / SHORT, 1.0)


def _less_and_less_told(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    u[:, 0] -= 0.3 * since


def _amplified(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    y[:, 0] *= 1.2


def _amplified_in_time(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    y[:, 0] *= 1.0 + 0.2 * np.minimum(since / SHORT, 1.0)


def _damped_in_time(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    u[:, 0] /= 1.0 + 0.25 * np.minimum(since / SHORT, 1.0)


def _damped_more_and_more(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    u[:, 0] /= 1.0 + 0.05 * since


def _stuck(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    y[:, 1] = 2.5


def _noisy(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    y[:, 0] += np.random.default_rng(3).normal(0.0, np.sqrt(24.0) * NOISE["omega"], len(y))


def _less_told(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    u[:, 0] -= 1.5


def _at_times(since: FloatArray, off: float = 1.2) -> BoolArray:
    """Where a fault is there: for as long as `on`, then gone for `off` seconds, again and again."""
    return np.asarray(since % (ON + off) < ON)


def _biased_at_times(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    y[_at_times(since), 0] += 15.0 * NOISE["omega"]


def _biased_now(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    y[_at_times(since[-1] - since), 0] += 15.0 * NOISE["omega"]


def _biased_once(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    y[since < ON, 1] -= 15.0 * NOISE["i"]


def _loose(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    y[_at_times(since), 1] = 0.0


def _less_told_at_times(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    u[_at_times(since), 0] -= 1.5


def _less_told_now(y: FloatArray, u: FloatArray, since: FloatArray) -> None:
    u[_at_times(since[-1] - since), 0] -= 1.5


def _switches(last: float) -> tuple[Fault, ...]:
    """R is doubled every other two and a half seconds."""
    moments = np.arange(START, last, PERIOD)
    return tuple(
        Fault(parameter="R", factor=2.0 if k % 2 == 0 else 1.0, start=float(moment)) for k, moment in enumerate(moments)
    )


END = (ROWS - 1) * DT
CASES = {
    "step": Case(
        kind=FaultKind.STEP, component="J", value=0.9, faults=(Fault(parameter="J", factor=0.6, start=START),)
    ),
    "drift": Case(
        kind=FaultKind.DRIFT,
        component="R",
        value=3.0 + 0.3 * (END - START),
        rate=0.3,
        faults=(Fault(parameter="R", factor=3.0, start=START, end=START + RAMP),),
    ),
    "gone": Case(
        kind=FaultKind.INTERMITTENT, component="R", value=6.0, present=False, faults=_switches(START + 3.5 * PERIOD)
    ),
    "there": Case(kind=FaultKind.INTERMITTENT, component="R", value=6.0, faults=_switches(START + 2.5 * PERIOD)),
    "bias": Case(kind=FaultKind.BIAS, component="omega", value=8.0 * NOISE["omega"], changed=_biased),
    "sensor drift": Case(kind=FaultKind.DRIFT, component="i", value=0.05 * (END - START), rate=0.05, changed=_drifting),
    "gain": Case(kind=FaultKind.GAIN, component="omega", value=1.2, changed=_amplified),
    "stuck": Case(kind=FaultKind.STUCK, component="i", value=2.5, changed=_stuck),
    "noise": Case(kind=FaultKind.NOISE, component="omega", value=5.0 * NOISE["omega"], changed=_noisy),
    "bias at times": Case(
        kind=FaultKind.INTERMITTENT,
        component="omega",
        value=15.0 * NOISE["omega"],
        present=False,
        changed=_biased_at_times,
    ),
    "bias now": Case(kind=FaultKind.INTERMITTENT, component="omega", value=15.0 * NOISE["omega"], changed=_biased_now),
    "bias once": Case(
        kind=FaultKind.INTERMITTENT, component="i", value=-15.0 * NOISE["i"], present=False, changed=_biased_once
    ),
    "loose": Case(kind=FaultKind.INTERMITTENT, component="i", value=0.0, present=False, changed=_loose),
    "input at times": Case(
        kind=FaultKind.INTERMITTENT, component="V", value=1.5, present=False, changed=_less_told_at_times
    ),
    "input now": Case(kind=FaultKind.INTERMITTENT, component="V", value=1.5, changed=_less_told_now),
    "ramp": Case(
        kind=FaultKind.RAMP,
        component="R",
        value=6.0,
        faults=(Fault(parameter="R", factor=2.0, start=START, end=START + SHORT),),
    ),
    "sensor ramp": Case(kind=FaultKind.RAMP, component="i", value=15.0 * NOISE["i"], changed=_drifted),
    "gain ramp": Case(kind=FaultKind.RAMP, component="omega", value=1.2, changed=_amplified_in_time),
    "input gain ramp": Case(kind=FaultKind.RAMP, component="V", value=1.25, changed=_damped_in_time),
    "input gain drift": Case(
        kind=FaultKind.DRIFT, component="V", value=1.0 + 0.05 * (END - START), rate=0.05, changed=_damped_more_and_more
    ),
    "input drift": Case(
        kind=FaultKind.DRIFT, component="V", value=0.3 * (END - START), rate=0.3, changed=_less_and_less_told
    ),
    "input stuck": Case(
        kind=FaultKind.STUCK, component="V", value=7.0, faults=(Fault(parameter="V.stuck", value=7.0, start=START),)
    ),
    "input bias": Case(kind=FaultKind.BIAS, component="V", value=1.5, changed=_less_told),
}


@cache
def recording(name: str) -> tuple[Sample, ...]:
    """Samples of the motor with that fault."""
    case, graph = CASES[name], graph_of(NAME)
    time = np.asarray(np.arange(ROWS) * DT, dtype=np.float64)
    voltage = random_steps(time, np.random.default_rng(6), low=2, high=12, shortest=0.5, longest=2.0)
    made = simulate(graph, Inputs(time=time, values=voltage[:, None]), case.faults, seed=12)
    u, y = made.inputs.copy(), made.outputs.copy()
    if case.changed is not None:
        case.changed(y[ONSET:], u[ONSET:], time[ONSET:] - START)
    return samples_of(time, u, y)


@cache
def ended(name: str) -> tuple[Monitor, Monitor]:
    """The monitor in the middle of a diagnosis, before the bank is renewed, and after the recording."""
    monitor = Monitor(plant_in_full(NAME)[2])
    middle = monitor
    for sample in recording(name):
        monitor.step(sample)
        if monitor.number("clock.index") == monitor.number("clock.alarm") + 25:
            middle = monitor.copy()
    assert ONSET <= monitor.number("clock.alarm") == middle.number("clock.alarm") < ROWS - 60
    assert middle is not monitor
    return middle, monitor


def best(name: str) -> Candidate:
    """The best candidate at the end."""
    return ended(name)[1].conclude().candidates[0]


@pytest.mark.parametrize("name", CASES)
def test_the_kind_and_its_value_are_found(name: str) -> None:
    """The part at fault is first, by far, with the kind of its fault and its value within three standard deviations."""
    case, found = CASES[name], best(name)
    assert (found.components, found.kind) == ((case.component,), case.kind)
    assert found.probability > 0.99
    assert dict(found.kinds)[case.kind] > 0.6
    assert found.present == case.present
    suspect = found.suspects[0]
    assert suspect.estimate == pytest.approx(case.value, abs=3.0 * suspect.sd)
    assert suspect.sd < (0.1 * abs(case.value) or NOISE["i"])
    if case.rate is None:
        assert suspect.rate is None
    else:
        assert suspect.rate is not None
        assert suspect.rate_sd is not None
        assert suspect.rate == pytest.approx(case.rate, abs=3.0 * suspect.rate_sd)
        assert suspect.rate_sd < 0.2 * case.rate


@pytest.mark.parametrize("name", ["ramp", "sensor ramp", "gain ramp", "input gain ramp"])
def test_a_ramp_is_told_with_its_times(name: str) -> None:
    """It is said when it began and when it ended, to a quarter of what it took; of other kinds there is nothing."""
    suspect = best(name).suspects[0]
    assert suspect.began == pytest.approx(START, abs=0.25 * SHORT)
    assert suspect.ended == pytest.approx(START + SHORT, abs=0.25 * SHORT)
    assert (best("step").suspects[0].began, best("drift").suspects[0].ended) == (None, None)


@pytest.mark.parametrize("name", CASES)
def test_what_explains_the_data_leaves_nothing(name: str) -> None:
    """Where the kind of fault is right, nothing is unexplained."""
    assert ended(name)[1].conclude().unexplained is None


@pytest.mark.parametrize("name", CASES)
def test_a_run_saved_with_any_kind_of_alarm_goes_on(name: str) -> None:
    """Saved and restored in the middle of a diagnosis, a run ends in the same numbers, to the last bit."""
    middle, whole = ended(name)
    restored = Monitor(middle.core, middle.save())
    assert not differing(middle, restored)
    again, _ = run(middle.core, recording(name)[int(middle.number("clock.index")) :], restored)
    assert not differing(again, whole)


def accepted(name: str) -> Monitor:
    """The monitor after the best candidate was accepted."""
    monitor = ended(name)[1].copy()
    monitor.accept(best(name).hypothesis)
    assert monitor.number("clock.alarm") < 0
    return monitor


@pytest.mark.parametrize("name", ["bias at times", "loose", "input at times"])
def test_what_erred_at_times_and_is_right_now_is_used_on(name: str) -> None:
    """Accepted while its fault is gone, a sensor is read and an input is believed as before."""
    after = accepted(name)
    assert after.numbers("normal.noise").tolist() == [1.0, 1.0]
    assert after.numbers("normal.input_offset").tolist() == [0.0]
    assert np.all(np.isfinite(after.numbers("healthy.lane")))


def test_what_errs_at_times_and_does_so_now() -> None:
    """Accepted while its fault is there, a sensor is not used any more; an input acts as it does now."""
    assert accepted("bias now").numbers("normal.noise").tolist() == [np.inf, 1.0]
    offset = accepted("input now").numbers("normal.input_offset")
    assert offset == pytest.approx(best("input now").suspects[0].estimate)


def test_a_gain_that_has_come_to_stay_is_accepted_as_a_gain() -> None:
    """Readings are divided by it, and what acts is the record times it; nothing is added to either."""
    sensor, commanded = accepted("gain ramp"), accepted("input gain ramp")
    assert sensor.numbers("normal.gain")[0] == pytest.approx(best("gain ramp").suspects[0].estimate)
    assert sensor.numbers("normal.offset").tolist() == [0.0, 0.0]
    assert sensor.numbers("normal.noise").tolist() == [1.0, 1.0]
    assert commanded.numbers("normal.input_gain") == pytest.approx(best("input gain ramp").suspects[0].estimate)
    assert commanded.numbers("normal.input_offset").tolist() == [0.0]


def test_noise_is_accepted_as_it_was_told() -> None:
    """Not as the noise of the lane, which is one of a few that are tried."""
    noise, told = accepted("noise").numbers("normal.noise"), best("noise").suspects[0].estimate
    assert noise[0] == pytest.approx((told / NOISE["omega"]) ** 2, rel=1e-12)
    assert noise[1] == 1.0
