"""The plant of a run: its model file, read as a model only where something is asked that the cache does not know."""

from functools import cached_property
from hashlib import sha256
from pathlib import Path

from faultbond.app.wishes import Wanted
from faultbond.io.cache import loadable
from faultbond.io.prepared import Identity, Prepared, code_identity, read_prepared
from faultbond.io.recording import Columns, columns_of
from faultbond.model.document import ModelDocument, ModelFile, read_document
from faultbond.model.graph import BondGraph
from faultbond.runtime.core import Core, load_core
from faultbond.types import Method


class WatchedPlant:
    """The plant of a run.

    Parameters
    ----------
    document : its model file
    identity : what the cache would know it by; None where nothing is to be kept
    prepared : what the cache knows of it
    """

    def __init__(self, document: ModelDocument, identity: Identity | None, prepared: Prepared | None) -> None:
        self._document = document
        self.identity, self.prepared = identity, prepared

    @cached_property
    def graph(self) -> BondGraph:
        """Its model."""
        from faultbond.model.text import parse_model  # noqa: PLC0415 - loads yaml

        return parse_model(self._document.text, file=self._document.label)

    @property
    def document(self) -> tuple[str, str]:
        """The path and the text of its model file."""
        return self._document.label, self._document.text

    @property
    def columns(self) -> Columns:
        """What to read of a recording."""
        return columns_of(self.graph) if self.prepared is None else self.prepared.columns


def find_plant(model: ModelFile, wanted: Wanted) -> WatchedPlant:
    """Read a model file, and look for what is known of it.

    Raises
    ------
    ModelError
        Where the file cannot be read.
    CacheError
        Where others may write the cache.
    """
    document = read_document(model)
    identity = plant_identity(document) if wanted.method is Method.BANK else None
    return WatchedPlant(document, identity, read_prepared(identity) if identity is not None else None)


def plant_identity(document: ModelDocument) -> Identity | None:
    """Give what the cache knows a plant by; None where no engine can be compiled."""
    from faultbond.synthesis.compile import compiler_identity, find_compiler, processor  # noqa: PLC0415 - not all need it

    compiler = find_compiler()
    if compiler is None:
        return None
    try:
        code = code_identity()
    except OSError:  # as where the package is imported from an archive
        return None
    return Identity(
        model=sha256(document.data).hexdigest(),
        stem=Path(document.label).stem,
        code=code,
        compiler=compiler_identity(compiler),
        processor=processor(),
    )


def load_prepared(prepared: Prepared) -> Core:
    """Give the core of a prepared plant.

    Raises
    ------
    CacheError
        Where others may write the cache.
    GenerationError
        Where it cannot be loaded.
    """
    with loadable([prepared.library]) as (path,):
        return load_core(path, prepared.spec, prepared.compiler)
