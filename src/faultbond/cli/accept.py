"""The arguments of `accept` and `reject`."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from faultbond.cli.verbs import DONE, Subparsers, Verbs, add_model, add_verb
from faultbond.io.out import Out


def add_accept(verbs: Subparsers) -> None:
    """Add `accept`."""

    def call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
        verbs.accept(arguments.model, arguments.state, _names(arguments.names), out=out)
        return DONE

    summary = "take a diagnosis of a kept run as the new normal"
    parser = add_verb(verbs, "accept", call, summary, "faultbond accept model.yaml plant.state K1")
    _add_names(parser, "*", "parameters or components of the candidate, or its sensor or input (default: the best)")


def add_reject(verbs: Subparsers) -> None:
    """Add `reject`."""

    def call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
        verbs.reject(arguments.model, arguments.state, _names(arguments.names), out=out)
        return DONE

    summary = "rule a diagnosis of a kept run out; the others share its probability"
    parser = add_verb(verbs, "reject", call, summary, "faultbond reject model.yaml plant.state K1")
    _add_names(parser, "+", "parameters or components of the candidate, or its sensor or input")


def _add_names(parser: argparse.ArgumentParser, number: str, meaning: str) -> None:
    add_model(parser)
    parser.add_argument("state", metavar="STATE", type=Path, help="file that `run --state` wrote")
    parser.add_argument("names", metavar="NAME", nargs=number, help=meaning)


def _names(words: Sequence[str]) -> tuple[str, ...]:
    """Give the names; as elsewhere they may have commas between."""
    return tuple(name for word in words for name in word.split(",") if name)
