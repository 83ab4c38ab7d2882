"""The model file: text to bond graph and back."""

import os
from pathlib import Path

from faultbond.errors import ModelError
from faultbond.model.dump import dump_model
from faultbond.model.graph import BondGraph
from faultbond.model.resolve import resolve
from faultbond.model.source import Source, shown_path
from faultbond.model.yaml_nodes import MAX_BYTES, read_yaml

__all__ = ["dump_model", "load_model", "parse_model"]


def load_model(path: str | os.PathLike[str]) -> BondGraph:
    """Give the bond graph of a model file.

    Parameters
    ----------
    path : a YAML file in UTF-8, 1 MiB at most

    Raises
    ------
    ModelError
        if the file cannot be read or is not a model; the message starts with `file:line: `.
    """
    label = os.fspath(path)
    try:
        with Path(label).open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a file name"
        raise ModelError(f"{shown_path(label)}: cannot be read: {reason}; give the path of a model file") from None
    if len(data) > MAX_BYTES:
        raise ModelError(f"{shown_path(label)}: more than {MAX_BYTES} bytes; split the plant into several models")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ModelError(f"{shown_path(label)}:{line}: not UTF-8 text; save the file as UTF-8") from None
    return parse_model(text, file=shown_path(label))


def parse_model(text: str, file: str = "model.yaml") -> BondGraph:
    """Give the bond graph of a model text.

    Parameters
    ----------
    text : YAML; every scalar is read as plain text
    file : name of the file in messages; its stem is the model's name where the text states none

    Raises
    ------
    ModelError
        at the first thing that is not a complete, consistent model.
    """
    source = Source(file)
    return resolve(read_yaml(text, source), source, Path(file).stem[:100] or "model")
