"""The smallest fault that the detector finds: against the monitor in simulation, and its limits."""

from dataclasses import replace
from math import inf, sqrt
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from diagnosed import SPEC
from faultbond.analysis.faulty import fault_targets
from faultbond.analysis.smallest import SmallestFault, smallest_faults
from faultbond.app.realisations import compiled_detector
from faultbond.contract.claims import claimed_parameter
from faultbond.contract.samples import Sample
from faultbond.contract.spec import EngineSpec
from faultbond.equations.step import StepModel
from faultbond.errors import ModelError, RecordingError
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Effects, Fault, Inputs, Simulation, simulate
from faultbond.simulate.truth import healthy_parameters
from faultbond.synthesis.engine import build_engine
from faultbond.synthesis.specify import build_spec
from plants import circuit, example, stated

Built = tuple[StepModel, EngineSpec, Core]


def built(model: StepModel) -> Built:
    """Give a model with its specification and its core."""
    spec = build_spec(model)
    return model, spec, build_engine(model.plant.graph)[1]


def found(plant: Built, **options: object) -> dict[str, SmallestFault]:
    """Give the smallest faults by parameter."""
    return {item.parameter: item for item in smallest_faults(*plant, compiled_detector(plant[1].thresholds), **options)}  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def motor() -> Built:
    """Give the motor."""
    return built(example("dc_motor"))


def square(count: int, dt: float) -> Inputs:
    """Give a voltage that steps between 4 V and 10 V every second."""
    time = dt * np.arange(count, dtype=np.float64)
    return Inputs(time=time, values=np.where(time % 2.0 < 1.0, 4.0, 10.0)[:, None])


def watched(monitor: Monitor, made: Simulation, rows: range) -> bool:
    """Pass rows of a recording through a quiet monitor; say whether its CUSUM crosses the limit."""
    crossed = False
    for k in rows:
        dt = float(made.time[k] - made.time[k - 1]) if k else 0.0
        report = monitor.step(Sample(time=float(made.time[k]), dt=dt, u=made.inputs[k], y=made.outputs[k]))
        crossed |= bool(np.any(report.cusum > monitor.spec.thresholds.cusum_limit))
    return crossed


def test_the_predicted_size_is_what_the_monitor_finds(motor: Built) -> None:
    """A fault 1.5 times as large as predicted is found in time in every plant; of a 1.5th of it some are missed."""
    model, core, dt, onset, window, spread = motor[0], motor[2], 0.02, 150, 60, 0.03 * sqrt(3.0)
    graph, inputs = model.plant.graph, square(onset + window + 1, dt)
    run = simulate(graph, inputs, seed=None)
    samples = [Sample(time=t, dt=dt * (k > 0), u=run.inputs[k], y=run.outputs[k]) for k, t in enumerate(run.time)]
    smallest = found(motor, samples=samples, parameters=["K"], within=window * dt, onsets=[onset * dt])["K"]
    size = smallest.up
    assert size is not None
    assert smallest.onsets == pytest.approx([onset * dt])
    index = [item.name for item in motor[1].parameters].index("K")
    assert smallest.claimed == claimed_parameter(motor[1], index) > 0.0
    assert found(motor, parameters=["K"], within=window * dt)["K"].onsets == ()
    counts = {1.5: 0, 1 / 1.5: 0}
    for seed in range(40, 49):
        true = healthy_parameters(graph, spread, np.random.default_rng(seed))[2]
        begun = Monitor(core, quiet=True)
        for part in counts:
            fault = Fault(parameter="K", value=true + part * size, start=onset * dt)
            made = simulate(graph, inputs, [fault], seed=seed, effects=Effects(spread=spread))
            if not begun.number("clock.index"):
                watched(begun, made, range(onset))
            counts[part] += watched(begun.copy(), made, range(onset, onset + window + 1))
    assert counts[1.5] == 9
    assert counts[1 / 1.5] <= 5


def test_noise_makes_the_smallest_fault_larger(motor: Built) -> None:
    """Ten times the noise of the sensor: every fault must be larger to be found, or is not found."""
    noisy = built(example("dc_motor", ("noise: 0.06 rad/s", "noise: 0.6 rad/s")))
    quiet_sizes, noisy_sizes = (found(plant, within=2.0) for plant in (motor, noisy))
    assert set(quiet_sizes) == {"R", "L", "K", "J", "C", "omega.bias", "V.bias", "V.gain"}
    for name, item in quiet_sizes.items():
        assert item.value is not None
        assert item.value == max(item.up or 0.0, item.down or 0.0)
        assert item.direction in ("up", "down")
        assert item.up is not None
        other = noisy_sizes[name].up  # downwards the speed has a maximum at K^2 = R C, which is in the way
        assert other is None or other > 1.5 * item.up
        (effect,) = item.effects
        assert effect.output == "omega"
        assert effect.in_noise == pytest.approx(effect.size / 0.06)


def test_what_no_sensor_sees_is_never_found() -> None:
    """Of two branches at one source only the measured one has a smallest fault."""
    plant = built(
        circuit(
            "  A: {type: R, parameters: {RA: 3 ohm}}\n  B: {type: R, parameters: {RB: 3 ohm}}",
            "node: 0",
            "source -> node -> A, node -> B",
            "i: {reads: A.f, unit: A, noise: 0.01 A}",
        )
    )
    sizes = found(plant, within=10.0)
    assert sizes["RA"].value is not None
    assert sizes["RA"].value < 1.5
    unseen = sizes["RB"]
    assert (unseen.value, unseen.up, unseen.down, unseen.direction, unseen.effects) == (None, None, None, None, ())
    assert unseen.reason == "no sensor shows it"


def test_a_fault_stays_in_its_range() -> None:
    """A parameter that can hardly move has no smallest fault, though outputs show it."""
    change = "{K: {nominal: 2 V*s/rad, range: [1.99 V*s/rad, 2.01 V*s/rad], accuracy: 0.1 %}}"
    plant = built(example("dc_motor", ("{K: 2 V*s/rad}", change)))
    item = found(plant, parameters=["K"], within=2.0)["K"]
    assert item.value is None
    assert item.reason == "not found however large, within its range"


def test_a_range_ends_where_the_plant_has_no_solution() -> None:
    """A voltage of log(1.25 - A) ends at A = 1.25: a weak one is not found before, and the reason is said."""
    text = (
        "name: source\nsample_time: 0.1 s\ninputs: {V: {unit: V}}\ncomponents:\n"
        "  source: {type: Se, law: e = V + WEIGHT*log(1.25 - A), parameters: {A: {nominal: 1, range: [0.1, 9]}}}\n"
        "  R: {type: R, parameters: {R: {nominal: 3 ohm, range: [2.999999 ohm, 3.000001 ohm], accuracy: 1e-6}}}\n"
        "  L: {type: I, parameters: {L: 1 H}}\njunctions: {loop: 1}\nbonds: [source -> loop -> R, loop -> L]\n"
        "constants: {WEIGHT: SIZE V}\nsensors: {i: {reads: R.f, unit: A, noise: 0.01 A}}\n"
    )
    strong, weak = (built(stated(text.replace("SIZE", size))) for size in ("1", "1e-9"))
    item = found(strong, parameters=["A"], within=10.0)["A"]
    assert item.value is not None
    assert item.up is None or item.up < 0.25
    item = found(weak, parameters=["A"], within=10.0)["A"]
    assert item.value is None
    assert item.reason == "not found before the plant has no finite solution any more"


def test_a_plant_that_rounding_takes_elsewhere_has_no_sizes() -> None:
    """A current that is thrown off a pole ever anew multiplies the least change: no size is given, and why."""
    text = (
        "name: pole\nsample_time: 0.1 s\ninputs: {V: {unit: V}}\ncomponents:\n  source: {type: Se, law: e = V}\n"
        "  R: {type: R, parameters: {R: 3 ohm}}\n  L: {type: I, parameters: {L: 2 H}}\n"
        "  X: {type: R, law: e = P/(f - 0.2), parameters: {P: 0.1}}\njunctions: {loop: 1}\n"
        "bonds: [source -> loop -> R, loop -> L, loop -> X]\nsensors: {i: {reads: loop.f, noise: 0.01}}\n"
    )
    sizes = found(built(stated(text)))
    assert {name for name, item in sizes.items() if item.value is not None} == {"i.bias"}  # passes through no plant
    assert "the least change already takes the plant elsewhere" in {item.reason for item in sizes.values()}


def test_a_plant_with_no_solution_but_the_healthy_one() -> None:
    """Where no size of any fault that is asked leaves the plant a solution the reason is said."""
    text = (
        "name: source\nsample_time: 0.1 s\ninputs: {V: {unit: V}}\ncomponents:\n"
        "  source: {type: Se, law: e = V + WEIGHT*(A + TINY*log(SMALL - (A - 1)**2)), parameters: {A: 1}}\n"
        "  R: {type: R, parameters: {R: 3 ohm}}\n  L: {type: I, parameters: {L: 1 H}}\njunctions: {loop: 1}\n"
        "bonds: [source -> loop -> R, loop -> L]\nconstants: {WEIGHT: 1 V, SMALL: 1e-20, TINY: 1e-9}\n"
        "sensors: {i: {reads: R.f, unit: A, noise: 0.01 A}}\n"
    )
    item = found(built(stated(text)), parameters=["A"], within=10.0)["A"]
    assert (item.value, item.reason) == (None, "the least change already takes the plant elsewhere")


def test_what_there_is_no_time_for_is_said(motor: Built) -> None:
    """Without time every parameter is given, none with a size, each with the reason."""
    sizes = found(motor, within=2.0, seconds=0.0)
    assert set(sizes) == {"R", "L", "K", "J", "C", "omega.bias", "V.bias", "V.gain"}
    assert {(item.value, item.reason) for item in sizes.values()} == {(None, "no time left; raise --budget")}


def test_instruments_have_sizes_too(motor: Built) -> None:
    """A bias shows in its sensor as large as it is, in both directions alike; one of the input acts by the plant."""
    sizes = found(motor, parameters=["omega.bias", "V.bias"], within=2.0)
    (shown,) = sizes["omega.bias"].effects
    assert shown.size == pytest.approx(sizes["omega.bias"].value)
    assert sizes["omega.bias"].up == pytest.approx(sizes["omega.bias"].down, rel=0.2)
    up, down = sizes["V.bias"].up, sizes["V.bias"].down
    assert up is not None
    assert up == pytest.approx(down, rel=0.2)
    assert sizes["V.bias"].effects[0].in_noise < up / motor[1].outputs[0].noise


def test_the_gain_of_an_input_that_stands_still_is_its_bias(motor: Built) -> None:
    """Of 6 V all the time, so many volts less are so many sixths less; a gain acts less where it is below 1."""
    dt, held = 0.02, np.full((211, 1), 6.0)
    run = simulate(motor[0].plant.graph, Inputs(time=dt * np.arange(211.0), values=held), seed=None)
    samples = [Sample(time=t, dt=dt * (k > 0), u=run.inputs[k], y=run.outputs[k]) for k, t in enumerate(run.time)]
    sizes = found(motor, samples=samples, parameters=["V.bias", "V.gain"], within=1.2, onsets=[3.0])
    bias, gain = sizes["V.bias"], sizes["V.gain"]
    assert gain.up is not None
    assert gain.down is not None
    assert (6.0 * gain.up, 6.0 * gain.down) == pytest.approx((bias.down, bias.up), rel=0.1)
    assert (bias.alike, gain.alike) == (("V.gain",), ("V.bias",))


def test_what_is_alike_at_the_smallest_size_is_named() -> None:
    """So small a change of the tank is a bias of the pressure sensor too, and the other way round; the pipe is none."""
    sizes = found(built(example("tank")), parameters=["K1", "K3", "pressure.bias"])
    assert sizes["K3"].alike == ("pressure.bias",)
    assert sizes["pressure.bias"].alike == ("K3",)
    assert sizes["K1"].alike == ()


def test_a_slow_error_alarms_too() -> None:
    """With the CUSUM off the tank's leak is found by the slow error of the flow out, watched as long as its memory."""
    warm = ("accuracy: 3 %", "accuracy: 3 %\nwarm_up: 20 s")
    model, spec, core = built(example("tank", warm, ("outlet.f: 2 % over 600 s", "outlet.f: 2 % over 100 s")))
    _, young, _ = built(example("tank", warm))
    young = replace(young, thresholds=replace(young.thresholds, cusum_limit=inf, fast_limit=inf))
    deaf = replace(spec, thresholds=replace(spec.thresholds, cusum_limit=inf, fast_limit=inf))
    deafer = replace(deaf, slow_errors=tuple(replace(item, limit=inf) for item in spec.slow_errors))
    assert found((model, deaf, core), parameters=["K6"], within=150.0)["K6"].up is not None
    assert found((model, deafer, core), parameters=["K6"], within=150.0)["K6"].value is None
    assert found((model, young, core), parameters=["K6"], within=150.0)["K6"].value is None


def test_bad_requests_are_refused(motor: Built) -> None:
    """An unknown parameter, a run too short for the time asked for, and an onset outside the run each get one line."""
    model = motor[0]
    with pytest.raises(ModelError, match="no parameter Q; there are R, L, K, J, C"):
        found(motor, parameters=["Q"])
    run = simulate(model.plant.graph, square(60, 0.02), seed=None)
    samples = [Sample(time=t, dt=0.02, u=run.inputs[k], y=run.outputs[k]) for k, t in enumerate(run.time)]
    with pytest.raises(RecordingError, match="give a longer recording or less time"):
        found(motor, samples=samples)
    with pytest.raises(RecordingError, match="choose onsets between them"):
        found(motor, samples=samples, within=0.2, onsets=[100.0])


@pytest.mark.parametrize(("reached", "gains"), [((303.15, 263.15), 1), ((273.15,), 0)])
def test_a_gain_is_of_what_its_unit_counts(reached: tuple[float, ...], gains: int) -> None:
    """Of 30 degC it is 30 K, of 0 degC nothing; a bias is a part of all of the 303 K: the core takes both so."""
    spec = replace(SPEC, inputs=(replace(SPEC.inputs[0], unit_offset=273.15),))
    u = np.array([[273.15], *([level] for level in reached)])
    targets = {item.name: item for item in fault_targets(spec, cast("Any", SimpleNamespace(u=u)))}
    assert targets["V.bias"].largest == targets["V.bias"].scale == pytest.approx(max(reached))
    assert [item.largest for item in targets.values() if item.is_gain] == pytest.approx([30.0] * gains)
