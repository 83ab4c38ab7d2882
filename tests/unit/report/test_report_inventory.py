"""What `check` says of instruments, limits, false alarms and checks by hand."""

import io
import json

import pytest
from rich.console import Console

from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.graph import Check
from faultbond.model.text import parse_model
from faultbond.report.inventory import Inventory, _check_row, check_record, print_check
from faultbond.synthesis.specify import build_spec
from faultbond.types import CheckKind
from made import graph_of

MODEL = """\
name: vessel
sample_time: 1 s
inputs: {Q: {unit: l/min, suspect: no}}
components:
  pump: {type: Sf, law: f = G*Q, parameters: {G: 1}}
  vessel: {type: C, law: e = q/A, parameters: {A: 0.2 m^2}}
  outlet: {type: R, law: f = K*sqrt(e), parameters: {K: {nominal: 1e-4 m^2.5/s, limit: [5e-5, 2e-4 m^2.5/s]}}}
junctions: {node: 0}
bonds: [pump -> node -> vessel, node -> outlet]
sensors: {level: {reads: vessel.e, unit: cm, noise: 2 mm, range: [0, inf]}}
"""
MORE = """\
time_between_false_alarms: 30 days
checks: {outlet: 20, Q: {move: 2 l/min}, jug: {reads: outlet.f, unit: l/min, noise: 0.1 l/min}}
"""


@pytest.fixture(scope="module", params=["", MORE])
def seen(request: pytest.FixtureRequest) -> tuple[str, Inventory]:
    """The vessel without and with checks and a promise."""
    graph = parse_model(MODEL + request.param)
    model = build_step_model(build_plant(graph))
    return request.param, Inventory(graph=graph, model=model, spec=build_spec(model), engine="none")


def printed(seen: Inventory, *, settings: bool = False) -> str:
    """Give the listing with single spaces."""
    target = io.StringIO()
    print_check(Console(file=target), seen, settings=settings)
    return " ".join(target.getvalue().split())


def test_instruments_and_limits(seen: tuple[str, Inventory]) -> None:
    """The listing names trusted instruments, measuring ranges and limits in the units of the file."""
    text = printed(seen[1])
    assert "trusted Q" in text
    assert "range level 0 or more cm" in text
    assert "drifts matter at K 5e-5 m^2.5/s or 2e-4 m^2.5/s" in text


def test_the_numbers_of_the_method_are_shown_when_asked_for(seen: tuple[str, Inventory]) -> None:
    """Else a line says how to ask for them."""
    meaning = "CUSUM: limit at which it alarms"
    assert meaning in printed(seen[1], settings=True)
    assert meaning not in printed(seen[1])
    assert "numbers that no model states: `check --settings` shows them" in printed(seen[1])


def test_promise_and_checks(seen: tuple[str, Inventory]) -> None:
    """The promised time and the checks with their costs are listed where they are stated, and only there."""
    more, inventory = seen
    text = printed(inventory)
    words = ["false alarms one in 30 d", "outlet look at it 20", "Q move it by 2 l/min 1"]
    words += ["jug measure outlet.f, noise (sd) 0.1 l/min 1"]
    assert [word in text for word in words] == [bool(more)] * 4


def test_what_nobody_can_move() -> None:
    """The check of such an input says so, with its cost."""
    assert _check_row(Check(name="V", kind=CheckKind.INPUT, move=0.0), graph_of("dc_motor"))[1] == "cannot be moved"


def test_record(seen: tuple[str, Inventory]) -> None:
    """The record has the same in SI."""
    more, inventory = seen
    record = json.loads(json.dumps(check_record(inventory)))
    assert record["inputs"][0]["suspect"] is False
    assert (record["sensors"][0]["suspect"], record["sensors"][0]["range"]) == (True, [0.0, float("inf")])
    assert [item["limits"] for item in record["parameters"]] == [[], [], [5e-5, 2e-4]]
    assert record["time_between_false_alarms"] == (30 * 86400 if more else None)
    assert [item["kind"] for item in record["checks"]] == (["component", "input", "signal"] if more else [])


def test_a_resistance_below_zero_is_doubtful() -> None:
    """The listing and the record name a number of a sign that cannot be, and a healthy model has none."""
    graph = parse_model(
        MODEL.replace("limit: [5e-5, 2e-4 m^2.5/s]", "change: 100 %").replace("1e-4 m^2.5", "-1e-4 m^2.5")
    )
    model = build_step_model(build_plant(graph))
    doubtful = Inventory(graph=graph, model=model, spec=build_spec(model), engine="none")
    assert "doubtful K is -1e-4 m^2.5/s, so outlet gives power: state it above zero" in printed(doubtful)
    assert check_record(doubtful)["active"] == [{"component": "outlet", "numbers": ["K"]}]


def test_a_healthy_model_has_no_active_part(seen: tuple[str, Inventory]) -> None:
    """Where every sign is right nothing is doubtful."""
    assert check_record(seen[1])["active"] == []
    assert "doubtful" not in printed(seen[1])


def test_a_known_start_is_told_in_its_unit() -> None:
    """A start, and the size of a slow error without a unit of its own, have the unit that laws and units fix."""
    text = MODEL.replace("law: e = q/A,", "law: e = q/A, start: {q: 0.02 m^3, sd: 0.01 m^3},")
    graph = parse_model(text + "slow_error: {outlet.f: 1e-5 m^3/s over 600 s}\n")
    assert graph.signal_unit("vessel.q").text == "m^3"
    assert graph.signal_unit("nothing").text == ""
    model = build_step_model(build_plant(graph))
    told = printed(Inventory(graph=graph, model=model, spec=build_spec(model), engine="none"))
    assert "start: 0.02 ± 0.01 m^3" in told
    assert "SI" not in told.replace("SI unit", "")


def test_a_torque_is_no_energy() -> None:
    """Both are the same power of base units; an effort is never in joules, and a heat is."""
    shaft = (
        "name: s\nsample_time: 1 s\ninputs: {M: {unit: N*m}}\ncomponents: {drive: {type: Se, law: e = M}, J: {type: I, "
    )
    shaft += "parameters: {J: 2 kg*m^2}}}\nbonds: [drive -> J]\nsensors: {w: {reads: J.f, unit: rad/s, noise: 1 rad/s}}"
    assert parse_model(shaft).signal_unit("J.e").text == "N*m"
    heat = "name: h\nsample_time: 1 s\ninputs: {Q: {unit: W}}\ncomponents: {heater: {type: Sf, law: f = Q}, block: "
    heat += "{type: C, parameters: {C: 2 J/K}}}\nbonds: [heater -> block]\nsensors: {T: {reads: block.e, noise: 1 K}}"
    assert parse_model(heat).signal_unit("block.q").text == "J"


@pytest.mark.parametrize(("fitted", "guessed"), [("", True), (", fitted_range: [10 l/min, 20 l/min]", False)])
def test_what_no_data_fix_may_be_for_where_inputs_are_taken_to_be(fitted: str, *, guessed: bool) -> None:
    """A valve that is shut there says nothing; a fit writes where inputs were."""
    text = MODEL.replace("suspect: no}", f"suspect: no{fitted}}}")
    relief = """\
  relief: {type: R, law: "f = L*max(e - e0, 0)", parameters: {L: 1e-3 m^2/s, e0: {nominal: 90 m, suspect: no}}}
"""
    text = text.replace("  outlet:", f"{relief}  outlet:")
    model = build_step_model(build_plant(parse_model(text.replace("node -> outlet", "node -> outlet, node -> relief"))))
    told = printed(Inventory(graph=model.plant.graph, model=model, spec=build_spec(model), engine="none"))
    assert "L: no data fix such a change by itself; `analyse` tells why" in told
    assert ("(inputs as guessed: a `fit` writes where they were)" in told) == guessed
