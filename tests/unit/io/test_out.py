"""Streams of a verb."""

import json
import math
from pathlib import Path

import pytest

from faultbond.io.out import Out, open_out


def test_records_in_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With a file for the records, people still get their text on standard output."""
    path = tmp_path / "out.json"
    with open_out(str(path), grows=True) as out:
        out.say("Grüße")
        out.record({"name": "Behälter", "list": (1, math.nan), "deep": {"x": math.inf}})
        assert path.read_text(encoding="utf-8").count("\n") == 1  # flushed while the stream is open
    assert json.loads(path.read_text(encoding="utf-8")) == {"name": "Behälter", "list": [1, None], "deep": {"x": None}}
    assert capsys.readouterr().out == "Grüße\n"


def test_records_on_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    """With `-` there is nothing but records on standard output."""
    with open_out("-") as out:
        out.say("for people")
        out.record({"record": "end"})
    assert capsys.readouterr().out == '{"record": "end"}\n'


def test_no_records(capsys: pytest.CaptureFixture[str]) -> None:
    """Without a target, records are dropped."""
    with open_out(None) as out:
        out.say("for people")
        out.record({"record": "end"})
    assert capsys.readouterr().out == "for people\n"


def test_nothing_at_all() -> None:
    """An Out without streams takes everything and writes nothing."""
    out = Out(text=None, json=None)
    out.say("x")
    out.record({"x": 1})
    assert (out.text, out.json) == (None, None)
