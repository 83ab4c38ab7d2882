"""The model file: text to bond graph and back."""

import os
from pathlib import Path

from faultbond.model.document import read_document
from faultbond.model.dump import dump_model
from faultbond.model.graph import BondGraph
from faultbond.model.resolve import resolve
from faultbond.model.source import Source
from faultbond.model.yaml_nodes import read_yaml

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
    document = read_document(path)
    return parse_model(document.text, file=document.label)


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
