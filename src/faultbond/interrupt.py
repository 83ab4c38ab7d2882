"""Ctrl-C while the program is still being loaded: it leaves at once, without a traceback.

This is the first thing that is imported. It does nothing where faultbond is a library of another program.
"""

import os
import signal
import sys

INTERRUPTED = 130  # as shells report a program stopped by Ctrl-C


def is_program() -> bool:
    """Whether this process is `faultbond` or `python -m faultbond`."""
    words = sys.orig_argv[1:]
    called = os.path.basename(sys.argv[0]) if sys.argv else ""
    return called in ("faultbond", "faultbond.exe") or ["-m", "faultbond"] in (
        words[k : k + 2] for k in range(len(words))
    )


def leave(number: int, frame: object) -> None:
    """End the process; there is nothing yet that has to be written or kept."""
    os._exit(INTERRUPTED)


if is_program() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, leave)
