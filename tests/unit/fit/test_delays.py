"""What errors go with: which inputs seem to be another between two rows."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.fit.delays import held_late, in_a_loop, other_holds
from faultbond.fit.hints import early_sensors
from faultbond.fit.imperfections import Kind
from faultbond.model.text import parse_model
from faultbond.types import Hold

GRAPH = parse_model("""
name: circuit
sample_time: 1 s
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 10 ohm}}
  C: {type: C, parameters: {C: 1 F}}
junctions: {one: 1}
bonds: [source -> one, one -> R, one -> C]
sensors: {v: {reads: C.e, unit: V, noise: 1 mV}}
""")
ROWS = 2000


def made(sign: float, ago: int = 0) -> tuple[FloatArray, FloatArray]:
    """Give an input in steps, and errors that go with these steps some rows ago."""
    rng = np.random.default_rng(4)
    u = np.repeat(rng.normal(size=ROWS // 20), 20)
    change = np.diff(u, prepend=u[:1])
    return u, rng.normal(size=ROWS) + sign * np.concatenate([np.zeros(ago), change[: ROWS - ago]])


def proposed(
    sign: float, *, ago: int = 0, way: float = 1.0, direct: tuple[int, ...] = (), hold: Hold = Hold.LAST
) -> list[Kind]:
    """Give what is proposed where errors go with the steps of an input some rows ago, and the plant goes a way."""
    u, off = made(sign, ago)
    graph = replace(GRAPH, inputs=(replace(GRAPH.inputs[0], hold=hold),))
    stand = SimpleNamespace(graph=graph, innovations=(off[:, None],), ways=np.array([[way]]))
    records = (SimpleNamespace(u=u[:, None]),)
    return [item.kind for item in other_holds(cast("Any", stand), cast("Any", records), (direct,))]


def test_an_error_in_the_row_of_a_change_asks_for_the_next_row() -> None:
    """One that comes a row later does not, nor one against the way the plant goes, as a controller makes it."""
    assert proposed(2.0) == [Kind.NEXT]
    assert proposed(-2.0, way=-1.0) == [Kind.NEXT]
    assert proposed(2.0, ago=1) == []
    assert proposed(-2.0) == []
    assert proposed(2.0, way=0.0) == []


@pytest.mark.parametrize(("size", "clear"), [(2.0, True), (0.4, False), (-2.0, False)])
def test_rows_clearly_hold_what_acted_until_then(size: float, *, clear: bool) -> None:
    """Where errors of the very row are most of the scatter; a few nats come of whatever else a model lacks."""
    u, off = made(size)
    stand = SimpleNamespace(graph=GRAPH, innovations=(off[:, None],), ways=np.array([[1.0]]))
    records = (SimpleNamespace(u=u[:, None]),)
    found = held_late(cast("Any", stand), cast("Any", records), ((),))
    assert [item.kind for item in found] == [Kind.NEXT] * clear
    assert held_late(cast("Any", stand), cast("Any", records), ((0,),)) == []
    late = SimpleNamespace(
        **(vars(stand) | {"graph": replace(GRAPH, inputs=(replace(GRAPH.inputs[0], hold=Hold.NEXT),))})
    )
    assert held_late(cast("Any", late), cast("Any", records), ((),)) == []


@pytest.mark.parametrize(
    ("sign", "ago", "in_loop"), [(2.0, 0, True), (-2.0, 0, True), (2.0, 1, False), (0.0, 0, False)]
)
def test_an_input_that_answers_a_reading_in_its_row_is_in_a_loop(sign: float, ago: int, *, in_loop: bool) -> None:
    """Whichever way the plant goes; one whose moves come before the errors is not, nor one that is felt at once."""
    u, off = made(sign, ago)
    stand = cast("Any", SimpleNamespace(graph=GRAPH, innovations=(off[:, None],)))
    records = cast("Any", (SimpleNamespace(u=u[:, None]),))
    assert in_a_loop(stand, records, ((),)) == (frozenset({("v", "V")}) if in_loop else frozenset())
    assert in_a_loop(stand, records, ((0,),)) == frozenset()


def test_what_is_there_already_is_not_asked_for() -> None:
    """An input that is held so by now, and a sensor that feels it at once, whose errors there may be of any law."""
    assert proposed(2.0, hold=Hold.NEXT) == []
    assert proposed(2.0, direct=(0,)) == []


@pytest.mark.parametrize(("direct", "told"), [((), ["v"]), ((0,), [])])
def test_a_sensor_that_feels_its_input_at_once_is_never_early(direct: tuple[int, ...], told: list[str]) -> None:
    """Its errors go with the row of a change, as those of any law that is wrong do."""
    u, off = made(2.0)
    output, known = SimpleNamespace(name="v", direct_inputs=direct), SimpleNamespace(name="V")
    spec = cast("Any", SimpleNamespace(outputs=(output,), inputs=(known,)))
    records = cast("Any", (SimpleNamespace(u=u[:, None]),))
    watch = SimpleNamespace(scores=off[:, None], ways=np.array([[1.0]]))
    found = early_sensors(spec, records, cast("Any", (watch,)))
    assert [item.sensor for item in found] == told


@pytest.mark.parametrize("hold", [Hold.LAST, Hold.LINEAR])
def test_of_an_input_that_goes_linearly_it_is_asked_too(hold: Hold) -> None:
    """It may have been taken for that before."""
    assert proposed(2.0, hold=hold) == [Kind.NEXT]
