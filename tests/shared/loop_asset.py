"""The RLC circuit as an asset of a service: its plant, a recording with a fault of it, and deeds of people."""

from functools import cache
from pathlib import Path

from faultbond.app.plant import WatchedPlant, find_plant
from faultbond.app.wishes import Wanted
from faultbond.io.recording import read_blocks
from faultbond.io.row_block import RowBlock, joined_rows
from faultbond.service.contract.messages import Action, Deed

MODEL = Path("examples/rlc/model.yaml").resolve()
RECORDING = next(MODEL.parent.glob("fault_*.csv"))
FOUND = 950  # rows by which the fault has been found and named


@cache
def plant() -> WatchedPlant:
    """Give its plant."""
    return find_plant(MODEL, Wanted())


@cache
def rows() -> RowBlock:
    """Give the rows of the recording in one block."""
    return joined_rows(list(read_blocks(str(RECORDING), plant().columns)))


def deed(action: Action, *target: str, rows: int = 0, at: float = 100.0, until: float | None = None) -> Deed:
    """Give a deed of somebody."""
    return Deed(asset="loop", action=action, at=at, who="anna", rows=rows, target=target, until=until)
