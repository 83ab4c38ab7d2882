"""What holds for all tests."""

import gc
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

# Matrices are small here, and threads would only wait for each other. numpy asks for it when it is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from watching import watch_program

# Cores of tests run for moments, and are compiled in a third of the time; tests/unit/synthesis/test_compile.py compares
# them with those of users.
os.environ["FAULTBOND_HASTY"] = "1"


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
