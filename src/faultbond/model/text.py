"""The model file: text to bond graph and back, or to a structure without laws."""

from pathlib import Path

from faultbond.model.document import ModelFile, read_document
from faultbond.model.dump import dump_model
from faultbond.model.graph import BondGraph
from faultbond.model.resolve import resolve
from faultbond.model.source import Source, Table
from faultbond.model.structure import STRUCTURE, Structure, read_structure
from faultbond.model.yaml_nodes import read_yaml

__all__ = ["dump_model", "load_any", "load_model", "parse_any", "parse_model"]


def load_model(path: ModelFile) -> BondGraph:
    """Give the bond graph of a model file.

    Parameters
    ----------
    path : a YAML file in UTF-8, 1 MiB at most, or what was read of one

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
        at the first thing that is not a complete, consistent model, and where it is a structure without laws.
    """
    found = parse_any(text, file)
    if isinstance(found, Structure):
        problem = "it has no laws, and laws are needed here: `blocks`, or `components` and `bonds`"
        advice = "what can be said without are `check MODEL` and `analyse MODEL`"
        raise Source(file).error(found.line, f"{found.name} is a `{STRUCTURE}`: {problem}; {advice}")
    return found


def load_any(path: ModelFile) -> BondGraph | Structure:
    """Give the bond graph of a model file, or its structure where it states one in place of laws.

    Arguments and errors as of `load_model`.
    """
    document = read_document(path)
    return parse_any(document.text, file=document.label)


def parse_any(text: str, file: str = "model.yaml") -> BondGraph | Structure:
    """Give the bond graph of a model text, or its structure where it states one in place of laws.

    Arguments and errors as of `parse_model`.
    """
    source = Source(file)
    return stated_in(read_yaml(text, source), source, Path(file).stem[:100] or "model")


def stated_in(table: Table, source: Source, name: str) -> BondGraph | Structure:
    """Give what the top table of a model states.

    Parameters
    ----------
    table : the words of the model
    source : starts every message
    name : of the model where it states none

    Raises
    ------
    ModelError
        at the first thing that is not a complete, consistent model.
    """
    if any(entry.key == STRUCTURE for entry in table.entries):
        return read_structure(table, source, name)
    return resolve(table, source, name)
