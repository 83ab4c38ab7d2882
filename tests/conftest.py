"""What holds for all tests."""

import gc
import os
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

# Matrices are small here, and threads would only wait for each other. numpy asks for it when it is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.shared.broker import MOSQUITTO, Mosquitto

from costs import Costs
from postgres import MISSING, PostgresServer, can_run
from watching import watch_program

# Cores of tests run for moments, and are compiled in a third of the time; tests/unit/synthesis/test_compile.py compares
# them with those of users.
os.environ["FAULTBOND_HASTY"] = "1"

BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")  # the first one that is here


def pytest_addoption(parser: pytest.Parser) -> None:
    """Tests can be quick."""
    parser.addoption("--quick", action="store_true", help="leave out files whose tests took long the last time")


def pytest_configure(config: pytest.Config) -> None:
    """Measure what tests cost."""
    cache: pytest.Cache | None = getattr(config, "cache", None)  # which can be switched off
    if cache is not None:
        config.pluginmanager.register(Costs(config, cache))


def pytest_collection_finish() -> None:
    """Let the collector of garbage look at what tests make, seldom; what all modules made stays to the end."""
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Gives the program of a built-in plant, by its name; workers of one session share them."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    return partial(watch_program, folder=shared / "programs")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium without a window; the shell that has none takes half of the time of the whole program."""
    playwright = pytest.importorskip("playwright.sync_api", reason="there is no playwright: pip install playwright")
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip("there is no chromium")
    options = ["--no-sandbox"] if os.name == "posix" and os.geteuid() == 0 else []
    with playwright.sync_playwright() as player:
        opened = player.chromium.launch(executable_path=found, args=options)
        yield opened
        opened.close()


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[PostgresServer]:
    """The server of all tests of a worker."""
    pytest.importorskip("psycopg", reason='there is no psycopg: pip install "faultbond[postgres]"')
    if not can_run():
        pytest.skip(MISSING)
    found = PostgresServer()
    yield found
    found.close()


@pytest.fixture
def postgres(postgres_server: PostgresServer) -> Iterator[PostgresServer]:
    """A server of PostgreSQL that runs, and that a test may kill."""
    yield postgres_server
    if not postgres_server.is_running:
        postgres_server.start()


@pytest.fixture(params=["sqlite", "postgresql"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """The address of a store of each kind that is not there yet."""
    if request.param == "sqlite":
        return str(tmp_path / "plant.db")
    server: PostgresServer = request.getfixturevalue("postgres")
    return server.url()


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    """A broker without a log-in."""
    if MOSQUITTO is None:
        pytest.skip("there is no mosquitto")
    pytest.importorskip("aiomqtt", reason="there is no aiomqtt: pip install 'faultbond[mqtt]'")
    found = Mosquitto(tmp_path)
    found.start()
    yield found
    found.kill()
