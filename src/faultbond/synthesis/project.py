"""A project in C and C++ of one model: all files of the folder that `generate` writes, as texts.

In it are the core as it is, the model's own tables and functions, a face of the library, and what builds and tests it.
The same model gives the same bytes: no date, no path, no order of sets. Templates look like their target; what stands
in double braces there is put in here.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.resources import files

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.errors import plain
from faultbond.io.recording import columns_of
from faultbond.model.graph import BondGraph
from faultbond.model.parser import number_text, to_text
from faultbond.synthesis.c_files import FLEETS, sources_of
from faultbond.synthesis.columns_text import columns_text
from faultbond.synthesis.extent import count_lanes
from faultbond.synthesis.names_text import names_text
from faultbond.synthesis.readable import enumeration, in_comment, laws_of, readable_model, tested
from faultbond.synthesis.samples_text import samples_text
from faultbond.types import TARGETS

_HOLE = re.compile(r"\{\{(\w+)\}\}")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectParts:
    """What a project is made of.

    graph, spec : the model, and its contract
    model : `model.h`, as `model_text` gives it
    sizes : bytes of a state, of work memory and of a saved state, by these names
    recording, records : of the self-test: CSV, and the JSON lines that `run` writes of it
    samples : (n_samples, 2 + n_inputs + n_sensors), those that the core takes of it: time and step (s), inputs and
        readings, SI, nan where missing
    target : what `make` builds for if it is not told
    """

    graph: BondGraph
    spec: EngineSpec
    model: str
    sizes: Mapping[str, int]
    recording: str
    records: str
    samples: FloatArray
    target: str = TARGETS[0]


def project_files(parts: ProjectParts) -> dict[str, str]:
    """Give the files of a project, by their paths in its folder."""
    holes = _holes(parts)
    own = ("Makefile", "CMakeLists.txt", "README.md", "faultbond.h", "fb.hpp", "library.c", "example.c")
    found = {name: _filled(name, holes) for name in own}
    found["model.h"] = readable_model(parts.model, parts.spec, parts.graph)
    found["columns.h"], found["names.h"] = columns_text(parts.spec, columns_of(parts.graph)), names_text(parts.spec)
    found |= {f"core/{name}": text for name, text in sources_of("core").items() if name not in FLEETS}
    found |= {f"program/{name}": text for name, text in sources_of("program").items()}
    found["program/memory.c"] = _filled("memory.c", holes)
    found |= {f"board/{name}": text for name, text in sources_of("board").items()}
    found["check/samples.h"] = samples_text(parts.samples, parts.records)
    checks = ("compare.c", "misra.awk", "misra.txt", "stack.awk", "wasi.mjs")
    found |= {f"check/{name}": _filled(name, holes) for name in checks}
    found["check/recording.csv"], found["check/expected.jsonl"] = parts.recording, parts.records
    return dict(sorted(found.items()))


def _suspects(parts: ProjectParts) -> str:
    """Give the table of the parameters that may be at fault."""
    return _table(
        ("parameter", "of", "nominal", "unit", "line"),
        (
            (i.name, i.owner, number_text(i.unit.from_si(i.nominal)), i.unit.text, i.line)
            for i in parts.graph.parameters
            if i.suspect
        ),
    )


def _template(name: str) -> str:
    return files("faultbond").joinpath("synthesis", "templates", name).read_text(encoding="utf-8")


def _filled(name: str, holes: Mapping[str, str]) -> str:
    """Give a template with its holes filled."""
    return _HOLE.sub(lambda hole: holes[hole[1]], _template(name))


def _holes(parts: ProjectParts) -> dict[str, str]:
    """Give what stands in the holes of the templates, by name."""
    spec, size = parts.spec, parts.sizes
    inputs, sensors = [item.name for item in spec.inputs], [item.name for item in spec.outputs]
    parameters = [item.name for item in spec.parameters]
    return {
        "model": in_comment(spec.model),
        "title": _in_markdown(spec.model),
        "version": spec.version,
        "sha256": spec.model_sha256,
        "target": parts.target,
        "targets": ", ".join(f"`{name}`" for name in TARGETS[1:]),
        "sizes": _sizes(parts.model),
        "state_bytes": str(size["state"]),
        "work_bytes": str(size["work"]),
        "saved_bytes": str(size["saved"]),
        "lanes": str(count_lanes(spec)),
        "parameter_texts": _texts(parameters),
        "input_texts": _texts(inputs),
        "sensor_texts": _texts(sensors),
        "input_order": _order("FB_INPUT", inputs),
        "sensor_order": _order("FB_SENSOR", sensors),
        "parameter_order": _order("FB_PARAMETER", parameters),
        "inputs": _table(("input", "column", "unit"), ((i.name, i.column, i.unit.text) for i in parts.graph.inputs)),
        "sensors": _table(
            ("sensor", "column", "unit", "reads", "line"),
            ((i.name, i.column, i.unit.text, _code(to_text(i.reads)), i.line) for i in parts.graph.sensors),
        ),
        "suspects": _suspects(parts) if spec.n_hypotheses else "",
        "instruments": _listed(f"`{item.name}`" for item in spec.instruments) or "none",
        "tested": "; ".join(tested(spec)),
        "laws": "\n".join(
            f"    line {line:>4}  {item.name + ':':<12} {in_comment(law)}"
            for item in parts.graph.components
            for line, law in laws_of(item)
        ),
        "verdict": "1" if '"record": "detection"' in parts.records else "0",
        "misra": _deviations(_template("misra.txt")),
        "rows": str(parts.recording.count("\n") - 1),
    }


def _sizes(model: str) -> str:
    """Give the definitions of `model.h` that `core/found.h` needs, and the kinds of fault."""
    used = set(re.findall(r"\w+", sources_of("core")["found.h"]))
    found = re.finditer(r"^#define (\w+) .*$", model[: model.index("#include")], re.MULTILINE)
    return "\n".join(item[0] for item in found if item[1] in used or item[1].startswith(("KIND_", "CHECK_")))


def _deviations(text: str) -> str:
    """Give the table of the rules that are not followed: the rows of `misra.txt`."""
    head = "| rule | | places in the library | in the program | why |\n|---|---|---|---|---|"
    return "\n".join((head, *(f"| {line} |" for line in text.splitlines() if not line.startswith("#"))))


def _texts(names: Iterable[str]) -> str:
    """Give names as texts of C; one at least."""
    return ", ".join(f'"{name}"' for name in names) or '""'


def _order(prefix: str, names: Iterable[str]) -> str:
    """Give names as an enumeration; one at least."""
    return enumeration([f"{prefix}_{name} = {k}" for k, name in enumerate(names)] or [f"{prefix}_NONE = -1"])


def _listed(items: Iterable[str]) -> str:
    return ", ".join(items)


def _table(head: tuple[str, ...], rows: Iterable[tuple[object, ...]]) -> str:
    """Give a table in Markdown."""
    lines = [head, tuple("---" for _ in head), *(tuple(map(_cell, row)) for row in rows)]
    return "\n".join(f"| {' | '.join(row)} |" for row in lines) if len(lines) > 2 else "none"


def _cell(value: object) -> str:
    return str(value) if str(value).startswith("`") else _in_markdown(str(value))


def _code(text: str) -> str:
    return "`" + plain(text).replace("`", "'").replace("|", "\\|") + "`"


def _in_markdown(text: str) -> str:
    """Give a text of the user's that is no mark of Markdown."""
    return re.sub(r"([\\`*_{}\[\]<>#|~$])", r"\\\1", plain(" ".join(text.split())))
