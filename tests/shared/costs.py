"""What tests cost, kept from one whole run to the next; `--quick` leaves out the files whose tests are dear.

A file is as dear as its tests are on average, in seconds of a processor, those of programs that they start among them.
What its tests share, such as a browser or an engine, is paid by one of them, so single tests are not told apart.
"""

import os
from collections import defaultdict
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

DEAR = 0.35  # s of a processor for a test: with all dearer files left out, the rest takes about six minutes of one
PLACE = "faultbond/costs"  # in pytest's own cache
PROCESSOR = "s of a processor"  # the name by which a report carries what its test cost


class Costs:
    """Measures tests, and leaves out dear files if it is to be quick."""

    def __init__(self, config: pytest.Config, cache: pytest.Cache) -> None:
        self.config, self.cache, self.quick = config, cache, bool(config.getoption("--quick"))
        self.known: dict[str, float] = cache.get(PLACE, {})
        self.found: dict[str, list[float]] = defaultdict(list)
        self.begun = 0.0

    def pytest_ignore_collect(self, collection_path: Path) -> bool | None:
        """Leave out a file that is known to be dear; what was never measured runs."""
        name = collection_path.relative_to(self.config.rootpath).as_posix()
        return True if self.quick and self.known.get(name, 0.0) > DEAR else None

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_setup(self) -> Generator[None, Any, Any]:
        """Look at the clock."""
        self.begun = _used()
        return (yield)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Let the last report of a test carry what it cost."""
        try:
            return (yield)
        finally:
            item.user_properties.append((PROCESSOR, _used() - self.begun))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note what a test cost, whichever process it ran in."""
        if report.when == "teardown":
            spent = [float(str(s)) for name, s in report.user_properties if name == PROCESSOR]
            self.found[report.nodeid.partition("::")[0]] += spent

    def pytest_sessionfinish(self, exitstatus: int) -> None:
        """Keep what a whole run has cost; of a part the means would be others."""
        options = self.config.option
        some = options.quick or options.keyword or options.markexpr or options.collectonly or options.maxfail
        whole = self.config.args_source is pytest.Config.ArgsSource.TESTPATHS and not some
        if whole and exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED) and not _is_worker(self.config):
            self.cache.set(PLACE, {name: round(sum(s) / len(s), 3) for name, s in sorted(self.found.items()) if s})


def _used() -> float:
    """Give the processor time of this process and of those that it waited for."""
    return sum(os.times()[:4])


def _is_worker(config: pytest.Config) -> bool:
    """Whether this process runs a part of the tests for another one."""
    return hasattr(config, "workerinput")
