"""The arguments of `fit`."""

import argparse
from pathlib import Path

from faultbond.app import FitWishes
from faultbond.cli.verbs import DONE, Subparsers, Verbs, add_engine, add_model, add_verb, engine, whole
from faultbond.errors import FaultbondError
from faultbond.io.out import Out

MOST_STARTS = 100


def add_fit(verbs: Subparsers) -> None:
    """Add `fit`."""
    example = "faultbond fit model.yaml healthy.csv -o fitted.yaml --report fit.html"
    summary = "find parameters and noise from healthy recordings, and write them into a model file"
    parser = add_verb(verbs, "fit", _call, summary, example)
    add_model(parser)
    parser.add_argument("recordings", metavar="REC", nargs="+", help="healthy recording; several are fitted together")
    parser.add_argument("-o", "--output", metavar="MODEL2", type=Path, help="model file to write")
    parser.add_argument("--report", metavar="FILE.html", type=Path, help="write a report to open in a browser")
    parser.add_argument(
        "--fixed", metavar="NAMES", type=_names, default=(), help="parameters that are known: G,K_meter"
    )
    parser.add_argument("--free", metavar="NAMES", type=_names, help="the only parameters to find (default: all)")
    parser.add_argument(
        "--per-recording",
        metavar="NAMES",
        type=_names,
        default=(),
        help="parameters that each recording has for itself, such as a temperature at its start",
    )
    parser.add_argument(
        "--prior",
        choices=["widened", "declared", "none"],
        default="widened",
        help="what declared accuracies count for: widened where the data contradict them, as declared, or nothing "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--starts", metavar="N", type=_count, default=4, help="begin the search at N places (default: %(default)s)"
    )
    parser.add_argument(
        "--seed", metavar="N", type=whole, default=0, help="choose the other places (default: %(default)s)"
    )
    add_engine(parser)


def _call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
    wishes = FitWishes(
        fixed=arguments.fixed,
        free=arguments.free,
        prior=arguments.prior,
        starts=arguments.starts,
        seed=arguments.seed,
        own=arguments.per_recording,
    )
    verbs.fit(
        arguments.model,
        tuple(arguments.recordings),
        wishes=wishes,
        output=arguments.output,
        report=arguments.report,
        engine=engine(arguments),
        out=out,
    )
    return DONE


def _count(text: str) -> int:
    """Read a number of starts."""
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= MOST_STARTS):
        raise FaultbondError(f"--starts {text}: expected a whole number from 1 to {MOST_STARTS}")
    return int(text)


def _names(text: str) -> tuple[str, ...]:
    """Read names with commas between."""
    names = tuple(part.strip() for part in text.split(","))
    if not all(names):
        raise FaultbondError(f"{text!r}: expected names with commas between, such as R,L")
    if len(set(names)) < len(names):
        raise FaultbondError(f"{text!r}: a name stands there twice; give each once")
    return names
