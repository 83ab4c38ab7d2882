"""`run`, the door to three products: a plant in time, a network without time, and a logic circuit."""

from pathlib import Path
from typing import TYPE_CHECKING

from faultbond.app.plant import find_plant
from faultbond.app.plant_run import PlantRun, watch_plant
from faultbond.app.wishes import Wanted
from faultbond.errors import ModelError
from faultbond.io.files import STANDARD_INPUT
from faultbond.io.memory_table import Recording
from faultbond.io.out import Out
from faultbond.model.document import ModelDocument, ModelFile, is_circuit
from faultbond.types import Method, TimeGrid, Verdict

if TYPE_CHECKING:
    from faultbond.app.network_run import NetworkRun


def run(model: ModelFile, recording: Recording, *, wanted: Wanted, out: Out) -> Verdict:
    """Watch a recording, tell what was found, and give the verdict; who stops it is told what was found by then.

    Raises
    ------
    KeyboardInterrupt
        Where somebody stopped it, once that is told.
    """
    found = watch_any(model, recording, wanted=wanted, out=out, curves=wanted.report is not None)
    found.tell(wanted.report, out)
    if found.stopped is not None:
        if str(recording) != STANDARD_INPUT:
            out.warn("stopped: the rows that follow were not looked at.")
        raise found.stopped
    return found.verdict


def watch_any(
    model: ModelFile, recording: Recording, *, wanted: Wanted, out: Out, curves: bool
) -> "PlantRun | NetworkRun":
    """Watch a recording, and write the records as they come.

    Parameters
    ----------
    model : the model file
    recording : what was measured
    wanted : how it is watched
    out : where the records go
    curves : whether all samples are kept, to be drawn
    """
    if is_circuit(model):
        from faultbond.app.network_run import watch_circuit  # noqa: PLC0415 - loads casadi and sympy

        circuit = Path(model.label if isinstance(model, ModelDocument) else model)
        _refuse_time(wanted, str(circuit))
        return watch_circuit(circuit, recording, wanted=wanted, out=out)
    plant = find_plant(model, wanted)
    if plant.prepared is None and plant.graph.grid is TimeGrid.NONE:
        from faultbond.app.network_run import watch_static  # noqa: PLC0415 - loads casadi and sympy

        _refuse_time(wanted, plant.graph.file)
        return watch_static(plant.graph, recording, wanted=wanted, out=out)
    return watch_plant(plant, recording, wanted=wanted, out=out, curves=curves)


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
