"""The service and what it keeps."""

import asyncio
import os
import threading
from contextlib import closing
from datetime import datetime

from faultbond.api.options import (
    PathLike,
    file_of,
    level_of,
    moment_at,
    path_of,
    refuse_overwriting,
    truth_of,
    whole_of,
)
from faultbond.api.told import Records, Told, heard
from faultbond.errors import FaultbondError, Mistakes
from faultbond.io.out import open_out
from faultbond.service import program
from faultbond.service.history import Excerpt, tell_history
from faultbond.service.log_lines import LogForm
from faultbond.service.site import chosen_site
from faultbond.service.store.opening import open_store


def serve(
    *models: PathLike,
    site: PathLike | None = None,
    source: str | None = None,
    store: PathLike | None = None,
    port: int | None = None,
    accept: float | str | None = None,
    log: str | None = None,
    json: PathLike | None = None,
    check: bool = False,
) -> Told | None:
    """Watch live sources, keep what happens, and show it on a page until Ctrl-C or another signal comes.

    Parameters
    ----------
    models : paths of model files; none: the built-in water tank
    site : YAML file that names assets, models, sources and users instead
    source : where values come from, such as "file:live.csv"; None: they are simulated
    store : file or postgresql:// address where all is kept; None: faultbond.sqlite
    port : of the page; None: 8350; 0: any
    accept : as of `run`
    log : how standard error is written, `plain`, `journal` or `json`; None: as it suits that
    json : file for the records
    check : only say what would be watched, and whether it can be; that is what is given then, and nothing without

    Raises
    ------
    FaultbondError
        Where something is wrong with a model, the site or an option, or it is called in a notebook or a thread.
    KeyboardInterrupt
        When a signal came, after every asset was kept as it stands.
    """
    forms = [item.value for item in LogForm]
    if log is not None and log not in forms:
        raise FaultbondError(f"log={log!r}: expected {', '.join(forms)}")
    read = [*((item, "a model") for item in models), *([(site, "the site file")] if site is not None else [])]
    refuse_overwriting(read, {"the store": _file_in(store), "the file of records": json})
    mistakes = Mistakes()
    watched = chosen_site(
        [file_of(item, "model") for item in models],
        file=path_of(site, "site"),
        source=source,
        store=None if store is None else os.fspath(store),
        port=None if port is None else whole_of(port, "port", 0, 65535),
        accept=level_of(accept),
        mistakes=mistakes,
    )
    if truth_of(check, "check"):
        found = heard(lambda out: program.serve(watched, check=True, out=out, mistakes=mistakes))
        return Told(record=found[0], text=found.text)
    _refuse_company()
    with open_out(None if json is None else str(file_of(json, "json")), grows=True) as out:
        program.serve(watched, log=None if log is None else LogForm(log), out=out, mistakes=mistakes)
    return None


def history(
    store: PathLike,
    *,
    asset: str | None = None,
    begin: float | str | datetime | None = None,
    end: float | str | datetime | None = None,
    output: PathLike | None = None,
) -> Records:
    """List what a service found and people did, or write a period as a recording or a report.

    Parameters
    ----------
    store : file or postgresql:// address that `serve` writes; it may be writing it now
    asset : only of this one; None: of all
    begin, end : first and last moment, s, a date and time or its ISO text on the recording's clock; None: of all rows
    output : file to write instead, which ends in .csv, .parquet or .html

    Raises
    ------
    FaultbondError
        Where the store cannot be read, or has no such asset or period.
    """
    wanted = Excerpt(asset=asset, begin=moment_at(begin, "begin"), end=moment_at(end, "end"))
    file = _file_in(store)
    refuse_overwriting([] if file is None else [(file, "the store")], {"the output": output})
    with closing(open_store(store if isinstance(store, str) else file_of(store, "store"), writes=False)) as kept:
        return heard(lambda out: tell_history(kept, wanted, output=path_of(output, "output"), out=out))


def _file_in(store: PathLike | None) -> PathLike | None:
    """Give the file of a store; None of one in a server, and of none."""
    return None if isinstance(store, str) and "://" in store else store


def _refuse_company() -> None:
    """Refuse to block where signals do not arrive, or where others wait for their turn.

    Raises
    ------
    FaultbondError
        In a thread beside the main one, and in a loop of events, as that of a notebook.
    """
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        if threading.current_thread() is threading.main_thread():
            return
    raise FaultbondError(
        "serve: it blocks until a signal ends it, so it needs the main thread of a program, and not of a notebook."
    )
