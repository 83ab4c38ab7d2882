"""Engines as the command line chooses them."""

from faultbond.contract.spec import Engine, EngineSpec
from faultbond.errors import GenerationError
from faultbond.model.graph import BondGraph
from faultbond.types import EngineChoice

NO_COMPILER = (
    "The engine `c` cannot be built: there is no C compiler that works. "
    "Install gcc or clang, or `pip install 'faultbond[compiler]'`, or take the engine `vm`."
)


def build_watcher(graph: BondGraph, choice: EngineChoice) -> tuple[EngineSpec, Engine]:
    """Build the engine that was chosen."""
    from faultbond.synthesis.engine import build_engine  # noqa: PLC0415 - loads casadi

    spec, engine = build_engine(graph, compiled=choice is not EngineChoice.MACHINE)
    if choice is EngineChoice.COMPILED and not hasattr(engine, "compiler"):
        raise GenerationError(NO_COMPILER)
    return spec, engine


def engine_title(choice: EngineChoice) -> str:
    """Say which engine would be taken, without building it."""
    from faultbond.synthesis.compile import cache_folder, find_compiler  # noqa: PLC0415 - only for `check`

    compiler = None if choice is EngineChoice.MACHINE else find_compiler()
    if compiler is not None:
        return f"compiled C ({' '.join(compiler)}), built at the first run and kept in {cache_folder()}"
    if choice is EngineChoice.COMPILED:
        raise GenerationError(NO_COMPILER)
    return "CasADi virtual machine (no C compiler used)"
