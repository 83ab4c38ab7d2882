"""What comes behind otherwise than by one store: drives with a highest rate, and dead times."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from faultbond.app import quiet_fit
from faultbond.fit import delays, further, quiet_search
from faultbond.fit.delays import late_ones
from faultbond.fit.foothold import Added, Footing, with_orders
from faultbond.fit.further import plainest
from faultbond.fit.ground import LAGS, Ground
from faultbond.fit.imperfections import Imperfection, Kind, found_in, lag_of, with_imperfections, without_lag
from faultbond.fit.likelihood import layout_of, nominal_q
from faultbond.fit.quiet_search import NO_LAG, Search
from faultbond.model.text import load_model, parse_model
from faultbond.report.quiet_result import amended_text
from faultbond.synthesis.engine import build_model
from quieted import quiet_record
from winding import MODEL

TRUE = MODEL.replace("3 ohm", "3.05 ohm").replace("50 mA", "20 mA")
STEP = 0.02  # s
LIMIT = Imperfection(kind=Kind.RATE_LIMIT, place="V", size=12.0, memory=0.06)


def steps(seed: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Give a command that steps every 0.8 s."""
    return np.repeat(np.random.default_rng(seed).choice([-4.0, -1.0, 2.0, 5.0], 30), 40)


def test_a_highest_rate_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A source that moves by 12 V/s at most is told as that, with its lag, and no store and no error stand for it."""
    monkeypatch.setattr(quiet_fit, "smallest_of_each", lambda *_: [(), ()])
    found = quiet_record(
        tmp_path, MODEL, TRUE.replace("{unit: V}", "{unit: V, lag: 0.06 s, rate_limit: 12 V/s}"), steps, STEP
    )
    (added,) = found["added"]
    assert (added["kind"], added["of"]) == ("rate limit", "V")
    assert added["size"] == pytest.approx(12.0, rel=0.02)
    assert found["quiet"]
    graph = load_model(tmp_path / "new.yaml")
    assert [item.name for item in graph.parameters if item.suspect] == ["R", "L", "V_rate_limit"]
    assert graph.parameter("V_rate_limit").nominal == pytest.approx(12.0, rel=0.02)
    assert graph.parameter("V_lag").nominal == pytest.approx(0.06, rel=0.2)
    assert graph.parameter("R").nominal == pytest.approx(3.05, rel=0.01)
    assert graph.parameter("L").nominal == pytest.approx(2.5, rel=0.02)
    told = " ".join(capsys.readouterr().out.split())
    assert "trusted V_lag: no fault is sought in it" in told


def test_a_dead_time_is_found_as_a_lag_in_stages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A sensor that comes 0.3 s behind in four stages is told so, its noise and the winding as they are."""
    monkeypatch.setattr(quiet_fit, "smallest_of_each", lambda *_: [(), ()])
    found = quiet_record(tmp_path, MODEL, TRUE.replace("20 mA", "20 mA, lag: {value: 0.3 s, order: 4}"), steps, STEP)
    (added,) = found["added"]
    assert (added["kind"], added["order"]) == ("lag", 4)
    assert added["of"] in "Vi"  # in a linear circuit both are the same
    graph = load_model(tmp_path / "new.yaml")
    assert graph.parameter(f"{added['of']}_lag").nominal == pytest.approx(0.3, rel=0.02)
    assert graph.parameter("L").nominal == pytest.approx(2.5, rel=0.02)
    assert graph.sensors[0].noise == pytest.approx(0.02, rel=0.1)
    told = " ".join(capsys.readouterr().out.split())
    assert "lag in 4 stages" in told
    assert f"trusted {added['of']}_lag: no fault is sought in it, unless the model says `suspect: yes` there" in told


def test_a_rate_limit_brings_a_lag_of_its_own() -> None:
    """Where the input lags already it keeps that; either reads back from the text with both numbers."""
    graph = parse_model(MODEL)
    limited = with_imperfections(graph, (LIMIT,))
    assert (limited.inputs[0].lag, limited.inputs[0].rate_limit) == ("V_lag", "V_rate_limit")
    assert [item.nominal for item in limited.parameters[-2:]] == [0.06, 12.0]
    assert limited.parameter("V_rate_limit").unit.text == "V/s"
    assert [item.suspect for item in limited.parameters[-2:]] == [False, True]  # as in a file
    layout, q = layout_of(build_model(limited)), nominal_q(build_model(limited))
    (found,) = found_in(limited, layout, q, (replace(LIMIT, size=1.0, memory=1.0),))
    assert (found.size, found.memory) == pytest.approx((12.0, 0.06))
    lagging = with_imperfections(graph, (Imperfection(kind=Kind.LAG, place="V", size=0.5, order=2),))
    both = with_imperfections(lagging, (LIMIT,))
    assert (both.parameter("V_lag").nominal, both.inputs[0].order) == (0.5, 2)
    assert quiet_search._opened(LIMIT, 0.08) == replace(LIMIT, memory=0.08)  # steps are easy for a lag of some samples
    back = parse_model(amended_text(MODEL, graph, [Added(what=LIMIT, trained=1.0, held=1.0)]))
    assert [back.parameter(name).nominal for name in ("V_lag", "V_rate_limit")] == [0.06, 12.0]
    lag = replace(lag_of(LIMIT), size=0.4, order=3)
    back = parse_model(amended_text(MODEL, graph, [Added(what=item, trained=1.0, held=1.0) for item in (LIMIT, lag)]))
    assert (back.parameter("V_lag").nominal, back.inputs[0].order) == (0.4, 3)


def test_an_order_changes_how_a_declared_lag_comes() -> None:
    """Only that is written, beside the value that was declared."""
    text = MODEL.replace("noise: 50 mA", "noise: 50 mA, lag: 0.3 s")
    order = Imperfection(kind=Kind.ORDER, place="i", is_sensor=True, size=4.0)
    graph = parse_model(text)
    assert with_imperfections(graph, (order,)).sensors[0].order == 4
    back = parse_model(amended_text(text, graph, [Added(what=order, trained=1.0, held=1.0)]))
    assert (back.parameter("i_lag").nominal, back.sensors[0].order) == (0.3, 4)


def chosen(gains: Sequence[tuple[Imperfection, float]], monkeypatch: pytest.MonkeyPatch) -> tuple[Search, Footing]:
    """Give what a round keeps of what was tried, each with what it foretells, and the search."""
    stand = Footing(graph=parse_model(MODEL), values={}, starts={})
    search = Search.__new__(Search)
    search.tell, search.refused = lambda _: None, {}
    found = [
        replace(stand, held=x, unknown=float(-k), added=(Added(what=item, trained=x, held=x),))
        for k, (item, x) in enumerate(gains)
    ]

    def ground(footing: Footing) -> Any:
        return SimpleNamespace(climbed=lambda *_, **_how: footing)

    tried = [(ground(footing), item, 9.0) for footing, (item, _) in zip(found, gains, strict=True)]
    monkeypatch.setattr(further, "late_together", lambda *_: None)
    monkeypatch.setattr(further, "worth_fitting", lambda *_: tried)
    monkeypatch.setattr(further, "_joint", lambda *_: None)
    monkeypatch.setattr(
        further, "added_together", lambda _, stand, more, **_how: replace(stand, held=more[0].held, added=tuple(more))
    )
    better = further.better(search, stand)
    assert better is not None
    return search, better


LAG = Imperfection(kind=Kind.LAG, place="V", size=0.1)


def test_a_lag_that_does_as_well_is_kept_before_a_highest_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rate limit has a lag in it, so it is never worse: it is kept where it is better, and never named as good."""
    other = replace(LAG, place="i", is_sensor=True)
    _, found = chosen([(LAG, 990.0), (other, 985.0), (LIMIT, 1000.0)], monkeypatch)
    assert found.added[0].what == other  # the parameters are best known with that
    assert found.added[0].alike == (LAG,)
    _, found = chosen([(LAG, 700.0), (LIMIT, 1000.0)], monkeypatch)
    assert (found.added[0].what, found.added[0].alike) == (LIMIT, ())


def test_a_lag_is_refused_where_it_is_in_vain_in_one_stage_and_in_several(monkeypatch: pytest.MonkeyPatch) -> None:
    """One way that foretells more is enough; the other way is not named as being as good."""
    staged = replace(LAG, order=4)
    search, found = chosen([(LAG, 2.0), (staged, 100.0), (LIMIT, 1.0)], monkeypatch)
    assert set(search.refused) == {LIMIT.key}
    assert found.added[0].what == staged
    search, found = chosen([(LAG, 100.0), (staged, 101.0), (LIMIT, 1.0)], monkeypatch)
    assert found.added[0].alike == ()
    assert "in 4 stages" in staged.words


def test_of_ways_to_come_behind_the_plainest_is_kept_that_explains_as_much(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though parameters are better known with several stages, which all are followed by whoever watches."""
    staged, other = replace(LAG, order=4), replace(LAG, place="i", is_sensor=True)
    assert chosen([(LAG, 990.0), (staged, 1000.0)], monkeypatch)[1].added[0].what == LAG
    assert chosen([(LAG, 900.0), (staged, 1000.0)], monkeypatch)[1].added[0].what == staged
    given = [(LAG, 20.0), (staged, 24.0), (LIMIT, 24.0), (replace(other, order=4), 24.0), (other, 15.0)]
    assert plainest(given) == [(LAG, 20.0), (replace(other, order=4), 24.0), (other, 15.0)]


@pytest.mark.parametrize(
    ("peak", "follows", "size", "gain"),
    [(-30.0, 700.0, LAGS[0], 640.0), (50.0, 60.0, LAGS[2], 50.0), (50.0, 400.0, LAGS[2], 340.0)],
)
def test_a_lag_counts_by_what_it_gains_once_all_else_follows(
    peak: float, follows: float, size: float, gain: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where others have made room for it even the shortest loses at first; it begins as the best, or as that."""
    asked: list[float] = []

    def gains_of(_: Ground, __: Footing, tried: Sequence[Imperfection]) -> list[float]:
        return [peak if item.size == 0.1 * LAGS[2] else -60.0 - k for k, item in enumerate(tried)]

    def gains_once_all_follows(_: Ground, __: Footing, new: Sequence[Imperfection]) -> list[float]:
        asked.extend(item.size for item in new)
        return [follows]

    monkeypatch.setattr(Ground, "gains_of", gains_of)
    monkeypatch.setattr(Ground, "gains_once_all_follows", gains_once_all_follows)
    ground = Ground.__new__(Ground)
    ground.search = cast("Any", SimpleNamespace(step=0.1, longest=10.0))
    stand = Footing(graph=parse_model(MODEL), values={}, starts={})
    found, promised = ground.best_late(stand, LAG)
    assert asked == [pytest.approx(0.1 * LAGS[0])]
    assert found.size == pytest.approx(0.1 * size)
    assert promised == gain
    form = replace(LAG, kind=Kind.HOLD, size=7.0)
    assert ground.best_late(stand, form) == (form, -60.0)
    assert len(asked) == 1


def fitted_of(
    monkeypatch: pytest.MonkeyPatch, gains: dict[tuple[Kind, str, int], float], size: float
) -> tuple[list[Imperfection], list[Imperfection]]:
    """Give what a round asks for, and what it fits, of what would gain by kind, place and stages; lags of a size."""
    asked, lags = (
        list[Imperfection](),
        [Imperfection(kind=kind, place=place) for kind, place, order in gains if order == 1],
    )

    def weighed(_: object, __: object, items: Sequence[Imperfection]) -> list[tuple[Imperfection, Imperfection, float]]:
        asked.extend(items)
        return [(item, replace(item, size=size), gains[item.kind, item.place, item.order]) for item in items]

    search = SimpleNamespace(
        step=1.0, trained=(), refused={}, idle={}, all=SimpleNamespace(model=SimpleNamespace(direct=())),
        profile=lambda _: [], curves=lambda _: [], ground_with=lambda *_: None,
    )  # fmt: skip
    monkeypatch.setattr(further, "late_ones", lambda *_: [(item, 100.0) for item in lags])
    monkeypatch.setattr(further, "other_holds", lambda *_: [])
    monkeypatch.setattr(further, "_weighed", weighed)
    tried = further.worth_fitting(cast("Any", search), Footing(graph=parse_model(MODEL), values={}, starts={}))
    return asked, [item for _, item, _ in tried]


@pytest.mark.parametrize(
    ("size", "gain", "asked_of", "fitted"),
    [(0.9, 200.0, [1], [1]), (1.1, 200.0, [1, 4], [1, 4]), (1.1, 102.0, [1, 4], [1])],
)
def test_stages_are_asked_for_where_a_lag_is_longer_than_a_sample(
    size: float, gain: float, asked_of: list[int], fitted: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within one nobody sees them; and they are fitted where they promise more than the lag of one stage."""
    gains = {(Kind.LAG, "V", 1): 100.0, (Kind.LAG, "V", 4): gain}
    asked, tried = fitted_of(monkeypatch, gains, size)
    assert [item.order for item in asked] == asked_of
    assert sorted(item.order for item in tried) == fitted


def test_a_rate_limit_takes_no_place_of_a_lag_that_promises_as_much(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of all that seems to come behind three are fitted; that of an input is among them in its plainest way."""
    gains = {(Kind.RATE_LIMIT, "V", 1): 105.0, (Kind.LAG, "V", 1): 101.0, (Kind.LAG, "a", 1): 103.0}
    gains |= {(Kind.LAG, "b", 1): 102.0, (Kind.LAG, "c", 1): 90.0}
    _, tried = fitted_of(monkeypatch, gains, 0.5)
    assert {(item.kind, item.place) for item in tried} == {(Kind.LAG, "V"), (Kind.LAG, "a"), (Kind.LAG, "b")}


def test_what_is_added_says_the_order_of_its_lag() -> None:
    """An order that is found after the lag is part of it, with what both gained; one of a declared lag stands alone."""
    lag = Added(what=Imperfection(kind=Kind.LAG, place="i", size=0.3), trained=5.0, held=4.0)
    order = Added(what=Imperfection(kind=Kind.ORDER, place="i", size=4.0), trained=2.0, held=1.0)
    other = replace(order, what=replace(order.what, place="V"))
    found = with_orders((lag, order, other))
    assert [(item.what.kind, item.what.place, item.what.order) for item in found] == [
        (Kind.LAG, "i", 4),
        (Kind.ORDER, "V", 1),
    ]
    assert (found[0].trained, found[0].held) == (7.0, 5.0)
    plain = without_lag(with_imperfections(parse_model(MODEL), (replace(lag.what, order=4),)), lag.what)
    assert plain.sensors[0].lag == ""


def promised(text: str, values: Sequence[float]) -> dict[Imperfection, float]:
    """Give what may come behind, with what it seems to explain, of a model and a recording of its input."""
    record = SimpleNamespace(u=np.asarray(values)[:, None], time=0.5 * np.arange(float(len(values))))
    off = np.zeros((len(values), 1))
    graph = parse_model(text)
    stand = SimpleNamespace(graph=graph, innovations=(off,), expected=(off + np.asarray(values)[:, None],))
    return dict(late_ones(cast("Any", stand), cast("Any", (record,))))


def proposed(text: str, values: Sequence[float]) -> set[tuple[Kind, str, float]]:
    """Give what may come behind: kind, of what, and how large."""
    return {(item.kind, item.place, item.size) for item in promised(text, values)}


def test_commands_may_have_a_highest_rate() -> None:
    """As large as the largest move at first; what stands still has none, nor what is measured, nor one that has it."""
    limit = (Kind.RATE_LIMIT, "V", 6.0)
    assert limit in proposed(MODEL, [0.0] * 10 + [3.0] * 10)
    assert limit[0] not in {kind for kind, *_ in proposed(MODEL, [3.0] * 20)}
    for stated in ("noise: 0.1 V", "noise: 0.1 V, noise_of: record", "hold: linear"):
        measured = MODEL.replace("{unit: V}", f"{{unit: V, {stated}}}")
        assert limit not in proposed(measured, [0.0] * 10 + [3.0] * 10)
    stated = MODEL.replace("{unit: V}", "{unit: V, lag: 1 s, rate_limit: 2 V/s}")
    assert limit[0] not in {kind for kind, *_ in proposed(stated, [0.0] * 10 + [3.0] * 10)}


def test_a_command_is_asked_for_a_lag_where_it_is_for_a_highest_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its lag may not show by itself; but where nobody asks for it a rate limit, which has one in it, stands for it."""
    monkeypatch.setattr(delays, "explained", lambda *_: 100.0)
    monkeypatch.setattr(delays, "_gone_with", lambda *_: 1.0)
    found = promised(MODEL, [0.0] * 10 + [3.0] * 10)
    assert {(item.kind, item.place): x for item, x in found.items()} == {
        (Kind.LAG, "i"): 100.0,
        (Kind.LAG, "V"): 100.0,
        (Kind.RATE_LIMIT, "V"): 100.0,
    }


def test_what_lags_may_do_so_in_other_stages() -> None:
    """In those that it does not have; what does not lag may do so in one or in several."""
    rows = [0.0] * 10 + [3.0] * 10
    stated = proposed(MODEL.replace("50 mA", "50 mA, lag: {value: 1 s, order: 2}"), rows)
    assert {size for kind, place, size in stated if (kind, place) == (Kind.ORDER, "i")} == {1.0, 4.0}
    assert (Kind.LAG, "i") not in {(kind, place) for kind, place, _ in stated}
    assert not {place for kind, place, _ in proposed(MODEL, rows) if kind is Kind.ORDER}


def test_a_lag_beside_a_highest_rate_is_not_left_out() -> None:
    """However short it is: the rate is of what lags."""
    search = Search.__new__(Search)
    search.graph, search.step = parse_model(MODEL), 1.0
    lag = Added(what=replace(lag_of(LIMIT), size=0.9 * NO_LAG), trained=9.0, held=9.0)
    stand = Footing(graph=search.graph, values={}, starts={}, added=(lag,))
    assert search._spent_lags(stand) == [lag]
    assert not search._spent_lags(replace(stand, added=(lag, Added(what=LIMIT, trained=9.0, held=9.0))))


def test_a_lag_that_is_none_goes_where_the_time_is_up() -> None:
    """All else stays as it stands, the lag of another column too."""
    search = Search.__new__(Search)
    search.graph, search.step = parse_model(MODEL), 1.0
    kinds = (("V", 0.9 * NO_LAG, False), ("i", 1.1 * NO_LAG, True))
    lags = tuple(Imperfection(kind=Kind.LAG, place=place, size=x, is_sensor=is_one) for place, x, is_one in kinds)
    added = tuple(Added(what=item, trained=9.0, held=9.0) for item in lags)
    stand = Footing(graph=with_imperfections(search.graph, lags), values={}, starts={}, held=5.0, added=added)
    left = search.without_spent_lags(stand)
    assert (left.added, left.held) == (added[1:], 5.0)
    assert (left.graph.input("V").lag, [item.lag for item in left.graph.sensors]) == ("", ["i_lag"])


@pytest.mark.parametrize("loops", [frozenset[tuple[str, str]](), frozenset({("i", "V")})])
def test_no_transient_error_is_asked_of_a_sensor_in_a_loop(
    loops: frozenset[tuple[str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A slow error of it is; and a transient one where the input does not answer it."""
    slow = Imperfection(kind=Kind.ABSOLUTE, place="i", is_sensor=True)
    after = replace(slow, kind=Kind.TRANSIENT, after="V")
    search = Search.__new__(Search)
    search.tell, search.possible, search.trained = lambda _: None, (slow, after), ()
    search.all = cast("Any", SimpleNamespace(model=SimpleNamespace(direct=((),))))
    monkeypatch.setattr(search, "asking", lambda _: ({}, lambda tried: [1.0] * len(tried)))
    monkeypatch.setattr(search, "_sizes", lambda *_: (1.0,))
    monkeypatch.setattr(search, "_memories", lambda _: (1.0,))
    monkeypatch.setattr(quiet_search, "in_a_loop", lambda *_: loops)
    asked = search.profile(Footing(graph=parse_model(MODEL), values={}, starts={}))
    assert {item.kind for item, _ in asked} == ({Kind.ABSOLUTE} if loops else {Kind.ABSOLUTE, Kind.TRANSIENT})
