"""Names that a user gives."""

from faultbond.errors import ModelError
from faultbond.model.graph import BondGraph


def check_names(graph: BondGraph, names: tuple[str, ...]) -> None:
    """Refuse names that are no parameters.

    Raises
    ------
    ModelError
    """
    known = [item.name for item in graph.parameters]
    for name in names:
        if name not in known:
            raise ModelError(f"{graph.file}: no parameter {name}; there are {', '.join(known) or 'none'}")
