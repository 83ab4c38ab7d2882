"""Programs for other machines, built by zig and run by what can run them here: the self-test of the tank passes on all.

That takes minutes, most of it for zig's own libraries the first time; so without FAULTBOND_TARGETS=all only two run.
"""

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from faultbond.cli import main
from faultbond.types import TARGETS

TANK = Path(__file__).parents[2] / "examples" / "tank"
RUNNERS = {
    "x86_64-linux-static": None,
    "wasm32-wasi": "node",
    "aarch64-linux": "qemu-aarch64",
    "armv7-linux": "qemu-arm",
    "riscv64-linux": "qemu-riscv64",
    "x86_64-windows": "wine",
    "aarch64-macos": "",  # nothing runs it here; it is built
}
OFTEN = ("x86_64-linux-static", "wasm32-wasi")
LARGEST = 300_000  # bytes of the static program
ZIG = shutil.which("zig") or (f"{sys.executable} -m ziglang" if find_spec("ziglang") else "")

pytestmark = [
    pytest.mark.skipif(not ZIG, reason="there is no zig: pip install ziglang"),
    pytest.mark.skipif(shutil.which("make") is None, reason="there is no make"),
]


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project of the tank."""
    folder = tmp_path_factory.mktemp("targets") / "tank"
    assert main(["generate", str(TANK / "model.yaml"), "-o", str(folder)]) == 0
    return folder


def made(folder: Path, *words: str) -> str:
    """Run make; gives what it says."""
    done = subprocess.run(
        ["make", "-s", "-j1", "-C", str(folder), f"ZIG={ZIG}", *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("target", [name for name in TARGETS[1:] if name != "cortex-m7"])  # see test_board
def test_the_self_test_passes_on(target: str, project: Path) -> None:
    """The program of a target says of the recorded samples what `run` said here; the static one is small, and alone."""
    if target not in OFTEN and os.environ.get("FAULTBOND_TARGETS") != "all":
        pytest.skip("FAULTBOND_TARGETS is not `all`")
    runner = RUNNERS[target]
    if runner and shutil.which(runner) is None:
        pytest.skip(f"there is no {runner}")
    made(project, f"TARGET={target}", "all")
    if runner != "":
        assert "records, as expected" in made(project, f"TARGET={target}", "check")
    if target == "x86_64-linux-static":
        program = project / "build" / target / "watch"
        assert program.stat().st_size < LARGEST
        assert b"/ld-" not in program.read_bytes()  # no loader, so no library at run time
