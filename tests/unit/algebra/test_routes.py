"""Routes by matching: what they hold, what they cannot do, and what the refusals say."""

from dataclasses import replace

import pytest
from benchmarks.shared.ladders import components_of, example, ladder
from solved import earlier

from faultbond.algebra.route import Question, Route, RouteStep
from faultbond.algebra.routes.matched import alternatives, find_route
from faultbond.algebra.routes.questions import outputs, parameter_sets, parameters, states, states_from_rates
from faultbond.algebra.routes.unroll import assemble, causes, frame_limit, unroll
from faultbond.equations.component_network import ComponentNetwork
from faultbond.errors import StructureError
from small_networks import ask, network

DERIVATIVE = """
name: two inertias on one shaft, a capacitor on a source
sample_time: 1 s
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  C1: {type: C, parameters: {C1: 1 F}}
  I1: {type: I, parameters: {I1: 1 H}}
  I2: {type: I, parameters: {I2: 2 H}}
  R: {type: R, parameters: {R: 3 ohm}}
junctions: {node: 0, line: 1}
bonds: [source -> node -> C1, node -> line -> I1, line -> I2, line -> R]
sensors: {i: {reads: line.f, unit: A, noise: 1 mA}}
"""


def passed(route: Route) -> set[str]:
    """The components of a route with their frames."""
    return {f"{step.equation}_{step.frame}" for step in route.steps}


def test_sensor_is_the_shortest_route() -> None:
    """The pressure drop of the orifice is read off the flow meter, without any other component."""
    tank = example("tank")
    route = find_route(tank, Question(targets=(("orifice.e", 0),), observed=tank.observed))
    assert route.steps == (RouteStep(equation="flow", frame=0, finds=("orifice.e", 0)),)
    assert route.samples == (("flow", 0),)


def test_known_target() -> None:
    """What is measured needs no step; its sample is what is used."""
    motor = example("dc_motor")
    route = find_route(motor, Question(targets=(("omega", 0),), observed=motor.observed))
    assert (route.steps, route.blocks, route.samples) == ((), (), (("omega", 0),))
    assert (route.frames, route.observations, route.largest_block) == (0, 1, 0)


def test_steps_from_the_target_on() -> None:
    """The first step finds the target, the last block is solved last and holds it."""
    motor = example("dc_motor")
    route = find_route(motor, parameters(motor, ("R",)))
    assert route.steps[0] == RouteStep(equation="R", frame=0, finds="R")
    assert route.blocks[-1] == (0,)


def test_known_signals_shorten_routes() -> None:
    """With the rates known the current takes four components of one frame (figure 4.6)."""
    motor = example("dc_motor")
    known = frozenset({("L.rate", 0), ("J.rate", 0)})
    question = Question(targets=(("armature.f", 0),), observed=frozenset({"V", "omega"}), known=known, frames=1)
    mechanical = replace(question, suspended=frozenset({"R"}))
    assert passed(find_route(motor, question)) == {"R_0", "armature_0", "K.1_0", "L_0"}
    route = find_route(motor, mechanical)
    assert passed(route) == {"K.2_0", "shaft_0", "J_0", "C_0"}
    assert route.known == (("J.rate", 0),)


def test_suspended_components_are_not_passed() -> None:
    """With the sum of the rotor suspended in every frame nothing leads from omega to its rate."""
    motor = example("dc_motor")
    question = Question(targets=(("J.rate", 0),), observed=motor.observed, suspended=frozenset({"J.sum"}))
    with pytest.raises(StructureError, match=r"J\.rate_0 cannot be found from V, omega"):
        find_route(motor, question)


def test_hidden_samples_are_not_used() -> None:
    """Where a sample of omega is hidden it is found by other components and is no sample of the route."""
    motor = example("dc_motor")
    for question in (outputs(motor)[0], replace(outputs(motor)[0], causal=False)):
        route = find_route(motor, question)
        assert ("omega", 0) not in route.samples
        assert set(route.samples) == {("V", 0), ("omega", 1)}
        assert route.known == (("armature.f", 1),)


def test_newest_frame() -> None:
    """A question may begin with an older frame; its route is that of the newest, shifted."""
    motor = example("dc_motor")
    now = states(motor)[0]
    before = replace(now, targets=(("armature.f", 1),), newest=1)
    assert find_route(motor, before).steps == earlier(find_route(motor, now)).steps
    assert passed(find_route(motor, before)) == {"K.2_1", "shaft_1", "J_1", "C_1", "J.sum_1"}


def test_earlier() -> None:
    """A route some frames earlier finds what was then from what was then known; parameters stay."""
    motor = example("dc_motor")
    route = find_route(motor, parameters(motor, ("R",)))
    shifted = earlier(route, 2)
    assert shifted.samples == tuple((name, frame + 2) for name, frame in route.samples)
    assert shifted.steps[0] == RouteStep(equation="R", frame=2, finds="R")
    assert shifted.blocks == route.blocks
    assert shifted == assemble(motor, shifted.question, shifted.steps)


def test_earlier_is_an_answer() -> None:
    """The question of a shifted route has that route as its answer: newer frames are not used."""
    motor = example("dc_motor")
    for question in (states(motor)[0], states_from_rates(motor)[0]):
        shifted = earlier(find_route(motor, question))
        assert find_route(motor, shifted.question).steps == shifted.steps


def test_sensors_weigh_nothing() -> None:
    """Two sensors are taken rather than one component, and one sensor rather than two."""
    net = network("c: x y; m?: x w y; n?: w y")
    assert passed(find_route(net, ask(net, ("x", 0)))) == {"m_0", "n_0"}
    net = network("m?: x w y; n?: w y; o?: x y")
    assert passed(find_route(net, ask(net, ("x", 0)))) == {"o_0"}


def test_shorter_by_two_exchanges() -> None:
    """From the rates the voltage in the middle follows from the end of the ladder: four components, not six."""
    net = ladder(3, "ends+i")
    question = states_from_rates(net)[1]
    assert question.targets == (("node2.e", 0),)
    assert passed(find_route(net, question)) == {"line3_0", "R3_0", "node3_0", "C3_0"}


def test_frames_only_add_numbers() -> None:
    """Unrolling a further frame leaves the numbers of what is there."""
    motor = example("dc_motor")
    question = parameters(motor, ("R", "L"))
    two, three = unroll(motor, question, 2), unroll(motor, question, 3)
    assert unroll(motor, question, 3, two) == three
    assert three.equations[: len(two.equations)] == two.equations
    assert three.unknowns[: len(two.unknowns)] == two.unknowns
    assert three.unknowns[:2] == ("R", "L")


def test_frames_that_suffice() -> None:
    """No set of motor parameters takes more frames than there are states and parameters sought, and two."""
    motor = example("dc_motor")
    for question in parameter_sets(motor, 5):
        assert find_route(motor, question).frames <= frame_limit(motor, question)
        assert frame_limit(motor, question) == 2 + len(question.targets) + 2


def test_shortest_of_ladders() -> None:
    """Routes on a ladder have the lengths that the search and integer programming find."""
    lengths = {
        ("ends", 4, "C2"): 50,
        ("ends", 12, "C6"): 390,
        ("ends+i", 4, "C2"): 26,
        ("ends+i", 12, "C6"): 194,
        ("all", 12, "C6"): 7,
    }
    for (sensors, sections, name), length in lengths.items():
        net = ladder(sections, sensors)
        assert len(find_route(net, parameters(net, (name,))).steps) == length


def test_refusal_names_a_sensor_that_helps() -> None:
    """From V alone R is refused; with the sensor that the message names it is found."""
    motor = replace(example("dc_motor"), outputs=())
    with pytest.raises(StructureError) as refused:
        find_route(motor, parameters(motor, ("R",)))
    message = str(refused.value)
    assert "model.yaml: R cannot be found from V: it stays undetermined however many samples are used" in message
    name = message.partition("for example of ")[2].split(" or ")[0]
    better = replace(parameters(motor, ("R",)), observed=frozenset({"V", name}))
    assert find_route(motor, better).steps


def test_refusal_within_a_limit() -> None:
    """A question that is allowed too few frames says so."""
    motor = example("dc_motor")
    question = replace(parameters(motor, ("R", "L")), frames=2)
    with pytest.raises(StructureError, match="within 2 time frames, the limit"):
        find_route(motor, question)
    assert find_route(motor, replace(question, frames=3)).frames == 3


def test_refusal_of_several() -> None:
    """Every target that stays undetermined is named, those that are found are not."""
    tank = example("tank")
    question = Question(targets=("K1", "K8"), unknown=("K1", "K8"), observed=frozenset({"u_in", "u_out", "flow"}))
    with pytest.raises(StructureError, match="they stay undetermined"):
        find_route(tank, replace(question, suspended=frozenset({"line"})))
    with pytest.raises(StructureError, match=r": K1 cannot be found from u_in, u_out: it stays"):
        find_route(tank, replace(question, targets=("K1",), unknown=("K1",), observed=frozenset({"u_in", "u_out"})))


def test_no_components_at_all() -> None:
    """With every component suspended nothing is found, and the message is still one line."""
    motor = example("dc_motor")
    question = replace(parameters(motor, ("R",)), suspended=frozenset(item.name for item in motor.equations))
    with pytest.raises(StructureError, match=r"R cannot be found from V, omega: .*; add sensors"):
        find_route(motor, question)


def test_unknown_target() -> None:
    """A target that the model does not have is refused by name."""
    motor = example("dc_motor")
    with pytest.raises(StructureError, match="there is no parameter Q; look at the names in the model"):
        find_route(motor, parameters(motor, ("Q",)))


def test_alternatives_use_other_samples() -> None:
    """The current follows from the rotor, or through the armature from the rotor one, two or three samples before."""
    motor = example("dc_motor")
    question = states(motor)[0]
    found = list(alternatives(motor, question))
    assert found[0] == find_route(motor, question)
    assert [route.observations for route in found] == [2, 3, 4, 5]
    assert len({frozenset(passed(route)) for route in found}) == 4
    assert list(alternatives(motor, question, 2)) == found[:2]
    assert any(("V", 0) in route.samples for route in found[1:])


def test_alternatives_are_not_the_same_earlier() -> None:
    """R and L of the motor may be found from older samples alone, but that is no other route."""
    motor = example("dc_motor")
    found = list(alternatives(motor, parameters(motor, ("R", "L")), 12))
    moved = [
        {(step.equation, step.frame - min(s.frame for s in route.steps)) for step in route.steps} for route in found
    ]
    assert len(found) == 12
    assert all(one not in moved[:k] for k, one in enumerate(moved))


def test_alternatives_end() -> None:
    """Where nothing can be spared there is one route, and where there is none, a refusal."""
    motor = example("dc_motor")
    question = Question(targets=(("R.e", 0),), observed=frozenset({"armature.f", "V", "omega"}), frames=1)
    only = replace(question, suspended=frozenset({"armature"}))
    assert [passed(route) for route in alternatives(motor, only)] == [{"R_0"}]
    with pytest.raises(StructureError):
        list(alternatives(motor, replace(only, suspended=frozenset({"R", "armature"}))))


def causes_of(net: ComponentNetwork) -> dict[str, list[str]]:
    """What each component causes, sorted."""
    return {name: sorted(signals) for name, signals in causes(net).items()}


def test_causes_of_the_motor() -> None:
    """In integral causality a store causes its state, an inertia its rate, a resistor on a 1-junction its effort."""
    assert causes_of(example("dc_motor")) == {
        "K.1": ["K.e1"],
        "K.2": ["K.e2"],
        "R": ["R.e"],
        "L": ["L.rate"],
        "L.sum": ["armature.f"],
        "J": ["J.rate"],
        "J.sum": ["omega"],
        "C": ["C.e"],
        "armature": ["L.e"],
        "shaft": ["J.e"],
    }


def test_causes_in_a_loop() -> None:
    """The three resistances in the line of the tank form a loop: each may cause any signal of it that it relates."""
    found = causes_of(example("tank"))
    assert found["pipe"] == ["line.f", "pipe.e"]
    assert found["line"] == ["orifice.e", "pipe.e", "valve.e"]
    assert found["tank.sum"] == ["pressure"]
    assert found["flow"] == ["flow"]


def test_causes_in_derivative_causality() -> None:
    """A capacitor on a source has its voltage from there: its sum causes its rate; so with one of two inertias."""
    assert causes_of(components_of(DERIVATIVE)) == {
        "C1": ["C1.f"],
        "C1.sum": ["C1.rate"],
        "I1": ["I1.rate"],
        "I1.sum": ["i"],
        "I2": ["I2.e"],
        "I2.sum": ["I2.rate"],
        "R": ["R.e"],
        "node": ["source.f"],
        "line": ["I1.e"],
    }


def test_prediction_along_causality_through_a_loop() -> None:
    """The flow into the tank is predicted from the pump on, through the loop of the resistances (thesis 7)."""
    tank = example("tank")
    route = find_route(tank, outputs(tank)[0])
    assert passed(route) == {"flow_0", "orifice_0", "pipe_0", "valve_0", "line_0", "pump_0"}
    assert route.largest_block == 4


def test_causal_question_without_causal_route() -> None:
    """Where causality leads to what is not known, the question is answered in any direction."""
    motor = example("dc_motor")
    question = Question(targets=(("K.e2", 0),), observed=motor.observed, causal=True)
    route = find_route(motor, replace(question, suspended=frozenset({"K.2"})))
    assert passed(route) == {"shaft_0", "J_0", "C_0", "J.sum_0"}
