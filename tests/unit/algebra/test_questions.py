"""The functions of thesis 4.2 on plants whose answers are known, and on all kinds of networks."""

import pytest
from benchmarks.shared.ladders import components_of, example
from solved import earlier

from faultbond.algebra.route import Question, Route
from faultbond.algebra.routes import questions
from faultbond.algebra.routes.matched import find_route
from faultbond.equations.component_network import ComponentNetwork
from faultbond.errors import StructureError

BLOCKS = """
name: amplifier with feedback through an integrator
sample_time: 1 s
inputs: {u: {}}
blocks:
  error: {law: d = u - G*y, parameters: {G: 2}}
  store: {law: der(y) = d/P, parameters: {P: 5}}
  square: {law: z = S*y**2, parameters: {S: 3}}
sensors: {m: {reads: z, noise: 1}}
"""

STATIC = """
name: figure 6.1
sample_time: none
inputs: {Vi: {}}
blocks:
  A: {law: x = Vi + A, parameters: {A: 2}}
  B: {law: y = B*x, parameters: {B: 5}}
  C: {law: z = C*Vi, parameters: {C: 4}}
  sum: {law: s = y + z, suspect: no}
sensors: {Vo: {reads: s}}
"""

NONLINEAR = """
name: spring that stiffens
sample_time: 1 s
inputs: {F: {unit: N}}
components:
  source: {type: Se, law: e = F}
  mass: {type: I, parameters: {M: 1 kg}}
  spring: {type: C, law: e = K*q**3, parameters: {K: 1 N/m^3}}
  damper: {type: R, parameters: {D: {nominal: 1 N*s/m, suspect: no}}}
junctions: {body: 1}
bonds: [source -> body -> mass, body -> spring, body -> damper]
sensors: {x: {reads: body.q, unit: m, noise: 1 mm}}
"""


def passed(route: Route) -> set[str]:
    """The components of a route with their frames."""
    return {f"{step.equation}_{step.frame}" for step in route.steps}


def routes(net: ComponentNetwork, asked: tuple[Question, ...]) -> dict[str, set[str]]:
    """The components of each answer, by the title of its question."""
    return {question.title: passed(find_route(net, question)) for question in asked}


def test_states_of_the_motor() -> None:
    """The current follows from two samples of omega along the rotor; omega is measured (4.2.1)."""
    motor = example("dc_motor")
    assert routes(motor, questions.states(motor)) == {
        "state armature.f": {"K.2_0", "shaft_0", "J_0", "C_0", "J.sum_0"},
        "state omega": set(),
    }


def test_states_at_the_start() -> None:
    """The current one sample back takes two samples of omega and one of V (4.2.1)."""
    motor = example("dc_motor")
    route = find_route(motor, questions.states_at_start(motor)[0])
    assert set(route.samples) == {("omega", 0), ("omega", 1), ("V", 0)}
    assert route.question.title == "state armature.f at the start"


def test_states_from_the_rates() -> None:
    """The current is (a - l*L/dt - K*b)/R: four components of one frame (4.3, table 4.2)."""
    motor = example("dc_motor")
    route = find_route(motor, questions.states_from_rates(motor)[0])
    assert passed(route) == {"K.1_0", "L_0", "armature_0", "R_0"}
    assert (route.samples, route.known) == ((("omega", 0), ("V", 0)), (("L.rate", 0),))


def test_states_from_the_rates_of_a_nonlinear_plant() -> None:
    """The speed is the rate of the position; the spring's length follows from the balance of forces."""
    net = components_of(NONLINEAR)
    speed, spring, position = (find_route(net, question) for question in questions.states_from_rates(net))
    assert (passed(speed), speed.known) == (set(), (("body.f", 0),))
    assert passed(spring) == {"spring_0", "body_0", "mass_0", "damper_0"}
    assert (passed(position), position.samples) == (set(), (("x", 0),))


def test_rates_are_differences_of_states() -> None:
    """The current before follows from omega 1 and 2 as that of now from omega 0 and 1, not through the coil (4.2.3)."""
    motor = example("dc_motor")
    now, before = questions.rates(motor)[0]
    assert find_route(motor, before).steps == earlier(find_route(motor, now)).steps
    assert set(find_route(motor, before).samples) == {("omega", 1), ("omega", 2)}


def test_outputs_along_causality() -> None:
    """omega takes all ten constraints of table 4.1 at once; with the current measured it takes those of the rotor."""
    motor = example("dc_motor")
    route = find_route(motor, questions.outputs(motor)[0])
    assert (len(route.steps), route.largest_block) == (10, 10)
    assert (set(route.samples), route.known) == ({("V", 0), ("omega", 1)}, (("armature.f", 1),))
    both = example("dc_motor_current")
    assert routes(both, questions.outputs(both)) == {
        "output omega": {"J.sum_0", "J_0", "shaft_0", "K.2_0", "C_0"},
        "output i": {"L.sum_0", "L_0", "armature_0", "R_0", "K.1_0"},
    }


def test_signals_on_either_side() -> None:
    """At R the voltage comes through the armature, the current from the rotor; R itself is not passed (4.2.2)."""
    motor = example("dc_motor")
    question = questions.either_side(motor)[0]
    assert question.targets == (("R.e", 0), ("armature.f", 0))
    route = find_route(motor, question)
    assert passed(route) == {"armature_0", "K.1_0", "L_0", "K.2_0", "shaft_0", "J_0", "C_0"}
    assert set(route.known) == {("L.rate", 0), ("J.rate", 0)}


def test_gyrator_has_four_sides() -> None:
    """Its parameter stands in two equations; both are suspended, and without the current measured that is too much."""
    motor = example("dc_motor")
    question = questions.either_side(motor)[2]
    assert question.suspended == {"K.1", "K.2"}
    assert question.targets == (("K.e1", 0), ("omega", 0), ("K.e2", 0), ("armature.f", 0))
    with pytest.raises(StructureError, match=r"K\.e1_0, armature\.f_0 cannot be found"):
        find_route(motor, question)
    both = example("dc_motor_current")
    assert "K.1_0" not in passed(find_route(both, questions.either_side(both)[2]))


def test_parameter_sets() -> None:
    """Sets of suspects, small ones first; a component that is trusted is in none."""
    net = components_of(NONLINEAR)
    asked = questions.parameter_sets(net, 2)
    assert [question.targets for question in asked] == [("M",), ("K",), ("M", "K")]
    assert [question.title for question in asked] == ["parameter M", "parameter K", "parameters M, K"]
    assert all(question.unknown == question.targets for question in asked)


def test_nonlinear_store() -> None:
    """A store that is no plain multiple carries its content, which is found, known at the start, and differenced."""
    net = components_of(NONLINEAR)
    assert "state spring.q" in {question.title for question in questions.states(net)}
    asked = [*questions.states(net), *questions.outputs(net), *questions.parameter_sets(net, 2)]
    found = {question.title: find_route(net, question) for question in asked}
    assert passed(found["output x"]) >= {"body.q.sum_0", "mass.sum_0", "spring.sum_0"}
    assert ("spring.q", 1) in found["output x"].known
    assert [question.title for question in questions.either_side(net)] == ["signals at M", "signals at K"]


def test_blocks_with_a_store() -> None:
    """In a block network the state is found through the square that is measured."""
    net = components_of(BLOCKS)
    found = routes(net, questions.all_questions(net, 2))
    assert found["state y"] == {"square_0"}
    assert found["state y one sample before"] == {"square_1"}
    assert found["output m"] == {"square_0", "store.sum_0", "store_0", "error_0"}
    assert found["parameter P"] == {"store_0", "store.sum_0", "error_0", "square_0", "square_1"}


def test_static_blocks() -> None:
    """A network without time has no states; its parameters take one observation each, pairs take two."""
    net = components_of(STATIC)
    assert [*questions.states(net), *questions.states_at_start(net), *questions.rates(net)] == []
    for question in questions.parameter_sets(net, 2):
        route = find_route(net, question)
        assert route.observations == len(question.targets)
    assert routes(net, questions.outputs(net)) == {"output Vo": {"A_0", "B_0", "C_0", "sum_0"}}


def test_stores_that_share_a_state() -> None:
    """Two inertias on one shaft have one speed, which is asked for once."""
    net = components_of(
        "name: x\nsample_time: 1 s\ninputs: {V: {unit: V}}\ncomponents:\n  s: {type: Se, law: e = V}\n"
        "  I1: {type: I, parameters: {I1: 1 H}}\n  I2: {type: I, parameters: {I2: 1 H}}\njunctions: {n: 1}\n"
        "bonds: [s -> n -> I1, n -> I2]\nsensors: {i: {reads: n.f, unit: A, noise: 1 mA}}\n"
    )
    assert [question.targets for question in questions.states(net)] == [(("i", 0),)]
    assert len(net.states) == 2


def test_all_questions_have_titles_of_their_own() -> None:
    """Every question of a plant can be told by its title."""
    for folder in ("tank", "rlc", "dc_motor_current"):
        net = example(folder)
        titles = [question.title for question in questions.all_questions(net, 2)]
        assert len(set(titles)) == len(titles)
        assert all(titles)


def test_a_parameter_named_twice_is_asked_for_once() -> None:
    """{R, R} is the set {R}."""
    net = example("rlc")
    assert questions.parameters(net, ("R", "R")) == questions.parameters(net, ("R",))
