"""Laws of method `classic` that hold whatever the numbers."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from faultbond import sets
from faultbond.thesis.online.indices import add_error, indices_of, limits_of, trust_in_samples
from faultbond.thesis.online.prefilter import filtered
from faultbond.thesis.online.ranking import CLIP, cleared_parts, hitting_indices
from faultbond.thesis.online.settings import Settings

USUAL = Settings()
SHARE = st.floats(0.0, 1.0)
WEIGHT = st.just(0.0) | st.floats(1e-9, 1.0)  # smaller ones would be lost to rounding in the sums


@given(noise=st.floats(1e-4, 1.0), accuracy=SHARE, samples=st.integers(0, 10_000))
def test_trust_falls_and_stays_a_share(noise: float, accuracy: float, samples: int) -> None:
    """P_A begins at 1, never rises, and never falls below 1 - n."""
    now, later = (trust_in_samples(USUAL, noise, accuracy, samples + k) for k in (0, 1))
    assert trust_in_samples(USUAL, noise, accuracy, 0) == 1.0
    assert 1.0 - accuracy - 1e-12 <= later <= now <= 1.0


@given(
    errors=st.lists(st.floats(0.0, 2.0), min_size=1, max_size=30),
    weights=st.lists(WEIGHT, min_size=30, max_size=30),
)
def test_index_is_a_mean_of_relative_errors(errors: list[float], weights: list[float]) -> None:
    """With an output of constant size the index lies between the smallest and the largest relative error taken in."""
    sums = np.zeros((2, 1, 1))
    taken = []
    for error, weight in zip(errors, weights, strict=False):
        sums = add_error(USUAL, sums, np.array([-3.0]), np.array([[3.0 * error]]), np.array([weight]))
        taken += [error] if weight > 0.0 else []
    index = indices_of(sums)[0, 0]
    if taken:
        assert min(taken) - 1e-9 <= index <= max(taken) + 1e-9
    else:
        assert index == 0.0


@given(noise=SHARE, model=SHARE, samples=st.integers(0, 1000))
def test_limit_never_rises(noise: float, model: float, samples: int) -> None:
    """The limit falls with time and stays above its end."""
    errors = np.array([0.0, model])
    now, later = (limits_of(USUAL, np.full(2, noise), errors, samples + k) for k in (0, 1))
    assert np.all(later <= now + 1e-12)
    assert np.all(later >= min(1.5 * noise, 1.0) - 1e-12)


@given(
    values=st.lists(st.floats(-1e3, 1e3), min_size=17, max_size=17),
    missing=st.sets(st.integers(0, 16), max_size=17),
    band=st.floats(0.0, 1e3),
)
def test_prefilter_stays_in_its_band(values: list[float], missing: set[int], band: float) -> None:
    """What is there is moved by no more than the band, and nothing is made of too little."""
    window = np.array(values)
    window[list(missing)] = np.nan
    found = filtered(window, 8, band)
    if np.isfinite(window[8]):
        assert abs(found - window[8]) <= band * (1 + 1e-9) + 1e-9
    else:
        assert np.isfinite(found) == (len(missing) <= 8)


SUSPECTS = tuple(range(5))


@st.composite
def judged_sets(draw: st.DrawFn) -> tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, ...], ...], list[float]]:
    """Hypotheses, the largest of them, and an error index for each of these."""
    size = draw(st.integers(1, 3))
    everything = [tuple(sorted(item)) for item in sets.hypotheses(SUSPECTS, size)]
    chosen = draw(st.lists(st.sampled_from(everything), min_size=1, unique=True))
    tested = tuple(tuple(sorted(item)) for item in sets.largest(chosen))
    errors = draw(st.lists(st.floats(0.0, 1.0), min_size=len(tested), max_size=len(tested)))
    return tuple(chosen), tested, errors


@given(made=judged_sets(), limit=SHARE)
@settings(max_examples=60)
def test_reasoning_is_that_of_the_sets(
    made: tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, ...], ...], list[float]], limit: float
) -> None:
    """Hitting indices and the hypotheses left are those of the plain algebra of sets (thesis 6.4.2, 6.6)."""
    hypotheses, tested, errors = made
    contains = np.array([[set(item) <= set(other) for other in tested] for item in hypotheses], dtype=bool)
    explains = np.array(errors) <= limit
    everyone = frozenset(SUSPECTS)
    by_conflict = {everyone - set(item): error for item, error in zip(tested, errors, strict=True)}
    wanted = [sets.hitting_index(item, by_conflict, CLIP) for item in hypotheses]
    assert np.allclose(hitting_indices(contains, np.array(errors)), wanted)
    verdicts = {frozenset(item): bool(told) for item, told in zip(tested, explains, strict=True)}
    left = sets.hypotheses_left(verdicts)
    found = cleared_parts(contains, explains) == 1.0
    assert [frozenset(item) in left for item in hypotheses] == found.tolist()


def test_settings_are_values() -> None:
    """Settings can be compared, hashed and changed in one place."""
    assert replace(USUAL, band=1.0) != USUAL
    assert hash(replace(USUAL, band=3.0)) == hash(USUAL)
