"""The program of a model for a browser: a module of WebAssembly that takes bytes of CSV and gives records.

Its face stands in `faultbond/browser/page.c`; it needs nothing of the machine, so the page that runs it lends it
nothing. The same model, version and compiler give the same bytes.
"""

from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.io.recording import columns_of
from faultbond.model.graph import BondGraph
from faultbond.synthesis.c_files import FLEETS, sources_of
from faultbond.synthesis.columns_text import columns_text
from faultbond.synthesis.compile import compile_wasm
from faultbond.synthesis.extent import narrowed
from faultbond.synthesis.model_text import model_text
from faultbond.synthesis.names_text import names_text
from faultbond.synthesis.specify import build_spec

COMPILED = ("page.c", "memory.c")
_FOLDERS = {
    "browser": "",
    "core": "core/",
    "program": "program/",
}  # what their files begin with here
_NOT_NEEDED = (*FLEETS, "main.c")


def browser_module(
    graph: BondGraph, *, lanes_at_most: int | None = None, alarms_only: bool = False
) -> tuple[EngineSpec, bytes]:
    """Give the contract of a model, and its module of WebAssembly.

    Parameters
    ----------
    graph : the model
    lanes_at_most : no more hypotheses are tested than fit in so many filters; None: all are
    alarms_only : whether alarms are raised, and no fault is named

    Raises
    ------
    GenerationError
        Where there is no zig, or it fails.
    """
    plant = build_plant(graph)
    spec = narrowed(build_spec(build_step_model(plant)), lanes_at_most=lanes_at_most, alarms_only=alarms_only)
    texts = {
        prefix + name: text
        for folder, prefix in _FOLDERS.items()
        for name, text in sources_of(folder).items()
        if name not in _NOT_NEEDED
    }
    texts["model.h"] = model_text(spec, build_step_model(plant, all_inputs=True))
    texts["columns.h"], texts["names.h"] = columns_text(spec, columns_of(graph)), names_text(spec)
    return spec, compile_wasm(texts, COMPILED)
