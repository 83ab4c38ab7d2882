"""From a bond graph to a specification and a running engine."""

from concurrent.futures import ThreadPoolExecutor
from itertools import repeat

from faultbond.contract.spec import Engine, EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.errors import GenerationError
from faultbond.model.graph import BondGraph
from faultbond.runtime.library import load_engine
from faultbond.synthesis.compile import compile_library, find_compiler
from faultbond.synthesis.filter import build_filter
from faultbond.synthesis.machine import VirtualMachine
from faultbond.synthesis.model_text import core_text
from faultbond.synthesis.specify import build_spec


def build_model(graph: BondGraph) -> StepModel:
    """Give the discrete-time model of a bond graph."""
    return build_step_model(build_plant(graph))


def build_engine(graph: BondGraph, *, compiled: bool = True) -> tuple[EngineSpec, Engine]:
    """Give the specification of a bond graph and an engine that runs it.

    Parameters
    ----------
    graph : the plant
    compiled : whether to use a C compiler if there is one; otherwise CasADi's virtual machine runs the same graph
    """
    plant = build_plant(graph)
    model = build_step_model(plant)
    spec = build_spec(model)
    wide = build_step_model(plant, all_inputs=True)
    compiler = find_compiler() if compiled else None
    if compiler is None:
        return spec, _interpreted(spec, model, wide)
    sources = [core_text(layout, wide) for layout in (spec, spec.slotted)]
    try:
        with ThreadPoolExecutor() as pool:
            libraries = list(pool.map(compile_library, sources, repeat(compiler)))
    except GenerationError:
        return spec, _interpreted(spec, model, wide)  # a broken compiler is as good as none
    n_innovations = 2 * len(spec.outputs)
    command = " ".join(compiler)
    second = load_engine(libraries[1], n_innovations, command)
    return spec, load_engine(libraries[0], n_innovations, command, second)


def _interpreted(spec: EngineSpec, model: StepModel, wide: StepModel) -> VirtualMachine:
    return VirtualMachine(build_filter(spec, model), VirtualMachine(build_filter(spec.slotted, wide)))
