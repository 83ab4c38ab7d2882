"""The interface does what its description says, whatever it is asked: by schemathesis, from `/openapi.json`."""

import importlib
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings

from asked import Asked
from fake_desk import FakeDesk
from fake_face import FakeFace
from faultbond.service.web.application import application
from faultbond.service.web.route_parts import TOKEN
from faultbond.service.web.security import LocalGuard

schemathesis = pytest.importorskip("schemathesis", reason="there is no schemathesis: pip install schemathesis")

checks = importlib.import_module("schemathesis.specs.openapi.checks")
not_a_server_error = importlib.import_module("schemathesis.checks").not_a_server_error
FEW = settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck))
ENDLESS = "/api/v1/events"  # a stream, which test_broadcast.py listens to
OPERATIONS = [
    (method, path)
    for path, methods in application(FakeFace(), LocalGuard(), desk=FakeDesk()).openapi()["paths"].items()
    for method in methods
    if path != ENDLESS
]


@pytest.mark.parametrize("name", ["viola", "emma"])
@pytest.mark.parametrize(("method", "path"), OPERATIONS)
def test_what_is_asked_is_answered_as_described(
    method: str, path: str, name: str, guarded: Callable[..., Asked]
) -> None:
    """No answer is a failure, none has a status or a shape that is not described, and what is wrong is refused.

    Who has no session, or another one, is told so; whoever asks, and whatever their role.
    """
    inside = guarded(name)
    inside.face.fails_each = 3  # as a store that cannot be read now
    schema = schemathesis.openapi.from_asgi("/openapi.json", inside.app, headers={"host": "localhost"})
    operation = schema[path][method.upper()]
    told = {TOKEN: inside.token, "host": "localhost"}

    @FEW
    @given(case=operation.as_strategy())
    def asked(case: Any) -> None:
        if path.endswith("/logout"):
            inside.enter(name)
            told[TOKEN] = inside.token
        # What keys need of each other is told in words, by the refusal, and not by the description. A store that cannot
        # be read is no failure of the service: 503 is an answer, where it is described.
        excluded = [checks.positive_data_acceptance, not_a_server_error]
        answer = case.call_and_validate(headers=told, cookies=inside.cookies, excluded_checks=excluded)
        assert answer.status_code < 500 or answer.status_code == 503

    asked()
