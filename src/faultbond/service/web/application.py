"""The application: the page, and the interface behind it under `api/v1`. Nothing here writes into the plant.

The interface is described by `openapi.json`. All that is refused has one shape, `{"ok": false, "error", "status"}`.
"""

import asyncio
import gzip
import hmac
import logging
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from typing import Annotated, Any

from fastapi import APIRouter, Depends, FastAPI, HTTPException, Path, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse
from fastapi.security import HTTPAuthorizationCredentials as Bearer
from fastapi.security import HTTPBearer
from starlette.exceptions import HTTPException as AnyHTTPException

from faultbond.errors import FaultbondError, StoreError
from faultbond.service.contract.face import Face, Shown
from faultbond.service.contract.face import Request as Wanted
from faultbond.service.contract.messages import Action
from faultbond.service.contract.offline import Desk
from faultbond.service.sinks.openmetrics import MEDIA_TYPE
from faultbond.service.web.audit_trail import AuditTrail, address_of
from faultbond.service.web.broadcast import Broadcast, BusyError, EventStream
from faultbond.service.web.offline_routes import offline_routes
from faultbond.service.web.page_files import page_files
from faultbond.service.web.request_rate import RequestRate
from faultbond.service.web.route_parts import (
    COOKIE,
    Bounded,
    RoleError,
    check_json,
    check_token,
    paced,
    person_of,
    refusals,
    session_cookie,
    token_header,
)
from faultbond.service.web.security import Guard, Person, Role, TooManyTriesError, needed
from faultbond.service.web.shapes import (
    AssetShape,
    CurvesShape,
    DeedShape,
    DoneShape,
    EntryShape,
    HealthShape,
    LoginShape,
    MeShape,
    RefusalShape,
    SiteShape,
)
from faultbond.service.web.shield import HEADERS, LOOPBACK, REPORT_POLICY, Shield, refusal

MOST_POINTS = 5000
DEEDS, CURVES, REPORTS = 120, 600, 60  # of a session in a minute; pictures as often as reports
_LOG = logging.getLogger(__name__)
_bearer = HTTPBearer(auto_error=False, description="The token of `tell` with `to: metrics`")
AssetName = Annotated[str, Path(max_length=200, description="Name of an asset")]
ClockTime = Annotated[float | None, Query(allow_inf_nan=False, description="By the clock of the samples, s")]


class Metrics(Response):
    """Numbers as OpenMetrics has them."""

    media_type = MEDIA_TYPE


class Svg(Response):
    """A picture that may be enlarged."""

    media_type = "image/svg+xml"


class Described(FastAPI):
    """An application whose description tells that refusals are JSON where the answer itself is not."""

    def openapi(self) -> dict[str, Any]:
        """Give the description."""
        if self.openapi_schema is None:
            shape = {"application/json": {"schema": {"$ref": f"#/components/schemas/{RefusalShape.__name__}"}}}
            operations = [item for path in super().openapi()["paths"].values() for item in path.values()]
            for status, answer in (pair for item in operations for pair in item["responses"].items()):
                if status != "200" and "application/json" not in answer.get("content", {}):
                    answer["content"] = shape
        return super().openapi()


def application(
    face: Face,
    guard: Guard,
    *,
    hosts: Collection[str] = LOOPBACK,
    metrics_token: str = "",
    desk: Desk | None = None,
) -> FastAPI:
    """Make the application.

    Parameters
    ----------
    face : the service
    guard : knows people
    hosts : names and addresses under which the service may be asked, without ports
    metrics_token : with which a program may ask for `/metrics` that has no session; empty: none may
    desk : takes files that people bring, and analyses of them; None: there is none

    Returns
    -------
    It has the viewers as `state.broadcast`, of which `close` sends them away where the service stops.
    """
    made = Described(
        title="faultbond",
        version=version("faultbond"),
        description="What a service of faultbond sees, and what people do about it. It never writes into the plant.",
        docs_url=None,  # that page would load scripts from another host
        redoc_url=None,
        openapi_url="/openapi.json",
        responses=refusals(421),
    )
    made.state.broadcast = Broadcast(face)
    made.add_middleware(Shield, hosts=hosts)
    trail = AuditTrail(face)
    _tell_errors(made, trail)
    made.include_router(_pages())
    made.include_router(_people(guard, trail, has_desk=desk is not None))
    made.include_router(_views(face, guard, made.state.broadcast))
    made.include_router(_measures(face, guard, made.state.broadcast, metrics_token))
    made.include_router(_deeds(face, guard))
    if desk is not None:
        made.include_router(offline_routes(desk, guard))
    return made


def _tell_errors(made: FastAPI, trail: AuditTrail) -> None:
    """Give all errors the one shape."""

    @made.exception_handler(AnyHTTPException)
    async def told(request: Request, error: AnyHTTPException) -> Response:
        if isinstance(error, RoleError):
            await trail.tell_role(error.person.name, error.role.name.lower(), request)
        return refusal(error.status_code, str(error.detail), dict(error.headers or {}))

    @made.exception_handler(RequestValidationError)
    async def invalid(request: Request, error: RequestValidationError) -> Response:
        first = error.errors()[0]
        if first["type"] == "json_invalid":
            why = first.get("ctx", {}).get("error", "it ends too soon")
            return refusal(400, f"The body is no JSON, at character {first['loc'][-1]}: {why}.")
        place = ".".join(str(part) for part in first["loc"][1:])
        text = str(first["msg"]).removeprefix("Value error, ")
        return refusal(422, f"{place}: {text}." if place else f"{text}.")

    @made.exception_handler(Exception)
    async def failed(request: Request, error: Exception) -> Response:
        _LOG.error("%s %s failed", request.method, request.url.path, exc_info=error)
        return refusal(500, "The service failed at this; its log tells more.", HEADERS)


def _pages() -> APIRouter:
    """Give the page and its files, which hold no data of the plant."""
    router = APIRouter(include_in_schema=False)
    files = page_files()

    def served(request: Request, name: str) -> Response:
        found = files.get(name)
        if found is None:
            raise HTTPException(404, "There is no such file.")
        headers = {"etag": found.tag, "cache-control": "no-cache", "vary": "accept-encoding"}
        if request.headers.get("if-none-match") == found.tag:
            return Response(status_code=304, headers=headers)
        if "gzip" not in request.headers.get("accept-encoding", ""):
            return Response(found.content, media_type=found.media_type, headers=headers)
        return Response(found.packed, media_type=found.media_type, headers=headers | {"content-encoding": "gzip"})

    @router.api_route("/", methods=["GET", "HEAD"])
    async def index(request: Request) -> Response:
        return served(request, "index.html")

    @router.api_route("/static/{name:path}", methods=["GET", "HEAD"])
    async def file(request: Request, name: str) -> Response:
        return served(request, name)

    return router


def _people(guard: Guard, trail: AuditTrail, *, has_desk: bool) -> APIRouter:
    """Give who asks, login and logout."""
    router = APIRouter(prefix="/api/v1", tags=["people"], route_class=Bounded)
    one_at_a_time = asyncio.Semaphore(1)  # hashing takes memory and a core

    @router.get("/me", response_model=MeShape, responses=refusals(401))
    async def me(person: Annotated[Person, person_of(guard, Role.VIEW)]) -> Response:
        """Tell who asks, and the token that goes with every deed."""
        told = {"name": person.name, "role": person.role.name.lower(), "token": person.token}
        may_analyse = has_desk and person.role >= Role.ENGINEER
        more = {"actions": person.actions(), "may_analyse": may_analyse, "can_log_out": guard.asks_login}
        return JSONResponse(told | more)

    @router.post(
        "/login",
        response_model=DoneShape,
        responses=refusals(400, 401, 403, 413, 415, 422, 429),
        dependencies=[Depends(check_json)],
    )
    async def login(request: Request, body: LoginShape) -> Response:
        """Begin a session; it is in the cookie of the answer."""
        address = address_of(request)
        try:
            async with one_at_a_time:
                session = await asyncio.to_thread(guard.login, body.name, body.password, address)
        except TooManyTriesError as error:
            await trail.tell_refused("logins refused", body.name, request)
            raise HTTPException(429, str(error), {"retry-after": f"{error.seconds:.0f}"}) from None
        if session is None:
            _LOG.warning("login of %r from %s failed", body.name, address)
            await trail.tell_refused("login failed", body.name, request)
            raise HTTPException(401, "Name and password do not belong together.", {"www-authenticate": "Session"})
        await trail.tell("login", body.name, request)
        answer = JSONResponse({"ok": True})
        is_secure = request.url.scheme == "https"
        answer.set_cookie(COOKIE, session, httponly=True, samesite="strict", secure=is_secure, path="/")
        return answer

    @router.post("/logout", response_model=DoneShape, responses=refusals(401, 403, 413))
    async def logout(
        request: Request,
        person: Annotated[Person, person_of(guard, Role.VIEW)],
        cookie: Annotated[str | None, Depends(session_cookie)],
        token: Annotated[str | None, Depends(token_header)],
    ) -> Response:
        """End the session."""
        check_token(person, token)
        guard.logout(cookie)
        if guard.asks_login:
            await trail.tell("logout", person.name, request)
        answer = JSONResponse({"ok": True})
        answer.delete_cookie(COOKIE, path="/", httponly=True, samesite="strict")
        return answer

    return router


def _views(face: Face, guard: Guard, broadcast: Broadcast) -> APIRouter:
    """Give what there is to see; where the service may be busy it is asked in a thread, and the others are served."""
    router = APIRouter(tags=["views"], route_class=Bounded)
    viewer = person_of(guard, Role.VIEW)
    seen = refusals(401, 403)
    seen_of_one, paced_of_one = refusals(401, 403, 404, 422, 503), refusals(401, 403, 404, 422, 429, 503)

    @router.get("/health", response_model=HealthShape, responses={503: {"model": HealthShape}})
    async def health(request: Request) -> Response:
        """Tell whether the service is well; 503 where it is not. Of its parts only those are told who are logged in."""
        told = dict(face.health())
        is_known = guard.who(request.cookies.get(COOKIE)) is not None  # a cookie may come with it, and need not
        shown = told if is_known else {"ok": told["ok"]}
        return JSONResponse(shown, 200 if told["ok"] else 503)

    @router.get("/api/v1/site", response_model=SiteShape, responses=seen, dependencies=[viewer])
    def site() -> Response:
        """Tell of all assets, each in a line."""
        return JSONResponse(face.site())

    @router.get("/api/v1/assets/{asset}", response_model=AssetShape, responses=seen_of_one, dependencies=[viewer])
    def one(asset: AssetName) -> Response:
        """Tell all of an asset: verdict, candidates, journal."""
        with _refusing(asset):
            return JSONResponse(face.asset(asset))

    @router.get(
        "/api/v1/assets/{asset}/curves",
        response_model=CurvesShape,
        responses=paced_of_one,
        dependencies=[paced(viewer, RequestRate(most=CURVES))],
    )
    def curves(
        request: Request,
        asset: AssetName,
        begin: ClockTime = None,
        end: ClockTime = None,
        most: Annotated[int, Query(ge=2, le=MOST_POINTS)] = 1200,
    ) -> Response:
        """Give curves of a period, the newest where none is given; of at most so many points, with all peaks."""
        if begin is not None and end is not None and begin > end:
            raise HTTPException(422, "begin: it is behind the end.")
        with _refusing(asset):
            return _packed(request, JSONResponse(face.curves(asset, begin, end, most)))

    @router.get(
        "/api/v1/assets/{asset}/picture",
        response_class=Svg,
        responses=paced_of_one,
        dependencies=[paced(viewer, RequestRate(most=REPORTS))],
    )
    def picture(request: Request, asset: AssetName) -> Response:
        """Give the picture of the process, where the site has one for an asset."""
        with _refusing(asset):
            found = face.picture(asset)
        if not found:
            raise HTTPException(404, f"The asset {asset!r} has no picture.")
        return _packed(request, Svg(found))

    @router.get(
        "/api/v1/assets/{asset}/report",
        response_class=HTMLResponse,
        responses=paced_of_one,
        dependencies=[paced(viewer, RequestRate(most=REPORTS))],
    )
    def report(asset: AssetName) -> Response:
        """Give the report of what an asset saw lately, a page in one file."""
        with _refusing(asset):
            return HTMLResponse(face.report(asset), headers={"content-security-policy": REPORT_POLICY})

    @router.get(
        "/api/v1/events", response_class=EventStream, status_code=200, responses=refusals(401, 403, 404, 422, 503)
    )
    async def events(
        person: Annotated[Person, viewer],
        cookie: Annotated[str | None, Depends(session_cookie)],
        asset: Annotated[str | None, Query(max_length=200, description="All of this one; of others summaries")] = None,
    ) -> Response:
        """Tell what is so now and what happens: events `site`, `service`, `asset`, `summary`, `samples`, `alive`."""
        try:
            with _refusing(asset):
                admitted = await broadcast.admit(asset)
        except BusyError as error:
            raise HTTPException(503, str(error), {"retry-after": "10"}) from None
        return EventStream(broadcast, admitted, lambda: guard.who(cookie) is not None)

    return router


def _measures(face: Face, guard: Guard, broadcast: Broadcast, token: str) -> APIRouter:
    """Give what programs measure; they show a token where people have a session."""
    router = APIRouter(tags=["views"], route_class=Bounded)

    async def may_ask(
        cookie: Annotated[str | None, Depends(session_cookie)], shown: Annotated[Bearer | None, Depends(_bearer)]
    ) -> None:
        is_known = bool(token) and shown is not None and hmac.compare_digest(shown.credentials.encode(), token.encode())
        if not is_known and guard.who(cookie) is None:
            raise HTTPException(401, "Nobody is logged in. Show the token of `tell`.", {"www-authenticate": "Bearer"})

    @router.get("/metrics", response_class=Metrics, responses=refusals(401), dependencies=[Depends(may_ask)])
    def metrics(request: Request) -> Response:
        """Tell what is measured, as OpenMetrics has it."""
        return _packed(request, Metrics(face.metrics(len(broadcast))))

    return router


def _packed(request: Request, answer: Response) -> Response:
    """Give an answer by gzip where that is taken; only one without secrets, since its size tells of what is in it."""
    answer.headers["vary"] = "accept-encoding"
    if "gzip" in request.headers.get("accept-encoding", ""):
        answer.body = gzip.compress(bytes(answer.body), 4)
        answer.headers["content-encoding"] = "gzip"
        answer.headers["content-length"] = str(len(answer.body))
    return answer


@contextmanager
def _refusing(asset: str | None) -> Iterator[None]:
    """Refuse what is asked of an asset as HTTP does."""
    try:
        yield
    except KeyError:
        raise HTTPException(404, f"There is no asset {asset!r}.") from None
    except StoreError as error:
        raise HTTPException(503, str(error)) from None


def _deeds(face: Face, guard: Guard) -> APIRouter:
    """Give what people may do."""
    router = APIRouter(tags=["deeds"], route_class=Bounded)
    operator = person_of(guard, Role.OPERATE)

    @router.post(
        "/api/v1/assets/{asset}/deeds",
        status_code=201,
        response_model=EntryShape,
        responses=refusals(400, 401, 403, 404, 409, 413, 415, 422, 429, 503),
        dependencies=[Depends(check_json), paced(operator, RequestRate(most=DEEDS))],
    )
    async def do(
        asset: AssetName,
        body: DeedShape,
        person: Annotated[Person, operator],
        token: Annotated[str | None, Depends(token_header)],
    ) -> Response:
        """Do something about an asset; what comes back is the entry of the journal, and is on the disk."""
        check_token(person, token)
        role = await asyncio.to_thread(_needed, face, asset, body)
        if person.role < role:
            raise RoleError(person, role)
        wanted = Wanted(
            asset=asset,
            action=body.action,
            who=person.name,
            comment=body.comment.strip(),
            target=tuple(body.target),
            minutes=body.minutes,
            undone=body.undone,
        )
        return JSONResponse(await _done(face, wanted), 201)

    return router


def _needed(face: Face, asset: str, deed: DeedShape) -> Role:
    """Give the role that a deed takes; to take one back takes that of the deed, and of an old one the highest."""
    if deed.action is not Action.UNDO:
        return needed(deed.action)
    with _refusing(asset):
        journal = face.asset(asset)["journal"]
    taken_back = [entry["action"] for entry in journal if entry["number"] == deed.undone]
    return needed(Action(taken_back[0])) if taken_back else Role.ENGINEER


async def _done(face: Face, wanted: Wanted) -> Shown:
    try:
        with _refusing(wanted.asset):
            return await face.do(wanted)
    except FaultbondError as error:
        raise HTTPException(409, str(error)) from None
