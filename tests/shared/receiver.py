"""A program that is told by webhook: it fails as often as a test wants, and keeps what it took."""

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any


@dataclass
class Receiver:
    """What came, and how it is answered.

    answers: statuses of the next posts, before all that follow are taken with 204. taken: headers and body of each
    that was. seen: how many came. after: what `Retry-After` says with a failure. port: where it listens.
    """

    answers: list[int] = field(default_factory=list)
    taken: list[tuple[dict[str, str], bytes]] = field(default_factory=list)
    seen: int = 0
    after: str = ""
    port: int = 0

    def records(self) -> list[dict[str, Any]]:
        """Give the records that were taken."""
        return [json.loads(body) for _, body in self.taken]

    def answer(self, headers: dict[str, str], body: bytes) -> int:
        """Take a post or not, and give the status."""
        self.seen += 1
        status = self.answers.pop(0) if self.answers else 204
        if status < 300:
            self.taken.append((headers, body))
        return status


@contextmanager
def listening(receiver: Receiver) -> Iterator[Receiver]:
    """Let a receiver listen, at its port if it has one."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            self.send_response(receiver.answer({k.lower(): v for k, v in self.headers.items()}, body))
            if receiver.after:
                self.send_header("Retry-After", receiver.after)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", receiver.port), Handler) as server:
        receiver.port = server.server_address[1]
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield receiver
        finally:
            server.shutdown()
            thread.join()
