"""Blend, error index, limit and detection rule of method `classic`, as they work and as printed."""

import numpy as np
import pytest

from faultbond.thesis.online.indices import (
    add_error,
    exceeds,
    indices_of,
    limits_of,
    trust_in_samples,
    weights_of,
)
from faultbond.thesis.online.settings import PRINTED, Erratum, Settings

USUAL = Settings()


def printed(*errata: Erratum) -> Settings:
    """Settings with some printed formulas."""
    return Settings(printed=frozenset(errata))


def test_trust_is_that_of_a_recursive_mean_at_ten_percent_noise() -> None:
    """With N = 0.1 and n = 1 the share of the newest sample is 1/(1 + T)."""
    found = [trust_in_samples(USUAL, 0.1, 1.0, samples) for samples in range(5)]
    assert found == pytest.approx([1.0, 1 / 2, 1 / 3, 1 / 4, 1 / 5])


def test_printed_trust_freezes_the_first_estimate() -> None:
    """The printed formula leaves 1/101 to the second sample, and trusts samples more where they are noisier."""
    assert trust_in_samples(printed(Erratum.TRUST), 0.1, 1.0, 1) == pytest.approx(1 / 101)
    assert trust_in_samples(printed(Erratum.TRUST), 0.2, 1.0, 1) > trust_in_samples(printed(Erratum.TRUST), 0.1, 1.0, 1)
    assert trust_in_samples(USUAL, 0.2, 1.0, 1) < trust_in_samples(USUAL, 0.1, 1.0, 1)


def test_accuracy_is_left_in_the_end() -> None:
    """The share of the samples ends at 1 - n; printed it ends at 0 for every n, and begins at n."""
    assert trust_in_samples(USUAL, 0.1, 0.93, 10**9) == pytest.approx(0.07)
    assert trust_in_samples(USUAL, 0.1, 0.0, 50) == 1.0
    as_printed = printed(Erratum.ACCURACY)
    assert trust_in_samples(as_printed, 0.1, 0.93, 10**9) == pytest.approx(0.0, abs=1e-8)
    assert trust_in_samples(as_printed, 0.1, 0.93, 0) == 0.93


def test_weight_begins_at_nothing() -> None:
    """From the limit to four times the limit the weight goes from 0 to 1; printed it jumps to 1/4 first."""
    size = np.array([0.5, 1.0, 2.5, 4.0, 9.0])
    small = np.ones(5)
    assert weights_of(USUAL, size, small) == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0])
    assert weights_of(printed(Erratum.WEIGHT), size, small) == pytest.approx([0.0, 0.25, 0.625, 1.0, 1.0])
    assert weights_of(USUAL, size, np.zeros(5)) == pytest.approx(np.ones(5))


def test_index_is_the_fraction_of_the_thesis() -> None:
    """The recursion gives the sums over all past samples with their products of forgetting factors."""
    generator = np.random.default_rng(3)
    measured, weights = generator.normal(size=(40, 2)), generator.uniform(0, 1, size=(40, 2))
    errors = generator.uniform(0, 1, size=(40, 2, 3))
    weights[7] = 0.0
    sums = np.zeros((2, 2, 3))
    for k in range(40):
        sums = add_error(USUAL, sums, measured[k], errors[k], weights[k])
    above, below = np.zeros((2, 3)), np.zeros((2, 3))
    for n in range(40):  # E_n F_(n-1) ... F_0 W_n
        k = 39 - n
        kept = np.prod(1.0 - 0.02 * weights[k + 1 :], axis=0)[:, None]
        above += errors[k] * kept * weights[k][:, None]
        below += np.abs(measured[k])[:, None] * kept * weights[k][:, None]
    assert indices_of(sums) == pytest.approx(above / below)


def test_a_sample_without_weight_changes_nothing() -> None:
    """Neither sum moves where W is 0, and the index of nothing is 0."""
    sums = np.array([[[0.5]], [[2.0]]])
    assert np.array_equal(add_error(USUAL, sums, np.array([3.0]), np.array([[1.0]]), np.zeros(1)), sums)
    assert indices_of(np.zeros((2, 1, 4))).tolist() == [[0.0] * 4]


def test_printed_error_is_divided_twice() -> None:
    """With the error of figure 5.11 the index of a steady error falls with the size of the output."""
    for size in (1.0, 10.0):
        sums = add_error(
            printed(Erratum.PERCENT), np.zeros((2, 1, 1)), np.array([size]), np.array([[0.1 * size]]), np.ones(1)
        )
        assert indices_of(sums)[0, 0] == pytest.approx(0.1 / size)


def test_limit_falls_from_all_to_what_noise_and_model_explain() -> None:
    """It begins at 1 and ends at 1.5 times noise and model errors together; printed, model errors count nothing."""
    noise, model = np.array([0.02, 0.02]), np.array([0.03, 0.0])
    assert limits_of(USUAL, noise, model, 0) == pytest.approx([1.0, 1.0])
    assert limits_of(USUAL, noise, model, 95)[0] == pytest.approx(0.075 + 0.925 / np.e)
    assert limits_of(USUAL, noise, model, 10**6) == pytest.approx([0.075, 0.03])
    assert limits_of(printed(Erratum.LIMIT), noise, model, 10**6) == pytest.approx([0.03, 0.03])
    assert limits_of(USUAL, noise, np.full(2, 5.0), 10**6) == pytest.approx([1.0, 1.0])


def test_any_output_alarms_unless_its_index_falls() -> None:
    """Above the limit and not decreasing, each output by itself; printed, the average of all."""
    limit = np.array([0.03, 0.03])
    index, before = np.array([0.01, 0.04]), np.array([0.01, 0.035])
    assert exceeds(USUAL, index, before, limit).tolist() == [False, True]
    assert exceeds(USUAL, before, index, limit).tolist() == [False, False]
    assert not exceeds(printed(Erratum.AVERAGE), index, before, limit).any()
    assert exceeds(printed(Erratum.AVERAGE), index * 3, before, limit).all()


def test_every_erratum_says_where_it_stands() -> None:
    """All switches together are the printed algorithm, and each names a section."""
    assert frozenset(Erratum) == PRINTED
    assert all(item.value.partition(":")[0].replace(".", "").isdigit() for item in Erratum)
