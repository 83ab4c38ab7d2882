"""A server of PostgreSQL for tests, in a folder of its own and on a free port."""

import os
import shutil
import socket
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any

from benchmarks.shared.broker import free_port

MISSING = "there is no PostgreSQL: apt install postgresql"
OWNERS = ("postgres", "nobody")  # who runs it where the tests are run by root, which it refuses to be
GUARDED = "host all guarded 127.0.0.1/32 scram-sha-256"  # who needs a password


def programs() -> Path | None:
    """Give the folder with the programs of the newest PostgreSQL here; None where there is none."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/pg_ctl"), key=lambda path: int(path.parts[-3]))
    near = shutil.which("pg_ctl")
    return found[-1].parent if found else Path(near).parent if near else None


def can_run() -> bool:
    """Whether there is one, and somebody who may run it."""
    return programs() is not None and (not _is_root() or _owner() is not None)


def _is_root() -> bool:
    return hasattr(os, "geteuid") and os.geteuid() == 0


def _owner() -> str | None:
    """Give who is to run it; None: who runs the tests."""
    if not _is_root():
        return None
    import pwd  # noqa: PLC0415 - not on every system

    known = {item.pw_name for item in pwd.getpwall()}
    return next((name for name in OWNERS if name in known), None)


class PostgresServer:
    """A server that anybody on this machine may use without a password, `guarded` excepted, and that can be killed."""

    def __init__(self) -> None:
        self.port = free_port()
        self._folder = Path(tempfile.mkdtemp(prefix="fbpg"))
        self._numbers = count()
        owner = _owner()
        if owner is not None:
            shutil.chown(self._folder, owner)
        data = self._folder / "data"
        self._run("initdb", "--pgdata", data, "--username", "root", "--auth", "trust", "--no-sync", "-E", "UTF8")
        rules = data / "pg_hba.conf"
        rules.write_text(f"{GUARDED}\n{rules.read_text()}")
        settings = f"port={self.port}\nlisten_addresses='127.0.0.1'\nunix_socket_directories='{self._folder}'\n"
        with (data / "postgresql.conf").open("a") as stream:
            stream.write(f"{settings}max_connections=20\nautovacuum_naptime=5s\n")
        self.start()

    def url(self, schema: str = "", *, user: str = "root", database: str = "postgres") -> str:
        """Give the address of a schema; that of a new one where none is named."""
        return f"postgresql://{user}@127.0.0.1:{self.port}/{database}?schema={schema or f's{next(self._numbers)}'}"

    @property
    def is_running(self) -> bool:
        """Whether it runs."""
        return (self._folder / "data" / "postmaster.pid").exists()

    def start(self) -> None:
        """Start it, and wait until it answers."""
        self._control("start")

    def stop(self) -> None:
        """Kill it, as a loss of power would."""
        self._control("stop")

    def restart(self) -> None:
        """Kill it, and start it again."""
        self._control("restart")

    def close(self) -> None:
        """Kill it, and remove all that it had."""
        if self.is_running:
            self.stop()
        shutil.rmtree(self._folder, ignore_errors=True)

    @contextmanager
    def session(self) -> Iterator[Any]:
        """Let somebody else do something in it who may do anything."""
        import psycopg  # noqa: PLC0415 - an extra

        with psycopg.connect(self.url("x").partition("?")[0], autocommit=True) as found:
            yield found

    def _control(self, what: str) -> None:
        how = () if what == "start" else ("-m", "immediate")
        self._run("pg_ctl", what, "-D", self._folder / "data", "-w", "-t", 60, *how, "-l", self._folder / "log")

    def _run(self, program: str, *words: object) -> None:
        place = programs()
        assert place is not None
        command = [str(place / program), *map(str, words)]
        subprocess.run(command, check=True, cwd="/", user=_owner(), stdout=subprocess.DEVNULL, env=_plain())


class DeafLine:
    """A way to a server on which an answer can be lost. deaf: the next word that a commit is done does not arrive."""

    def __init__(self, server: PostgresServer) -> None:
        self._server, self.deaf = server, False
        self._door = socket.create_server(("127.0.0.1", 0))
        self._ends: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def url(self, schema: str = "") -> str:
        """Give the address of a schema, by this way."""
        port = self._door.getsockname()[1]
        return self._server.url(schema).replace(f":{self._server.port}/", f":{port}/")

    def cut(self) -> None:
        """Close all that goes over it."""
        while self._ends:
            with suppress(OSError):
                self._ends[-1].shutdown(socket.SHUT_RDWR)
            self._ends.pop().close()

    def close(self) -> None:
        """Close it."""
        self.cut()
        self._door.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._door.accept()
                far = socket.create_connection(("127.0.0.1", self._server.port))
                self._ends += [near, far]
                for one, other in ((near, far), (far, near)):
                    threading.Thread(target=self._pass, args=(one, other, one is far), daemon=True).start()

    def _pass(self, one: socket.socket, other: socket.socket, is_answer: bool) -> None:
        with suppress(OSError):
            while data := one.recv(2**16):
                if is_answer and self.deaf and b"COMMIT\0" in data:
                    self.deaf = False
                    break
                other.sendall(data)
        for end in (one, other):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)


def _plain() -> dict[str, str]:
    """Give an environment in which messages are English."""
    return {**{name: value for name, value in os.environ.items() if not name.startswith("PG")}, "LC_ALL": "C"}
