"""Exceptions: each message names the user's thing, what was expected, and what to do."""

import os
import re
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

CONTROLS = ("Cc", "Cf", "Cs", "Zl", "Zp")  # categories of Unicode
_LINE = re.compile(r":([0-9]+): ")  # behind the name of a file
_NUMBER = re.compile(r"^\[Errno -?[0-9]+\] ")
_Found = TypeVar("_Found")


class FaultbondError(Exception):
    """Base of every error that a user can cause and mend."""


class ModelError(FaultbondError):
    """The model text, drawing or API call does not describe a model."""


class CausalityError(FaultbondError):
    """No consistent causality exists: two causes fix one signal, or none does."""


class StructureError(FaultbondError):
    """The equations are unbalanced or singular."""


class GenerationError(FaultbondError):
    """The engine could not be generated, compiled or loaded."""


class RecordingError(FaultbondError):
    """A recording cannot be read, or lacks a column that the model needs."""


class RowError(RecordingError):
    """Rows do not go with the model. line: of the row that shows it, 0: it has no number. problem: all but where."""

    def __init__(self, line: int, problem: str) -> None:
        super().__init__(f"line {line}: {problem}" if line else problem)
        self.line, self.problem = line, problem


class NoRowError(RecordingError):
    """A record of a table says nothing for sure; the next one may."""


class NoVerdictError(RecordingError):
    """A recording can be read, and nothing that was asked for can be said from it."""


class CacheError(FaultbondError):
    """Others may write the folder of compiled engines, so what is in it may be anybody's."""


class SourceError(FaultbondError):
    """A source of live values cannot be reached, or has been lost."""


class SinkError(FaultbondError):
    """Who is to be told cannot be reached. after: s for which it wants to be left alone."""

    def __init__(self, message: str, *, after: float = 0.0) -> None:
        super().__init__(message)
        self.after = after


class RefusedError(SinkError):
    """Who is told does not take what it is told."""


class StoreError(FaultbondError):
    """What the service has to keep cannot be written or read."""


class UnreadyStoreError(StoreError):
    """A store cannot be had now, and may be later: its server is not there, its disk is full, or somebody holds it."""


class AbsentStoreError(StoreError):
    """There is no store where one is to be read."""


class ForgottenError(StoreError):
    """Rows that are to pass again are not in the store any more."""


class ManyMistakesError(FaultbondError):
    """Several mistakes, a line of the message each."""


class Mistakes:
    """Mistakes that are found one after the other, where one can go on.

    Example
    -------
    >>> found = Mistakes()
    >>> for line in (7, 3):
    ...     with found.noted():
    ...         raise ModelError(f"site.yaml:{line}: port is missing")
    >>> found.tell()
    Traceback (most recent call last):
    ...
    faultbond.errors.ManyMistakesError: site.yaml:3: port is missing
    site.yaml:7: port is missing
    """

    def __init__(self) -> None:
        self._found: list[FaultbondError] = []

    def note(self, mistake: FaultbondError) -> None:
        """Take a mistake; what is told already is not told again."""
        if str(mistake) not in map(str, self._found):
            self._found.append(mistake)

    @contextmanager
    def noted(self) -> Iterator[None]:
        """Take a mistake that is raised inside, and go on behind it."""
        try:
            yield
        except FaultbondError as mistake:
            self.note(mistake)

    def or_else(self, read: Callable[[], _Found], missing: _Found) -> _Found:
        """Give what is read, or something else where that is a mistake."""
        with self.noted():
            return read()
        return missing

    def tell(self) -> None:
        """Raise what was found, by lines of the file; nothing where there is none.

        Raises
        ------
        FaultbondError
            The one mistake, where there is one.
        ManyMistakesError
            All of them, where there are more.
        """
        if len(self._found) == 1:
            raise self._found[0]
        if self._found:
            raise ManyMistakesError("\n".join(sorted(map(str, self._found), key=_line)))


def _line(message: str) -> int:
    """Give the line of a file that a message begins with; 0 where it names none."""
    found = _LINE.search(message)
    return int(found[1]) if found else 0


def plain(text: str) -> str:
    """Give a text that cannot steer a terminal: controls, and marks that turn a text around, are `?`."""
    if text.isascii() and text.isprintable():
        return text
    return "".join("?" if unicodedata.category(letter) in CONTROLS and letter != "\n" else letter for letter in text)


def reason_of(error: BaseException) -> str:
    """Give what went wrong with a connection in words for a sentence: one line, no full stop, no number of an error.

    Example
    -------
    >>> reason_of(ConnectionRefusedError(111, "Connect call failed ('10.0.0.7', 1883)"))
    'Connection refused'
    """
    if isinstance(error, TimeoutError):
        return "no answer in time"
    cause = error.__cause__ if error.__cause__ is not None and not str(error).strip() else error
    text = " ".join(str(cause).split())
    if isinstance(cause, OSError) and cause.errno and "Connect call failed" in text:  # asyncio's word for any reason
        text = os.strerror(cause.errno)
    return _NUMBER.sub("", text).rstrip(".") or type(cause).__name__


def one_line(message: str) -> str:
    """Give a message on one line, as `plain` gives it."""
    return plain(" ".join(message.split()))
