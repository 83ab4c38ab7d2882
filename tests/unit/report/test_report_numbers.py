"""Numbers, units and times as printed."""

import math

import pytest

from faultbond.report.numbers import (
    Notation,
    certainty_text,
    change_text,
    clock_text,
    coarse_clock_text,
    duration_text,
    figure,
    pace,
    probability_text,
    rounded_up,
    share_text,
    short,
    unit_text,
)


@pytest.mark.parametrize(
    ("value", "sd", "text"),
    [
        (4.4321e11, 6.2e9, "4.43e11 ± 0.06e11"),
        (4.4321e11, 1.2e9, "4.432e11 ± 0.012e11"),
        (64650.0, 123.0, "64650 ± 120"),
        (12.3456, 0.0345, "12.35 ± 0.03"),
        (1.00157262, 1.6e-13, "1.00157"),
        (1.1e-5, 2.1e-5, "1.1e-5 ± 2.1e-5"),
        (0.0, 0.5, "0.0 ± 0.5"),
        (-3.14159, 0.26, "-3.14 ± 0.26"),
        (-4e-8, 8.1e-7, "0 ± 8e-7"),
    ],
)
def test_digits_follow_the_standard_deviation(value: float, sd: float, text: str) -> None:
    """A number ends at the digit that its standard deviation makes doubtful."""
    assert figure(value, sd).both(Notation.FILE) == text


@pytest.mark.parametrize(("value", "text"), [(2.41e11, "2.41e11"), (130000.0, "1.3e5"), (3.0, "3"), (0.0, "0")])
def test_exact_numbers_have_no_trailing_zeros(value: float, text: str) -> None:
    """A number without standard deviation is printed as a person writes it."""
    assert figure(value).both(Notation.FILE) == text


@pytest.mark.parametrize(
    ("value", "near", "above"),
    [(523.1, "520", "530"), (12840.0, "13000", "13000"), (0.01234, "0.012", "0.013"), (2.31e-9, "2.3e-9", "2.4e-9")],
)
def test_two_digits_are_told_without_a_power_of_ten_where_that_is_short(value: float, near: str, above: str) -> None:
    """A size that is declared is rounded up, so that it is no less than what was found."""
    assert (short(value), rounded_up(value)) == (near, above)
    assert rounded_up(float(above)) == above
    assert short(0.0) == rounded_up(0.0) == "0"


def test_print_notation_raises_powers() -> None:
    """In print powers and units are raised and percent is a sign."""
    assert figure(4.43e11, 6e9).both(Notation.PRINT) == "(4.43 ± 0.06) \N{MULTIPLICATION SIGN} 10¹¹"
    assert figure(-0.294).number(Notation.PRINT) == "\N{MINUS SIGN}0.294"
    assert figure(-4.43e11, 6e9).both(Notation.PRINT) == "(\N{MINUS SIGN}4.43 ± 0.06) \N{MULTIPLICATION SIGN} 10¹¹"
    assert figure(-0.294).number() == "-0.294"
    assert unit_text("Pa^0.5*s/m^3/percent^2", Notation.PRINT) == "Pa^0.5·s/m³/%²"
    assert unit_text("Pa*s^2/m^6", Notation.FILE) == "Pa*s^2/m^6"


def test_probability_is_never_certain() -> None:
    """A probability is neither 0 nor 100 %, and certainty is rounded down."""
    assert [probability_text(p) for p in (0.0, 0.1234, 1.0)] == ["<0.1", "12.3", ">99.9"]
    assert certainty_text(0.987) == "98 % sure"
    assert certainty_text(1.0) == "more than 99.9 % sure"


@pytest.mark.parametrize(
    ("probability", "text"), [(0.99, "99.0"), (0.9969, "99.6"), (0.99871, "99.8"), (0.999, "99.9")]
)
def test_table_and_sentence_agree_near_certainty(probability: float, text: str) -> None:
    """From 99 % on both show the same tenth, rounded down."""
    assert probability_text(probability) == text
    assert certainty_text(probability) == f"{text} % sure"


def test_a_table_says_no_99_where_the_sentence_says_98() -> None:
    """What is less than 99 % is not rounded up to that."""
    assert (probability_text(0.98988), certainty_text(0.98988)) == ("98.9", "98 % sure")


@pytest.mark.parametrize(
    ("part", "text"), [(0.0123, "1.2 %"), (1.5, "150 %"), (9.94, "990 %"), (19.2, "19 times"), (2340.0, "2300 times")]
)
def test_many_times_a_value_is_told_in_times(part: float, text: str) -> None:
    """What is ten times as large is no matter of per cent."""
    assert share_text(part) == text


def test_change_is_signed_and_empty_without_nominal() -> None:
    """A change is given with its sign; about a nominal value of 0 it means nothing."""
    assert change_text(2.41, 4.43, 0.05) == "+84 %"
    assert change_text(2.0, 1.9, 0.001) == "\N{MINUS SIGN}5.0 %"
    assert change_text(-2.0, -1.0, 0.1) == "+50 %"
    assert change_text(0.0, 1.0, 0.1) == ""


def test_clock_shows_dates_of_unix_seconds_only() -> None:
    """Small clocks stay seconds as written, Unix seconds become a date."""
    assert clock_text(2736.0) == "2736 s"
    assert clock_text(0.02) == "0.02 s"
    assert clock_text(1.71e9) == "2024-03-09 16:00:00 UTC"
    assert clock_text(1.71e9 + 0.25) == "2024-03-09 16:00:00.250 UTC"


@pytest.mark.parametrize(("seconds", "text"), [(0.04, "0.04 s"), (90, "90 s"), (4919, "82 min"), (1e6, "11.6 d")])
def test_duration_takes_a_handy_unit(seconds: float, text: str) -> None:
    """A length of time is given in the unit in which it is a small number."""
    assert duration_text(seconds) == text


@pytest.mark.parametrize(
    ("rate", "size", "name"),
    [(1.0, 50.0, "s"), (-1.0, 500.0, "min"), (1.0, 1e5, "h"), (1.0, 1e6, "d"), (1e-9, 1.0, "d"), (0.0, 0.0, "s")],
)
def test_rates_are_told_in_a_time_in_which_something_happens(rate: float, size: float, name: str) -> None:
    """The unit of time is the smallest in which a hundredth of the value changes, a day at most."""
    assert pace(rate, size)[1] == name


@pytest.mark.parametrize(
    ("time", "width", "text"),
    [
        (4213.7, 1700.0, "4200 s"),
        (4213.7, 90.0, "4214 s"),
        (4213.7, 9.0, "4213.7 s"),
        (4213.7, 0.0, "4213.7 s"),
        (1.7e9 + 4321.0, 30.0, "2023-11-14 23:25:21 UTC"),
        (1.7e9 + 4321.0, 1000.0, "2023-11-14 23:25 UTC"),
        (1.7e9 + 4321.0, 1e6, "2023-11-14 23:00 UTC"),
    ],
)
def test_uncertain_times_are_rounded(time: float, width: float, text: str) -> None:
    """A time is told to a tenth of its uncertainty."""
    assert coarse_clock_text(time, width) == text


def test_numbers_too_small_for_a_power_are_zero() -> None:
    """Neither a value nor a standard deviation near the end of the numbers stops the report."""
    assert figure(5e-324).both(Notation.FILE) == "0"
    assert figure(1.0, 5e-324).both(Notation.FILE) == "1"


def test_durations_may_have_fewer_digits() -> None:
    """A forecast has no use for three digits."""
    assert duration_text(551.0, digits=2) == "9.2 min"
    assert duration_text(98765.0, digits=2) == "27 h"


def test_zero_alone_has_no_power_of_ten() -> None:
    """What is zero to the digits that are known reads as zero, alone and beside its spread in plain text."""
    found = figure(-1e-7, 7e-5)
    assert found.number(Notation.FILE) == found.number(Notation.PRINT) == "0"
    assert found.both(Notation.FILE) == "0 ± 7e-5"
    assert figure(3e-5, 1e-6).number(Notation.FILE) == "3.00e-5"


ODD = (0.0, 1e-320, 1e-300, -1e-9, 3.0, 1e9, 1e18, -1e200, 1e300, 1.7e308, math.inf, math.nan)


@pytest.mark.parametrize("value", ODD)
@pytest.mark.parametrize("other", ODD)
def test_no_number_fills_the_line(value: float, other: float) -> None:
    """Whatever a number and its standard deviation are, they are told in a few digits, and so are changes and times."""
    size = abs(other)
    texts = [figure(value, size).both(notation) for notation in Notation]
    texts += [change_text(value, other, size), duration_text(value), clock_text(value), coarse_clock_text(value, size)]
    assert max(map(len, texts)) <= 50, texts


def test_times_without_a_date() -> None:
    """Beyond the year 9999 a clock is told in seconds, and changes and times beyond all measure by their power."""
    assert clock_text(1e18) == "1e18 s"
    assert coarse_clock_text(1e18, 100.0) == "1e18 s"
    assert clock_text(math.nan) == "an unknown time"
    assert change_text(1e-300, 1.0, 0.0) == "+1e302 %"
    assert duration_text(1e300) == "1e295 d"
