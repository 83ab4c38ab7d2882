"""`check`: what was understood of a model."""

from pathlib import Path

from faultbond.app.engine import engine_title
from faultbond.io.out import Out
from faultbond.model.structure import Structure
from faultbond.model.text import load_any


def check(model: Path, *, out: Out) -> None:
    """Tell what was understood of a model."""
    graph = load_any(model)
    if isinstance(graph, Structure):
        _check_structure(graph, out)
        return
    title = engine_title()
    from faultbond.report.inventory import Inventory, check_record  # noqa: PLC0415 - loads casadi
    from faultbond.synthesis.engine import build_model  # noqa: PLC0415 - loads casadi
    from faultbond.synthesis.specify import build_spec  # noqa: PLC0415 - loads casadi

    step_model = build_model(graph)
    seen = Inventory(graph=graph, model=step_model, spec=build_spec(step_model), engine=title)
    out.record(check_record(seen))
    if out.text is not None:
        from rich.console import Console  # noqa: PLC0415 - slow to load

        from faultbond.report.inventory import print_check  # noqa: PLC0415 - loads rich

        print_check(Console(file=out.text), seen)


def _check_structure(structure: Structure, out: Out) -> None:
    """Tell what was understood of equations without laws."""
    from faultbond.report.structure import print_equations, structure_check_record  # noqa: PLC0415 - loads rich

    out.record(structure_check_record(structure))
    if out.text is not None:
        from rich.console import Console  # noqa: PLC0415 - slow to load

        print_equations(Console(file=out.text), structure)
