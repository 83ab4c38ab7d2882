"""`generate --web`: a page of a browser that watches recordings of one model."""

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from faultbond.app.generation import Generated, check_has_time
from faultbond.errors import FaultbondError
from faultbond.io.files import replaced_text
from faultbond.io.recording import columns_of, read_blocks
from faultbond.model.document import ModelFile
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model

if TYPE_CHECKING:
    from faultbond.report.browser import BuiltInRecording

ENDINGS = (".html", ".htm")
BESIDE = "fault_*.csv"  # recordings beside a model that its page plays, as those of the examples


def generated_page(
    model: ModelFile, *, output: Path, recording: Path | None, lanes_at_most: int | None, watch_only: bool
) -> Generated:
    """Write the page of a model, and give what was written.

    Parameters
    ----------
    model : the model file, or what was read of one
    output : the file
    recording : CSV that the page has inside; None: the first `fault_*.csv` beside the model, if there is one
    lanes_at_most : no more hypotheses are tested than fit in so many filters; None: all are
    watch_only : whether alarms are raised, and no fault is named

    Raises
    ------
    FaultbondError
        Where the file is not called as a page, or the recording cannot be read.
    ModelError
        Where the model has no time, so that there is nothing to watch.
    GenerationError
        Where there is no zig, or it fails.
    """
    if output.suffix not in ENDINGS:
        raise FaultbondError(f"{output}: a page is one file. Name one that ends in {ENDINGS[0]}.")
    graph = load_model(model)
    check_has_time(graph)
    played = _beside(graph) if recording is None else _read(recording, graph)
    from faultbond.equations.causality import assign_causality  # noqa: PLC0415 - not all need it
    from faultbond.report.browser import render_browser_page  # noqa: PLC0415 - loads jinja2
    from faultbond.synthesis.browser_module import browser_module  # noqa: PLC0415 - loads casadi

    spec, module = browser_module(graph, lanes_at_most=lanes_at_most, alarms_only=watch_only)
    page = render_browser_page(graph, spec, module, dict(assign_causality(graph).strokes), played)
    with replaced_text(output) as stream:
        stream.write(page)
    inside = f"plays {played.name}" if played else "has no recording inside"
    return Generated(
        record={
            "record": "page",
            "model": graph.name,
            "output": str(output),
            "bytes": len(page.encode()),
            "recording": played.name if played else None,
            "watch_only": watch_only,
        },
        lines=(
            f"{output}: {len(page.encode()) / 1000.0:.0f} kB, one file that needs no network.",
            f"It {inside}, and takes any other that is dropped on it.",
        ),
    )


def _beside(graph: BondGraph) -> "BuiltInRecording | None":
    """Read the first recording beside the model that is one of its plant; None where there is none."""
    for path in sorted(Path(graph.file).parent.glob(BESIDE)):
        with suppress(FaultbondError):
            return _read(path, graph)
    return None


def _read(recording: Path, graph: BondGraph) -> "BuiltInRecording":
    """Read a recording that a page has inside, all of it, so that a mistake in it is told now."""
    from faultbond.report.browser import BuiltInRecording  # noqa: PLC0415 - loads jinja2

    blocks = [block for block in read_blocks(str(recording), columns_of(graph)) if len(block.time)]
    if recording.suffix.lower() == ".parquet" or not blocks:
        raise FaultbondError(f"{recording}: a page plays CSV with rows. Name another recording.")
    return BuiltInRecording(
        name=recording.name,
        content=recording.read_bytes(),
        start=float(blocks[0].time[0]),
        end=float(blocks[-1].time[-1]),
    )
