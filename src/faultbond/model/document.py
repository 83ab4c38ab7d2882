"""The model file as it stands on the disk, before it is read as a model."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from faultbond.errors import ModelError
from faultbond.model.source import SMALLER, shown_path

MAX_BYTES = 2**20
CIRCUIT_SUFFIX = ".xml"


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelDocument:
    """A model file. label: its path, as messages show it. data: all its bytes."""

    label: str
    data: bytes

    @property
    def text(self) -> str:
        """Its text.

        Raises
        ------
        ModelError
            Where it is not UTF-8.
        """
        try:
            return self.data.decode("utf-8")
        except UnicodeDecodeError as error:
            line = self.data.count(b"\n", 0, error.start) + 1
            raise ModelError(f"{self.label}:{line}: not UTF-8 text; save the file as UTF-8") from None


ModelFile: TypeAlias = str | os.PathLike[str] | ModelDocument  # a path, or what was read of it


def read_document(path: ModelFile, what: str = "model file", smaller: str = SMALLER) -> ModelDocument:
    """Read a model file, or another one of its kind, 1 MiB at most; one that was read is given back.

    what: the word for such a file. smaller: what to do where it is too large.

    Raises
    ------
    ModelError
        Where it cannot be read, or is larger.
    """
    if isinstance(path, ModelDocument):
        return path
    label = shown_path(os.fspath(path))
    try:
        with Path(path).open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a file name"
        raise ModelError(f"{label}: cannot be read: {reason}; give the path of a {what}") from None
    if len(data) > MAX_BYTES:
        raise ModelError(f"{label}: more than {MAX_BYTES} bytes; {smaller}")
    return ModelDocument(label=label, data=data)


def is_circuit(path: ModelFile) -> bool:
    """Whether a file is a logic circuit by its name, which ends in `.xml`."""
    name = path.label if isinstance(path, ModelDocument) else path
    return Path(name).suffix.lower() == CIRCUIT_SUFFIX
