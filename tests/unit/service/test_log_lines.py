"""What stands on standard error: for people, for the journal, as JSON."""

import io
import json
import logging
import os
import sys
from datetime import datetime
from pathlib import Path

import pytest

from faultbond.service.log_lines import LogForm, logged, usual_form

OURS, OTHERS = logging.getLogger("faultbond.service.station"), logging.getLogger("uvicorn.error")


def said(form: LogForm, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Let some things happen, and give the lines."""
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    with logged(form):
        OURS.debug("a detail")
        OURS.info("it works")
        OTHERS.info("a detail")
        OTHERS.warning("it is late")
        logging.getLogger("asyncua.client.client").warning("nobody needs this")
        try:
            raise ValueError("pump\x1b[2J")
        except ValueError:
            OURS.exception("it failed\non two lines \x1b[2J")
    OURS.warning("nobody hears this")
    return stream.getvalue().splitlines()


def test_lines_for_people(monkeypatch: pytest.MonkeyPatch) -> None:
    """With time and level; of other packages what is wrong only, of asyncua errors; nothing steers the terminal."""
    lines = said(LogForm.PLAIN, monkeypatch)
    assert [line.partition(" UTC ")[2] for line in lines[:3]] == [
        "info: it works",
        "warning: uvicorn.error: it is late",
        "error: it failed on two lines ?[2J",
    ]
    assert datetime.fromisoformat(lines[0].partition(" UTC ")[0])
    assert lines[3] == "Traceback (most recent call last):"
    assert lines[-1] == "ValueError: pump?[2J"


def test_lines_for_the_journal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each line has the priority of its event, those of a traceback, too."""
    lines = said(LogForm.JOURNAL, monkeypatch)
    assert lines[:3] == ["<6>it works", "<4>it is late", "<3>it failed on two lines ?[2J"]
    assert len(lines) > 5
    assert {line[:3] for line in lines[3:]} == {"<3>"}


def test_lines_as_json(monkeypatch: pytest.MonkeyPatch) -> None:
    """An object each, with its traceback inside."""
    works, late, failed = map(json.loads, said(LogForm.JSON, monkeypatch))
    assert works.keys() == late.keys() == {"time", "level", "logger", "message"}
    assert (late["level"], late["logger"], late["message"]) == ("warning", "uvicorn.error", "it is late")
    assert datetime.fromisoformat(works["time"]).tzinfo is not None
    assert failed["traceback"].startswith("Traceback")
    assert failed["traceback"].count("\n") > 2


def test_the_journal_is_known_by_what_systemd_says(tmp_path: Path) -> None:
    """By device and inode of the file behind standard error; another file is none, nor is no file."""
    with (tmp_path / "stderr").open("w") as stream:
        found = os.fstat(stream.fileno())
        own = {"JOURNAL_STREAM": f"{found.st_dev}:{found.st_ino}"}
        assert usual_form(stream, own) is LogForm.JOURNAL
        assert usual_form(stream, {"JOURNAL_STREAM": f"{found.st_dev}:{found.st_ino + 1}"}) is LogForm.PLAIN
        assert usual_form(stream, {}) is LogForm.PLAIN
    assert usual_form(io.StringIO(), own) is LogForm.PLAIN
