"""Exceptions: each message names the user's thing, what was expected, and what to do."""

import unicodedata

CONTROLS = ("Cc", "Cf", "Cs", "Zl", "Zp")  # categories of Unicode


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


def plain(text: str) -> str:
    """Give a text that cannot steer a terminal: controls, and marks that turn a text around, are `?`."""
    if text.isascii() and text.isprintable():
        return text
    return "".join("?" if unicodedata.category(letter) in CONTROLS and letter != "\n" else letter for letter in text)


def one_line(message: str) -> str:
    """Give a message on one line, as `plain` gives it."""
    return plain(" ".join(message.split()))
