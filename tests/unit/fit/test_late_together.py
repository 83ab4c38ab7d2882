"""Much that comes behind is asked for together, and what only seems to goes."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from faultbond.app import quiet_fit
from faultbond.arrays import FloatArray
from faultbond.errors import StructureError
from faultbond.fit import lags
from faultbond.fit.foothold import Added, Footing
from faultbond.fit.imperfections import Imperfection, Kind
from faultbond.fit.quiet_search import FEWEST
from faultbond.model.text import parse_model
from quieted import quiet_record

STEP = 0.05  # s
LADDER = """
name: ladder
sample_time: 50 ms
accuracy: 3 %
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R1: {type: R, law: e = R1*f, parameters: {R1: 1 kohm}}
  C1: {type: C, law: q = C1*e, parameters: {C1: 200 uF}}
  R2: {type: R, law: e = R2*f, parameters: {R2: 2 kohm}}
  C2: {type: C, law: q = C2*e, parameters: {C2: 150 uF}}
  load: {type: R, law: e = R3*f, parameters: {R3: 5 kohm}}
junctions: {line: 1, first: 0, between: 1, second: 0}
bonds: [source -> line, line -> R1, line -> first, first -> C1, first -> between, between -> R2, between -> second,
        second -> C2, second -> load]
sensors:
  v1: {reads: first.e, unit: V, noise: 10 mV}
  v2: {reads: second.e, unit: V, noise: 10 mV}
  i: {reads: line.f, unit: A, noise: 0.02 mA}
"""
LAGS = {"v1": 0.12, "v2": 0.2, "i": 0.15}


def steps(seed: int) -> FloatArray:
    """Give a voltage that steps every 1.5 s."""
    return np.repeat(np.random.default_rng(seed).choice([-4.0, -1.0, 2.0, 5.0], 40), 30)


@pytest.fixture(autouse=True)
def _no_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(quiet_fit, "smallest_of_each", lambda *_: [(), ()])


def test_sensors_that_all_lag_are_found_in_one_round(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each with its own time, in spite of an input that seems to lag as well."""
    truth = LADDER
    for name, time in LAGS.items():
        truth = truth.replace(f"{name}: {{reads", f"{name}: {{lag: {time} s, reads")
    found = quiet_record(tmp_path, LADDER, truth, steps, STEP)
    assert "together, since many seem to lag" in capsys.readouterr().err
    times = {item["of"]: item["size"] for item in found["added"] if item["kind"] == "lag"}
    assert times == {name: pytest.approx(time, rel=0.15) for name, time in LAGS.items()}
    assert found["quiet"]
    assert found["rounds"] <= 2


def test_one_input_that_lags_is_not_taken_for_its_sensors(tmp_path: Path) -> None:
    """All three come behind, and one lag explains it."""
    truth = LADDER.replace("{unit: V}", "{unit: V, lag: 0.15 s}")
    found = quiet_record(tmp_path, LADDER, truth, steps, STEP)
    assert [(item["kind"], item["of"]) for item in found["added"]] == [("lag", "V")]
    assert found["added"][0]["size"] == pytest.approx(0.15, rel=0.1)
    assert found["quiet"]


def test_several_inputs_that_lag_are_told_from_their_sensors(tmp_path: Path) -> None:
    """Two inputs come behind by times of their own, and one sensor; the other sensors only seem to."""
    model = LADDER.replace("{V: {unit: V}}", "{V: {unit: V}, drawn: {unit: A}}")
    model = model.replace("-> load]", "-> load, tap -> second]")
    model = model.replace("junctions:", "  tap: {type: Sf, law: f = -drawn}\njunctions:")
    truth = model.replace("unit: V}, drawn: {unit: A}", "unit: V, lag: 0.12 s}, drawn: {unit: A, lag: 0.25 s}")
    truth = truth.replace("i: {reads", "i: {lag: 0.15 s, reads")

    def moves(seed: int) -> FloatArray:
        drawn = np.repeat(np.random.default_rng(10 + seed).choice([0.0, 0.2e-3, 0.5e-3], 30), 40)
        return np.column_stack([steps(seed), drawn])

    found = quiet_record(tmp_path, model, truth, moves, STEP)
    times = {item["of"]: item["size"] for item in found["added"]}
    assert times == {name: pytest.approx(time, rel=0.1) for name, time in {"V": 0.12, "drawn": 0.25, "i": 0.15}.items()}
    assert found["quiet"]


def test_they_are_asked_for_together_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of three that seem to lag; where that is in vain, each is asked for by itself, and two are no crowd."""
    names, told = ["v1", "v2", "i"], list[str]()

    def hinted(*_: object) -> list[tuple[Imperfection, float]]:
        return [(Imperfection(kind=Kind.LAG, place=name, is_sensor=True), 100.0) for name in names]

    def without_order(*_: object) -> Any:
        raise StructureError

    monkeypatch.setattr(lags, "late_ones", hinted)
    search = SimpleNamespace(trained=(), step=STEP, idle={}, refused={}, asked_together=frozenset(), few_are_all=False)
    search.tell, search.ground_with = told.append, without_order
    stand = Footing(graph=parse_model(LADDER), values={}, starts={})
    seen = []
    for tried in (["v1", "v2"], ["v1", "v2", "i"], ["v1", "v2", "i"], ["v1", "v2", "i", "w"]):
        names[:] = tried
        assert lags.late_together(cast(Any, search), stand) is None
        seen.append(len(told))
    assert seen == [0, 1, 1, 2]


@pytest.mark.parametrize("few_are_all", [False, True])
@pytest.mark.parametrize(
    ("gained", "held", "sizes", "kept"),
    [
        (100.0, 50.0, (0.2, 0.2, 0.2), ["v1", "v2", "i"]),
        (100.0, 50.0, (0.2, 0.01, 0.2), ["v1", "i"]),  # one has come down to the least
        (100.0, 50.0, (0.01, 0.01, 0.01), None),
        (100.0, 2.0, (0.2, 0.2, 0.2), None),  # what was held back is foretold no better
        (4.0, 50.0, (0.2, 0.2, 0.2), None),  # nor what is fitted
        (100.0, -101.0, (0.2, 0.2, 0.2), None),  # what was held back loses more than few gain: no further climb
    ],
)
def test_lags_are_kept_that_last_where_they_foretell_better(
    gained: float,
    held: float,
    sizes: tuple[float, ...],
    kept: list[str] | None,
    monkeypatch: pytest.MonkeyPatch,
    *,
    few_are_all: bool,
) -> None:
    """What they gain together is told of the first; there is no further climb where the first had all recordings."""
    hints = [(Imperfection(kind=Kind.LAG, place=name, is_sensor=True), 100.0) for name in ("v1", "v2", "i")]
    stand, found = (
        Footing(graph=parse_model(LADDER), values={}, starts={}),
        dict(zip(("v1", "v2", "i"), sizes, strict=True)),
    )

    climbs: list[int] = []

    def climbed(begin: Footing, *asked: Imperfection, few: bool = False) -> Footing:
        climbs.append(len(asked))
        assert few is (not few_are_all and len(climbs) == 1)
        new = (Added(what=replace(x, size=found[x.place]), trained=gained, held=held) for x in asked)
        return replace(begin, few=begin.few + gained, held=begin.held + held, added=(*begin.added, *new))

    monkeypatch.setattr(lags, "late_ones", lambda *_: hints)
    search = SimpleNamespace(
        trained=(), step=STEP, idle={}, refused={}, asked_together=frozenset(), few_are_all=few_are_all
    )
    search.tell, search.ground_with = (lambda _: None), (lambda *_: SimpleNamespace(climbed=climbed))
    lagging = lags.late_together(cast(Any, search), stand)
    assert (None if lagging is None else [item.what.place for item in lagging.added]) == kept
    in_one = gained < FEWEST or held < -gained or max(sizes) < 0.1 or (few_are_all and min(sizes) > 0.1)
    assert len(climbs) == (1 if in_one else 2)
    if lagging is not None:
        assert [item.held for item in lagging.added] == [held, *[0.0] * (len(lagging.added) - 1)]


@pytest.mark.parametrize(
    ("inputs", "held", "sizes", "kept"),
    [
        (("V", "w"), 57.0, {"V": 0.2, "w": 0.3}, ["v1", "i", "V", "w"]),  # v2 has come down to the least
        (("V",), 57.0, {"V": 0.2, "w": 0.3}, ["v1", "v2", "i"]),  # of one input that tells nothing
        (("V", "w"), 57.0, {"V": 0.01, "w": 0.3}, ["v1", "i", "w"]),
        (("V", "w"), 57.0, {"V": 0.01, "w": 0.01}, ["v1", "v2", "i"]),  # inputs follow at once, as sensors do alone
        (("V", "w"), 52.0, {"V": 0.2, "w": 0.3}, ["v1", "v2", "i"]),  # a further lag has to foretell better,
        (("V", "w"), 55.0, {"V": 0.2, "w": 0.3, "v2": 0.1}, ["v1", "v2", "i"]),  # and two of them twice as much
    ],
)
def test_what_sensors_share_is_asked_of_several_inputs(
    inputs: tuple[str, ...], held: float, sizes: dict[str, float], kept: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Begun where inputs have what is common to all sensors, which keep the rest."""
    hints = [(Imperfection(kind=Kind.LAG, place=name, is_sensor=True), 100.0) for name in ("v1", "v2", "i")]
    hints += [(Imperfection(kind=Kind.LAG, place=name), 100.0) for name in inputs]
    hints.append((Imperfection(kind=Kind.RATE_LIMIT, place="w", size=1.0), 100.0))
    alone = {"v1": 0.4, "v2": 0.25, "i": 0.3}
    begun: list[dict[str, float]] = []

    def climbed(begin: Footing, *asked: Imperfection, **_: object) -> Footing:
        begun.append({item.place: item.size for item in asked})
        beside = any(not item.is_sensor for item in asked)
        assert not beside or [item.what.place for item in search.by_then.added] == list(alone)  # if it ends now
        found = {"v1": 0.2, "v2": 0.01, "i": 0.1} | sizes if beside else alone
        new = (Added(what=replace(x, size=found[x.place]), trained=9.0, held=9.0) for x in asked)
        return replace(begin, few=begin.few + 100.0, held=held if beside else 50.0, added=(*begin.added, *new))

    monkeypatch.setattr(lags, "late_ones", lambda *_: hints)
    search = SimpleNamespace(trained=(), step=STEP, idle={}, refused={}, asked_together=frozenset(), few_are_all=False)
    search.tell, search.ground_with = (lambda _: None), (lambda *_: SimpleNamespace(climbed=climbed))
    lagging = lags.late_together(cast(Any, search), Footing(graph=parse_model(LADDER), values={}, starts={}))
    assert lagging is not None
    assert [item.what.place for item in lagging.added] == kept
    if len(inputs) > 1:
        shared, least = 0.25, 0.2 * STEP
        left = {"v1": 0.4 - shared, "v2": least, "i": 0.3 - shared}
        assert begun[2] == pytest.approx(left | {"V": shared, "w": shared})
    else:
        assert len(begun) == 2
