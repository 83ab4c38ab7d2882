"""From a bond graph to a specification and its compiled core."""

from dataclasses import dataclass

from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import Plant, build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.io.cache import Library, loadable
from faultbond.model.graph import BondGraph
from faultbond.runtime.core import Core, load_core
from faultbond.synthesis.compile import compile_core, compiler_title, required_compiler
from faultbond.synthesis.model_text import model_text
from faultbond.synthesis.specify import build_spec


def build_model(graph: BondGraph) -> StepModel:
    """Give the discrete-time model of a bond graph."""
    return build_step_model(build_plant(graph))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Built:
    """A core, and what it was loaded from: the library, and which compiler made it."""

    core: Core
    library: Library
    compiler: str


def build_engine(graph: BondGraph, *, fleets: bool = False) -> tuple[EngineSpec, Core]:
    """Give the specification of a bond graph, and its core; with what fleets need, it takes longer to compile.

    Raises
    ------
    GenerationError
        Where there is no C compiler, or it fails.
    """
    plant = build_plant(graph)
    core = _built(plant, build_spec(build_step_model(plant)), fleets=fleets).core
    return core.spec, core


def build(graph: BondGraph, *, brief: bool = False) -> Built:
    """Give the core of a bond graph with its library, so that this can be kept; see `compile_core` of what is brief.

    Raises
    ------
    GenerationError
        Where there is no C compiler, or it fails.
    """
    plant = build_plant(graph)
    return _built(plant, build_spec(build_step_model(plant)), brief=brief)


def build_core(plant: Plant, spec: EngineSpec) -> Core:
    """Give the core of a plant with a specification of it.

    Raises
    ------
    GenerationError
        Where there is no C compiler, or it fails.
    """
    return _built(plant, spec).core


def _built(plant: Plant, spec: EngineSpec, *, fleets: bool = False, brief: bool = False) -> Built:
    compiler, text = required_compiler(), model_text(spec, build_step_model(plant, all_inputs=True))
    library = compile_core(text, compiler, fleets=fleets, brief=brief)
    title = compiler_title(compiler)
    with loadable([library]) as (path,):
        return Built(core=load_core(path, spec, title), library=library, compiler=title)
