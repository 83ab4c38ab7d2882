"""The arguments of `history`, and how it is called with them."""

import argparse
from contextlib import closing
from pathlib import Path

from faultbond.cli.values import moment
from faultbond.io.out import Out


def add_period(parser: argparse.ArgumentParser) -> None:
    """Add the store, the period, and where to write it."""
    add = parser.add_argument
    add("kept", metavar="STORE", help="file or postgresql:// address that `serve` writes; it may be writing it now")
    add("--asset", metavar="NAME", help="only of this asset (default: all)")
    for option, where, name in (("--from", "begin", "first"), ("--to", "end", "last")):
        meaning = f"{name} moment of the period, s or ISO 8601 on the recording's clock (default: the {name} row)"
        add(option, metavar="T", dest=where, type=moment, help=meaning)
    add("-o", "--output", metavar="FILE", type=Path, help="write FILE.csv, FILE.parquet or FILE.html instead")


def show_history(arguments: argparse.Namespace, out: Out) -> None:
    """Call the verb."""
    from faultbond.service.history import Excerpt, tell_history  # noqa: PLC0415 - not all need it
    from faultbond.service.store.opening import open_store  # noqa: PLC0415

    wanted = Excerpt(asset=arguments.asset, begin=arguments.begin, end=arguments.end)
    with closing(open_store(arguments.kept, writes=False)) as store:
        tell_history(store, wanted, output=arguments.output, out=out)
