"""The command line: arguments and exit codes only; what a verb does is in `faultbond.app`."""

from faultbond.cli.program import DONE, FAULT_DETECTED, NO_VERDICT, build_parser, main

__all__ = ["DONE", "FAULT_DETECTED", "NO_VERDICT", "build_parser", "main"]
