"""The program: parser, verb, exit code."""

import argparse
import os
import sys
import traceback
from collections.abc import Sequence
from importlib.metadata import version
from io import TextIOWrapper
from typing import Never

from faultbond import app
from faultbond.cli.accept import add_accept, add_reject
from faultbond.cli.analyse import add_analyse
from faultbond.cli.arguments import add_check, add_demo, add_run, add_simulate
from faultbond.cli.fit import add_fit
from faultbond.cli.verbs import DONE, FAULT_DETECTED, Call, Parser, Verbs
from faultbond.errors import FaultbondError
from faultbond.io.out import STANDARD_OUTPUT, open_out
from faultbond.io.recording import STANDARD_INPUT

USER_MISTAKE, INTERNAL_ERROR = 2, 3
INTERRUPTED, NOBODY_READS = 130, 141  # as shells report a program stopped by Ctrl-C or a closed pipe
TRACEBACK = "FAULTBOND_TRACEBACK"

__all__ = ["DONE", "FAULT_DETECTED", "build_parser", "main"]


class _Version(argparse.Action):
    """Write the version and stop."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> Never:
        sys.stdout.write(f"faultbond {version('faultbond')}\n")
        parser.exit()


def build_parser() -> argparse.ArgumentParser:
    """Give the parser of all verbs."""
    parser = Parser(
        prog="faultbond",
        description="Find and diagnose faults of a plant from a bond graph of it and a recording.",
        epilog="First steps: `faultbond demo`, then `faultbond VERB --help`.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and stop")
    verbs = parser.add_subparsers(title="verbs", metavar="VERB", dest="verb")
    add_check(verbs)
    add_analyse(verbs)
    add_fit(verbs)
    add_simulate(verbs)
    add_run(verbs)
    add_accept(verbs)
    add_reject(verbs)
    add_demo(verbs)
    return parser


def main(argv: Sequence[str] | None = None, verbs: Verbs = app) -> int:
    """Run the command line and give the exit code.

    Parameters
    ----------
    argv : arguments after the program name; None takes those of the process
    verbs : what carries the verbs out
    """
    try:
        _speak_utf8()
        code = _execute(argv, verbs)
        sys.stdout.flush()
    except FaultbondError as error:
        return _complain(str(error), USER_MISTAKE)
    except BrokenPipeError:
        return _give_up_output()
    except SystemExit as leaving:
        if isinstance(leaving.__context__, BrokenPipeError):  # rich makes this of it
            return _give_up_output()
        raise
    except OSError as error:
        return _complain(_of_system(error), USER_MISTAKE)
    except KeyboardInterrupt:
        return INTERRUPTED
    except Exception as error:  # the last line of defence
        return _internal(error)
    return code


def _execute(argv: Sequence[str] | None, verbs: Verbs) -> int:
    """Read the arguments, open the streams and call the verb."""
    parser = build_parser()
    arguments = parser.parse_args(argv)
    if arguments.verb is None:
        parser.print_help()
        return DONE
    call: Call = arguments.call
    target: str | None = arguments.json
    if target is None and getattr(arguments, "recording", None) == STANDARD_INPUT:
        target = STANDARD_OUTPUT
    with open_out(target) as out:
        return call(arguments, verbs, out)


def _speak_utf8() -> None:
    """Write UTF-8 whatever the machine's locale says."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper) and stream.encoding.lower().replace("-", "") != "utf8":
            stream.reconfigure(encoding="utf-8")


def _complain(message: str, code: int) -> int:
    """Write one line for the user."""
    sys.stderr.write(" ".join(message.split()) + "\n")
    return code


def _of_system(error: OSError) -> str:
    """Say what the operating system refused."""
    return f"{error.filename}: {error.strerror}." if error.filename else f"{error.strerror or error}."


def _give_up_output() -> int:
    """Stop quietly when nobody reads standard output any more, as in `faultbond run ... | head`."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # else the interpreter complains when it flushes at the end
    return NOBODY_READS


def _internal(error: Exception) -> int:
    """Report a defect of faultbond: one line, or the traceback to those who ask for it."""
    if os.environ.get(TRACEBACK):
        sys.stderr.write(traceback.format_exc())
    hint = f"Please report it with the traceback: set {TRACEBACK}=1 and run again."
    return _complain(f"faultbond: internal error: {type(error).__name__}: {error}. {hint}", INTERNAL_ERROR)
