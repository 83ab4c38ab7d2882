"""The core of a plant, as the verbs build it and speak of it."""

from faultbond.io.cache import cache_folder
from faultbond.io.prepared import Identity, Prepared, write_prepared
from faultbond.io.recording import columns_of
from faultbond.model.graph import BondGraph
from faultbond.runtime.core import Core


def build_watcher(graph: BondGraph, identity: Identity | None = None) -> Core:
    """Build the core of a plant; under its identity, if there is one, the cache keeps it.

    Raises
    ------
    GenerationError
        Where there is no C compiler, or it fails.
    """
    from faultbond.synthesis.engine import build  # noqa: PLC0415 - loads casadi

    built = build(graph)
    if identity is not None and graph.stands_alone:
        spec, columns = built.core.spec, columns_of(graph)
        kept = Prepared(spec=spec, columns=columns, compiler=built.compiler, library=built.library)
        write_prepared(identity, kept)
    return built.core


def build_trial(graph: BondGraph) -> Core:
    """Build the core of a plant that is tried on recordings for moments, in a third of the time.

    Raises
    ------
    GenerationError
        Where there is no C compiler, or it fails.
    """
    from faultbond.synthesis.engine import build  # noqa: PLC0415 - loads casadi

    return build(graph, brief=True).core


def engine_title() -> str:
    """Say which engine a run would take, without building it."""
    from faultbond.synthesis.compile import NO_COMPILER, compiler_title, find_compiler  # noqa: PLC0415 - only here

    compiler = find_compiler()
    if compiler is None:
        return f"none. {NO_COMPILER}"
    return f"compiled C ({compiler_title(compiler)}), built at the first run and kept in {cache_folder()}"
