"""`make quick` leaves out what took long the last time that all tests ran, and nothing else."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from costs import DEAR

CONFTEST = """
from costs import Costs

def pytest_addoption(parser):
    parser.addoption("--quick", action="store_true")

def pytest_configure(config):
    config.pluginmanager.register(Costs(config, config.cache))
"""
BUSY = f"import time; end = time.process_time() + {2.5 * DEAR}\nwhile time.process_time() < end: pass\n"
TESTS = {
    "test_cheap.py": "def test_one(): pass\ndef test_fails(): assert 0\n",
    "test_busy.py": f"def test_it():\n    {BUSY.replace(chr(10), chr(10) + '    ')}\ndef test_two(): pass\n",
    "test_starts.py": f"import subprocess, sys\ndef test_it(): subprocess.run([sys.executable, '-c', {BUSY!r}])\n",
}
NEW = "test_new.py"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project with a cheap file, one whose tests are dear, and one whose programs are."""
    (tmp_path / "pytest.ini").write_text("[pytest]\ntestpaths = tests\n")
    (tmp_path / "tests").mkdir()
    for name, text in {"conftest.py": CONFTEST, **TESTS}.items():
        (tmp_path / "tests" / name).write_text(text)
    return tmp_path


def files_run(project: Path, *words: str) -> set[str]:
    """The files of which tests ran."""
    command = [sys.executable, "-m", "pytest", "-v", "-p", "xdist", "-n", "1", *words]
    environment = {
        **os.environ,
        "PYTHONPATH": str(Path(__file__).parent / "shared"),
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
    }
    said = subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, check=False).stdout
    return {name for name in (*TESTS, NEW) if f"{name}::" in said}


def test_what_was_dear_is_left_out(project: Path) -> None:
    """What a whole run found dear is left out, what is cheap or new is not; a part of the tests measures nothing."""
    assert files_run(project, "tests/test_busy.py") == {"test_busy.py"}
    assert files_run(project, "--quick") == {*TESTS}
    assert files_run(project) == {*TESTS}
    (project / "tests" / NEW).write_text("def test_it(): pass\n")
    assert files_run(project, "--quick") == {"test_cheap.py", NEW}
