"""An application about made-up assets, asked without a socket as a browser would."""

import asyncio
from collections.abc import Awaitable, Mapping
from typing import Any

import httpx

from fake_desk import FakeDesk
from fake_face import FakeFace
from faultbond.service.web.application import application
from faultbond.service.web.route_parts import COOKIE, TOKEN
from faultbond.service.web.security import Guard, Role
from faultbond.service.web.shapes import RefusalShape

LONGEST = 30.0  # s
PASSWORDS = {
    "viola": ("seen only", Role.VIEW),
    "otto": ("hands on", Role.OPERATE),
    "emma": ("all of it", Role.ENGINEER),
}


class Asked:
    """Asks an application as a browser would: with its cookies and, where it has one, the token."""

    def __init__(self, face: FakeFace, guard: Guard) -> None:
        self.face = face
        self.guard = guard
        self.desk = FakeDesk()
        self.app = application(face, guard, desk=self.desk)
        self.cookies: dict[str, str] = {}
        self.token: str | None = None

    def __call__(
        self, method: str, path: str, *, headers: Mapping[str, str] | None = None, host: str = "localhost", **told: Any
    ) -> Any:
        """Ask once and give the answer."""
        return run(self._ask(method, path, headers or {}, host, told))

    async def _ask(self, method: str, path: str, headers: Mapping[str, str], host: str, told: dict[str, Any]) -> Any:
        transport = httpx.ASGITransport(app=self.app, raise_app_exceptions=False)
        own = {TOKEN: self.token} if self.token is not None else {}
        async with httpx.AsyncClient(
            transport=transport, base_url=f"http://{host}:8080", cookies=self.cookies
        ) as client:
            return await client.request(method, path, headers={**own, **headers}, **told)

    def enter(self, name: str | None = None) -> "Asked":
        """Log in, where there is a name, and take the token."""
        if name is not None:
            answer = self("POST", "/api/v1/login", json={"name": name, "password": PASSWORDS[name][0]})
            self.cookies = {COOKIE: answer.cookies[COOKIE]}
        self.token = self("GET", "/api/v1/me").json()["token"]
        return self

    def do(self, asset: str = "tank_2", headers: Mapping[str, str] | None = None, **deed: Any) -> Any:
        """Do something about an asset."""
        return self("POST", f"/api/v1/assets/{asset}/deeds", headers=headers, json=deed)


def is_refused(answer: Any, status: int, text: str = "") -> bool:
    """Whether an answer is a refusal in the one shape, with a sentence that has a text."""
    told = answer.json()
    shape = RefusalShape.model_validate(told, strict=True)
    return (
        set(told) == {"ok", "error", "status"} and answer.status_code == shape.status == status and text in shape.error
    )


def run(work: Awaitable[Any]) -> Any:
    """Wait for something, not for ever."""

    async def bounded() -> Any:
        return await asyncio.wait_for(work, LONGEST)

    return asyncio.run(bounded())
