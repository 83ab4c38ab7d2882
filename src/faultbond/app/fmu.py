"""`generate --fmu`: an FMU of one model, for simulators and test benches."""

from pathlib import Path
from zipfile import BadZipFile, ZipFile

from faultbond.app.generation import Generated
from faultbond.errors import FaultbondError
from faultbond.io.files import replaced
from faultbond.model.document import ModelFile
from faultbond.model.text import load_model

ENDING = ".fmu"
DESCRIPTION = "modelDescription.xml"  # in every FMU


def refuse_other_file(output: Path) -> None:
    """Refuse a file that is there and is no FMU.

    Raises
    ------
    FaultbondError
        Where it is a folder, or holds something else.
    """
    if output.is_dir():
        raise FaultbondError(f"{output}: this is a folder. An FMU is one file; name another one.")
    if output.is_file() and output.stat().st_size and not _is_fmu(output):
        raise FaultbondError(f"{output}: this file is no FMU, and it stays as it is. Name another file, or delete it.")


def _is_fmu(path: Path) -> bool:
    try:
        with ZipFile(path) as archive:
            return DESCRIPTION in archive.namelist()
    except (OSError, BadZipFile, ValueError):
        return False


def generated_fmu(
    model: ModelFile, *, fmi: int, output: Path, lanes_at_most: int | None, watch_only: bool
) -> Generated:
    """Write the FMU of a model, and give what was written.

    Parameters
    ----------
    model : the model file, or what was read of one
    fmi : version of the standard, 2 or 3
    output : the file
    lanes_at_most : no more hypotheses are tested than fit in so many filters; None: all are
    watch_only : whether alarms are raised, and no fault is named

    Raises
    ------
    FaultbondError
        Where the file is not called as one, or holds something else.
    ModelError
        Where samples of the model do not come at fixed times, or one of its names is that of another variable.
    GenerationError
        Where there is no C compiler, or it fails.
    """
    if output.suffix != ENDING:
        raise FaultbondError(f"{output}: an FMU is one file. Name one that ends in {ENDING}.")
    refuse_other_file(output)
    graph = load_model(model)
    from faultbond.synthesis import fmu  # noqa: PLC0415 - loads casadi

    parts = fmu.fmu_parts(graph, lanes_at_most=lanes_at_most, alarms_only=watch_only)
    files = fmu.fmu_files(fmi, parts)
    with replaced(output) as stream:
        stream.write(fmu.fmu_archive(files))
    title, platform = fmu.fmu_title(parts), fmu.fmu_platform(fmi)[0]
    told = f"{len(graph.inputs)} inputs and {len(graph.sensors)} readings"
    return Generated(
        record={
            "record": "fmu",
            "model": graph.name,
            "output": str(output),
            "fmi": fmi,
            "token": title.token,
            "platform": platform,
            "files": len(files),
            "watch_only": watch_only,
        },
        lines=(
            f"{output}: FMI {fmi}.0, co-simulation, with sources and a library for {platform}.",
            f"It is told {told} every {title.step:g} s; docs/fmu.md lists what it says.",
        ),
    )
