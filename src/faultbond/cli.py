"""The command line: arguments and exit codes only; what a verb does is in `faultbond.app`."""

import argparse
import os
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from io import TextIOWrapper
from pathlib import Path
from typing import Never, Protocol, TypeAlias

from faultbond import app
from faultbond.app import Imperfections, Wishes
from faultbond.errors import FaultbondError
from faultbond.io.faults import FaultRequest, parse_fault
from faultbond.io.out import STANDARD_OUTPUT, Out, open_out
from faultbond.io.recording import STANDARD_INPUT
from faultbond.model.quantities import duration, quantity, spread
from faultbond.types import EngineChoice, Method

DONE, FAULT_DETECTED, USER_MISTAKE, INTERNAL_ERROR = 0, 1, 2, 3
INTERRUPTED, NOBODY_READS = 130, 141  # as shells report a program stopped by Ctrl-C or a closed pipe
TRACEBACK = "FAULTBOND_TRACEBACK"
ENGINE = "FAULTBOND_ENGINE"
MAX_CLOSED = 5


class Verbs(Protocol):
    """What the command line needs of `faultbond.app`."""

    def check(self, model: Path, *, engine: EngineChoice, out: Out) -> None:
        """Tell what was understood of a model."""

    def analyse(self, model: Path, *, wishes: Wishes, out: Out) -> None:
        """Tell what can be found and told apart."""

    def print_code(self, model: Path, form: str, *, wishes: Wishes, out: Out) -> None:
        """Print the closed forms as code."""

    def trace(self, model: Path, names: tuple[str, ...], *, out: Out) -> None:
        """Print the thesis' search for a route."""

    def simulate(
        self,
        model: Path,
        *,
        inputs: str,
        faults: tuple[FaultRequest, ...],
        seed: int | None,
        imperfections: Imperfections,
        start: Mapping[str, float],
        output: Path,
        out: Out,
    ) -> None:
        """Write a recording of the simulated plant; `inputs` is a path or `-`."""

    def run(
        self, model: Path, recording: str, *, method: Method, report: Path | None, engine: EngineChoice, out: Out
    ) -> bool:
        """Watch a recording, a path or `-`, and tell whether a fault was detected."""

    def demo(self, *, report: Path, engine: EngineChoice, out: Out) -> None:
        """Find a fault in the built-in water tank and write the report."""


Call = Callable[[argparse.Namespace, Verbs, Out], int]


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaint is one line."""

    def error(self, message: str) -> Never:
        """Refuse the arguments."""
        raise FaultbondError(f"{self.prog}: {message}. See: {self.prog} --help")


Subparsers: TypeAlias = "argparse._SubParsersAction[Parser]"


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
    _add_check(verbs)
    _add_analyse(verbs)
    _add_simulate(verbs)
    _add_run(verbs)
    _add_demo(verbs)
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


def _add_verb(verbs: Subparsers, name: str, call: Call, summary: str, example: str) -> argparse.ArgumentParser:
    """Add a verb with what all verbs share."""
    parser = verbs.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.",
        epilog=f"Example: {example}",
        allow_abbrev=False,
    )
    parser.add_argument("--json", metavar="FILE", help="write the result as JSON lines; - is standard output")
    parser.set_defaults(call=call)
    return parser


def _add_model(parser: argparse.ArgumentParser) -> None:
    """Add the model file argument."""
    parser.add_argument("model", metavar="MODEL", type=Path, help="model file, YAML")


def _add_engine(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the engine."""
    parser.add_argument(
        "--engine",
        choices=[choice.value for choice in EngineChoice],
        help=f"c: compiled, vm: without a compiler, auto: c where there is a compiler (default: ${ENGINE}, else auto)",
    )


def _engine(arguments: argparse.Namespace) -> EngineChoice:
    """Give the engine of the option, else of the environment."""
    name: str = arguments.engine or os.environ.get(ENGINE) or EngineChoice.AUTO.value
    known = [choice.value for choice in EngineChoice]
    if name not in known:
        raise FaultbondError(f"{ENGINE}={name}: no such engine; set it to one of {', '.join(known)}.")
    return EngineChoice(name)


def _add_check(verbs: Subparsers) -> None:
    """Add `check`."""

    def call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
        verbs.check(arguments.model, engine=_engine(arguments), out=out)
        return DONE

    example = "faultbond check examples/tank/model.yaml"
    parser = _add_verb(verbs, "check", call, "show what was understood of a model, with every default", example)
    _add_model(parser)
    _add_engine(parser)


def _add_analyse(verbs: Subparsers) -> None:
    """Add `analyse`."""

    def call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
        if arguments.trace is not None:
            verbs.trace(arguments.model, arguments.trace, out=out)
            return DONE
        wishes = Wishes(
            data=arguments.data,
            within=arguments.within,
            separate=tuple(arguments.separate),
            closed=arguments.closed,
            preference=arguments.preference,
        )
        if arguments.code is not None:
            verbs.print_code(arguments.model, arguments.code, wishes=wishes, out=out)
        else:
            verbs.analyse(arguments.model, wishes=wishes, out=out)
        return DONE

    example = "faultbond analyse model.yaml --data healthy.csv"
    summary = "tell which faults can be found and told apart, how small, and what would help"
    parser = _add_verb(verbs, "analyse", call, summary, example)
    _add_model(parser)
    parser.add_argument("--data", metavar="REC", help="healthy recording: tell also what its inputs allow to see")
    parser.add_argument(
        "--within", metavar="TIME", type=_time, help="find the smallest faults within '60 s' (default: 300 samples)"
    )
    parser.add_argument(
        "--separate",
        metavar="SET",
        nargs="+",
        type=_names,
        default=[],
        help="find the input that best separates these sets, such as K4 K6,K1 (default: those alike at rest)",
    )
    parser.add_argument(
        "--closed",
        metavar="N",
        type=_size,
        default=1,
        help="solve sets of up to N parameters in closed form (default: %(default)s; 0 none)",
    )
    routes = parser.add_mutually_exclusive_group()
    for option, value in (("--fewest", "fewest components"), ("--least-noise", "least noise")):
        summary = f"take routes with the {value}, not with the fewest samples"
        routes.add_argument(option, dest="preference", action="store_const", const=value, help=summary)
    parser.set_defaults(preference="fewest frames")
    parser.add_argument(
        "--code", choices=["python", "c", "latex"], help="print the closed forms as functions, and nothing else"
    )
    parser.add_argument(
        "--trace", metavar="NAMES", type=_names, help="print the thesis' search for the parameters R,L, step by step"
    )


def _size(text: str) -> int:
    """Read the size of a set."""
    if not (text.isascii() and text.isdigit() and int(text) <= MAX_CLOSED):
        raise FaultbondError(f"--closed {text}: expected a whole number from 0 to {MAX_CLOSED}")
    return int(text)


def _names(text: str) -> tuple[str, ...]:
    """Read names with commas between."""
    names = tuple(part.strip() for part in text.split(","))
    if not all(names):
        raise FaultbondError(f"{text!r}: expected names with commas between, such as R,L")
    return names


def _add_simulate(verbs: Subparsers) -> None:
    """Add `simulate`."""

    def call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
        verbs.simulate(
            arguments.model,
            inputs=arguments.inputs,
            faults=tuple(parse_fault(text) for text in arguments.fault),
            seed=arguments.seed,
            imperfections=Imperfections(spread=arguments.spread, lag=arguments.lag, curve=arguments.curve),
            start=dict(arguments.start),
            output=arguments.output,
            out=out,
        )
        return DONE

    example = "faultbond simulate model.yaml --inputs healthy.csv --fault K1=x1.85@2460 --seed 1 -o faulty.csv"
    parser = _add_verb(verbs, "simulate", call, "make a recording of the plant, healthy or faulty", example)
    _add_model(parser)
    parser.add_argument(
        "--inputs", metavar="REC", required=True, help="recording with the time and input columns; - is standard input"
    )
    parser.add_argument(
        "--fault",
        metavar="FAULT",
        action="append",
        default=[],
        help="NAME=VALUE@TIME in the model's unit, NAME=xFACTOR@TIME, or @TIME..TIME for a ramp; may be repeated",
    )
    parser.add_argument("--seed", metavar="N", type=int, help="make the noise repeatable")
    parser.add_argument(
        "--start",
        metavar="STATE=VALUE",
        action="append",
        default=[],
        type=_start,
        help="start of a state, such as 'tank.q=0.05 m^3', SI without a unit; may be repeated (default: that of the "
        "model, else solved from the sensors in REC, else 0)",
    )
    zero = "(default: 0)"
    parser.add_argument(
        "--spread", metavar="PART", type=_part, default=0.0, help=f"true parameters are off by up to '3 %%' {zero}"
    )
    parser.add_argument(
        "--lag", metavar="TIME", type=_time, default=0.0, help=f"inputs that settle lag behind by '3 s' {zero}"
    )
    parser.add_argument(
        "--curve", metavar="PART", type=_part, default=0.0, help=f"inputs in percent act wrongly by up to '3 %%' {zero}"
    )
    parser.add_argument("-o", "--output", metavar="REC", type=Path, required=True, help="CSV file to write")


def _part(text: str) -> float:
    """Read a percentage as a part of 1."""
    found = spread(text)
    if not found.is_relative:
        raise FaultbondError(f"{text!r} is no percentage. Write it as in --spread '3 %'.")
    return found.ratio


def _time(text: str) -> float:
    """Read a length of time in seconds."""
    return duration(text)


def _start(text: str) -> tuple[str, float]:
    """Read the start of a state; SI."""
    name, equals, value = text.partition("=")
    if not equals:
        raise FaultbondError(f"--start {text!r}: expected STATE=VALUE, such as 'tank.q=0.05 m^3'.")
    return name.strip(), quantity(value, f"--start {text!r}: ").value


def _add_run(verbs: Subparsers) -> None:
    """Add `run`."""

    def call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
        detected = verbs.run(
            arguments.model,
            arguments.recording,
            method=Method(arguments.method),
            report=arguments.report,
            engine=_engine(arguments),
            out=out,
        )
        return FAULT_DETECTED if detected else DONE

    example = "faultbond run model.yaml faulty.csv --report report.html"
    summary = "watch a recording, detect a fault and diagnose it; exit code 1 if there is one"
    parser = _add_verb(verbs, "run", call, summary, example)
    _add_model(parser)
    parser.add_argument("recording", metavar="REC", help="recording, CSV or Parquet; - is CSV on standard input, live")
    parser.add_argument(
        "--method",
        choices=[method.value for method in Method],
        default=Method.BANK.value,
        help="how to detect and diagnose (default: %(default)s)",
    )
    parser.add_argument("--report", metavar="FILE.html", type=Path, help="write a report to open in a browser")
    _add_engine(parser)


def _add_demo(verbs: Subparsers) -> None:
    """Add `demo`."""

    def call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
        verbs.demo(report=arguments.report, engine=_engine(arguments), out=out)
        return DONE

    example = "faultbond demo"
    parser = _add_verb(verbs, "demo", call, "find a fault in the built-in water tank", example)
    parser.add_argument(
        "--report",
        metavar="FILE.html",
        type=Path,
        default=Path("report.html"),
        help="where to write the report (default: %(default)s)",
    )
    _add_engine(parser)


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
