"""`run`, the door to three products: a plant in time, a network without time, and a logic circuit."""

from pathlib import Path

from faultbond.app.plant import find_plant
from faultbond.app.plant_run import run_plant
from faultbond.app.wishes import Wanted
from faultbond.errors import ModelError
from faultbond.io.out import Out
from faultbond.model.document import is_circuit
from faultbond.types import Method, TimeGrid, Verdict


def run(model: Path, recording: str, *, wanted: Wanted, out: Out) -> Verdict:
    """Watch a recording, a path or `-`, and give the verdict."""
    if is_circuit(model):
        from faultbond.app.network_run import run_circuit  # noqa: PLC0415 - loads casadi and sympy

        _refuse_time(wanted, str(model))
        return run_circuit(model, recording, method=wanted.method, report=wanted.report, out=out)
    plant = find_plant(model, wanted)
    if plant.prepared is None and plant.graph.grid is TimeGrid.NONE:
        from faultbond.app.network_run import run_static  # noqa: PLC0415 - loads casadi and sympy

        _refuse_time(wanted, plant.graph.file)
        return run_static(plant.graph, recording, method=wanted.method, report=wanted.report, out=out)
    return run_plant(plant, recording, wanted=wanted, out=out)


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
