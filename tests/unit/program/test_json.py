"""The generated program writes numbers and texts as Python's json does, to the byte."""

import json
import math
import struct
import subprocess
from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faultbond.synthesis.names_text import text_literal
from in_c import small_program

NUMBERS = """\
#include <inttypes.h>
#include "json.h"

int main(void)
{
    static Out out;
    Json json = {&out, 0};
    uint64_t word;
    double value;
    int64_t whole;
    out_begin(&out, stdout);
    while (scanf("%" SCNx64, &word) == 1) {
        memcpy(&value, &word, sizeof value);
        memcpy(&whole, &word, sizeof whole);
        json_open(&json, '[');
        json_real(&json, value);
        json_whole(&json, whole);
        json_close(&json, ']');
        json_end(&json);
    }
    return 0;
}
"""
TEXTS = """\
#include "json.h"

int main(void)
{{
    static Out out;
    static const char *const texts[] = {{{texts}}};
    Json json = {{&out, 0}};
    out_begin(&out, stdout);
    for (size_t k = 0; k < sizeof texts / sizeof texts[0]; k++) {{
        json_open(&json, '{{');
        json_key(&json, texts[k]);
        json_text(&json, texts[k]);
        json_key_of_two(&json, "", texts[k]);
        json_truth(&json, 1);
        json_close(&json, '}}');
        json_end(&json);
    }}
    return 0;
}}
"""
EDGES = [word + step for power in range(0, 0x7FF, 3) for step in (-1, 0, 1) if (word := power << 52) + step >= 0]
USUAL = [
    0.0,
    -0.0,
    0.05,
    1.0,
    20.0,
    1e16,
    9999999999999998.0,
    1e-4,
    9.9999e-5,
    123456.789,
    5e-324,
    1.7976931348623157e308,
]
ODD = [
    "flow",
    'a "b" \\ c',
    "Füllstand 水",
    "tab\tline\nback\b feed\f return\r",
    "\x01\x1f\x7f",
    "??/ ??=",
    "",
    "\U0001f6b0",
    "0\n1",
]


def word_of(value: float) -> int:
    """The bits of a number."""
    return int(struct.unpack("<Q", struct.pack("<d", value))[0])


def written(words: Iterable[int], language: str = "C") -> list[str]:
    """The lines of the program for numbers of these bits: as a number, and as a whole number."""
    told = "\n".join(f"{word:x}" for word in words)
    return subprocess.run(
        [small_program(NUMBERS, language)], input=told, capture_output=True, text=True, check=True
    ).stdout.splitlines()


def expected(word: int) -> str:
    """The line of Python for a number of these bits."""
    value, whole = struct.unpack("<dq", struct.pack("<QQ", word, word))
    return json.dumps([value if math.isfinite(value) else None, whole])


@pytest.mark.parametrize("language", ["C", "C++"])
def test_numbers_next_to_powers_of_two_have_the_digits_of_python(language: str) -> None:
    """Where steps between numbers change, at both ends of all, and for numbers of every day, digits are the same."""
    words = [
        *map(word_of, USUAL),
        *EDGES[: None if language == "C" else 600],
        1,
        2,
        0xFFF << 52,
        0x7FF << 52,
        0x7FF8 << 48,
    ]
    assert written(words, language) == [expected(word) for word in words]


@given(st.lists(st.one_of(st.integers(0, 2**64 - 1), st.floats().map(word_of)), min_size=1, max_size=400))
@settings(max_examples=25, deadline=None)
def test_any_number_has_the_digits_of_python(words: list[int]) -> None:
    """Any bits give what Python's json gives, null where they are no finite number."""
    assert written(words) == [expected(word) for word in words]


@given(st.integers(-(10**9), 10**9), st.integers(-12, 12))
@settings(max_examples=20, deadline=None)
def test_rounded_numbers_stay_short(digits: int, power: int) -> None:
    """A number of few decimal digits is written with these."""
    words = [word_of(float(f"{digits + k}e{power}")) for k in range(50)]
    assert written(words) == [expected(word) for word in words]


def test_texts_have_the_escapes_of_python() -> None:
    """Quotation marks, controls and letters of any script are written as Python does, as text and as key."""
    text = TEXTS.format(texts=", ".join(map(text_literal, ODD)))
    said = subprocess.run([small_program(text)], capture_output=True, check=True).stdout.decode().split("\n")
    assert said == [*(json.dumps({item: item, f".{item}": True}, ensure_ascii=False) for item in ODD), ""]
