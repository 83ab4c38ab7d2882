"""Noise gain: what linear propagation says is what simulated noise does."""

from collections.abc import Mapping
from dataclasses import replace
from math import inf

import numpy as np
import pytest
from solved import example, route_to

from faultbond.algebra.route import Question, Route
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.solving.backward_euler import FrameRecord, NumericPlant
from faultbond.algebra.solving.noise import noise_gain, nominal_record
from faultbond.algebra.solving.problem import prepare
from faultbond.algebra.solving.solution import Solution, solve_samples
from faultbond.algebra.solving.solve import solve
from faultbond.arrays import FloatArray
from faultbond.equations.component_network import ComponentNetwork
from faultbond.errors import StructureError


def quiet(plant: NumericPlant, factor: float) -> NumericPlant:
    """The same plant with less noise everywhere."""
    return replace(plant, sds={name: factor * sd for name, sd in plant.sds.items()})


def simulated_spread(
    network: ComponentNetwork,
    route: Route,
    plant: NumericPlant,
    record: FrameRecord,
    solution: Solution,
    draws: int = 400,
) -> FloatArray:
    """The spread of the first target at the newest instant of a record under random noise."""
    problem = prepare(network, route, plant)
    rng = np.random.default_rng(3)
    end = len(next(iter(record.values()))) - 1
    found = []
    for _ in range(draws):
        values: dict[str, float] = {name: float(value) for name, value in plant.values.items()}
        values["dt"] = float(plant.sample_time)
        for name in problem.samples:
            signal, frame = problem.signals[name]
            values[name] = float(record[signal][end - frame]) + plant.sds[signal] * rng.standard_normal()
        (root,) = solve_samples(solution, {**values})
        found.append(float(root[problem.targets[0]]))
    return np.array(found)


@pytest.mark.parametrize(("folder", "target"), [("dc_motor_current", "L"), ("rlc", "R"), ("tank", "K1")])
def test_gain_is_what_noise_does(folder: str, target: str) -> None:
    """The standard deviation at one instant agrees with that of results from noisy samples."""
    network, plant = example(folder)
    plant = quiet(plant, 1e-4)
    route = route_to(network, target)
    record = nominal_record(network, plant, 3, instants=1)
    gain = noise_gain(network, route, plant, record, instants=1)
    spread = simulated_spread(network, route, plant, record, solve(network, route, plant))
    relative = spread.std() / float(plant.values[target])
    assert gain.deviations[target] == pytest.approx(relative, rel=0.12)


def test_gain_grows_with_the_noise() -> None:
    """Twice the noise, twice the deviation; no noise, none, and no sample to blame."""
    network, plant = example("dc_motor")
    route = route_to(network, "R")
    once, twice = noise_gain(network, route, plant), noise_gain(network, route, quiet(plant, 2.0))
    assert twice.worst == pytest.approx(2.0 * once.worst)
    assert once.main["R"].startswith("omega_")
    silent = noise_gain(network, route, quiet(plant, 0.0))
    assert (silent.worst, silent.main) == (0.0, {"R": ""})


def test_signals_in_their_own_unit() -> None:
    """A measured signal has the deviation of its sensor, in SI."""
    network, plant = example("dc_motor_current")
    question = Question(targets=(("K.e1", 0),), observed=network.observed)
    gain = noise_gain(network, find_route(network, question), plant)
    assert gain.deviations["K.e1_0"] == pytest.approx(2.0 * plant.sds["omega"])


def test_deeper_routes_amplify_more() -> None:
    """Two parameters need a deeper route than one, and are noisier (each frame differentiates once more)."""
    network, plant = example("dc_motor")
    one, both = (
        noise_gain(network, route_to(network, "R"), plant),
        noise_gain(network, route_to(network, "R", "L"), plant),
    )
    assert both.deviations["R"] > one.deviations["R"]


def test_route_that_fixes_nothing() -> None:
    """Where only a combination of the parameters acts, the deviation is infinite."""
    network, plant = example("rc")
    gain = noise_gain(network, route_to(network, "R", "C"), plant)
    assert gain.deviations == {"R": inf, "C": inf}


def test_no_closed_form_is_needed() -> None:
    """The gain does not depend on the closed form: a parameter inside an exponential has one."""
    network, plant = example("emps")
    gains: Mapping[str, float] = noise_gain(network, route_to(network, "Fc"), plant).deviations
    assert 0.0 < gains["Fc"] < inf


def test_record_too_short() -> None:
    """A record with fewer samples than frames is refused."""
    network, plant = example("rc")
    record = {name: series[:1] for name, series in nominal_record(network, plant, 1).items()}
    with pytest.raises(StructureError, match="record of 1 samples is too short for 2 frames"):
        noise_gain(network, route_to(network, "R"), plant, record)
