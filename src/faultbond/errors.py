"""Exceptions: each message names the user's thing, what was expected, and what to do."""


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
