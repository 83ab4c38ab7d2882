"""Parameters that go with a signal, as laws do not say: which may, how that is written, and whether it is found."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import casadi as ca
import numpy as np
import pytest

from faultbond.app import attempt
from faultbond.arrays import BoolArray, FloatArray
from faultbond.cli import DONE, main
from faultbond.equations.evaluate import evaluate
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.fit import further
from faultbond.fit import ground as ground_module
from faultbond.fit.ascent import Finish
from faultbond.fit.bend import LEAST, Bend, bend_by
from faultbond.fit.curves import (
    FOREIGN,
    bendable_parameters,
    likeliest_curves,
    movers_of,
    possible_curves,
)
from faultbond.fit.foothold import Added, Footing
from faultbond.fit.further import SURE
from faultbond.fit.ground import MOST_POWER, Ground
from faultbond.fit.imperfections import (
    Imperfection,
    Kind,
    law_signals,
    laws_of_signals,
    parameter_name,
    possible,
    power_of,
    with_imperfections,
    without_curve,
)
from faultbond.fit.likelihood import Likelihood, nominal_q
from faultbond.fit.objective import Evaluation, FitPoint, FittedPlant
from faultbond.fit.quiet_search import WORTH, Search
from faultbond.io.recording import write_recording
from faultbond.model.expression import Binary, Name
from faultbond.model.graph import BondGraph, Check
from faultbond.model.parser import to_text
from faultbond.model.text import load_model, parse_model
from faultbond.report.numbers import MINUS
from faultbond.report.quiet_result import _added_row, _curve_words, amended_text
from faultbond.types import CheckKind

COOLER = """
name: cooler
sample_time: 10 s
accuracy: 5 %
inputs: {flow: {unit: l/min}, load: {unit: W}, t_in: {unit: degC}}
components:
  gear: {type: Sf, law: f = k*load, parameters: {k: 1}}
  oil: {type: C, law: q = C_oil*e, parameters: {C_oil: 60 kJ/K}}
  wall: {type: R, law: f = U*e, parameters: {U: 170 W/K}}
  metal: {type: C, law: q = C_metal*e, parameters: {C_metal: 30 kJ/K}}
  film: {type: R, law: f = h*(flow/usual)**0.8*e, parameters: {h: 250 W/K}}
  water: {type: Se, law: e = t_in}
constants: {usual: 20 l/min}
junctions: {oil_side: 0, through: 1, metal_side: 0, out: 1}
bonds: [gear -> oil_side -> oil, oil_side -> through -> metal_side -> metal, through -> wall,
        metal_side -> out -> water, out -> film]
sensors:
  t_oil: {reads: oil_side.e, unit: degC, noise: 0.05 K}
  t_metal: {reads: metal_side.e, unit: degC, noise: 0.05 K}
"""
DUCT = """
name: duct
sample_time: 1 s
inputs: {speed: {unit: percent}, damper: {unit: percent}}
components:
  fan: {type: Se, law: e = P*(speed/full)**2, parameters: {P: 1550 Pa}}
  air: {type: I, law: p = M*f, parameters: {M: 450 Pa*s^2/m^3}}
  flap: {type: R, law: e = K*(full/damper)**2*f*abs(f), parameters: {K: 54 Pa*s^2/m^6}}
  plenum: {type: C, law: q = C*e, parameters: {C: 0.02 m^3/Pa}}
  outlets: {type: R, law: e = K_out*f*abs(f), parameters: {K_out: 27 Pa*s^2/m^6}}
constants: {full: 100 percent}
junctions: {line: 1, box: 0}
bonds: [fan -> line -> air, line -> flap, line -> box -> plenum, box -> outlets]
sensors: {p: {reads: box.e, unit: Pa, noise: 3 Pa}, q: {reads: line.f, unit: m^3/s, noise: 0.02 m^3/s}}
"""
X = Name("x")
BLOCKS = """
name: pump
sample_time: 1 s
inputs: {n: {unit: percent}}
blocks:
  pump: {law: P = H*n**2, parameters: {H: 12}}
  both: {law: ["a = P/R", "der(c) = a"], parameters: {R: 3}}
sensors: {Q: {reads: c, noise: 0.1}, I: {reads: H*n, noise: 0.1}}
"""


@pytest.fixture(scope="module", params=[COOLER, DUCT, BLOCKS], ids=["cooler", "duct", "blocks"])
def model(request: pytest.FixtureRequest) -> StepModel:
    """A plant in discrete time."""
    return build_step_model(build_plant(parse_model(request.param)))


def courses_of(model: StepModel) -> dict[str, FloatArray]:
    """Give courses of all that laws may go with, of which some change their sign."""
    generator = np.random.default_rng(5)
    return {text: generator.normal(3.0 * (k % 2), 1.0, 50) for k, text in enumerate(movers_of(model))}


def everything_of(model: StepModel) -> set[str]:
    """Give all that laws relate, as if all were known to be off."""
    return {name for item in bendable_parameters(model) for name in item.acts_on}


@pytest.mark.parametrize(
    "bend",
    [
        Bend(X, "x", 2.0, 0.5),
        Bend(X, "x", 2.0, 0.5, signed=True),
        Bend(X, "x", 4.0),
        Bend(X, "x", 2.0, 0.5, bowed=True),
        Bend(X, "x", 2.0, 0.5, signed=True, bowed=True),
        Bend(X, "x", 2.0, 0.5, 4.0, bowed=True),
        Bend(X, "x", 2.0, 0.5, 4.0, signed=True),
    ],
    ids=["power", "size", "exponential", "bow", "bow of a size", "bow with an end", "its power"],
)
def test_what_is_written_is_what_is_compared(bend: Bend) -> None:
    """The factor in the law has the logarithm that is told for a power of 1, times its power."""
    x, power = ca.SX.sym("x"), ca.SX.sym("n")
    factor = ca.Function("factor", [x, power], [evaluate(bend.factor("n"), {"x": x, "n": power})])
    values = (
        np.array([-3.0, -0.1, 0.0, 0.2, 0.6, 2.0, 9.0]) if bend.signed or not bend.least else np.array([0.0, 0.2, 7.0])
    )
    for n in (-1.7, 0.0, 0.4):
        given = factor(values[None, :], n).full()[0]
        np.testing.assert_allclose(given, np.exp(n * bend.logarithm(values)), rtol=1e-14)
    assert bend.logarithm(np.array([bend.usual]))[0] == (0.0 if bend.least else 1.0)


def test_a_power_has_a_usual_size_and_an_end() -> None:
    """The usual size is a geometric mean, so that the law's parameter stays what it was; far below all is the same."""
    values = np.array([1.0, 10.0, 100.0])
    found = bend_by(X, "x", values, own=False)
    assert found == Bend(X, "x", 17.0, 0.85)  # where 1 counts as 5
    assert bend_by(X, "x", -values, own=True) == replace(found, signed=True)
    assert bend_by(X, "x", np.array([-1.0, 4.0]), own=True) == Bend(X, "x", 2.0, 0.53, signed=True)
    assert bend_by(X, "x", np.array([-1.0, 4.0]), own=False) == Bend(X, "x", 4.0)
    shut = bend_by(X, "x", np.array([0.0, 0.0, 8.0]), own=True)
    assert shut is not None
    assert 0.0 < shut.least <= LEAST * shut.usual * 1.1
    for largest, most in ((100.0, 100.0), (90.04, 91.0), (0.0331, 0.034), (99.6, 100.0), (1741.0, 1800.0)):
        bow = bend_by(X, "x", np.array([0.01 * largest, largest]), own=True, bowed=True)
        assert bow is not None
        assert bow.most == most  # a parabola goes anywhere beyond where it was seen
        assert power_of(replace(curve_over("x", foreign=False), kind=Kind.BOW, bend=bow)).bend == replace(
            bow, bowed=False
        )
    for nothing in (np.zeros(0), np.zeros(5), np.full(5, 3.0), np.array([1.0, np.nan])):
        assert bend_by(X, "x", nothing, own=True) is None


def test_parameters_go_with_what_their_laws_do_not_give() -> None:
    """Neither with what stands on the left, nor with what a law is solved for; none of stores, none in an exponent.

    Of a flow that follows from the pressure on the left, `K*f*abs(f)`, what that is K times stands for it.
    """
    cooler, duct, blocks = (
        {
            item.parameter: tuple([to_text(one) for one in some] for some in (item.spoken, item.near, item.others))
            for item in bendable_parameters(build_step_model(build_plant(parse_model(text))))
        }
        for text in (COOLER.replace("**0.8*e, parameters: {", "**n*e, parameters: {n: 0.8, "), DUCT, BLOCKS)
    )
    assert cooler == {
        "k": (["load"], ["oil_side.e"], ["flow", "t_in"]),
        "U": (["wall.e"], ["oil_side.e", "metal_side.e"], ["flow", "load", "t_in"]),
        "h": (["flow/usual", "film.e"], ["metal_side.e"], ["load", "t_in"]),
    }
    assert duct == {
        "P": (["speed/full"], ["line.f"], ["damper"]),
        "K": (["full/damper", "line.f"], [], ["speed"]),
        "K_out": (["box.e/K_out"], ["line.f"], ["speed", "damper"]),  # the law gives the flow
    }
    assert blocks == {"H": (["n"], [], []), "R": (["P"], [], ["H*n"])}  # which a sensor shows


@pytest.mark.parametrize("law", ["(flow/usual)**n*e", "exp(-n*log(flow/usual)**2)*flow/usual*e"])
def test_an_exponent_goes_with_nothing(law: str) -> None:
    """Nor does it wander: also that of a bow, which an earlier fit has written, is what it is."""
    text = COOLER.replace("(flow/usual)**0.8*e, parameters: {", f"{law}, parameters: {{n: 0.8, ")
    assert law in text
    model = build_step_model(build_plant(parse_model(text)))
    found = {item.parameter: [to_text(one) for one in item.spoken] for item in bendable_parameters(model)}
    assert found == {"k": ["load"], "U": ["wall.e"], "h": ["flow/usual" if "**n" in law else "flow", "film.e"]}
    wandering = {item.place for item in possible(model.plant.graph, law_signals(model), 2) if item.kind is Kind.WANDER}
    assert "n" not in wandering
    assert "h" in wandering


@pytest.mark.parametrize(("nominal", "may"), [("0.1 W/K", True), ("0 W/K", False)])
def test_what_is_not_there_while_healthy_goes_with_nothing(nominal: str, *, may: bool) -> None:
    """Of a leak of 0 healthy data fix no curve, and a real leak would follow whatever was found."""
    leak = f"leak: {{type: R, law: f = L*e, parameters: {{L: {{nominal: {nominal}, accuracy: 1 W/K, change: 5 W/K}}}}}}"
    text = COOLER.replace("  water:", f"  {leak}\n  water:")
    text = text.replace("metal_side -> metal,", "metal_side -> metal, metal_side -> leak,")
    assert text.count("leak") == 2
    found = bendable_parameters(build_step_model(build_plant(parse_model(text))))
    assert ("L" in {item.parameter for item in found}) == may
    assert {"k", "U", "h"} <= {item.parameter for item in found}


def test_a_change_of_what_goes_with_its_own_flow_is_found_as_large_as_it_is() -> None:
    """Where the pressure is as many times as large as K the flow is the same, by whichever power it goes with it."""
    graph = parse_model(DUCT)
    model = build_step_model(build_plant(graph))
    (curve,) = (item for item in possible_curves(model, courses_of(model), ()) if item.by == "box.e/K_out")
    bent = build_plant(with_imperfections(graph, (replace(curve, size=-0.145),)))
    flow = ca.Function("flow", [bent.x, bent.u, bent.theta, bent.b, bent.z], [bent.rates])
    x, u = np.array([0.7 * 450.0, 300.0 * 0.02]), np.array([0.8, 0.6])
    theta = np.array([item.nominal for item in bent.graph.parameters])
    names = [item.name for item in bent.graph.parameters]
    numbers = np.zeros(bent.b.numel()), np.zeros(bent.z.numel())

    def out_of_the_box(pressure: float, k: float) -> float:
        changed = theta.copy()
        changed[names.index("K_out")] *= k
        box = [item.name for item in bent.network.states].index("plenum.q")
        into = x.copy()
        into[box] = 0.02 * pressure
        return float(np.asarray(flow(into, u, changed, *numbers))[box, 0])

    usual = out_of_the_box(300.0, 1.0)
    assert out_of_the_box(1.35 * 300.0, 1.35) == pytest.approx(usual, rel=1e-12)
    assert out_of_the_box(1.35 * 300.0, 1.3) != pytest.approx(usual, rel=1e-3)


def test_what_is_offset_may_go_with_its_own_flow_too_and_is_told_by_the_power_of_that() -> None:
    """The search asks with an offset of each law; 0.873 of f*abs(f) is a flow to 1.75, by the law to 2."""
    graph = parse_model(DUCT)
    law = laws_of_signals(build_step_model(build_plant(graph)))["box.e"]
    offset = with_imperfections(graph, (Imperfection(kind=Kind.OFFSET, place="box.e", size=0.0, law=law),))
    model = build_step_model(build_plant(offset))
    (curve,) = (item for item in possible_curves(model, courses_of(model), ()) if item.by == "box.e/K_out")
    words = _curve_words(graph, replace(curve, size=-0.145))
    assert words.startswith(
        "box.e goes with outlets.f*abs(outlets.f) to the power 0.873, by its law to 1; K_out has its value where"
    )


def test_no_law_has_an_absurd_power() -> None:
    """A climb goes no farther, either way; with a power of 24 a filter loses its variance."""
    graph = parse_model(COOLER)
    curve = replace(curve_over("flow", foreign=False), size=0.3)
    bent = with_imperfections(graph, (curve,))
    model = build_step_model(build_plant(bent))
    fake = SimpleNamespace(own=(), graph=graph, parameters=(), inside=frozenset(), step=1.0, longest=100.0)
    ground = Ground(cast(Search, fake), bent, model, lambda: cast(Likelihood, None))
    unknowns = ground.plant(nominal_q(model), (curve,)).unknowns
    (k,) = (k for k, item in enumerate(unknowns.parameters) if item.name == parameter_name(curve))
    ends = np.array([unknowns.lower[k], unknowns.upper[k]]) * unknowns.parameters[k].scale
    assert sorted(ends) == pytest.approx([-MOST_POWER, MOST_POWER])


def test_of_an_input_that_lags_the_laws_know_the_name() -> None:
    """What a law raises to a power is called as it is there, so that it can be asked for and written."""
    text = DUCT.replace("speed: {unit: percent}", "speed: {unit: percent, lag: 3 s}")
    model = build_step_model(build_plant(parse_model(text)))
    assert "speed/full" in movers_of(model)
    checks = tuple(Check(name=key, kind=CheckKind.SIGNAL, reads=one) for key, one in movers_of(model).items())
    build_plant(replace(model.plant.graph, checks=checks))


def test_a_constant_of_a_meter_may_go_with_what_it_measures() -> None:
    """Of a sensor with a parameter of its own; a parameter that nothing names goes with nothing."""
    text = COOLER.replace("{h: 250 W/K}", "{h: 250 W/K, c: 2, d: 3}").replace("**0.8*e", "**0.8*(1 + 0*d)*e")
    text = text.replace("reads: metal_side.e, unit: degC", "reads: c*metal_side.e - load/usual_load, unit: K")
    graph = parse_model(text.replace("{usual: 20 l/min}", "{usual: 20 l/min, usual_load: 4000 W/K}"))
    found = {item.parameter: item for item in bendable_parameters(build_step_model(build_plant(graph)))}
    assert found["c"].acts_on == {"t_metal"}
    assert [to_text(one) for one in found["c"].spoken] == ["metal_side.e", "load"]


def test_two_curves_have_two_names() -> None:
    """What a law raises to a power, and an input in it that stands elsewhere too: only the former is tried."""
    graph = parse_model(COOLER.replace("(flow/usual)**0.8*e", "(flow/usual)**0.8*(1 + flow/usual)*e"))
    model = build_step_model(build_plant(graph))
    found = [item for item in possible_curves(model, courses_of(model), ()) if item.place == "h"]
    assert [item.by for item in found] == ["flow/usual", "film.e", "metal_side.e", "flow/usual", "film.e"]
    assert [item.kind for item in found] == [Kind.CURVE] * 3 + [Kind.BOW] * 2  # over what the law speaks of
    assert len({parameter_name(item) for item in found}) == len({item.key for item in found}) == len(found)


def test_a_fault_of_a_flow_moves_what_goes_with_it() -> None:
    """A film goes with the flow, not with the speed of the pump: with what its law or a sensor says the flow is."""
    by_law = COOLER.replace("(flow/usual)", "(G*flow/usual)").replace("{h: 250 W/K}", "{h: 250 W/K, G: 1}")
    by_sensor = COOLER.replace("(flow/usual)**0.8*", "").replace("{h: 250 W/K}", "{h: 250 W/K, G: 1}")
    by_sensor += "  meter: {reads: G*flow, unit: l/min, noise: 0.1 l/min}\n"
    found = []
    for text in (by_law, by_sensor):
        items = bendable_parameters(build_step_model(build_plant(parse_model(text))))
        (film,) = (item for item in items if item.parameter == "h")
        found.append([to_text(one) for one in (*film.spoken, *film.others)])
    assert "G*flow/usual" in found[0]
    assert "G*flow" in found[1]
    assert not {"flow", "G"} & {*found[0], *found[1]}


def test_a_power_of_nothing_changes_nothing(model: StepModel) -> None:
    """With all curves that a plant may have, each with a power of 0, it is the same plant, solved the same way."""
    curves = possible_curves(model, courses_of(model), everything_of(model))
    assert len({parameter_name(item) for item in curves}) == len(curves) > 1
    bent = build_step_model(
        build_plant(with_imperfections(model.plant.graph, tuple(replace(item, size=0.0) for item in curves)))
    )
    assert bent.states == model.states
    n_x, n_u, n_p = len(model.states), len(model.plant.graph.inputs), len(model.scales)
    generator = np.random.default_rng(2)
    for _ in range(5):
        x, u = generator.uniform(250.0, 320.0, n_x), generator.uniform(0.5, 40.0, n_u)
        v = np.concatenate([x, np.ones(n_p)])
        v_bent = np.concatenate([x, np.ones(n_p), np.zeros(len(curves))])
        z = model.reference_implicit
        found = [one.predict(values, u, z, 0.1)[0].full() for one, values in ((model, v), (bent, v_bent))]
        np.testing.assert_allclose(found[1], found[0], rtol=1e-12)


def test_a_curve_is_taken_out_again(model: StepModel) -> None:
    """Whatever stands around it: further curves, an offset."""
    graph = model.plant.graph
    first, *others = possible_curves(model, courses_of(model), everything_of(model))
    place, law = next(iter(laws_of_signals(model).items()))
    offset = Imperfection(kind=Kind.OFFSET, place=place, size=2.0, law=law)
    for more in ((), (offset,), (offset, *others)):
        without = with_imperfections(graph, more)
        for order in ((first, *more), (*more, first)):
            found = without_curve(with_imperfections(graph, order), first)
            assert found.components == without.components
            assert found.sensors == without.sensors
            assert found.parameters == without.parameters


def test_it_stands_in_the_law_and_is_read_back(model: StepModel) -> None:
    """A model file with curves is the plant that was fitted; the power is no suspect."""
    graph = model.plant.graph
    curves = [replace(item, size=0.3) for item in possible_curves(model, courses_of(model), everything_of(model))]
    text = {"cooler": COOLER, "duct": DUCT, "pump": BLOCKS}[graph.name]
    back = parse_model(amended_text(text, graph, [Added(what=item, trained=1.0, held=1.0) for item in curves]))
    once = with_imperfections(graph, tuple(curves))
    assert texts_of(back) == texts_of(once)
    for item in curves:
        power = back.parameter(parameter_name(item))
        assert (power.nominal, power.accuracy, power.suspect) == (0.3, 0.3, False)
        assert _added_row(graph, Added(what=item, trained=1.0, held=1.0))[1] == f"{item.place} over {item.by}"


def texts_of(graph: BondGraph) -> list[str]:
    """Give what laws give and sensors read."""
    rights = [law.right for part in graph.components for law in part.laws]
    return [to_text(item) for item in (*rights, *(sensor.reads for sensor in graph.sensors))]


def test_over_other_inputs_only_where_the_law_is_off(model: StepModel) -> None:
    """A law that is right is not bent over what it does not speak of."""
    courses = courses_of(model)
    foreign = {(item.parameter, to_text(one)) for item in bendable_parameters(model) for one in item.others}
    found = [
        {(item.place, item.by) for item in possible_curves(model, courses, off)}
        for off in (set[str](), everything_of(model))
    ]
    assert not found[0] & foreign
    assert found[1] - found[0] == foreign


def curve_over(by: str, *, foreign: bool) -> Imperfection:
    """Give a curve of h."""
    return Imperfection(kind=Kind.CURVE, place="h", bend=Bend(Name(by), by, 1.0, 0.1), foreign=foreign)


def test_which_curves_are_foreign(model: StepModel) -> None:
    """Those over what the laws of the parameter do not speak of."""
    spoken = {(item.parameter, to_text(one)) for item in bendable_parameters(model) for one in item.spoken}
    for item in possible_curves(model, courses_of(model), everything_of(model)):
        assert item.foreign == ((item.place, item.by) not in spoken)


@pytest.mark.parametrize(("own", "kept"), [(81.0, "flow"), (79.0, "pump")])
@pytest.mark.parametrize("place", ["h", "k"])
def test_a_curve_over_what_drives_a_flow_does_not_stand_for_one_over_the_flow(
    own: float, kept: str, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where that of the same parameter gains nearly as much; a fault of the flow alone tells them apart."""
    pump, flow = curve_over("pump", foreign=True), replace(curve_over("flow", foreign=False), place=place)
    stand, search = Footing(graph=parse_model(COOLER), values={}, starts={}), Search.__new__(Search)

    def climbed(stand: Footing, item: Imperfection, *, few: bool, least: float) -> Footing:
        gain = 50.0 if item is pump else 0.5 * own
        return replace(stand, held=gain, few=gain, added=(Added(what=item, trained=gain, held=gain),))

    tried = [(SimpleNamespace(climbed=climbed), item, 9.0) for item in (pump, flow)]
    monkeypatch.setattr(further, "late_together", lambda *_: None)
    monkeypatch.setattr(further, "worth_fitting", lambda *_: tried)
    monkeypatch.setattr(further, "_joint", lambda *_: None)
    monkeypatch.setattr(
        further, "added_together", lambda _, stand, more, **_how: replace(stand, held=40.0, added=tuple(more))
    )
    search.tell, search.refused = lambda _: None, {}
    found = further.better(search, stand)
    assert found is not None
    assert [item.what.by for item in found.added] == [kept if place == "h" else "pump"]


@pytest.mark.parametrize(("factor", "kept"), [(0.99, ["flow/usual"]), (1.01, ["metal_side.e", "flow/usual"])])
def test_what_the_law_speaks_of_comes_first(factor: float, kept: list[str]) -> None:
    """A curve over something else has to gain a quarter more."""
    gains = {"flow/usual": 40.0, "metal_side.e": 40.0 * FOREIGN * factor, "load": 3.0}
    found = likeliest_curves((curve_over(by, foreign=by != "flow/usual"), gain) for by, gain in gains.items())
    assert [(item.by, gain) for item, gain in found] == [(by, gains[by]) for by in kept]


def test_of_a_power_and_a_bow_the_power_is_kept_that_explains_as_much() -> None:
    """Whatever a bow gains has the power beside it; over something else or of another parameter it is its own."""
    power = curve_over("flow", foreign=False)
    bend = Bend(Name("flow"), "flow", 1.0, 0.1, bowed=True)
    bow = replace(power, kind=Kind.BOW, bend=bend)
    assert power_of(bow).key == power.key
    others = [(replace(bow, place="k"), 100.0), (replace(bow, bend=replace(bend, by=Name("load"))), 100.0)]
    assert further.plainest([(power, 98.0), (bow, 100.0), *others]) == [(power, 98.0), *others]
    assert further.plainest([(power, 90.0), (bow, 100.0)]) == [(power, 90.0), (bow, 100.0)]


def footing_with(stand: Footing, held: float, *items: Imperfection) -> Footing:
    """Give where some imperfections lead, all of the same gain."""
    return replace(stand, held=held, added=tuple(Added(what=item, trained=held, held=held) for item in items))


def test_of_curves_that_explain_as_much_the_gentlest_is_kept() -> None:
    """A power of 2 over a pressure that hardly moves says much of where that never was; the others are named."""
    stand = Footing(graph=parse_model(COOLER), values={}, starts={})
    steep = replace(curve_over("film.e", foreign=False), size=1.97)
    bend = Bend(X, "flow", 1.0, 0.1, bowed=True)
    bow = replace(curve_over("flow", foreign=False), kind=Kind.BOW, size=-0.03, bend=bend)
    bowed = footing_with(stand, 917.0, replace(power_of(bow), size=0.024), bow)
    other = footing_with(stand, 950.0, replace(steep, place="k"))
    slow = footing_with(stand, 912.0, Imperfection(kind=Kind.ABSOLUTE, place="film.f"))
    pressure = footing_with(stand, 926.0, steep)
    kept = further.gentlest(stand, [pressure, slow, bowed, other])
    assert [item.added[-1].what.key for item in kept] == [item.added[-1].what.key for item in (slow, bowed, other)]
    assert [item.added[-1].alike for item in kept] == [(), (steep,), ()]
    assert [len(item.added) for item in kept] == [1, 2, 1]  # with the power beside it
    # What explains clearly more is kept however steep it is, and one over what the law speaks of before another.
    clear = footing_with(stand, 1000.0, steep)
    assert further.gentlest(stand, [clear, bowed]) == [clear, bowed]
    foreign = footing_with(stand, 926.0, replace(steep, size=0.001, foreign=True))
    (own,) = further.gentlest(stand, [foreign, pressure])
    assert own.added[-1].what == steep


@pytest.mark.parametrize(
    ("bend", "change"),
    [(Bend(X, "x", 3.0, 0.1), 2.0), (Bend(X, "x", 3.0, 0.1, bowed=True), 2.0), (Bend(X, "x", 3.0), 1.0)],
)
def test_how_steep_a_curve_is(bend: Bend, change: float) -> None:
    """By what its factor changes from the usual size to twice that, up or down."""
    usual, twice = bend.logarithm(np.array([3.0, 3.0 * change]))
    assert bend.steepness(0.7) == bend.steepness(-0.7)
    if bend.least:
        assert bend.steepness(0.7) == pytest.approx(0.7 * (twice - usual))
    else:
        assert bend.steepness(0.7) == pytest.approx(0.7 * bend.logarithm(np.array([3.0]))[0])


def test_a_power_that_came_with_its_bow_has_no_gain_of_its_own() -> None:
    """Nobody asked what it would gain alone."""
    power = replace(curve_over("flow", foreign=False), size=0.02)
    graph = parse_model(COOLER)
    assert _added_row(graph, Added(what=power, trained=0.0, held=0.0))[5:] == ("with its bow", "")
    assert _added_row(graph, Added(what=power, trained=12.0, held=-3.0))[5:] == ("+12", f"{MINUS}3")


def test_a_bow_has_a_power_beside_it_unless_that_is_there() -> None:
    """Nobody knows where it has its end; what was added before is not added twice."""
    bow = replace(curve_over("flow", foreign=False), kind=Kind.BOW, bend=Bend(X, "flow", 1.0, 0.1, bowed=True))
    stand = Footing(graph=parse_model(COOLER), values={}, starts={})
    found = further.powers_beside(stand, [bow, curve_over("flow", foreign=False)])
    assert [(item.kind, item.bend, item.size) for item in found] == [(Kind.CURVE, Bend(X, "flow", 1.0, 0.1), 0.0)]
    assert further.powers_beside(replace(stand, values={"h_by_flow": 0.1}), [bow]) == []


@pytest.mark.parametrize(
    ("loss", "bent", "without", "is_kept"),
    [
        (WORTH - 0.1, 50.0, 100.0, False),
        (WORTH + 0.1, 50.0, 100.0, True),
        (50.0, WORTH - 0.1, 98.0, False),  # once all else follows it is not missed
        (50.0, WORTH - 0.1, 90.0, True),  # as it seemed; it is
    ],
)
def test_a_curve_of_no_use_is_left_out(
    loss: float, bent: float, without: float, is_kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was added with it or later explains what it did; it is not tried again."""
    graph = parse_model(COOLER)
    curve = Imperfection(kind=Kind.CURVE, place="h", bend=Bend(Name("flow"), "flow", 3e-4, 1e-4), size=0.01)
    stand = Footing(
        graph=with_imperfections(graph, (curve,)),
        values={},
        starts={},
        held=100.0,
        bent={curve.key: bent},
        added=(Added(what=curve, trained=9.0, held=9.0),),
    )
    search = Search.__new__(Search)
    search.tell, search.refused, search.graph, search.step = lambda _: None, {}, graph, 10.0
    search.missed, climbs = set(), [0]
    monkeypatch.setattr(search, "asking", lambda _: ({}, lambda tried: [0.0] * len(tried)))

    def gains_of(_: Footing, tried: Sequence[Imperfection]) -> FloatArray:
        assert [item.size for item in tried] == [0.0]
        return np.array([-loss])

    def climbed(begin: Footing) -> Footing:
        climbs[0] += 1
        return replace(begin, held=without)

    ground = SimpleNamespace(gains_of=gains_of, climbed=climbed)
    monkeypatch.setattr(Search, "ground", lambda *_, **__: ground)
    found = search.lasting(stand)
    assert bool(found.added) == is_kept
    assert not is_kept or search.lasting(stand) is stand
    assert climbs[0] == (loss < WORTH or bent < WORTH)  # what is missed is not left out again
    assert ("h_by_flow" in [item.name for item in found.graph.parameters]) == is_kept
    assert search.refused == ({} if is_kept else {curve.key: np.inf})


@pytest.mark.parametrize(
    ("lost", "climbs", "kept"), [(SURE, [True], "hk"), (0.9 * SURE, [True, False], "hk"), (1.0, [True, False], "h")]
)
@pytest.mark.parametrize("few_are_all", [False, True])
def test_what_few_recordings_miss_much_is_not_fitted_to_all_without(
    lost: float, climbs: list[bool], kept: str, monkeypatch: pytest.MonkeyPatch, *, few_are_all: bool
) -> None:
    """A climb with all recordings follows where few of them leave it open; it begins where these have led.

    Where few are all, that is one climb.
    """
    bend, asked = Bend(Name("flow"), "flow", 1.0, 0.1), list[bool]()
    h, k = (Imperfection(kind=Kind.CURVE, place=name, bend=bend) for name in "hk")
    more = [Added(what=item, trained=9.0, held=9.0) for item in (h, k)]
    stand = Footing(graph=parse_model(COOLER), values={"UA": 1.0}, starts={})
    found = replace(stand, held=200.0, added=tuple(more), values={"UA": 2.0})

    def together(_: Search, begin: Footing, more: Sequence[Added], *, few: bool = False, **__: float) -> Footing:
        assert begin.values["UA"] == (2.0 if few or few_are_all else 3.0)
        asked.append(few)
        return replace(begin, held=200.0 - lost, added=tuple(more), values={"UA": 3.0})

    monkeypatch.setattr(further, "added_together", together)
    search = Search.__new__(Search)
    search.tell, search.few_are_all = lambda _: None, few_are_all
    ended = further._without_needless(search, stand, found, more)
    assert asked == ([False] if few_are_all else climbs)
    assert "".join(item.what.place for item in ended.added) == kept


@pytest.mark.parametrize(
    ("worth", "kept"),
    [
        ({"slow": 0.0, "h": 50.0, "k": 40.0}, "hk"),  # the slow error stood for both
        ({"slow": 0.0, "h": 50.0, "k": 2.0}, "h"),  # one does what the other does, too
        ({"slow": 50.0, "h": 50.0, "k": 2.0}, "sh"),
        ({"slow": 50.0, "h": 50.0, "k": 2.0, "k as the hill bends": 0.9 * SURE}, "sh"),
        ({"slow": 50.0, "h": 50.0, "k": 2.0, "k as the hill bends": SURE}, "shk"),  # so it is not tried without
        ({"slow": 50.0, "h": 2.0, "k": 2.0}, "s"),
        ({"slow": 50.0, "h": 50.0, "k": 50.0}, "shk"),
    ],
)
def test_a_curve_beside_others_has_to_be_needed(
    worth: dict[str, float], kept: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is added together with a curve may do what it does: it is asked for without it."""
    slow = Imperfection(kind=Kind.ABSOLUTE, place="slow", memory=50.0)
    items = [
        slow,
        *(Imperfection(kind=Kind.CURVE, place=name, bend=Bend(Name("flow"), "flow", 1.0, 0.1)) for name in "hk"),
    ]
    stand = Footing(graph=parse_model(COOLER), values={}, starts={})

    def together(_: Search, stand: Footing, more: Sequence[Added], **how: float) -> Footing:
        assert bool(stand.starts) == bool(how)  # without one of them it begins where all of them have led
        bent = {item.what.key: worth.get(f"{item.what.place} as the hill bends", 0.0) for item in more}
        held, starts = sum(worth[item.what.place] for item in more), {"oil.e": np.ones(1)}
        return replace(stand, held=held, added=tuple(more), bent=bent, starts=starts)

    def climbed(
        stand: Footing, item: Imperfection, *, few: bool, least: float
    ) -> Footing:  # alone each does what the others do
        held = 30.0 - items.index(item)
        return replace(stand, held=held, added=(Added(what=item, trained=held, held=held),))

    monkeypatch.setattr(further, "added_together", together)
    monkeypatch.setattr(further, "late_together", lambda *_: None)
    monkeypatch.setattr(
        further, "worth_fitting", lambda *_: [(SimpleNamespace(climbed=climbed), item, 9.0) for item in items]
    )
    monkeypatch.setattr(further, "FEWEST", 0.5)
    search = Search.__new__(Search)
    search.tell, search.refused, search.few_are_all = lambda _: None, {}, False
    found = further.better(search, stand)
    assert found is not None
    assert "".join(item.what.place[0] for item in found.added) == kept


@pytest.mark.parametrize(
    ("bend", "told"),
    [
        (
            Bend(Binary("/", Name("flow"), Name("usual")), "flow", 0.94, 0.2),
            "h goes with flow/usual to the power -0.25, beside what its law says, so with 0.55 where it has 0.8; "
            "its value is that at 0.94",
        ),
        (
            Bend(Name("film.e"), "film_e", 12.0, 1.0, signed=True),
            "h goes with the size of film.e to the power -0.25, beside what its law says; its value is that at 12 K",
        ),
        (Bend(Name("film.e"), "film_e", 12.0), "h is exp(-0.25 film.e/12 K) times what it is where film.e is 0"),
        (
            Bend(Name("flow"), "flow", 1e-3 / 6, 1e-5),
            "h goes with flow to the power -0.25, beside what its law says; its value is that at 10 l/min",
        ),
    ],
)
def test_a_curve_is_told_in_words(bend: Bend, told: str) -> None:
    """With which power the law would be right, where it states one, and where the parameter has its value."""
    item = Imperfection(kind=Kind.CURVE, place="h", bend=bend, size=-0.25)
    assert _curve_words(parse_model(COOLER), item) == told.replace("-", MINUS)


def recorded(folder: Path, exponent: float, seed: int, bow: float = 0.0) -> Path:
    """Give a recording of a cooler whose film goes with the flow to a power, made by hand in steps of a second.

    With a bow that power is another one for each flow.
    """
    rng = np.random.default_rng(seed)
    flow, load, t_in, oil, metal, rows = 20.0, 2000.0, 18.0, 40.0, 28.0, []
    for k in range(900):
        rows.append([10.0 * k, flow, load, t_in, *(np.array([oil, metal]) + 0.05 * rng.standard_normal(2))])
        if k % 60 == 0:
            flow, load, t_in = rng.uniform(6.0, 40.0), rng.uniform(800.0, 5000.0), rng.uniform(16.0, 20.0)
        rows[-1][1:4] = flow, load, t_in
        for _ in range(10):
            power = exponent + bow * np.log(flow / 20.0)
            through, out = 180.0 * (oil - metal), 260.0 * (flow / 20.0) ** power * (metal - t_in)
            oil, metal = oil + (load - through) / 60e3, metal + (through - out) / 30e3
    path = folder / f"{seed}.csv"
    names = ["time", "flow", "load", "t_in", "t_oil", "t_metal"]
    write_recording(path, dict(zip(names, np.array(rows).T, strict=True)))
    return path


@pytest.mark.parametrize("exponent", [0.55, 0.8])
def test_another_power_is_found(exponent: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a film that carries heat with the flow to the power 0.55, not 0.8; to a law that is right nothing is added.

    What recordings would lose without a curve, as the hill bends at its top, is about what they do lose, or both are
    much.
    """
    losses, climb = list[tuple[float, float]](), Ground.climbed

    def climbed(ground: Ground, stand: Footing, *more: Imperfection, **options: Any) -> Footing:
        found = climb(ground, stand, *more, **options)
        losses.extend((found.bent[item.key], found.few - stand.few) for item in more if item.kind is Kind.CURVE)
        return found

    monkeypatch.setattr(Ground, "climbed", climbed)
    monkeypatch.setattr(attempt, "smallest_faults", lambda *_, **__: [])
    model, target = tmp_path / "model.yaml", tmp_path / "records.jsonl"
    model.write_text(COOLER, encoding="utf-8")
    made = [recorded(tmp_path, exponent, seed) for seed in (1, 2)]
    words = ["fit", *map(str, (model, *made)), "--until-quiet", "--starts", "1", "-o", str(tmp_path / "quiet.yaml")]
    assert main([*words, "--json", str(target)]) == DONE
    quiet = json.loads(target.read_text(encoding="utf-8").splitlines()[-1])
    assert quiet["quiet"]
    assert [(item["kind"], item["of"], item["over"]) for item in quiet["added"]] == (
        [] if exponent == 0.8 else [("curve", "h", "flow/usual")]
    )
    first = (tmp_path / "quiet.yaml").read_text(encoding="utf-8").partition("\n")[0]
    assert first.startswith("# Fitted to ")
    assert ("Added: curve of h over flow/usual." in first) == bool(quiet["added"])
    if quiet["added"]:
        power = load_model(tmp_path / "quiet.yaml").parameter("h_by_flow")
        assert power.nominal == pytest.approx(exponent - 0.8, abs=4.0 * power.accuracy)
        assert power.accuracy < 0.01
        assert len(losses) > 1
    for told, lost in losses:  # of more, noise takes its part
        assert min(told, 5.0 * SURE) == pytest.approx(min(lost, 5.0 * SURE), rel=0.5, abs=3.0)


def test_what_is_largest_somewhere_between_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A film that carries most at some flow beside what its law says, which is no power of it: a bow, and its place."""
    monkeypatch.setattr(attempt, "smallest_faults", lambda *_, **__: [])
    model, target, output = tmp_path / "model.yaml", tmp_path / "records.jsonl", tmp_path / "quiet.yaml"
    model.write_text(COOLER, encoding="utf-8")
    made = [recorded(tmp_path, 0.75, seed, bow=-0.15) for seed in (1, 2)]
    words = ["fit", *map(str, (model, *made)), "--until-quiet", "--starts", "1", "-o", str(output)]
    assert main([*words, "--json", str(target)]) == DONE
    quiet = json.loads(target.read_text(encoding="utf-8").splitlines()[-1])
    assert quiet["quiet"]
    assert {(item["kind"], item["of"], item["over"]) for item in quiet["added"]} == {
        ("curve", "h", "flow/usual"),
        ("bow", "h", "flow/usual"),
    }
    bow = load_model(output).parameter("h_bow_by_flow")
    assert bow.nominal == pytest.approx(-0.15, abs=4.0 * bow.accuracy)
    assert bow.accuracy < 0.01
    assert "% smaller where flow/usual is half of" in " ".join(capsys.readouterr().out.split())


def bent_cooler(inside: frozenset[str] = frozenset(), more: str = "") -> tuple[BondGraph, list[Imperfection], Ground]:
    """The oil cooler with a curve and a bow of its film, as a search without recordings takes it."""
    graph = parse_model(COOLER + more)
    bow = replace(
        curve_over("flow", foreign=False), kind=Kind.BOW, bend=Bend(Name("flow"), "flow", 1.0, 0.1, bowed=True)
    )
    new = [power_of(bow), bow]
    bent = with_imperfections(graph, tuple(new))
    model = build_step_model(build_plant(bent))
    begin = FitPoint(values=np.zeros(0), starts=np.zeros((0, 2)), sizes=np.zeros((0, 2)))
    fake = SimpleNamespace(
        own=(), graph=graph, parameters=tuple(enumerate(graph.parameters)), inside=inside, few=(), trained=(),
        believed=frozenset(), step=1.0, longest=100.0, begin=begin, columns=model.states,
    )  # fmt: skip
    return graph, new, Ground(cast(Search, fake), bent, model, lambda: cast(Likelihood, None))


@pytest.mark.parametrize(("few", "most"), [(True, 0.05), (False, 1e-3)])
def test_a_climb_that_compares_ends_earlier(few: bool, most: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of what is kept a thousandth of the gain may be left; where candidates compare, some hundredths.

    A step is worth what who compares says.
    """
    graph, (power, _), ground = bent_cooler()
    left: list[Finish] = []

    def stop(*_: object, finish: Finish, **__: object) -> None:
        left.append(finish)
        raise InterruptedError

    monkeypatch.setattr(ground_module, "ascend", stop)
    with pytest.raises(InterruptedError):
        ground.climbed(Footing(graph=graph, values={}, starts={}), power, few=few, least=7.0)
    assert len(left) == 1
    assert most / 10.0 < left[0].part <= most
    assert left[0].nats == 7.0


def test_what_compares_need_not_be_known_better_than_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    """A climb behind one that gained 5000 nats ends where a step brings less than 50; the first one knows of none."""
    items = [curve_over(name, foreign=False) for name in ("a", "b", "c")]
    stand, search = Footing(graph=parse_model(COOLER), values={}, starts={}), Search.__new__(Search)
    search.tell, search.refused, asked = lambda _: None, {}, list[float]()

    def climbed(stand: Footing, item: Imperfection, *, few: bool, least: float) -> Footing:
        assert few
        asked.append(least)
        return replace(stand, few=[5000.0, 800.0, 0.0][len(asked) - 1], held=-1.0)

    monkeypatch.setattr(further, "late_together", lambda *_: None)
    monkeypatch.setattr(
        further, "worth_fitting", lambda *_: [(SimpleNamespace(climbed=climbed), x, 9.0) for x in items]
    )
    assert further.better(search, stand) is None
    assert asked == [0.2, 50.0, 50.0]


def test_a_slow_error_may_be_as_large_as_declared_again() -> None:
    """A climb begins with it as it was found; what is added may leave it as much as was declared, and no more."""
    graph, _, ground = bent_cooler(more="slow_error: {out.f: 50 W over 600 s}")
    (error,) = graph.slow_errors
    stand = Footing(graph=graph, values={}, starts={}, slow={(error.target, error.relative): 0.1 * error.sd})
    q = ground.q_of(stand)
    plant, place = ground.plant(q), ground.layout.first_noise + ground.layout.n_y
    k = int(np.flatnonzero(plant.unknowns.places == place)[0])
    assert q[place] == pytest.approx(np.log(0.1 * error.sd))
    assert plant.unknowns.upper[k] == pytest.approx(np.log(error.sd))
    assert plant.unknowns.nominal[k] == pytest.approx(np.log(error.sd))


@pytest.mark.parametrize("higher", [0.0, -0.4])
def test_a_curve_begins_straight_where_that_is_higher(monkeypatch: pytest.MonkeyPatch, higher: float) -> None:
    """As it was found in another climb only where that is no worse: other values had made room for it there."""
    graph, (power, bow), ground = bent_cooler()
    begun: list[float] = []

    def place(plant: FittedPlant) -> int:
        return next(k for k, item in enumerate(plant.unknowns.parameters) if item.name == "h_by_flow")

    def height(plant: FittedPlant, _: object, point: FitPoint) -> float:
        return -abs(float(point.values[place(plant)] * plant.unknowns.parameters[place(plant)].scale) - higher)

    def stop(plant: FittedPlant, _: object, point: FitPoint, *__: object, **___: object) -> None:
        begun.append(float(point.values[place(plant)] * plant.unknowns.parameters[place(plant)].scale))
        raise InterruptedError

    monkeypatch.setattr(ground_module, "likelihood_value", height)
    monkeypatch.setattr(ground_module, "ascend", stop)
    values = {item.name: item.nominal for item in graph.parameters}
    with pytest.raises(InterruptedError):
        ground.climbed(Footing(graph=graph, values=values, starts={}), replace(power, size=-0.4), bow)
    assert begun == pytest.approx([higher])


def test_what_is_kept_at_an_end_follows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A parameter that is kept from straying stands at its end: what a curve gains is asked with it there."""
    seen = dict[str, bool]()
    graph, new, ground = bent_cooler(inside=frozenset({"h"}))
    values = {item.name: item.nominal * (3.0 if item.name == "h" else 1.0) for item in graph.parameters}

    def evaluated(plant: FittedPlant, *_: object) -> Evaluation:
        seen.update(dict.fromkeys((item.name for item in plant.unknowns.parameters), False))
        n = len(plant.unknowns.places)
        return Evaluation(value=0.0, score=np.zeros(n), information=np.eye(n))

    def gains(_: Evaluation, prior: FloatArray, moves: BoolArray, groups: Sequence[Sequence[int]]) -> list[float]:
        names = list(seen)
        seen.update(zip(names, moves.tolist(), strict=False))
        assert [[names[k] for k in group] for group in groups] == [["h_by_flow"], ["h_bow_by_flow", "h_by_flow"]]
        assert {names[k] for k in np.flatnonzero(prior == 0.0)} == {"h_by_flow", "h_bow_by_flow"}
        return [1.0, 2.0]

    monkeypatch.setattr(ground_module, "evaluate_likelihood", evaluated)
    monkeypatch.setattr(ground_module, "score_gains", gains)
    assert ground.gains_once_all_follows(Footing(graph=graph, values=values, starts={}), new) == [1.0, 2.0]
    assert {name for name, moves in seen.items() if not moves} == {"h", "h_by_flow", "h_bow_by_flow"}
