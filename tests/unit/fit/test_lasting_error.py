"""Slow errors of sensors that last as long as what alarms, where shorter ones, or none, leave a model loud."""

from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import pytest

from faultbond.app import attempt
from faultbond.app.attempt import Attempt, put_on_trial, raised_until_quiet
from faultbond.app.engine import build_watcher
from faultbond.contract.samples import Sample
from faultbond.fit.imperfections import Imperfection, Kind
from faultbond.fit.innovations import Variant
from faultbond.fit.lasting_error import as_noise, lasting_errors
from faultbond.fit.outcome import NoiseFound
from faultbond.fit.samples import healthy_recording
from faultbond.fit.trial import LASTING, ROOM, enough, on_trial
from faultbond.model.graph import BondGraph, SlowError
from faultbond.model.text import parse_model
from faultbond.report.fit_result import Fitted
from faultbond.report.resized import Resized
from faultbond.simulate import Inputs, simulate
from faultbond.synthesis.compile import find_compiler
from made import samples_of
from winding import MODEL

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
TRUTH = MODEL.replace("R: 3 ohm", "R: 3.3 ohm").replace("nominal: 2.5 H", "nominal: 2.2 H")
NOISE, ROWS, PROMISE = 0.05, 4000, 3600.0
LASTS = 300  # samples of half of a wave


SHORT = NoiseFound(  # what a fit says of a slow error that is replaced
    of=SlowError(target="i", sd=NOISE, relative=False, memory=0.02, is_sensor=True),
    declared=NOISE,
    found=NOISE,
    sd=0.001,
)


@dataclass(frozen=True, kw_only=True)
class Known:
    """What is asked of a fit here."""

    graph: BondGraph
    noises: tuple[NoiseFound, ...] = ()


def off(graph: BondGraph, size: float) -> tuple[Sample, ...]:
    """Samples of the winding whose current is off by a wave of that size, in its noise."""
    time = np.asarray(0.02 * np.arange(ROWS), dtype=np.float64)
    u = np.asarray(20.0 * (1.0 + np.arange(ROWS) // 100 % 2), dtype=np.float64)[:, None]
    made = simulate(graph, Inputs(time=time, values=u), seed=3)
    wave = size * NOISE * np.sin(np.pi * np.arange(ROWS) / LASTS)
    return samples_of(time, made.inputs, made.outputs + wave[:, None])


def attempted(text: str, size: float) -> Attempt:
    """The model of a text on trial with such samples."""
    graph = parse_model(text, file="m.yaml")
    core = build_watcher(graph)
    records = (healthy_recording("healthy", off(parse_model(TRUTH), size), core),)
    return Attempt(
        text=text,
        graph=graph,
        core=core,
        records=records,
        fitted=cast("Fitted", Known(graph=graph, noises=(SHORT,))),
        health=on_trial(core, records, PROMISE, factors=()),
        alarms={},
    )


def told(step: str) -> None:
    """Hear what is being done."""


@pytest.mark.parametrize(("size", "extra"), [(0.6, ""), (1.0, "slow_error: {i: 0.05 A over 0.02 s}\n")])
def test_an_error_as_long_as_what_alarms_leaves_noise_as_it_is(size: float, extra: str) -> None:
    """A current that is off for seconds: in place of noise several times as large, an error that lasts as long."""
    loud = attempted(TRUTH + extra, size)
    assert loud.health.peak > 1.0
    ((new, before),) = lasting_errors(loud.graph, loud.health)
    assert (before is not None) is bool(extra)
    assert LASTING * 0.02 < new.memory < 2 * LASTS * 0.02
    quiet, raised, lasting = raised_until_quiet(loud, PROMISE, told)
    assert quiet.health.has_room
    assert lasting == (new,)
    (error,) = quiet.graph.slow_errors
    assert error.target == "i"
    assert error.memory == pytest.approx(new.memory, rel=0.1)
    least, times = as_noise(NOISE, before), {item.what: item.times for item in raised}
    assert least * 0.999 <= times.get("noise of i", 1.0) <= least * 1.25
    assert (quiet.fitted.noises == ()) is bool(extra)
    alone = enough(loud.core, loud.records, PROMISE)
    assert alone is None or np.max(alone.noise) > 1.5


def test_where_noise_a_little_larger_is_enough_nothing_else_is_declared() -> None:
    """One step of noise costs less than an error that is as large as the noise."""
    loud = attempted(TRUTH, 0.3)
    assert lasting_errors(loud.graph, loud.health) != ()
    quiet, raised, lasting = raised_until_quiet(loud, PROMISE, told)
    assert quiet.health.has_room
    assert (lasting, len(quiet.graph.slow_errors)) == ((), 0)
    assert raised != ()


def test_what_is_not_quiet_with_it_is_made_so_without(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the monitor itself alarms on what takes less, what takes more is put on trial, too."""

    def on_trial_of(text: str, *more: Any) -> Attempt:
        found = put_on_trial(text, *more)
        return replace(found, alarms={"healthy": 1.0}) if "slow_error" in text else found

    monkeypatch.setattr(attempt, "put_on_trial", on_trial_of)
    quiet, raised, lasting = raised_until_quiet(attempted(TRUTH, 0.6), PROMISE, told)
    assert quiet.quiet
    assert ([item.what for item in raised], lasting) == (["noise of i"], ())


def test_what_is_not_quiet_yet_is_raised_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where wider accuracies let parameters move: what is told is how much larger all is in the end."""
    turns = []

    def too_little_at_first(*of: Any, **more: Any) -> Variant | None:
        turns.append(of)
        found = enough(*of, **more)
        return Variant(noise=(1.1,)) if len(turns) == 1 else found

    monkeypatch.setattr(attempt, "enough", too_little_at_first)
    monkeypatch.setattr(attempt, "lasting_errors", lambda *_: ())
    loud = attempted(TRUTH, 0.3)
    quiet, raised, _ = raised_until_quiet(loud, PROMISE, told)
    assert quiet.quiet
    assert len(turns) == 2
    ((what, times),) = ((item.what, item.times) for item in raised)
    assert what == "noise of i"
    assert times == pytest.approx(quiet.graph.sensors[0].noise / loud.graph.sensors[0].noise, rel=0.02)
    assert times > 1.1


def test_what_a_lasting_error_replaces_later_is_no_longer_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither a slow error that was raised before, nor one that lasted less."""
    loud = attempted(TRUTH, 0.3)
    first, then = (Imperfection(kind=Kind.ABSOLUTE, place="i", memory=memory) for memory in (1.0, 9.0))
    noise, slow = (Resized(what=what, times=1.5) for what in ("noise of i", "slow error of i"))
    turns = iter([((noise, slow), (first,)), ((), (then,)), ((), ())])
    monkeypatch.setattr(attempt, "_raised_once", lambda *_: (loud, *next(turns)))
    monkeypatch.setattr(Attempt, "quiet", property(lambda _: False))
    assert raised_until_quiet(loud, PROMISE, told)[1:] == ((noise,), (then,))


def test_what_would_be_louder_than_may_be_in_the_end_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each turn for itself raises by less."""
    monkeypatch.setattr(attempt, "enough", lambda *_, **_more: Variant(noise=(7.0,)))
    monkeypatch.setattr(attempt, "lasting_errors", lambda *_: ())
    monkeypatch.setattr(Attempt, "quiet", property(lambda _: False))
    _, raised, _ = raised_until_quiet(attempted(TRUTH, 0.3), PROMISE, told)
    assert [item.times for item in raised] == [7.0]


@pytest.mark.parametrize(
    ("size", "extra"),
    [(0.0, ""), *((2.0, f"slow_error: {{i: {size}}}\n") for size in ("0.05 A over 2 s", "1 % over 0.02 s"))],
)
def test_what_is_quiet_or_lasts_already_gets_none(size: float, extra: str) -> None:
    """Nor does a sensor whose slow error is a part of what it reads."""
    found = attempted(TRUTH + extra, size)
    assert lasting_errors(found.graph, found.health) == ()


def test_what_scatters_gets_none() -> None:
    """A sensor that scatters three times as much as declared is no longer off."""
    found = attempted(TRUTH.replace("50 mA", "15 mA"), 0.0)
    assert found.health.peak > ROOM
    assert lasting_errors(found.graph, found.health) == ()


@pytest.mark.parametrize(("samples", "lasts"), [(5, LASTING), (50, 50), (3000, 0.25 * (ROWS - 1))])
def test_it_lasts_as_long_as_the_highest_climb_took(samples: int, lasts: float) -> None:
    """But no shorter than what is much like noise, and no longer than a quarter of a recording."""
    found = attempted(TRUTH, 0.6)
    climbs = np.zeros_like(found.health.watches[0].climbs)
    climbs[1, 100 : 101 + samples, 0] = np.arange(samples + 1)
    climbs[0, 4 : 4 + samples // 2, 0] = 1.0
    seen = replace(found.health, watches=(replace(found.health.watches[0], climbs=climbs),))
    ((new, _),) = lasting_errors(found.graph, seen)
    assert new.memory == pytest.approx(0.02 * lasts)
