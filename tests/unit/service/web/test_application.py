"""The interface over HTTP: what it gives, and that all else is refused in one shape."""

import json
import re
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

from asked import Asked, is_refused
from faultbond.service.contract.messages import Action
from faultbond.service.web.page_files import page_files
from faultbond.service.web.route_parts import COOKIE, TOKEN
from faultbond.service.web.security import LocalGuard
from faultbond.service.web.shapes import AssetShape, CurvesShape, EntryShape, MeShape, SiteShape
from faultbond.service.web.shield import POLICY

LOADED = re.compile(r'(?:src|href)="(static/[^"]+)"')
LARGEST_LOAD = 200_000  # bytes
LIBRARY = b"https://github.com/leeoniya/uPlot"  # the comment at its head
ASSETS = ("tank_1", "tank_2", "tank_3", "tank_4", "motor_1", "motor_2", "motor_3")
OTHERS = [  # requests that no handler knows, and the status of the answer
    ("GET", "/api/v1/assets/nothing", 404),
    ("GET", "/api/v1/assets/nothing/curves", 404),
    ("GET", "/api/v1/assets/nothing/report", 404),
    ("GET", "/api/v1/events?asset=nothing", 404),
    ("GET", "/api/v1/assets/tank_1/curves?most=1", 422),
    ("GET", "/api/v1/assets/tank_1/curves?begin=nan", 422),
    ("GET", "/api/v1/assets/tank_1/curves?begin=9&end=1", 422),
    ("GET", "/api/v1/assets/" + "a" * 300, 422),
    ("GET", "/nothing", 404),
    ("DELETE", "/api/v1/site", 405),
    ("GET", "/api/v1/assets/tank_1/deeds", 405),
    ("POST", "/", 405),
]
PATHS = [
    "/static/../application.py",
    "/static/..%2fapplication.py",
    "/static/%2e%2e/%2e%2e/messages.py",
    "/static//etc/passwd",
    "/static/....//application.py",
    "/static/service.js%00.css",
    "/static/",
    "/static/C:%5Cwindows",
]
BAD_DEEDS: list[tuple[dict[str, Any], str]] = [
    ({"action": "explode"}, "action"),
    ({}, "action"),
    ({"action": "shelve"}, "needs `minutes`"),
    ({"action": "shelve", "minutes": 0}, "minutes"),
    ({"action": "shelve", "minutes": 1e9}, "minutes"),
    ({"action": "accept"}, "needs `target`"),
    ({"action": "undo"}, "needs `undone`"),
    ({"action": "acknowledge", "undone": 1}, "takes no `undone`"),
    ({"action": "acknowledge", "comment": "x" * 2001}, "comment"),
    ({"action": "acknowledge", "comment": "\0"}, "control characters"),
    ({"action": "acknowledge", "comment": "\ud800"}, "comment"),
    ({"action": "acknowledge", "who": "somebody else"}, "who"),
]


def test_its_answers_have_the_shapes_that_it_describes(local: Asked) -> None:
    """What is given of all assets fits the description."""
    MeShape.model_validate(local("GET", "/api/v1/me").json(), strict=True)
    site = SiteShape.model_validate(local("GET", "/api/v1/site").json(), strict=True)
    assert [item.name for item in site.assets] == list(ASSETS)
    for name in ASSETS:
        asset = AssetShape.model_validate(local("GET", f"/api/v1/assets/{name}").json(), strict=True)
        assert asset.summary.name == name
        CurvesShape.model_validate(local("GET", f"/api/v1/assets/{name}/curves").json(), strict=True)


def test_curves_of_a_period(local: Asked) -> None:
    """Curves come of the period that is asked for, and of no more points than asked for."""
    begin, end = local.face.time(100), local.face.time(160)
    told = local("GET", f"/api/v1/assets/tank_1/curves?begin={begin}&end={end}&most=31").json()
    assert (told["time"][0], told["time"][-1], len(told["time"])) == (begin, end, 31)


def test_curves_are_packed_where_that_is_taken(local: Asked) -> None:
    """Curves are the same by gzip and plain, and much smaller by gzip."""
    packed, plain = (
        local("GET", "/api/v1/assets/tank_1/curves", headers={"accept-encoding": kind}) for kind in ("gzip", "identity")
    )
    assert packed.json() == plain.json()
    assert 2 * int(packed.headers["content-length"]) < int(plain.headers["content-length"]) == len(plain.content)
    assert "content-encoding" not in plain.headers


def test_each_action_reaches_the_service(local: Asked) -> None:
    """What a person does comes to the service with who it was, and its entry comes back."""
    answer = local.do(action="shelve", minutes=30, comment="  Being cleaned. ")
    entry = EntryShape.model_validate(answer.json(), strict=True)
    done = local.face.done[-1]
    assert (answer.status_code, entry.who, entry.action, entry.comment) == (
        201,
        "local",
        "shelve",
        "Being cleaned.",
    )
    assert (done.asset, done.action, done.minutes) == ("tank_2", Action.SHELVE, 30)
    assert local.do(action="accept", target=["K6"]).status_code == 201
    assert local.face.done[-1].target == ("K6",)
    number = local.face.asset("tank_2")["journal"][0]["number"]
    assert local.do(action="undo", undone=number).status_code == 201
    assert local.face.asset("tank_2")["summary"]["alarm"]["state"] == "shelved"


@pytest.mark.parametrize(("method", "path", "status"), OTHERS)
def test_what_there_is_not_is_refused(local: Asked, method: str, path: str, status: int) -> None:
    """An asset, a path, a method or a number that there is not gets the one shape."""
    assert is_refused(local(method, path), status)


@pytest.mark.parametrize(("deed", "text"), BAD_DEEDS)
def test_a_bad_deed_is_refused(local: Asked, deed: dict[str, Any], text: str) -> None:
    """A deed that lacks something or has too much is refused, says what, and does not reach the service."""
    body = json.dumps(deed)
    answer = local("POST", "/api/v1/assets/tank_2/deeds", content=body, headers={"content-type": "application/json"})
    assert is_refused(answer, 422, text)
    assert local.face.done == []


def test_a_body_that_is_no_json_is_refused(local: Asked) -> None:
    """A form, broken JSON and a body that is too large are refused."""
    path = "/api/v1/assets/tank_2/deeds"
    assert is_refused(local("POST", path, data={"action": "acknowledge"}), 415)
    assert is_refused(local("POST", path, content="{", headers={"content-type": "application/json"}), 400, "no JSON")
    large = local.do(action="acknowledge", comment="x" * 70_000)
    assert is_refused(large, 413)

    async def chunks() -> AsyncIterator[bytes]:
        for _ in range(100):
            yield b" " * 1000

    assert is_refused(local("POST", path, content=chunks(), headers={"content-type": "application/json"}), 413)
    assert local.face.done == []


def test_what_cannot_be_done_says_why(local: Asked) -> None:
    """What makes no sense now, and a store that is full, come as the service says them."""
    assert is_refused(local.do(asset="tank_1", action="acknowledge"), 409, "tank_1: acknowledge makes no sense now")
    assert is_refused(local.do(asset="nothing", action="acknowledge"), 404)
    local.face.is_full = True
    assert is_refused(local.do(action="acknowledge"), 503, "the disk is full")
    assert local("GET", "/health").status_code == 503


@pytest.mark.parametrize("what", ["", "/curves", "/report"])
def test_a_store_that_cannot_be_read_is_told(local: Asked, what: str) -> None:
    """What is to be seen of an asset is refused as the store says why, and seen when it can be read again."""
    local.face.fails_each = 2
    statuses = [local("GET", f"/api/v1/assets/tank_1{what}").status_code for _ in range(4)]
    assert statuses == [200, 503, 200, 503]


def test_a_failure_tells_nothing_of_the_inside(local: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    """A mistake in the service gives 500 in the one shape, with the headers of all answers and no more."""

    def broken() -> None:
        raise RuntimeError("secret of the inside")

    monkeypatch.setattr(local.face, "site", broken)
    answer = local("GET", "/api/v1/site")
    assert is_refused(answer, 500)
    assert "secret" not in answer.text
    assert answer.headers["content-security-policy"] == POLICY


@pytest.mark.parametrize("path", ["/", "/static/service.js", "/api/v1/site", "/health", "/nothing", "/openapi.json"])
def test_every_answer_has_its_headers(local: Asked, path: str) -> None:
    """No answer may be framed, sniffed, or load what is not ours; the interface is not kept by a cache."""
    headers = local("GET", path).headers
    assert headers["content-security-policy"].startswith("default-src 'self';")
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["cache-control"] == ("no-cache" if path in {"/", "/static/service.js"} else "no-store")
    assert "access-control-allow-origin" not in headers


def test_a_report_runs_as_a_stranger(local: Asked) -> None:
    """A report has scripts inside; it gets no cookie of ours and no network."""
    policy = local("GET", "/api/v1/assets/tank_2/report").headers["content-security-policy"]
    assert policy.startswith("default-src 'none'; script-src 'unsafe-inline'")
    assert "sandbox" in policy
    assert "allow-same-origin" not in policy


@pytest.mark.parametrize("host", ["evil.example", "localhost.evil.example", "10.0.0.1", "127.0.0.1@evil.example", ""])
def test_a_foreign_name_is_refused(local: Asked, host: str) -> None:
    """Who asks under another name, as after DNS rebinding, gets nothing."""
    assert is_refused(local("GET", "/api/v1/site", headers={"host": host}), 421)


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:99", "127.0.0.1:8080", "[::1]:8080"])
def test_own_names_are_served(local: Asked, host: str) -> None:
    """The names of this machine are served, with any port."""
    assert local("GET", "/api/v1/site", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "http://localhost:1", "http://localhost", "file://", "http://localhost:8080.evil"],
)
def test_a_foreign_page_is_refused(local: Asked, origin: str) -> None:
    """A deed from a page of another origin is refused, even with the token."""
    assert is_refused(local.do(headers={"origin": origin}, action="acknowledge"), 403, "another site")
    assert local.face.done == []


def test_the_own_page_is_served(local: Asked) -> None:
    """A deed from the own page passes."""
    assert local.do(headers={"origin": "http://localhost:8080"}, action="acknowledge").status_code == 201


@pytest.mark.parametrize("token", [None, "", "wrong", "é"])
def test_a_deed_needs_the_token(local: Asked, token: str | None) -> None:
    """Without the token, or with another, nothing is done."""
    local.token = None
    headers = {} if token is None else {TOKEN: token.encode()}
    answer = local("POST", "/api/v1/assets/tank_2/deeds", headers=headers, json={"action": "acknowledge"})  # type: ignore[arg-type]
    assert is_refused(answer, 403, "token")
    assert local.face.done == []


@pytest.mark.parametrize("path", PATHS)
def test_only_files_of_the_page_are_served(local: Asked, path: str) -> None:
    """No path leads out of the files of the page."""
    assert is_refused(local("GET", path), 404)


def test_files_are_known_again(local: Asked) -> None:
    """A browser that has a file is told so, and one that takes gzip gets it."""
    first = local("GET", "/static/service.js", headers={"accept-encoding": "gzip"})
    assert first.headers["content-encoding"] == "gzip"
    assert first.content == page_files()["service.js"].content
    again = local("GET", "/static/service.js", headers={"if-none-match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    plain = local("GET", "/static/service.js", headers={"accept-encoding": "identity"})
    assert "content-encoding" not in plain.headers
    assert local("HEAD", "/").status_code == 200


def test_the_page_loads_only_what_is_served(local: Asked) -> None:
    """All that the page names is there and small, nothing is inline, and no other host is named."""
    text = local("GET", "/").text
    names = LOADED.findall(text)
    sizes = [len(local("GET", f"/{name}").content) for name in names]
    imported = {name for item in page_files() if item.endswith(".js") for name in _imports(item)}
    assert {name.removeprefix("static/") for name in names} == set(page_files()) - {"index.html"}
    assert imported <= set(page_files())
    assert sum(sizes) + len(text) < LARGEST_LOAD
    assert not re.search(r"<style|style=|\son\w+=|<script(?![^>]*src=)", text)
    everything = b"".join(item.content for item in page_files().values())
    assert {*re.findall(rb"https?://[^ \"]*", everything)} == {b"http://www.w3.org/2000/svg", LIBRARY}


def _imports(name: str) -> list[str]:
    return re.findall(r'from "\./([^"]+)"', page_files()[name].content.decode())


def test_a_shared_file_stands_once() -> None:
    """What other pages use too is served from where it is."""
    own = Path(__file__).parents[4] / "src/faultbond/service/web/static"
    shared = {"report.css", "plot.css", "plot.js", "uPlot.min.css", "uPlot.iife.min.js", "numbers.js"}
    assert shared <= set(page_files())
    assert not shared & {item.name for item in own.iterdir()}


def test_the_licence_of_the_library_is_served(local: Asked) -> None:
    """Who gets uPlot gets its licence, and the page leads to it."""
    assert '<a href="static/uPlot.LICENSE">' in local("GET", "/").text
    answer = local("GET", "/static/uPlot.LICENSE")
    assert answer.headers["content-type"] == "text/plain; charset=utf-8"
    assert "Permission is hereby granted" in answer.text


def test_the_description_is_complete(local: Asked) -> None:
    """Each operation tells its answer and its refusals, all in the one shape, and needs no other host."""
    told = local("GET", "/openapi.json").json()
    operations = [(path, method, item) for path, methods in told["paths"].items() for method, item in methods.items()]
    assert {path for path, _, _ in operations} == {
        "/health",
        "/metrics",
        *(f"/api/v1/{name}" for name in ("me", "login", "logout", "site", "events")),
        *(f"/api/v1/assets/{{asset}}{name}" for name in ("", "/curves", "/picture", "/report", "/deeds")),
        *(f"/api/v1/offline{name}" for name in ("", "/files", "/jobs")),
        *(f"/api/v1/offline/jobs/{{job}}{name}" for name in ("", "/report", "/records", "/analysis")),
    }
    for path, method, item in operations:
        statuses = set(item["responses"])
        assert "421" in statuses
        assert path in {"/health", "/api/v1/login"} or {"401"} <= statuses, path
        assert method == "get" or {"403", "413"} <= statuses, path
        assert "{asset}" not in path or "503" in statuses, path
        assert "{asset}/" not in path or "429" in statuses, path
        assert ("{asset}" not in path and "{job}" not in path) or {"404", "422"} <= statuses, path
        for status, answer in item["responses"].items():
            assert (status == "429") == ("Retry-After" in answer.get("headers", {})), path
            if status.startswith("4"):
                assert answer["content"]["application/json"]["schema"]["$ref"].endswith("/RefusalShape"), path
    assert "HTTPValidationError" not in str(told)
    assert local("GET", "/docs").status_code == 404


def test_the_picture_of_the_process(local: Asked) -> None:
    """As SVG, small on the way, of which nothing may run; one that there is not is refused, and the asset says so."""
    local.face.pictures["tank_1"] = "<svg/>"
    answer = local("GET", "/api/v1/assets/tank_1/picture")
    assert (answer.status_code, answer.text, answer.headers["content-encoding"]) == (200, "<svg/>", "gzip")
    assert answer.headers["content-type"] == "image/svg+xml"
    assert answer.headers["content-security-policy"] == POLICY
    assert is_refused(local("GET", "/api/v1/assets/tank_2/picture"), 404)
    assert is_refused(local("GET", "/api/v1/assets/nothing/picture"), 404)
    assert [bool(local("GET", f"/api/v1/assets/tank_{k}").json()["picture"]) for k in (1, 2)] == [True, False]


def test_nobody_sees_anything_without_login(guarded: Callable[..., Asked]) -> None:
    """Without a session there is the page and whether the service is well, and nothing of the plant."""
    asked = guarded()
    for path in (
        "me",
        "site",
        "events",
        "assets/tank_1",
        "assets/tank_1/curves",
        "assets/tank_1/picture",
        "assets/tank_1/report",
    ):
        assert is_refused(asked("GET", f"/api/v1/{path}"), 401)
    assert is_refused(asked.do(action="acknowledge"), 401)
    assert [asked("GET", path).status_code for path in ("/", "/health")] == [200, 200]
    assert asked("GET", "/health").json() == {"ok": True}
    assert "store" in guarded("viola")("GET", "/health").json()


def test_a_session_is_kept_from_scripts_and_strangers(guarded: Callable[..., Asked]) -> None:
    """The cookie is for this site and for no script; under TLS for TLS only."""
    asked, body = guarded(), {"name": "otto", "password": "hands on"}
    cookie = asked("POST", "/api/v1/login", json=body).headers["set-cookie"].lower()
    assert {"httponly", "samesite=strict", "path=/"} <= set(cookie.split("; "))
    assert "secure" not in cookie
    assert "; secure" in asked("POST", "https://localhost:8080/api/v1/login", json=body).headers["set-cookie"].lower()


@pytest.mark.parametrize("body", [{"name": "otto", "password": "wrong"}, {"name": "nobody", "password": "hands on"}])
def test_who_does_not_know_the_password_stays_out(guarded: Callable[..., Asked], body: dict[str, str]) -> None:
    """A wrong password and an unknown name are told alike, and after some failures none is tried for a while."""
    asked = guarded()
    for _ in range(5):
        assert is_refused(asked("POST", "/api/v1/login", json=body), 401, "do not belong together")
    answer = asked("POST", "/api/v1/login", json=body)
    assert is_refused(answer, 429)
    assert int(answer.headers["retry-after"]) > 0


@pytest.mark.parametrize(
    ("name", "action", "status"),
    [
        ("viola", {"action": "acknowledge"}, 403),
        ("viola", {"action": "undo", "undone": 1}, 403),
        ("otto", {"action": "acknowledge"}, 201),
        ("otto", {"action": "accept", "target": ["K6"]}, 201),
        ("otto", {"action": "suppress"}, 403),
        ("otto", {"action": "out of service"}, 403),
        ("emma", {"action": "suppress"}, 201),
        ("emma", {"action": "out of service"}, 201),
    ],
)
def test_each_role_does_what_it_may(
    guarded: Callable[..., Asked], name: str, action: dict[str, Any], status: int
) -> None:
    """Who may only look does nothing, and what silences for good is an engineer's."""
    asked = guarded(name)
    answer = asked.do(**action)
    assert answer.status_code == status
    assert [item.who for item in asked.face.done] == ([name] if status == 201 else [])


def test_what_an_engineer_did_an_operator_cannot_take_back(guarded: Callable[..., Asked]) -> None:
    """To undo takes the role of what is undone; what is not in the journal any more takes the highest."""
    asked = guarded("emma")
    number = asked.do(action="suppress").json()["number"]
    asked.enter("otto")
    assert is_refused(asked.do(action="undo", undone=number), 403, "engineer")
    assert is_refused(asked.do(action="undo", undone=4000), 403, "engineer")
    mine = asked.do(action="accept", target=["K6"]).json()["number"]
    assert asked.do(action="undo", undone=mine).status_code == 201


def test_logout_ends_the_session(guarded: Callable[..., Asked]) -> None:
    """After a logout the cookie is worth nothing, and a logout needs the token like all that changes something."""
    asked = guarded("otto")
    token, asked.token = asked.token, None
    assert is_refused(asked("POST", "/api/v1/logout"), 403)
    asked.token = token
    assert asked("POST", "/api/v1/logout").json() == {"ok": True}
    assert is_refused(asked("GET", "/api/v1/me"), 401)


def test_the_token_is_of_a_session(guarded: Callable[..., Asked]) -> None:
    """The token of one session does not serve another."""
    asked = guarded("otto")
    token = asked.token
    asked.enter("emma")
    assert token != asked.token
    asked.token = token
    assert is_refused(asked.do(action="acknowledge"), 403, "token")


def test_a_guard_of_loopback_knows_one_person(local: Asked) -> None:
    """On the loopback address there is one engineer, and nobody logs in."""
    me = local("GET", "/api/v1/me").json()
    assert (me["name"], me["role"], me["can_log_out"]) == ("local", "engineer", False)
    assert set(me["actions"]) == {action.value for action in Action}
    assert LocalGuard().who(None).token != me["token"]  # type: ignore[union-attr]
    assert is_refused(local("POST", "/api/v1/login", json={"name": "a", "password": "b"}), 401)
    assert COOKIE not in local("GET", "/").cookies
