"""The page that `generate --web` writes: one file with the program and the drawing of a model, and scripts.

What a recording says is not known here: the scripts of `faultbond/browser` say it when one is played. What they show of
the model, its names, units and drawing, is put in as the report shows it.
"""

import base64
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from math import isfinite

from faultbond.contract.core_settings import core_settings
from faultbond.contract.spec import EngineSpec
from faultbond.io.recording import Column, columns_of
from faultbond.model.graph import BondGraph, Unit
from faultbond.report.chart import Json
from faultbond.report.drawing import STRONGEST, draw, graph_title
from faultbond.report.html import STATIC
from faultbond.report.numbers import Notation, unit_text
from faultbond.report.suspects import UNDETERMINED_SHARE, instrument_title, owner_title, shown_in, unit_of, with_article
from faultbond.report.template import page_template
from faultbond.report.verdict import step_text
from faultbond.types import FaultKind

SCRIPTS = ("numbers.js", "words.js", "run.js", "page.js")  # in this order, after that of the plots, they are one
_FOLDER = resources.files("faultbond") / "browser"
_WORDS = (FaultKind.BIAS, FaultKind.GAIN, FaultKind.STUCK, FaultKind.NOISE)  # what may be wrong with a sensor or input
_SMALLEST = 9  # level of zlib


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltInRecording:
    """A recording that a page has inside: its name, its CSV as bytes, and the times of its first and last sample, s."""

    name: str
    content: bytes
    start: float
    end: float


def render_browser_page(
    graph: BondGraph, spec: EngineSpec, module: bytes, strokes: Mapping[int, str], recording: BuiltInRecording | None
) -> str:
    """Give the page of a model as HTML text.

    Parameters
    ----------
    graph : the plant
    spec : its contract
    module : the program as WebAssembly
    strokes : node at which the causal stroke of each bond stands, by bond index
    recording : that can be played without dropping one; None: there is none
    """
    columns = columns_of(graph)
    header = [columns.time.column] if columns.time.column else []
    return page_template("browser", "page.html.j2").render(
        name=graph.name,
        version=spec.version,
        columns=[(item.header, _column_unit(item), item.role) for item in columns.needed(header)],
        step=step_text(graph),
        drawing=draw(graph, strokes, {}),
        drawing_title=graph_title(graph),
        blocks_drawn=graph.is_block_network,
        instruments=_instruments(graph),
        recording=recording.name if recording else "",
        data=_data(graph, spec, recording),
        packed={"module": _packed(module), "recording": _packed(recording.content) if recording else ""},
        style="".join(map(_static, ("uPlot.min.css", "report.css", "plot.css"))) + _text("page.css"),
        licence=_static("uPlot.LICENSE"),
        worker=_text("worker.js"),
        library=_static("uPlot.iife.min.js"),
        script="\n".join((_static("plot.js"), *map(_text, SCRIPTS))),
    )


def _static(name: str) -> str:
    return (STATIC / name).read_text(encoding="utf-8")


def _text(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")


def _packed(content: bytes) -> str:
    """Give bytes as the page unpacks them: base64 of a stream of zlib."""
    return base64.b64encode(zlib.compress(content, _SMALLEST)).decode()


def _column_unit(column: Column) -> str:
    return unit_text(column.unit.text, Notation.PRINT)


def _instruments(graph: BondGraph) -> list[tuple[str, str]]:
    """Give sensors and inputs that may be at fault: name and title."""
    found = [item.name for item in graph.sensors if item.suspect]
    found += [item.name for item in graph.inputs if item.suspect]
    return [(name, instrument_title(graph, name)) for name in found]


def _data(graph: BondGraph, spec: EngineSpec, recording: BuiltInRecording | None) -> Json:
    """Give what the scripts need to know of the model."""
    alarming = [(k, error) for k, error in enumerate(spec.slow_errors) if error.alarms]
    return {
        "name": graph.name,
        "sampleTime": spec.sample_time,
        "warmUp": spec.thresholds.warm_up_samples,
        "lastRenewal": int(core_settings()["LAST_RENEWAL"]),
        "undetermined": UNDETERMINED_SHARE,
        "strongest": STRONGEST,
        "inputs": [{"name": item.name, **_unit(item.unit)} for item in graph.inputs],
        "sensors": [{"name": item.name, **_unit(item.unit)} for item in graph.sensors],
        "cusumLimit": spec.thresholds.cusum_limit,
        "slow": [{"name": error.words, "place": k, "limit": float(spec.slow_limits[k])} for k, error in alarming],
        "nSlow": len(spec.slow_errors),
        "falseAlarms": graph.false_alarms,
        "wanders": [item.target for item in graph.wanders],
        "lags": sorted(graph.lags),
        "suspects": dict(_suspects(graph)),
        "instruments": {name: with_article(title) for name, title in _instruments(graph)},
        "parts": {item.name: with_article(item.name) for item in graph.components},
        "recording": {"name": recording.name, "start": recording.start, "end": recording.end} if recording else None,
    }


def _unit(unit: Unit) -> Json:
    """Give a unit: a value in SI is `factor` times the value in the unit, and `offset`."""
    return {"unit": unit_text(unit.text, Notation.PRINT), "factor": unit.factor, "offset": unit.offset}


def _suspects(graph: BondGraph) -> list[tuple[str, Json]]:
    """Give what is said of each suspect, by its name in the records: owner, words before it, and unit."""
    found: list[tuple[str, Json]] = []
    for item in graph.parameters:
        owner = owner_title(graph, item)
        title = owner if item.owner == item.name else f"{owner} {item.name}"
        about = {
            "title": title,
            "owner": with_article(owner),
            "part": item.owner,
            "change": item.change if isfinite(item.change) else None,
            "mayFail": item.suspect,
        }
        found.append((item.name, {**about, **_unit(item.unit)}))
    for name in (*(item.name for item in graph.sensors), *(item.name for item in graph.inputs)):
        title = instrument_title(graph, name)
        is_input = title.startswith("input ")
        for word in _WORDS:
            key = f"{name}.{word.value}"
            about = {"title": title, "owner": with_article(title), "part": name, "word": word.value}
            about["shownIn"] = shown_in(graph, key, Notation.PRINT)
            found.append((key, {**about, "signal": name, "isInput": is_input, **_unit(unit_of(graph, key))}))
    return found
