"""The program: parser, verb, exit code."""

import argparse
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Sequence
from errno import ENOSPC
from io import TextIOWrapper
from typing import Never

from faultbond import app
from faultbond.app.signals import SIGNALLED, Stopped, Stopping
from faultbond.cli.arguments import DONE, FAULT_DETECTED, NO_VERDICT, Parser, VerbCall, add_verbs
from faultbond.cli.outputs import check_outputs
from faultbond.errors import FaultbondError, ManyMistakesError, NoVerdictError, one_line
from faultbond.io.files import STANDARD_INPUT
from faultbond.io.out import STANDARD_OUTPUT, drop_output, open_out

USER_MISTAKE, INTERNAL_ERROR = 2, 3
NOBODY_READS = 141  # as shells report a pipe that was closed
GROWING = ("run", "demo", "serve")  # verbs whose records are read while they run
TRACEBACK = "FAULTBOND_TRACEBACK"
EXIT_CODES = (
    "Exit codes: 0 done; 1 `run` raised an alarm; 2 a mistake in the command, the model or the recording; 3 a "
    "defect of faultbond; 4 no verdict could be given; 130 stopped by Ctrl-C, 143 and 129 by the signals TERM and HUP."
)

__all__ = ["DONE", "FAULT_DETECTED", "NO_VERDICT", "build_parser", "main"]


class _Version(argparse.Action):
    """Write the version and stop."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> Never:
        from importlib.metadata import version  # noqa: PLC0415 - slow to load

        sys.stdout.write(f"faultbond {version('faultbond')}\n")
        parser.exit()


def build_parser() -> argparse.ArgumentParser:
    """Give the parser of all verbs."""
    parser = Parser(
        prog="faultbond",
        description="Find and diagnose faults of a plant from a bond graph of it and a recording.",
        epilog=f"First steps: `faultbond demo`, then `faultbond VERB --help`. {EXIT_CODES}",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and stop")
    parser.set_defaults(program=parser)
    add_verbs(parser.add_subparsers(title="verbs", metavar="VERB", dest="verb"))
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and give the exit code.

    Parameters
    ----------
    argv : arguments after the program name; None takes those of the process
    """
    if argv is None and not sys.warnoptions:
        warnings.filterwarnings("ignore", category=RuntimeWarning)  # of arithmetic; what is not finite is told in words
    words = sys.argv[1:] if argv is None else argv
    if words and not {"-h", "--help"} & set(words):  # what the verb needs is loaded while Ctrl-C still ends at once
        getattr(app, words[0].replace("-", "_"), None)
    with Stopping() as stopping:
        try:
            return _guarded(argv)
        except KeyboardInterrupt as stopped:
            return SIGNALLED + (stopped.number if isinstance(stopped, Stopped) else signal.SIGINT)
        except Exception as error:  # the last line of defence
            if stopping.noted is not None:  # what the library made of it that was stopped
                return SIGNALLED + stopping.noted
            if os.environ.get(TRACEBACK):
                sys.stderr.write(traceback.format_exc())
            hint = f"Please report it with the traceback: set {TRACEBACK}=1 and run again."
            told = f"faultbond: internal error: {type(error).__name__}: {error}. {hint}"
            return _complain(told, INTERNAL_ERROR)


def _guarded(argv: Sequence[str] | None) -> int:
    """Run the command line and give the exit code, also where the user or the system has set a limit."""
    code = DONE
    try:
        for stream in (sys.stdout, sys.stderr):  # UTF-8 whatever the machine's locale says
            if isinstance(stream, TextIOWrapper) and stream.encoding.lower().replace("-", "") != "utf8":
                stream.reconfigure(encoding="utf-8")
        code = _execute(argv)
        sys.stdout.flush()
    except ManyMistakesError as error:
        return max(_complain(line, USER_MISTAKE) for line in str(error).splitlines())
    except FaultbondError as error:
        return _complain(str(error), NO_VERDICT if isinstance(error, NoVerdictError) else USER_MISTAKE)
    except (BrokenPipeError, SystemExit) as error:
        # nobody reads standard output any more, as in `faultbond run ... | head`; rich makes a SystemExit of it
        if not isinstance(error, BrokenPipeError) and not isinstance(error.__context__, BrokenPipeError):
            raise
        drop_output()
        return NOBODY_READS
    except OSError as error:
        full = _close_full_output() or error.errno == ENOSPC
        message = f"{error.filename}: {error.strerror}." if error.filename else f"{error.strerror or error}."
        if full and not error.filename:
            message = f"standard output: {error.strerror}."
        return _complain(message, code or USER_MISTAKE)
    return code


def _execute(argv: Sequence[str] | None) -> int:
    """Read the arguments, open the streams and call the verb."""
    parser = build_parser()
    arguments = parser.parse_args(argv)
    if arguments.verb is None:
        parser.print_help()
        return DONE
    call: VerbCall = arguments.call
    target: str | None = arguments.json
    if target is None and getattr(arguments, "recording", None) == STANDARD_INPUT:
        target = STANDARD_OUTPUT
    check_outputs(arguments)
    with open_out(target, grows=arguments.verb in GROWING) as out:
        return call(arguments, out)


def _complain(message: str, code: int) -> int:
    """Write one line for the user."""
    sys.stderr.write(one_line(message) + "\n")
    return code


def _close_full_output() -> bool:
    """Tell whether standard output cannot be written, as on a full disk, and leave nothing for the interpreter then."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        drop_output()
        return True
    return False
