"""An FMU of a model: the files of its archive, with the sources of a monitor and, for this machine, a library of them.

A simulator, or a test bench, tells it what acts and what sensors read, and it says what it finds. The wrapper stands in
`faultbond/fmu`; the same model, version and compiler give the same bytes.
"""

import io
import platform
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from html import escape
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.errors import ModelError
from faultbond.model.graph import BondGraph
from faultbond.synthesis.c_files import FLEETS, sources_of
from faultbond.synthesis.compile import compile_shared, required_compiler
from faultbond.synthesis.extent import narrowed
from faultbond.synthesis.fmu_description import FmuTitle, build_description, model_description, unit_name
from faultbond.synthesis.fmu_variables import Variable, fmu_variables, variables_header
from faultbond.synthesis.model_text import model_text
from faultbond.synthesis.readable import readable_model
from faultbond.synthesis.specify import build_spec
from faultbond.types import TimeGrid

WATCHER = "watcher.c"  # all that is large: the core, and what FMUs of all versions share
NOT_NEEDED = (*FLEETS, "filters.c", "one.c")  # files of the core; the last two are for who compiles it in parts
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time that a zip file can tell
_SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
_MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}
_FMI2_PLATFORMS = {
    ("linux", "x86_64"): "linux64",
    ("darwin", "x86_64"): "darwin64",
    ("darwin", "aarch64"): "darwin64",
    ("windows", "x86_64"): "win64",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuParts:
    """What an FMU is made of.

    graph, spec : the model, and its contract
    model : `model.h`, as `model_text` gives it
    """

    graph: BondGraph
    spec: EngineSpec
    model: str


def fmu_parts(graph: BondGraph, *, lanes_at_most: int | None = None, alarms_only: bool = False) -> FmuParts:
    """Give what an FMU of a bond graph is made of.

    Parameters
    ----------
    graph : the model
    lanes_at_most : no more hypotheses are tested than fit in so many filters; None: all are
    alarms_only : whether alarms are raised, and no fault is named

    Raises
    ------
    ModelError
        Where samples of the model do not come at fixed times, or are means of rows.
    """
    check_fits(graph)
    plant = build_plant(graph)
    spec = narrowed(build_spec(build_step_model(plant)), lanes_at_most=lanes_at_most, alarms_only=alarms_only)
    return FmuParts(graph=graph, spec=spec, model=model_text(spec, build_step_model(plant, all_inputs=True)))


def check_fits(graph: BondGraph) -> None:
    """Check that an FMU can watch a plant.

    Raises
    ------
    ModelError
        Where samples of the model do not come at fixed times, or are means of rows.
    """
    if graph.grid is TimeGrid.NONE:
        raise ModelError(
            f"{graph.file}: {graph.name} has no time (`sample_time: none`), and an FMU watches a plant in time; "
            "`run` diagnoses its observations."
        )
    if graph.grid is TimeGrid.VARIABLE:
        raise ModelError(
            f"{graph.file}: sample_time is {graph.grid.value}, and the steps of an FMU are a multiple of a fixed time. "
            "Give the model a sample_time in seconds."
        )
    if graph.row_time is not None:
        raise ModelError(
            f"{graph.file}: samples are means of rows, and an FMU takes each value that it is told as a sample. "
            "Leave row_time out, and state the noise of a sample."
        )


def fmu_files(fmi: int, parts: FmuParts) -> dict[str, bytes]:
    """Give the files of an FMU by their paths in its archive.

    Parameters
    ----------
    fmi : version of the standard, 2 or 3
    parts : what it is made of

    Raises
    ------
    ModelError
        Where an input or a sensor has the name of another variable.
    GenerationError
        Where there is no C compiler, or it fails.
    """
    title, variables = fmu_title(parts), fmu_variables(parts.graph, parts.spec)
    sources = fmu_sources(fmi, parts)
    compiled = (WATCHER, f"fmi{fmi}.c")
    folder, ending = fmu_platform(fmi)
    found = {f"sources/{name}": text.encode() for name, text in sources.items()}
    found["modelDescription.xml"] = model_description(fmi, title, variables, compiled)
    if fmi == 3:
        found["sources/buildDescription.xml"] = build_description(title, compiled)
    found[f"binaries/{folder}/{title.identifier}{ending}"] = _library(fmi, sources)
    found["documentation/index.html"] = _page(title, variables)
    return dict(sorted(found.items()))


def fmu_sources(fmi: int, parts: FmuParts) -> dict[str, str]:
    """Give the sources of an FMU, all of one folder, by name.

    Parameters
    ----------
    fmi : version of the standard, 2 or 3
    parts : what it is made of

    Raises
    ------
    ModelError
        Where an input or a sensor has the name of another variable.
    """
    found = {name: text for name, text in sources_of("core").items() if name not in NOT_NEEDED}
    found |= {
        name: text for name, text in sources_of("fmu").items() if name.partition(".")[0] in ("watcher", f"fmi{fmi}")
    }
    found["model.h"] = readable_model(parts.model, parts.spec, parts.graph)
    found["variables.h"] = variables_header(parts.graph, parts.spec, fmu_title(parts).token)
    return found


def fmu_archive(found: Mapping[str, bytes]) -> bytes:
    """Give an archive of files by their paths; the same files give the same bytes."""
    stream = io.BytesIO()
    with ZipFile(stream, "w") as archive:
        for name in sorted(found):
            about = ZipInfo(name, date_time=_EPOCH)
            about.compress_type, about.create_system, about.external_attr = ZIP_DEFLATED, 3, 0o644 << 16
            archive.writestr(about, found[name])
    return stream.getvalue()


def fmu_title(parts: FmuParts) -> FmuTitle:
    """Give what an FMU is called; its token tells one model and version of faultbond from another."""
    spec = parts.spec
    digits = sha256(f"{spec.model_sha256}\0{spec.version}\0{parts.model}".encode()).hexdigest()
    token = "-".join((digits[:8], digits[8:12], digits[12:16], digits[16:20], digits[20:32]))
    return FmuTitle(
        name=spec.model,
        identifier=_identifier(spec.model),
        token=f"{{{token}}}",
        version=spec.version,
        step=spec.sample_time or 0.0,
    )


def _identifier(name: str) -> str:
    """Give a name as one of C."""
    word = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    return word if word[:1].isalpha() else f"model_{word}".rstrip("_")


def fmu_platform(fmi: int) -> tuple[str, str]:
    """Give the folder of the library of this machine by a version of the standard, and how its name ends."""
    system, ending = _SYSTEMS.get(sys.platform, (sys.platform, ".so"))
    machine = platform.machine().lower()
    machine = _MACHINES.get(machine, machine)
    folder = f"{machine}-{system}"
    return (_FMI2_PLATFORMS.get((system, machine), folder) if fmi == 2 else folder), ending


def _library(fmi: int, sources: Mapping[str, str]) -> bytes:
    """Give the library for this machine."""
    own = {name: text for name, text in sources.items() if name in (f"fmi{fmi}.c", f"fmi{fmi}.h", "watcher.h")}
    rest = {name: text for name, text in sources.items() if not name.startswith("fmi")}
    return compile_shared({WATCHER: rest, f"fmi{fmi}.c": own}, required_compiler())


def _page(title: FmuTitle, variables: tuple[Variable, ...]) -> bytes:
    """Give the page of an FMU: what it is told, and what it says."""
    rows = "\n".join(
        f"<tr><td>{escape(item.name)}</td><td>{'input' if item.is_input else 'output'}</td>"
        f"<td>{escape(unit_name(item.unit))}</td><td>{escape(item.description)}</td></tr>"
        for item in variables
    )
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{escape(title.name)}</title></head><body>
<h1>{escape(title.name)}</h1>
<p>A monitor that watches a plant, detects faults and tells what is wrong, made by faultbond {escape(title.version)}.
Each communication step is a multiple of {title.step!r} s. A sample is what the inputs say when a step begins; NaN is a
missing value. Numbers are in SI units; a percentage is from 0 to 100.</p>
<table>
<tr><th>variable</th><th>causality</th><th>unit</th><th>meaning</th></tr>
{rows}
</table>
</body></html>
""".encode()
