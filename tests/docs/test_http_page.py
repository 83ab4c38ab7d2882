"""The page of the interface over HTTP has each request that there is, each refusal, and each thing to do."""

import re
from pathlib import Path

import pytest

pytest.importorskip("fastapi", reason='there is no fastapi: pip install "faultbond[serve]"')

from fake_desk import FakeDesk
from fake_face import FakeFace
from faultbond.service.contract.messages import Action
from faultbond.service.web.application import application
from faultbond.service.web.security import LocalGuard

PAGE = (Path(__file__).parents[2] / "docs" / "http.md").read_text(encoding="utf-8")
PATHS = application(FakeFace(), LocalGuard(), desk=FakeDesk()).openapi()["paths"]
REQUESTS = {f"{method.upper()} {path}": told for path, methods in PATHS.items() for method, told in methods.items()}


def test_each_request_is_there() -> None:
    """Once, and no other."""
    assert sorted(re.findall(r"^\| `([A-Z]+ /\S*)` \|", PAGE, re.MULTILINE)) == sorted(REQUESTS)


def test_each_refusal_is_there() -> None:
    """With when it comes."""
    refused = {status for told in REQUESTS.values() for status in told["responses"] if status >= "400"}
    table = PAGE.partition("## What is refused")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (\d[\d, ]*) \|", table, re.MULTILINE)
    assert sorted(status for row in rows for status in row.split(", ")) == sorted(refused)


def test_each_action_is_there() -> None:
    """Under its word."""
    told = PAGE.partition("`action` is one of")[2].partition(", which mean")[0]
    assert re.findall(r"`([^`]+)`", told) == [
        *(item.value for item in Action if item not in {Action.REJECT, Action.REPAIRED, Action.UNDO}),
        *(item.value for item in (Action.REPAIRED, Action.REJECT, Action.UNDO)),
    ]
