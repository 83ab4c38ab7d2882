"""Becomes another program within limits. It is run as a script, and so needs nothing but Python.

    python -I confined.py '{"RLIMIT_AS": [4000000000, 4000000000]}' PARENT PROGRAM ARGUMENT...

The program dies with who started it, and all that it began, such as compilers, dies with it, however it ends: that is
not handed on to those by the system, so a second process watches the first and ends their group. The program gives way
to what watches the plants, and is the first to go where the machine is short of memory. Where a limit cannot be set, it
is not begun.
Source: setrlimit(2), prctl(2) under PR_SET_PDEATHSIG, proc(5) under oom_score_adj.
"""

import ctypes
import json
import os
import resource
import signal
import sys
from contextlib import suppress

PDEATHSIG = 1  # of prctl
WAY = 10  # by which it is nicer
CODE = 126  # as shells end where a program cannot be begun


def become(words: list[str]) -> None:
    """Set limits and become the program."""
    limits, parent, program = json.loads(words[0]), int(words[1]), words[2:]
    if sys.platform == "linux":
        system = ctypes.CDLL(None)
        system.prctl(PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:  # it went before this was said
            os._exit(CODE)
        if os.getpgrp() == os.getpid():  # a group of its own, with nobody else in it
            end_group_after(system)
        with suppress(OSError), open("/proc/self/oom_score_adj", "w", encoding="ascii") as stream:
            stream.write("1000")
    os.nice(WAY)
    for name, (soft, hard) in limits.items():
        kind = getattr(resource, name)
        most = resource.getrlimit(kind)[1]
        if most != resource.RLIM_INFINITY:
            soft, hard = min(soft, most), min(hard, most)  # noqa: PLW2901
        resource.setrlimit(kind, (soft, hard))
    os.execv(program[0], program)  # noqa: S606 - it is ours


def end_group_after(system: ctypes.CDLL) -> None:
    """Begin a process that ends the group of this one once this one is gone."""
    watched = os.getpid()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1})
    if os.fork() == 0:
        try:
            os.closerange(0, 3)
            system.prctl(PDEATHSIG, signal.SIGUSR1, 0, 0, 0)
            if os.getppid() == watched:
                signal.sigwait({signal.SIGUSR1})
        finally:
            os.killpg(watched, signal.SIGKILL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGUSR1})


if __name__ == "__main__":
    try:
        become(sys.argv[1:])
    except (OSError, ValueError, AttributeError) as error:
        sys.stderr.write(f"limits cannot be set here: {error}\n")
        os._exit(CODE)
