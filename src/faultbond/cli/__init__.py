"""The command line: arguments and exit codes only; what a verb does is in `faultbond.app`.

In: the words after the program's name. Out: an exit code, and one line on standard error where something is wrong.
Read `program`, `arguments`, `outputs`, `completion`.
"""

from faultbond.cli.program import DONE, FAULT_DETECTED, NO_VERDICT, build_parser, main

__all__ = ["DONE", "FAULT_DETECTED", "NO_VERDICT", "build_parser", "main"]
