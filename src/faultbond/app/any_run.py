"""`run`, the door to three products: a plant in time, a network without time, and a logic circuit."""

from pathlib import Path

from faultbond.app.network_run import run_circuit, run_static
from faultbond.app.plant_run import run_plant
from faultbond.app.wishes import Wanted
from faultbond.errors import ModelError
from faultbond.io.out import Out
from faultbond.model.text import load_model
from faultbond.networks.logic.dxc import is_circuit
from faultbond.types import Method, TimeGrid, Verdict


def run(model: Path, recording: str, *, wanted: Wanted, out: Out) -> Verdict:
    """Watch a recording, a path or `-`, and give the verdict."""
    if is_circuit(model):
        _refuse_time(wanted, str(model))
        return run_circuit(model, recording, method=wanted.method, report=wanted.report, out=out)
    graph = load_model(model)
    if graph.grid is TimeGrid.NONE:
        _refuse_time(wanted, graph.file)
        return run_static(graph, recording, method=wanted.method, report=wanted.report, out=out)
    return run_plant(graph, recording, wanted=wanted, out=out)


def _refuse_time(wanted: Wanted, model: str) -> None:
    """Refuse what only a plant in time has."""
    options = {
        "--state": wanted.state is not None,
        "--accept": wanted.accept is not None,
        f"--method {wanted.method.value}": wanted.method is not Method.BANK,
    }
    for option, given in options.items():
        if given:
            raise ModelError(f"{model}: a network without time is diagnosed row by row; leave out {option}")
