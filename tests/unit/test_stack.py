"""`make stack` of a generated project: a bound of the library's stack that no run of its self-test passes."""

import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

from faultbond.cli import main

ROOT = Path(__file__).parents[2]
RC = ROOT / "examples" / "rc" / "model.yaml"
COUNTED = ROOT / "src" / "faultbond" / "synthesis" / "templates" / "stack.awk"
LIBRARY = 1024  # bytes that mathematics of the C library, and the call itself, may take on top
DEEPEST = re.compile(r"^ *(\d+) bytes  (\w+)$", re.MULTILINE)
PLAYER = """
#include <stdio.h>
#include <ucontext.h>

#include "faultbond.h"
#include "check/samples.h"

#define ROOM 65536
#define MARK 0x5A

FB_ALIGNED static unsigned char state[FB_STATE_BYTES], work[FB_WORK_BYTES], room[ROOM];
static Report report;
static Diagnosis found;
static ucontext_t back, there;

static void play(void)
{
    for (int k = 0; k < N_SAMPLES; k++) (void)fb_step(state, work, SAMPLES[k], &report, &found);
}

int main(void)
{
    int unused = 0;
    fb_init(state, SAMPLES[0][0], 0);
    memset(room, MARK, ROOM);
    getcontext(&there);
    there.uc_stack.ss_sp = room;
    there.uc_stack.ss_size = ROOM;
    there.uc_link = &back;
    makecontext(&there, play, 0);
    swapcontext(&back, &there);
    while (unused < ROOM && room[unused] == MARK) unused++;
    printf("%d\\n", ROOM - unused);
    return 0;
}
"""
GRAPH = """
node: {{ title: "fb_step" label: "fb_step\\ncore.c:1:1\\n{frame}" }}
node: {{ title: "core.c:turn" label: "turn\\ncore.c:9:1\\n32 bytes (static)" }}
edge: {{ sourcename: "fb_step" targetname: "core.c:turn" label: "core.c:2:5" }}
edge: {{ sourcename: "core.c:turn" targetname: "{called}" label: "core.c:10:5" }}
"""


def measures() -> bool:
    """Whether the system's compiler writes graphs of calls."""
    if shutil.which("cc") is None:
        return False
    command = ["cc", "-fcallgraph-info=su", "-c", "-x", "c", "-", "-o", "empty.o"]
    with tempfile.TemporaryDirectory() as folder:
        return subprocess.run(command, cwd=folder, input=b"", capture_output=True, check=False).returncode == 0


pytestmark = [
    pytest.mark.skipif(shutil.which("make") is None, reason="there is no make"),
    pytest.mark.skipif(shutil.which("awk") is None, reason="there is no awk"),
]


@pytest.mark.skipif(not measures(), reason="the compiler is not gcc 10 or later")
def test_a_run_stays_within_the_bound(tmp_path: Path) -> None:
    """What the self-test marks of a painted stack is no more than is told of `fb_step`, and most of it."""
    folder = tmp_path / "rc"
    assert main(["generate", str(RC), "-o", str(folder)]) == 0
    done = subprocess.run(
        ["make", "-s", "-j1", "-C", str(folder), "stack"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    told = {name: int(size) for size, name in DEEPEST.findall(done.stdout)}
    assert f"at the most {max(told.values())} bytes: fb_step > fb_block" in done.stdout
    (folder / "player.c").write_text(PLAYER)
    parts = [f"build/native/stack/{name}.o" for name in ("library", "filters", "one")]
    command = ["cc", "-O1", "-DFB_LANES=2", "-I.", "-Icore", "player.c", *parts, "-static", "-lm", "-o", "player"]
    subprocess.run(command, cwd=folder, check=True)
    used = int(subprocess.run(["./player"], cwd=folder, capture_output=True, text=True, check=True).stdout)
    assert 0.5 * told["fb_step"] < used <= told["fb_step"] + LIBRARY


@pytest.mark.parametrize(
    ("frame", "called", "words", "code"),
    [
        ("100 bytes (static)", "exp", "132 bytes  fb_step", 0),
        ("100 bytes (dynamic,bounded)", "exp", "132 bytes  fb_step", 0),
        ("100 bytes (dynamic)", "exp", "no bound: fb_step takes what it is asked for", 1),
        ("100 bytes (static)", "fb_step", "no bound: fb_step calls itself", 1),
        ("100 bytes (static)", "__indirect_call", "no bound: a call by a pointer", 1),
    ],
)
def test_what_has_no_bound_is_told(frame: str, called: str, words: str, code: int, tmp_path: Path) -> None:
    """Functions that call themselves or by a pointer, or take memory as they go, have no bound: an error."""
    graph = tmp_path / "core.ci"
    graph.write_text(GRAPH.format(frame=frame, called=called))
    done = subprocess.run(["awk", "-f", str(COUNTED), str(graph)], capture_output=True, text=True, check=False)
    assert (done.returncode, words in done.stdout) == (code, True), done.stdout + done.stderr
