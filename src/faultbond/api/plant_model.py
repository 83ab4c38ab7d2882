"""A model as Python programs hold it: the text of its file, and what it states."""

import os
from collections.abc import Mapping
from functools import cached_property
from hashlib import sha256
from html import escape
from pathlib import Path
from typing import TypeAlias

from faultbond.api.options import PathLike, file_of
from faultbond.errors import FaultbondError, ModelError
from faultbond.io.examples import example as example_folder
from faultbond.io.files import replaced_text
from faultbond.model.document import ModelDocument, ModelFile, is_circuit, read_document
from faultbond.model.graph import BondGraph, Input, Parameter, Sensor
from faultbond.model.structure import Structure
from faultbond.model.text import parse_any, parse_model
from faultbond.model.words import text_of_words


class Model:
    """A model.

    Parameters
    ----------
    text : of the model file, YAML
    file : how messages call it
    recordings : that come with it, by name
    words : in place of a text the words of the file, such as `name`, `inputs` and `components`, as dicts, lists, texts
        and numbers

    Raises
    ------
    ModelError
        At the first thing in the text that is no model.

    Example
    -------
    >>> from faultbond.api.plant_model import example
    >>> [item.name for item in example("tank").sensors]
    ['flow', 'pressure']
    """

    def __init__(
        self,
        text: str | None = None,
        file: str = "model.yaml",
        recordings: Mapping[str, Path] | None = None,
        **words: object,
    ) -> None:
        if words:
            if text is not None:
                raise ModelError(f"{', '.join(words)}: give the text of a model file, or its words, not both.")
            text = text_of_words(words)
        if not isinstance(text, str):
            raise ModelError(f"{type(text).__name__}: expected the text of a model file; `load` reads one.")
        self._source: ModelFile = ModelDocument(label=file, data=text.encode())
        self.recordings = dict(recordings or {})
        self.stated  # noqa: B018 - a mistake in it is told now

    @classmethod
    def of_source(cls, source: ModelFile, recordings: Mapping[str, Path] | None = None) -> "Model":
        """Give the model of a file; it is read as a model when something of it is asked for.

        Raises
        ------
        ModelError
            Where it cannot be read, or is the text of a model, not the path of its file.
        """
        if isinstance(source, str) and "\n" in source:
            raise ModelError("a text of several lines: expected the path of a model file; `Model(text)` takes a text.")
        model = cls.__new__(cls)
        model._source = source if is_circuit(source) else read_document(source)
        model.recordings = dict(recordings or {})
        return model

    @property
    def source(self) -> ModelFile:
        """The model file as it was read; of a logic circuit its path."""
        return self._source

    @property
    def file(self) -> str:
        """The path of the file, as messages show it."""
        return self._source.label if isinstance(self._source, ModelDocument) else str(self._source)

    @property
    def text(self) -> str:
        """The text of the file."""
        return read_document(self._source).text

    @cached_property
    def stated(self) -> BondGraph | Structure:
        """What the text states: a bond graph or a network of blocks, or equations without laws."""
        return parse_any(self.text, file=self.file)

    @cached_property
    def graph(self) -> BondGraph:
        """The bond graph, or the network of blocks, all in SI.

        Raises
        ------
        ModelError
            Where it has no laws, or is a logic circuit.
        """
        if is_circuit(self._source):
            raise ModelError(f"{self.file}: a logic circuit has no bond graph; `run` gives all its diagnoses.")
        return self.stated if isinstance(self.stated, BondGraph) else parse_model(self.text, file=self.file)

    @property
    def name(self) -> str:
        """What the model is called."""
        return Path(self.file).stem if is_circuit(self._source) else self.stated.name

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The suspects: SI values, each with its `unit`."""
        return self.graph.parameters

    @property
    def inputs(self) -> tuple[Input, ...]:
        """The inputs: `column` and `unit` are those of a recording."""
        return self.graph.inputs

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """The sensors: `column` and `unit` are those of a recording."""
        return self.graph.sensors

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the model file.

        Raises
        ------
        FaultbondError
            Where it cannot be written.
        """
        written(path, self.text)

    def __repr__(self) -> str:
        return f"<Model {self.name!r} of {self.file}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and (self.file, self.text) == (other.file, other.text)

    def __hash__(self) -> int:
        return hash((self.file, sha256(self.text.encode()).digest()))

    def _repr_html_(self) -> str:
        return f"<b>{escape(self.name)}</b> <code>{escape(self.file)}</code><pre>{escape(self.text)}</pre>"


ModelLike: TypeAlias = Model | BondGraph | str | os.PathLike[str]


def load(path: str | os.PathLike[str]) -> Model:
    """Read a model file.

    Parameters
    ----------
    path : a YAML file, or a logic circuit that ends in `.xml`

    Raises
    ------
    ModelError
        Where it cannot be read, or is no model; the message starts with `file:line: `.

    Example
    -------
    >>> from faultbond.io.examples import example
    >>> load(example("tank") / "model.yaml").name
    'water tank'
    """
    if not isinstance(path, str | os.PathLike):
        raise ModelError(f"{type(path).__name__}: expected the path of a model file.")
    model = Model.of_source(path)
    if not is_circuit(model.source):
        model.stated  # noqa: B018 - a mistake in it is told now
    return model


def example(name: str) -> Model:
    """Give a built-in example; its `recordings` are the paths of its CSV files by name.

    Parameters
    ----------
    name : such as `tank`

    Raises
    ------
    FaultbondError
        Where there is no such example.

    Example
    -------
    >>> sorted(example("tank").recordings)
    ['fault_pipe', 'healthy']
    """
    folder = example_folder(name)
    return Model.of_source(folder / "model.yaml", {path.stem: path for path in sorted(folder.glob("*.csv"))})


def as_model(model: ModelLike) -> Model:
    """Give a model as such, of itself, the path of its file, or a bond graph that was built in Python.

    Raises
    ------
    ModelError
        Where it is nothing of that kind.
    """
    if isinstance(model, Model):
        return model
    if isinstance(model, BondGraph):
        return Model(model.text, file=model.file)
    if isinstance(model, str | os.PathLike):
        return Model.of_source(model)
    raise ModelError(f"{type(model).__name__}: this is no model. Give what `load` gives, or the path of a model file.")


def written(path: PathLike, text: str) -> None:
    """Write a text file, which is replaced as a whole.

    Raises
    ------
    FaultbondError
        Where it cannot be written, or is no path.
    """
    try:
        with replaced_text(file_of(path, "path")) as stream:
            stream.write(text)
    except OSError as error:
        raise FaultbondError(f"{path}: it cannot be written: {error.strerror or error}. Name another file.") from error
