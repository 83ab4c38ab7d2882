"""Trajectories of plants side by side: the same as those found sample by sample."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.analysis.experiment import random_experiments
from faultbond.analysis.sensitivity import build_recursion, sensitivities
from faultbond.analysis.trajectories import Trajectory, lanes_of
from faultbond.equations.step import StepModel
from plants import circuit, example

DIODES = circuit(
    "  R: {type: R, parameters: {R: 100 ohm}}\n"
    "  D1: {type: R, law: f = I1*(exp(e/VT) - 1), parameters: {I1: 1e-6 A, VT: 0.1 V}}\n"
    "  D2: {type: R, law: e = V2*sign(f)*sqrt(abs(f)), parameters: {V2: 1 V/A^0.5}}\n"
    "  C: {type: C, parameters: {C: 10 mF}}",
    "loop: 1, node: 0, branch: 1",
    "source -> loop -> R, loop -> node -> D1, node -> branch -> D2, branch -> C",
    "V_R: {reads: R.e, unit: V, noise: 1 mV}",
)


@pytest.mark.parametrize("model", [example("tank"), example("dc_motor"), example("emps"), DIODES])
def test_outputs_and_slopes_are_those_of_the_sensitivities(model: StepModel) -> None:
    """Plants with parameters and starts of their own do what `sensitivity` says they do, with its derivatives."""
    recursion, rng = build_recursion(model.plant), np.random.default_rng(1)
    run = random_experiments(model, recursion)[0]
    count = len(model.plant.graph.parameters)
    thetas = [run.theta * np.exp(rng.uniform(-0.7, 0.7, count)) for _ in range(5)]
    places = [(k % count, (k + 1) % count)[: 1 + k % 2] for k in range(5)]
    lanes = lanes_of(thetas, run.start, places)
    lanes.start[1] *= 1.1
    course = Trajectory(recursion, run)
    nominal = course.alone(run.theta)
    assert nominal is not None
    found = course.follow(lanes, np.tile(nominal, (5, 1, 1)))
    expected = sensitivities(
        recursion, [replace(run, theta=t, start=s) for t, s in zip(lanes.theta, lanes.start, strict=True)]
    )
    assert found.good.tolist() == [item is not None for item in expected]
    assert found.good.sum() >= 4
    for lane, item in enumerate(expected):
        if item is None:
            continue
        assert found.y[lane] == pytest.approx(item.y, rel=1e-7, abs=1e-8 * np.abs(item.y).max())
        by = np.concatenate([item.by_theta[:, :, list(places[lane])], item.by_start], axis=2)
        width = len(places[lane])
        mine = np.concatenate([found.y_by[lane][..., :width], found.y_by[lane][..., lanes.places.shape[1] :]], axis=2)
        assert mine == pytest.approx(by, rel=1e-3, abs=1e-4 * np.abs(by).max())
        assert np.all(found.y_by[lane][..., width : lanes.places.shape[1]] == 0.0)


def test_a_plant_without_a_solution_is_not_good() -> None:
    """A resistance so negative that the step has no slope is no plant; its neighbours do not notice."""
    model = circuit(
        "  R: {type: R, parameters: {R: 3 ohm}}\n  L: {type: I, parameters: {L: 1 H}}",
        "loop: 1",
        "source -> loop -> R, loop -> L",
        "i: {reads: R.f, unit: A, noise: 0.01 A}",
    )
    recursion = build_recursion(model.plant)
    run = random_experiments(model, recursion)[0]
    run = replace(run, theta=np.array([3.0, 1.0]))
    course = Trajectory(recursion, run)
    singular = np.array([-1.0 / run.dt[3], 1.0])
    lanes = lanes_of([run.theta, singular, run.theta], run.start, [(0,)] * 3)
    nominal = course.alone(run.theta)
    assert nominal is not None
    found = course.follow(lanes, np.tile(nominal, (3, 1, 1)))
    assert found.good.tolist() == [True, False, True]
    assert np.array_equal(found.y[0], found.y[2])
    assert not course.follow(lanes, np.tile(0.0 * nominal, (3, 1, 1)), stop=lambda: True).good[1]
