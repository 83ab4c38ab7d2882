"""The arguments of `analyse`."""

import argparse

from faultbond.app import Wishes
from faultbond.cli.verbs import DONE, NO_VERDICT, Subparsers, Verbs, add_model, add_verb, time
from faultbond.errors import FaultbondError
from faultbond.io.out import Out

MAX_CLOSED = 5


def add_analyse(verbs: Subparsers) -> None:
    """Add `analyse`."""
    example = "faultbond analyse model.yaml --data healthy.csv"
    summary = "tell which faults can be found and told apart, how small, and what would help"
    parser = add_verb(verbs, "analyse", _call, summary, example)
    add_model(parser)
    parser.add_argument("--data", metavar="REC", help="healthy recording: tell also what its inputs allow to see")
    parser.add_argument(
        "--within", metavar="TIME", type=time, help="find the smallest faults within '60 s' (default: 300 samples)"
    )
    parser.add_argument(
        "--separate",
        metavar="SET",
        nargs="+",
        type=_names,
        default=[],
        help="find the input that best separates these sets, such as K4 K6,K1 "
        "(default: those alike at rest, or in the recording)",
    )
    _add_forms(parser)


def _add_forms(parser: argparse.ArgumentParser) -> None:
    """Add the options of routes and closed forms."""
    parser.add_argument(
        "--closed",
        metavar="N",
        type=_size,
        default=1,
        help="solve sets of up to N parameters in closed form (default: %(default)s; 0 none)",
    )
    parser.add_argument(
        "--patience",
        metavar="TIME",
        type=time,
        default=4.0,
        help="time for all closed forms together; one may take a quarter of it (default: 4 s)",
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


def _call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
    """Call the verb that the options ask for."""
    if arguments.trace is not None:
        verbs.trace(arguments.model, arguments.trace, out=out)
        return DONE
    wishes = Wishes(
        data=arguments.data,
        within=arguments.within,
        separate=tuple(arguments.separate),
        closed=arguments.closed,
        patience=arguments.patience,
        preference=arguments.preference,
    )
    if arguments.code is not None:
        verbs.print_code(arguments.model, arguments.code, wishes=wishes, out=out)
        return DONE
    return DONE if verbs.analyse(arguments.model, wishes=wishes, out=out) else NO_VERDICT


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
    if len(set(names)) < len(names):
        raise FaultbondError(f"{text!r}: a name stands there twice; give each once")
    return names
