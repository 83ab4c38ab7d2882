"""What a service says of itself on standard error, a line for each event: for people, for the journal, or as JSON.

Events come by `logging`, from the service and from the packages that it uses.
"""

import json
import logging
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from enum import Enum
from typing import TextIO

from faultbond.errors import one_line, plain

JOURNAL = "JOURNAL_STREAM"  # the variable by which systemd names the file behind standard error
OURS, OPC_UA = "faultbond", "asyncua"
PRIORITIES = {logging.CRITICAL: 2, logging.ERROR: 3, logging.WARNING: 4, logging.INFO: 6, logging.DEBUG: 7}


class LogForm(Enum):
    """How an event is written. journal: by itself where standard error is the journal's, with a priority for it."""

    PLAIN = "plain"
    JOURNAL = "journal"
    JSON = "json"


class LogLines(logging.Formatter):
    """Writes events in a form."""

    def __init__(self, form: LogForm) -> None:
        super().__init__()
        self._form = form

    def format(self, record: logging.LogRecord) -> str:
        """Give the lines of an event; a message is one line, a traceback stands behind it."""
        message = one_line(record.getMessage())
        if self._form is LogForm.PLAIN and not record.name.startswith(OURS):
            message = f"{record.name}: {message}"
        traceback = plain(self.formatException(record.exc_info)) if record.exc_info else ""
        level, moment = record.levelname.lower(), datetime.fromtimestamp(record.created, UTC)
        if self._form is LogForm.JSON:
            told = {"time": moment.isoformat(), "level": level, "logger": record.name, "message": message}
            return json.dumps(told | ({"traceback": traceback} if traceback else {}), ensure_ascii=False)
        lines = [message, *traceback.splitlines()]
        if self._form is LogForm.JOURNAL:
            return "\n".join(f"<{PRIORITIES.get(record.levelno, 6)}>{line}" for line in lines)
        return "\n".join([f"{moment:%Y-%m-%d %H:%M:%S} UTC {level}: {message}", *lines[1:]])


def usual_form(stream: TextIO, environment: Mapping[str, str] = os.environ) -> LogForm:
    """Give the form for a stream: that for the journal where systemd says that it is its own."""
    try:
        found = os.fstat(stream.fileno())
    except (OSError, ValueError):
        return LogForm.PLAIN
    is_journal = environment.get(JOURNAL, "") == f"{found.st_dev}:{found.st_ino}"
    return LogForm.JOURNAL if is_journal else LogForm.PLAIN


@contextmanager
def logged(form: LogForm | None = None) -> Iterator[None]:
    """Write what happens inside to standard error: of ours all but details, of packages what is wrong.

    Of a server that is not there or answers oddly asyncua warns several times at each try; we say so once.
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(LogLines(form or usual_form(sys.stderr)))
    root = logging.getLogger()
    levels = {"": logging.WARNING, OURS: logging.INFO, OPC_UA: logging.ERROR}
    before = {name: logging.getLogger(name).level for name in levels}
    root.addHandler(handler)
    for name, level in levels.items():
        logging.getLogger(name).setLevel(level)
    try:
        yield
    finally:
        root.removeHandler(handler)
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)
