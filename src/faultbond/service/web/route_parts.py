"""What the routes of the interface share: who may ask, what is taken of a body, and how refusals are described."""

import hmac
import math
from collections.abc import Callable, Coroutine
from typing import Annotated, Any

from fastapi import Depends, HTTPException, Request, Response
from fastapi.routing import APIRoute
from fastapi.security import APIKeyCookie, APIKeyHeader
from starlette.types import Message

from faultbond.service.web.request_rate import RequestRate
from faultbond.service.web.security import Guard, Person, Role
from faultbond.service.web.shapes import RefusalShape

COOKIE = "faultbond_session"
TOKEN = "X-Faultbond-Token"  # noqa: S105 - the name of a header
LARGEST_BODY = 64 * 1024  # bytes
_TOO_LARGE = f"The body is too large. At most {LARGEST_BODY // 1024} KiB are taken here."
REFUSALS = {
    400: "The request cannot be read.",
    401: "Nobody is logged in.",
    403: "The role, the origin or the token is not right.",
    404: "There is no such thing.",
    408: "A file does not come on.",
    409: "It cannot be done now.",
    413: "The body is too large.",
    415: "The body is not JSON, or a file is none of its kind.",
    421: "The service does not answer to this name.",
    422: "A value is missing or wrong.",
    429: "There were too many failed logins, requests, files, or analyses that wait.",
    503: "The store cannot be read or written, or too many pages are open.",
}
_MORE = {429: {"headers": {"Retry-After": {"description": "s to wait", "schema": {"type": "integer"}}}}}
session_cookie = APIKeyCookie(name=COOKIE, auto_error=False, description="Of a session that `login` began")
token_header = APIKeyHeader(name=TOKEN, auto_error=False, description="The `token` that `me` tells")


class Bounded(APIRoute):
    """A route that takes small bodies only; too large a one is refused in the shape of all refusals."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Give what answers."""
        answer = super().get_route_handler()

        async def bounded(request: Request) -> Response:
            length = request.headers.get("content-length", "")
            if length.isdecimal() and int(length) > LARGEST_BODY:
                raise HTTPException(413, _TOO_LARGE)
            taken = 0

            async def receive() -> Message:
                nonlocal taken
                message = await request.receive()
                taken += len(message.get("body", b""))
                if taken > LARGEST_BODY:
                    raise HTTPException(413, _TOO_LARGE)
                return message

            return await answer(Request(request.scope, receive))

        return bounded


def refusals(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Describe refusals by their statuses."""
    return {
        status: {"model": RefusalShape, "description": REFUSALS[status], **_MORE.get(status, {})} for status in statuses
    }


class RoleError(HTTPException):
    """The role of a person is less than what they ask for takes."""

    def __init__(self, person: Person, role: Role) -> None:
        super().__init__(403, f"{person.name} may not do this: it takes the role {role.name.lower()}.")
        self.person, self.role = person, role


def person_of(guard: Guard, role: Role) -> Any:
    """Give what finds the person that asks, and refuses one whose role is less."""

    async def found(cookie: Annotated[str | None, Depends(session_cookie)]) -> Person:
        person = guard.who(cookie)
        if person is None:
            raise HTTPException(401, "Nobody is logged in. Log in first.", {"www-authenticate": "Session"})
        if person.role < role:
            raise RoleError(person, role)
        return person

    return Depends(found)


def paced(person: Any, rate: RequestRate) -> Any:
    """Give what refuses a session that asks too often. person: what finds it, as of `person_of`."""

    async def checked(found: Annotated[Person, person]) -> None:
        wait = math.ceil(rate.wait(found.token))
        if wait:
            raise HTTPException(429, f"Too many requests. Ask again in {wait} s.", {"retry-after": str(wait)})

    return Depends(checked)


def check_token(person: Person, token: str | None) -> None:
    """Refuse what does not come from a page of this person.

    Raises
    ------
    HTTPException
        Where the token is not that of their session.
    """
    if token is None or not hmac.compare_digest(token.encode(), person.token.encode()):
        raise HTTPException(403, f"The token is not right. Send that of `me` as {TOKEN}.")


async def check_json(request: Request) -> None:
    """Refuse a body that is not said to be JSON.

    Raises
    ------
    HTTPException
        Where it is not.
    """
    if request.headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
        raise HTTPException(415, "The body is to be JSON. Send it as application/json.")
