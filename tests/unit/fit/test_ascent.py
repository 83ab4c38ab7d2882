"""The climb to the most probable values."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faultbond.arrays import FloatArray
from faultbond.fit import ascent
from faultbond.fit.ascent import AT_ONCE, LONGEST, Finish, Summit, as_bent, ascend
from faultbond.fit.objective import Evaluation, FitPoint, FittedPlant


def test_a_precision_bends_as_steps_have_seen() -> None:
    """Along the last step it is what that saw, it stays symmetric and positive, and n steps tell all of a parabola."""
    rng = np.random.default_rng(5)
    root, expected = rng.standard_normal((2, 4, 4))
    hill, precision = root @ root.T + np.eye(4), expected @ expected.T + np.eye(4)
    steps = list(np.linalg.eigh(hill)[1].T)  # which know nothing of each other
    seen = [(step, hill @ step) for step in steps]
    for count in range(1, 5):
        bent = as_bent(precision, seen[:count])
        assert bent == pytest.approx(bent.T)
        assert np.linalg.eigvalsh(bent).min() > 0.0
        assert bent @ steps[count - 1] == pytest.approx(hill @ steps[count - 1])
    assert bent == pytest.approx(hill)


def test_a_hill_that_bends_upwards_tells_nothing() -> None:
    """A step after which the slope has risen, or hardly fallen, leaves the precision as it was; so does no step."""
    precision, step = np.diag([1.0, 2.0]), np.array([1.0, 0.5])
    for fell in (-step, 1e-3 * step, np.zeros(2)):
        assert np.array_equal(as_bent(precision, [(step, fell)]), precision)
    assert np.array_equal(as_bent(precision, [(np.zeros(2), np.zeros(2))]), precision)


def unknowns(lower: FloatArray, upper: FloatArray, *, logarithmic: bool) -> tuple[FittedPlant, FitPoint]:
    """A plant of which numbers within these ends, (n,), are sought, and zero to begin at."""
    n = len(lower)
    sought = SimpleNamespace(
        n_theta=n, logarithmic=np.full(n, logarithmic), nominal=np.zeros(n), lower=lower, upper=upper
    )
    none = np.zeros((1, 0))
    return cast("FittedPlant", SimpleNamespace(unknowns=sought)), FitPoint(values=np.zeros(n), starts=none, sizes=none)


@given(data=st.data(), logarithmic=st.booleans(), damping=st.sampled_from([1e-7, 1e-3, 10.0]))
def test_a_step_leads_to_the_highest_place_within_reach(
    data: st.DataObject, damping: float, *, logarithmic: bool
) -> None:
    """There the slope is zero, or leads out of reach. Source: Karush, Kuhn, Tucker; Nocedal and Wright 2006, 12.1."""
    n = data.draw(st.integers(1, 5))
    rng = np.random.default_rng(data.draw(st.integers(0, 10_000)))
    lower, upper = -rng.exponential(1.0, n), rng.exponential(1.0, n)
    lower[rng.random(n) < 0.3] = 0.0  # it stands at its end
    plant, begin = unknowns(lower, upper, logarithmic=logarithmic)
    hill = ascent._Hill(plant, (), begin.starts, np.full(n, 1e3), lambda _: None)
    root = rng.standard_normal((n, n))
    precision, slope = root @ root.T + 1e-3 * np.eye(n), 3.0 * rng.standard_normal(n)
    now = Summit(
        point=begin,
        evaluation=Evaluation(value=0.0, score=slope, information=precision),
        posterior=0.0,
        precision=precision,
        settled=False,
        steps=0,
    )
    move, promise = hill.move(now, precision, slope, damping)
    least, most = (np.clip(ends, -LONGEST, LONGEST) if logarithmic else ends for ends in (lower, upper))
    assert np.all((move >= least - 1e-9) & (move <= most + 1e-9))
    left = slope - precision @ move - damping * np.diag(precision) * move
    left *= 1.0 / np.sqrt(np.diag(precision))
    assert np.all(left[move < most - 1e-9] <= 1e-6)
    assert np.all(left[move > least + 1e-9] >= -1e-6)
    assert promise == pytest.approx(slope @ move - 0.5 * move @ precision @ move)
    assert promise >= 0.0


def test_what_hardly_shows_does_not_make_the_way_of_the_others_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two numbers one leads a little higher the farther it goes, without end; the other is found in two steps."""

    def valley(_plant: object, _records: object, point: FitPoint) -> Evaluation:
        clear, faint = point.values
        score = np.array([1e4 * (1.4 - clear), 1.0])
        value = -0.5e4 * (1.4 - clear) ** 2 + faint
        return Evaluation(value=float(value), score=score, information=np.diag([1e4, 1e-3]))

    monkeypatch.setattr(ascent, "evaluate_likelihood", valley)
    plant, begin = unknowns(np.full(2, -9.0), np.full(2, 9.0), logarithmic=True)
    summit = ascend(plant, (), begin, np.full(2, 1e9), turns=2)
    assert summit.point.values[0] == pytest.approx(1.4, abs=1e-2)


def one_unknown() -> tuple[FittedPlant, FitPoint]:
    """A plant of which one number is sought, and zero to begin at."""
    far = np.full(1, np.inf)
    return unknowns(-far, far, logarithmic=False)


def test_where_a_step_leads_down_the_highest_of_many_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """The hill is sharper than it looks: slopes are asked once in vain, and then only where it is best."""
    plant, begin = unknowns(np.array([-100.0]), np.array([100.0]), logarithmic=False)
    slopes, together = list[float](), list[list[float]]()

    def value(x: float) -> float:
        return -50.0 * (x - 0.2) ** 2

    def evaluated(_: object, __: object, point: FitPoint) -> Evaluation:
        (x,) = point.values.tolist()
        slopes.append(x)
        return Evaluation(value=value(x), score=np.array([100.0 * (0.2 - x)]), information=np.eye(1))

    def values(_: object, __: object, points: Sequence[FitPoint]) -> FloatArray:
        together.append([float(point.values[0]) for point in points])
        return np.array([value(x) for x in together[-1]])

    monkeypatch.setattr(ascent, "evaluate_likelihood", evaluated)
    monkeypatch.setattr(ascent, "likelihood_values", values)
    found = ascend(plant, (), begin, np.array([1e3]), turns=2)
    assert [len(item) for item in together] == [AT_ONCE, AT_ONCE]
    assert slopes[1] > 1.0  # which leads down
    assert slopes[2:] == [max(item, key=value) for item in together]
    assert found.posterior == pytest.approx(value(slopes[-1]), abs=1e-6)
    assert found.course == tuple(sorted(found.course))
    monkeypatch.setattr(ascent, "likelihood_values", lambda _, __, points: np.full(len(points), -np.inf))
    assert not ascend(plant, (), begin, np.array([1e3]), turns=2).settled  # none leads higher


@pytest.mark.parametrize(
    ("gains", "steps"),
    [
        ((1.0, 0.1, 0.1), 3),
        ((0.1, 0.1), 2),
        ((0.1, 1.0, 0.1, 1.0, 0.1, 0.1), 6),
        ((0.3, 0.3, 0.3, 0.1, 0.3, 0.1, 0.1), 7),
    ],
)
def test_a_climb_ends_after_two_steps_that_bring_nothing(
    monkeypatch: pytest.MonkeyPatch, gains: tuple[float, ...], steps: int
) -> None:
    """On a fold, where the slope promises much and each step brings less than settles, two in a row are enough."""
    heights = np.cumsum([0.0, *gains, *[1.0] * 20])
    found = iter(heights)

    def folded(*_: object) -> Evaluation:
        return Evaluation(value=float(next(found)), score=np.ones(1), information=np.eye(1))

    monkeypatch.setattr(ascent, "evaluate_likelihood", folded)
    plant, begin = one_unknown()
    summit = ascend(plant, (), begin, np.full(1, 1e9), turns=len(heights) - 1, finish=Finish(0.2))
    assert (summit.steps, summit.settled) == (1 + steps, False)
    assert summit.posterior == pytest.approx(heights[steps])


@pytest.mark.parametrize(("part", "left"), [(0.0, 0.2), (0.01, 10.0), (0.1, 100.0)])
def test_a_climb_that_compares_ends_near_its_summit(monkeypatch: pytest.MonkeyPatch, part: float, left: float) -> None:
    """Where the next step would bring a part of the 1000 nats that it gained; a smaller gain is found as before."""

    def steep(_plant: object, _records: object, point: FitPoint) -> Evaluation:
        x = float(point.values[0])  # each step halves what is left
        return Evaluation(
            value=top * (1.0 - (1.0 - x) ** 2), score=np.full(1, top * (1.0 - x)), information=np.eye(1) * top
        )

    monkeypatch.setattr(ascent, "evaluate_likelihood", steep)
    monkeypatch.setattr(ascent, "as_bent", lambda precision, _: precision * 2.0)
    plant, begin = one_unknown()
    for top in (1000.0, 1.0):
        summit = ascend(plant, (), begin, np.full(1, 1e9), turns=50, finish=Finish(0.2, part))
        below = top - summit.posterior
        assert summit.settled
        assert below < 8.0 * max(0.2, left * top / 1000.0)
        if top * part > 0.2:
            assert below > left / 8.0


@pytest.mark.parametrize(("count", "turns"), [(0, 10), (3, 10), (3, None)])
def test_a_climb_without_time_ends_where_it_is(monkeypatch: pytest.MonkeyPatch, count: int, turns: int | None) -> None:
    """After as many steps as there was time for, and it looks at no place around."""
    asked = iter(range(100))

    def steep(_plant: object, _records: object, point: FitPoint) -> Evaluation:
        x = float(point.values[0])
        return Evaluation(value=-1e3 * (1.0 - x) ** 2, score=np.full(1, 1e3 * (1.0 - x)), information=np.eye(1) * 1e3)

    monkeypatch.setattr(ascent, "evaluate_likelihood", steep)
    monkeypatch.setattr(ascent, "as_bent", lambda precision, _: precision * 4.0)
    plant, begin = one_unknown()
    finish = Finish(0.0, in_time=lambda: next(asked) < count)
    summit = ascend(plant, (), begin, np.full(1, 1e9), turns=turns, finish=finish)
    assert (summit.steps, len(summit.course), summit.settled) == (1 + count, 1 + count, False)


@pytest.mark.parametrize(
    ("top", "ahead", "ends_early"), [(990.0, True, False), (1100.0, True, True), (1100.0, False, False)]
)
def test_a_climb_that_stays_behind_another_one_ends(
    monkeypatch: pytest.MonkeyPatch, top: float, *, ahead: bool, ends_early: bool
) -> None:
    """One to 1000 nats of which each step brings half of what is left: at first it seems to lead to any height.

    ahead : whether the other one is at each step
    """

    def steep(_plant: object, _records: object, point: FitPoint) -> Evaluation:
        left = 1.0 - float(point.values[0])
        return Evaluation(value=1000.0 * (1.0 - left**2), score=np.full(1, 1000.0 * left), information=np.eye(1) * 1e3)

    monkeypatch.setattr(ascent, "evaluate_likelihood", steep)
    monkeypatch.setattr(ascent, "as_bent", lambda precision, _: precision * 2.0)
    plant, begin = one_unknown()
    whole = ascend(plant, (), begin, np.full(1, 1e9), turns=50)
    assert whole.settled
    assert whole.gained == pytest.approx(1000.0, abs=0.1)
    rival = replace(whole, posterior=top, course=(whole.course[0] + (2000.0 if ahead else -1.0),))
    summit = ascend(plant, (), begin, np.full(1, 1e9), turns=50, rival=rival)
    assert summit.settled is not ends_early
    assert (summit.steps < whole.steps) is ends_early
    assert summit.steps > ascent.LATELY
