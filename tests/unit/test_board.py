"""Images for a Cortex-M7 without operating system: in an emulator they say of the recorded samples what `run` says.

zig builds its C library for the first of them, which takes a minute or two; FAULTBOND_TARGETS=all also runs the tank.
"""

import json
import os
import re
import shutil
import struct
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from faultbond.cli import main

EXAMPLES = Path(__file__).parents[2] / "examples"
ZIG = shutil.which("zig") or (f"{sys.executable} -m ziglang" if find_spec("ziglang") else "")
FLASH, RAM = 256 * 1024, 512 * 1024  # bytes of a usual controller of this kind
NEAR = 1e-6
ALLOCATED, WRITTEN, EMPTY = 2, 1, 8  # flags of a section, and the type of one without bytes in the file

pytestmark = [
    pytest.mark.skipif(not ZIG, reason="there is no zig: pip install ziglang"),
    pytest.mark.skipif(shutil.which("make") is None, reason="there is no make"),
    pytest.mark.skipif(
        shutil.which("qemu-system-arm") is None, reason="there is no qemu-system-arm: apt install qemu-system-arm"
    ),
]


def checked(folder: Path, *words: str) -> tuple[int, list[str]]:
    """Build the image of a project and run it; gives the exit code of make, and the lines that the image says."""
    command = ["make", "-s", "-j1", "-C", str(folder), f"ZIG={ZIG}", *words]
    done = subprocess.run([*command, "check"], capture_output=True, text=True, check=False, timeout=600)
    lines = (done.stdout + done.stderr).splitlines()
    return done.returncode, [line for line in lines if line.startswith("{") or "as expected" in line]


def project(example: str, folder: Path, *options: str) -> Path:
    """Generate the project of an example for the board."""
    model = str(EXAMPLES / example / "model.yaml")
    assert main(["generate", model, "-o", str(folder), "--target", "cortex-m7", *options]) == 0
    return folder


def sizes(image: Path) -> tuple[int, int]:
    """Give bytes of flash and of memory that an image takes, by the sections of its ELF file."""
    content = image.read_bytes()
    (start,) = struct.unpack_from("<I", content, 32)
    width, count = struct.unpack_from("<HH", content, 46)
    sections = [struct.unpack_from("<6I", content, start + width * k) for k in range(count)]
    kept = [(kind, flags, size) for _, kind, flags, _, _, size in sections if flags & ALLOCATED]
    flash = sum(size for kind, _, size in kept if kind != EMPTY)
    return flash, sum(size for _, flags, size in kept if flags & WRITTEN)


def agree(told: list[dict[str, Any]], folder: Path) -> None:
    """See that alarms and diagnoses are those of `run`: times, suspects, estimates and probabilities."""
    expected = [json.loads(line) for line in (folder / "check" / "expected.jsonl").read_text().splitlines()]
    for kind in ("detection", "diagnosis"):
        found, wanted = ([item for item in side if item["record"] == kind] for side in (told, expected))
        assert [item["time"] for item in found] == [item["time"] for item in wanted]
        assert found
        for one, other in zip(found, wanted, strict=True):
            for candidate, known in zip(one.get("candidates", []), other.get("candidates", []), strict=True):
                names = [name.split(".")[0] for name in known["parameters"]]
                assert list(candidate["suspects"]) == names
                estimates = [item["estimate"] for item in known["parameters"].values() if "estimate" in item]
                values = [value for value in candidate["suspects"].values() if value is not None]
                assert values == pytest.approx(estimates, rel=NEAR)
                assert candidate["probability"] == pytest.approx(known["probability"], rel=NEAR, abs=1e-12)


@pytest.mark.parametrize("example", ["dc_motor", "tank"])
def test_the_image_says_what_run_says(example: str, tmp_path: Path) -> None:
    """All alarms and diagnoses of the self-test are those of `run`, and the exit code tells when they are not."""
    if example == "tank" and os.environ.get("FAULTBOND_TARGETS") != "all":
        pytest.skip("FAULTBOND_TARGETS is not `all`")
    folder = project(example, tmp_path / "board")
    code, lines = checked(folder)
    assert (code, lines[-1]) == (0, "as expected")
    agree([json.loads(line) for line in lines[:-1]], folder)
    assert sizes(folder / "build" / "cortex-m7" / "image.elf")[0] < FLASH


def test_a_watch_fits_in_a_usual_controller(tmp_path: Path) -> None:
    """The motor without hypotheses raises its alarm in half a megabyte of memory; a wrong expectation is noticed."""
    folder = project("dc_motor", tmp_path / "board", "--watch-only")
    code, lines = checked(folder)
    assert (code, lines[-1]) == (0, "as expected")
    agree([json.loads(line) for line in lines[:-1]], folder)
    flash, memory = sizes(folder / "build" / "cortex-m7" / "image.elf")
    assert (flash < FLASH, memory < RAM) == (True, True)
    end = json.loads(lines[-2])
    assert 0 < end["stack"] < 16 * 1024
    assert 0 < end["watching_ticks"] / end["watching_steps"] < 10_000
    samples = folder / "check" / "samples.h"
    samples.write_text(re.sub(r"(EXPECTED_ALARM) .*", r"\1 1.0", samples.read_text()))
    code, lines = checked(folder)
    assert (code != 0, lines[-1]) == (True, "not as expected")
