"""What stands before every answer: whom it is for, what a browser may do with it, and how a refusal reads.

A browser on this machine can be made to ask this service by any page that it shows. So the name under which the service
is asked must be one of its own (else a foreign name could be turned to this address), and what changes something must
come from a page of ours and carry a token that only such a page can know.
"""

from collections.abc import Collection
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = ("localhost", "127.0.0.1", "::1")
SAFE = {"GET", "HEAD", "OPTIONS"}
POLICY = "default-src 'self'; object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
# A report is one file with scripts inside: they run, but as a stranger's, without the cookie and without the network.
REPORT_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'; sandbox allow-scripts allow-modals"
)
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
    "cache-control": "no-store",
}


def refusal(status: int, error: str, headers: dict[str, str] | None = None) -> JSONResponse:
    """Give the one shape of all that is refused or fails."""
    return JSONResponse({"ok": False, "error": error, "status": status}, status, headers)


class Shield:
    """Refuses foreign names and origins, and gives every answer the headers above that it has not got itself.

    hosts: names and addresses under which the service may be asked, without ports.
    """

    def __init__(self, app: ASGIApp, hosts: Collection[str]) -> None:
        self._app = app
        self._hosts = frozenset(name.lower().strip("[]") for name in hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        refused = self._refused(scope)
        await (refused or self._app)(scope, receive, guarded)

    def _refused(self, scope: Scope) -> JSONResponse | None:
        headers = Headers(scope=scope)
        asked = headers.getlist("host")
        if len(asked) != 1 or _hostname(asked[0]) not in self._hosts:
            return refusal(421, "This service does not answer to this name. Ask it by one of its own.")
        origin = headers.get("origin")
        if scope["method"] not in SAFE and origin is not None and not _is_same(origin, asked[0]):
            return refusal(403, "This came from a page of another site. Use the service's own page.")
        return None


def _hostname(host: str) -> str:
    """Give the name in a header like `name:port`, empty where it is none."""
    try:
        parts = urlsplit(f"//{host}")
        return "" if parts.path or "@" in host or "?" in host else (parts.hostname or "")
    except ValueError:
        return ""


def _is_same(origin: str, host: str) -> bool:
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    return parts.scheme in {"http", "https"} and parts.netloc.lower() == host.lower()
