"""The generated project of the tank, built for a target and run there."""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from benchmarks.shared.plants import EXAMPLES
from benchmarks.targets.healthy import healthy_rows
from faultbond.cli import main

TANK = EXAMPLES / "tank"
FEW, MANY = 5_000, 50_000  # healthy rows: what more rows take more
ROUNDS = 3
TICK = 40  # instructions, of the timer of the emulated board
BOARD = "cortex-m7"
NOWHERE = "nothing here"
GCC = {  # for graphs of calls, which zig's compiler does not write
    "native": "cc",
    BOARD: "arm-none-eabi-gcc -mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard",
}
IMAGE = "[an image](#a-microcontroller)"
PROBE = """
#include <stdio.h>

#include "faultbond.h"

int main(void)
{
    printf("%lld %lld\\n", (long long)fb_state_size(), (long long)fb_work_size());
    return 0;
}
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Project:
    """A generated folder."""

    folder: Path

    @classmethod
    def generate(cls, folder: Path) -> "Project":
        """Generate the project of the tank; its example is a program that tells sizes."""
        place = folder / "tank"
        if main(["generate", str(TANK / "model.yaml"), "-o", str(place)]) != 0:
            raise RuntimeError("faultbond generate failed")
        (place / "example.c").write_text(PROBE, encoding="utf-8")
        return cls(folder=place)

    def figures(self, target: str) -> tuple[str, ...]:
        """Give the cells of a target: bytes, memory, stack, time of a sample, verdict, and what ran it."""
        done = self._make(target, "all")
        if done.returncode != 0:
            return ("not built here", *("",) * 6)
        if target == BOARD:
            return self._figures_of_the_board()
        program = self._built(target, "watch")
        size = f"{program.stat().st_size:,}"
        runner = self._runner(target)
        if runner is None:
            return size, "", "", "", "", "not run", NOWHERE
        self._make(target, f"{self._place(target)}/{self._built(target, 'example').name}")
        told = subprocess.run(
            [*runner, str(self._built(target, "example"))], cwd=self.folder, capture_output=True, text=True, check=True
        )
        plant, call = (f"{int(word):,}" for word in told.stdout.split())
        verdict = "yes" if self._make(target, "check").returncode == 0 else "no"
        return (
            size,
            plant,
            call,
            self._stack(target),
            self._sample(target, runner),
            verdict,
            f"`{runner[0]}`" if runner else "itself",
        )

    def program(self, target: str = "native") -> Path:
        """Give the program of a target, built."""
        done = self._make(target, "all")
        if done.returncode != 0:
            raise RuntimeError(done.stderr)
        return self._built(target, "watch")

    def _sample(self, target: str, runner: list[str]) -> str:
        """Give the time of a healthy sample: of many rows, less that of few."""
        command = [*runner, str(self._built(target, "watch"))]
        found = []
        for _ in range(ROUNDS):
            few, many = (_processor(command, healthy_rows(count), self.folder) for count in (FEW, MANY))
            found.append(many - few)
        told = f"{1e6 * median(found) / (MANY - FEW):.1f} µs"
        return f"{told}, emulated" if runner and runner[0].startswith("qemu") else told

    def _figures_of_the_board(self) -> tuple[str, ...]:
        """Give the cells of the image for a board, from what it says of itself."""
        told = self._make(BOARD, "check")
        end = re.search(
            r'"state": (\d+), "work": (\d+), .*"watching_ticks": (\d+), "watching_steps": (\d+)',
            told.stdout + told.stderr,
        )
        if end is None:
            return IMAGE, "", "", "", "", "not run", NOWHERE
        state, work, ticks, steps = (int(word) for word in end.groups())
        verdict = "yes" if told.returncode == 0 else "no"
        step = f"{TICK * ticks / steps:,.0f} instructions, emulated"
        return IMAGE, f"{state:,}", f"{work:,}", self._stack(BOARD), step, verdict, "`qemu-system-arm`"

    def _stack(self, target: str) -> str:
        """Give the bound of the stack of a sample, bytes; nothing where no gcc of the target is here."""
        compiler = GCC.get(target, "")
        if not compiler or shutil.which(compiler.split()[0]) is None:
            return ""
        told = self._make(target, "stack", f"COMPILE={compiler}")
        found = re.search(r"^ *(\d+) bytes  fb_step$", told.stdout, re.MULTILINE)
        return f"{int(found[1]):,}" if found and told.returncode == 0 else ""

    def _runner(self, target: str) -> list[str] | None:
        """Give the words before a program of a target; None where nothing here runs it."""
        if target in ("native", "x86_64-linux-static"):
            return []
        if target == "aarch64-macos":
            return None
        makefile = (self.folder / "Makefile").read_text(encoding="utf-8")
        found = re.search(rf"^RUN_{re.escape(target)} = (.*)$", makefile, re.MULTILINE)
        words = found[1].split() if found else []
        return words if words and shutil.which(words[0]) else None

    def _place(self, target: str) -> str:
        return "." if target == "native" else f"build/{target}"

    def _built(self, target: str, name: str) -> Path:
        """Give the file of a program that was built, with or without an ending."""
        place = self.folder / self._place(target)
        endings = {"x86_64-windows": ".exe", "wasm32-wasi": ".wasm"}
        return place / f"{name}{endings.get(target, '')}"

    def _make(self, target: str, *words: str) -> subprocess.CompletedProcess[str]:
        zig = shutil.which("zig") or f"{sys.executable} -m ziglang"
        command = ["make", "-s", "-j1", "-C", str(self.folder), f"TARGET={target}", f"ZIG={zig}", *words]
        return subprocess.run(command, capture_output=True, text=True, check=False)


def _processor(command: list[str], rows: bytes, folder: Path) -> float:
    """Give the processor time of a program that reads rows, s.

    Raises
    ------
    RuntimeError
        Where it fails or finds a fault.
    """
    source = folder / "rows.csv"
    source.write_bytes(rows)
    with source.open("rb") as stream:
        process = subprocess.Popen(command, cwd=folder, stdin=stream, stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} ended with {process.returncode}")
    return usage.ru_utime + usage.ru_stime
