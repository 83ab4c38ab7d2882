"""Which change of an input separates sets that look alike."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.analysis.equilibrium import reference
from faultbond.analysis.input_advice import FAULT, _separation, input_advice
from faultbond.analysis.levenberg_marquardt import fit_lanes
from faultbond.analysis.sensitivity import Experiment, build_recursion, sensitivities
from faultbond.analysis.trajectories import Trajectory, lanes_of
from faultbond.errors import ModelError
from made import EXAMPLES
from plants import circuit, example, stated

PARALLEL = circuit(
    "  A: {type: R, parameters: {RA: 3 ohm}}\n  B: {type: R, parameters: {RB: 5 ohm}}",
    "loop: 1",
    "source -> loop -> A, loop -> B",
    "i: {reads: A.f, unit: A, noise: 0.01 A}",
)


@pytest.mark.parametrize(("sets", "valve"), [((["K1"], ["K7"]), "u_in"), ((["K4"], ["K6"]), "u_out")])
def test_the_tank_with_its_valves_at_rest(sets: tuple[list[str], list[str]], valve: str) -> None:
    """At rest pipe and valve, and outlet and leak, look alike; moving u_in separates the one pair, u_out the other."""
    advice = input_advice(example("tank"), sets)
    assert advice.choices
    assert {item.input for item in advice.choices} == {valve}
    assert all(item.before < 1e-6 for item in advice.choices)
    assert advice.choices[-1].after > 3.0
    assert all(0.0 <= item.level + item.change <= 100.0 for item in advice.choices)
    found = [item.after for item in advice.choices]
    assert found == sorted(found, reverse=True)
    best = advice.choices[0]
    start = (
        f"to tell {{{sets[0][0]}}} and {{{sets[1][0]}}} apart, move {valve} from 50 to {best.level + best.change:.3g} %"
    )
    assert advice.words.startswith(start)
    assert advice.words.endswith("standard deviations apart instead of 0")


@pytest.mark.parametrize(
    ("ends", "levels"), [("[2 V, 12 V]", {3.0, 5.0, 7.0, 9.0, 11.0}), ("[-inf, 8 V]", {0.0, 2.4, 7.2})]
)
def test_no_input_is_moved_beyond_its_range(ends: str, levels: set[float]) -> None:
    """What an input cannot be is no advice: parts of a range of two ends are tried, of others what is within."""
    text = (EXAMPLES / "dc_motor" / "model.yaml").read_text(encoding="utf-8")
    model = stated(text.replace("V: {unit: V", f"V: {{unit: V, range: {ends}", 1))
    choices = input_advice(model, [["R"], ["K"]]).choices
    assert choices
    assert {round(item.level + item.change, 9) for item in choices} <= levels


@pytest.mark.parametrize(("still", "left"), [("u_out: {move: no}", {"u_in"}), ("u_in: {move: no}", set())])
def test_what_nobody_can_move_is_not_moved(still: str, left: set[str]) -> None:
    """As the sun, or the air outside."""
    text = (EXAMPLES / "tank" / "model.yaml").read_text(encoding="utf-8")
    model = stated(f"{text}checks: {{{still}}}\n")
    assert {item.input for item in input_advice(model, [["K1"], ["K7"]]).choices} == left


def test_a_group_needs_both_moves() -> None:
    """Of {K1}, {K7}, {K4}, {K6} no single move separates all: the closest pair stays where it is."""
    advice = input_advice(example("tank"), [["K1"], ["K7"], ["K4"], ["K6"]])
    assert advice.choices == ()
    assert advice.words == "no change of one input brings {K1}, {K7}, {K4} and {K6} further apart"


def test_twins_for_every_input_are_said_to_be_so() -> None:
    """Of two resistances in series only the sum acts, whatever the voltage; no input is tried."""
    advice = input_advice(PARALLEL, [["RA"], ["RB"]])
    assert advice.choices == ()
    assert advice.words == "no input can separate {RA} and {RB}: for every input they have the same effects"


def test_a_plant_without_inputs() -> None:
    """Where nothing can be moved, this is said."""
    text = (
        "name: still\nsample_time: 1 s\nconstants: {Q: 1 m^3/s}\ncomponents:\n  pump: {type: Sf, law: f = Q}\n"
        "  tank: {type: C, law: e = q/A, parameters: {A: 2 m^2}}\n  out: {type: R, parameters: {R: 3 s/m^2}}\n"
        "junctions: {node: 0}\nbonds: [pump -> node -> tank, node -> out]\n"
        "sensors: {level: {reads: node.e, unit: m, noise: 1 mm}}\n"
    )
    assert input_advice(stated(text), [["A"], ["R"]]).words == "the plant has no input that could separate {A} and {R}"


def test_separation_is_what_a_fit_leaves() -> None:
    """What {K} leaves of a small fault of {R}, refitted with its own values and another start, is the separation."""
    model = example("dc_motor")
    recursion = build_recursion(model.plant)
    names = [item.name for item in model.plant.graph.parameters]
    longest, places = 12.0, ((names.index("R"),), (names.index("K"),))
    dt, stand = np.array([0.0, *[longest / 48] * 96]), reference(model)
    experiment = Experiment(
        start=stand.contents,
        inputs=np.array([[5.0]] * 49 + [[9.0]] * 48),
        dt=dt,
        theta=np.array([item.nominal for item in model.plant.graph.parameters]),
        implicit=stand.implicit,
    )
    (run,) = sensitivities(recursion, [experiment])
    assert run is not None
    expected = {}
    for one, other in (places, places[::-1]):
        relative = 1e-3
        theta = experiment.theta.copy()
        theta[list(one)] *= 1.0 + relative
        (faulty,) = sensitivities(recursion, [replace(experiment, theta=theta)])
        assert faulty is not None
        course = Trajectory(recursion, experiment)
        nominal = course.alone(experiment.theta)
        assert nominal is not None
        found = fit_lanes(course, lanes_of([experiment.theta], experiment.start, [other]), nominal, faulty.y[None])
        samples = longest / 48 / 0.02  # that a step of the run stands for
        left = found.misfit[0] * np.sqrt(np.mean(run.y**2)) * np.sqrt(run.y.size * samples) / 0.06
        item = model.plant.graph.parameters[one[0]]
        expected[one] = left * FAULT * item.change / item.nominal / relative
    for order in (places, places[::-1]):
        assert _separation(model, order, run, longest, 1.0) == pytest.approx(min(expected.values()), rel=0.01)


def test_bad_requests_are_refused() -> None:
    """An unknown name, and a single set, each get one line."""
    with pytest.raises(ModelError, match="no parameter Q; there are RA, RB"):
        input_advice(PARALLEL, [["RA"], ["Q"]])
    with pytest.raises(ModelError, match="two or more are needed"):
        input_advice(PARALLEL, [["RA"]])
