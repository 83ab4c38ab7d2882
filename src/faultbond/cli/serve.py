"""The arguments of `serve`, and how it is called with them."""

import argparse
from pathlib import Path

from faultbond.cli.values import level, whole_number
from faultbond.errors import Mistakes
from faultbond.io.out import Out


def add_site(parser: argparse.ArgumentParser) -> None:
    """Add what is watched, from where, and where it is kept and shown."""
    add = parser.add_argument
    add("models", metavar="MODEL", type=Path, nargs="*", help="model file, YAML; none: the built-in water tank")
    add("--site", metavar="FILE", type=Path, help="YAML file that names assets, models, sources and users instead")
    add("--source", metavar="ADDRESS", help="where values come from, such as file:live.csv or - (default: sim:)")
    add("--store", metavar="STORE", help="file or postgresql:// address where all is kept (default: faultbond.sqlite)")
    add(
        "--port",
        metavar="N",
        type=whole_number("--port", 0, 65535),
        help="port of the page (default: 8350); 0: any",
    )
    add("--accept", metavar="LEVEL", type=level, help="as of `run`")
    forms = "how standard error is written: plain, journal or json (default: as it suits that)"
    add("--log", metavar="FORM", choices=["plain", "journal", "json"], help=forms)
    add("--check", action="store_true", help="only say what would be watched, and whether it can be")
    add("--hash", action="store_true", help="ask for a password, and print its hash for the site file")


def start_service(arguments: argparse.Namespace, out: Out) -> None:
    """Call the verb."""
    from faultbond.service.log_lines import LogForm  # noqa: PLC0415 - not all need it
    from faultbond.service.program import hash_password, serve  # noqa: PLC0415
    from faultbond.service.site import chosen_site  # noqa: PLC0415

    if arguments.hash:
        hash_password(out)
        return
    mistakes = Mistakes()
    site = chosen_site(
        arguments.models,
        file=arguments.site,
        source=arguments.source,
        store=arguments.store,
        port=arguments.port,
        accept=arguments.accept,
        mistakes=mistakes,
    )
    form = None if arguments.log is None else LogForm(arguments.log)
    serve(site, check=arguments.check, log=form, out=out, mistakes=mistakes)
