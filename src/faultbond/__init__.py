"""faultbond: from a bond graph to a fault detection and diagnosis engine.

Here are the names for people who work in Python: `load` or `example` gives a model, the verbs of the command line are
functions, and a `Monitor` watches live; docs/python.md shows them. Beside them are the data that they give, and some of
the parts below: an engine is built by `faultbond.synthesis.engine.build_engine`, recordings are read by `faultbond.io`,
pages are made by `faultbond.report`. What is asked for is loaded then.
"""

from faultbond.interrupt import is_program  # noqa: F401 - first, since what follows takes a while

# isort: split
from typing import TYPE_CHECKING

from faultbond.lazy import lazily

if TYPE_CHECKING:
    from faultbond.api.frame import Frame
    from faultbond.api.installation import demo, doctor
    from faultbond.api.live import Event, Monitor
    from faultbond.api.plant_model import Model, example, load
    from faultbond.api.ranked import RankedCandidate, SuspectValue
    from faultbond.api.result import Result
    from faultbond.api.service import history, serve
    from faultbond.api.told import Analysis, FittedModel, Records, Told
    from faultbond.api.verbs import (
        Simulation,
        accept,
        analyse,
        check,
        code,
        fit,
        generate,
        reject,
        run,
        simulate,
        trace,
    )
    from faultbond.contract.findings import Advice, Candidate, Decision, Detection, Diagnosis, Suspect
    from faultbond.contract.samples import Report, Reports, Sample, Samples, Status
    from faultbond.contract.spec import Engine, EngineSpec
    from faultbond.errors import (
        CausalityError,
        FaultbondError,
        GenerationError,
        ModelError,
        RecordingError,
        StructureError,
    )
    from faultbond.model.builder import ModelBuilder
    from faultbond.model.graph import BondGraph
    from faultbond.model.text import dump_model, load_model, parse_model
    from faultbond.runtime.core import Core
    from faultbond.runtime.fleet import AssetEvent, EventKind, Fleet
    from faultbond.runtime.names import find_hypothesis, is_sure

__all__ = [
    "Advice",
    "Analysis",
    "AssetEvent",
    "BondGraph",
    "Candidate",
    "CausalityError",
    "Core",
    "Decision",
    "Detection",
    "Diagnosis",
    "Engine",
    "EngineSpec",
    "Event",
    "EventKind",
    "FaultbondError",
    "FittedModel",
    "Fleet",
    "Frame",
    "GenerationError",
    "Model",
    "ModelBuilder",
    "ModelError",
    "Monitor",
    "RankedCandidate",
    "RecordingError",
    "Records",
    "Report",
    "Reports",
    "Result",
    "Sample",
    "Samples",
    "Simulation",
    "Status",
    "StructureError",
    "Suspect",
    "SuspectValue",
    "Told",
    "accept",
    "analyse",
    "check",
    "code",
    "demo",
    "doctor",
    "dump_model",
    "example",
    "find_hypothesis",
    "fit",
    "generate",
    "history",
    "is_sure",
    "load",
    "load_model",
    "parse_model",
    "reject",
    "run",
    "serve",
    "simulate",
    "trace",
]

__getattr__ = lazily(
    "faultbond",
    {
        "api.frame": "Frame",
        "api.installation": "demo doctor",
        "api.live": "Event Monitor",
        "api.plant_model": "Model example load",
        "api.ranked": "RankedCandidate SuspectValue",
        "api.result": "Result",
        "api.service": "history serve",
        "api.told": "Analysis FittedModel Records Told",
        "api.verbs": "Simulation accept analyse check code fit generate reject run simulate trace",
        "contract.findings": "Advice Candidate Decision Detection Diagnosis Suspect",
        "contract.samples": "Report Reports Sample Samples Status",
        "contract.spec": "Engine EngineSpec",
        "errors": "CausalityError FaultbondError GenerationError ModelError RecordingError StructureError",
        "model.builder": "ModelBuilder",
        "model.graph": "BondGraph",
        "model.text": "dump_model load_model parse_model",
        "runtime.core": "Core",
        "runtime.fleet": "AssetEvent EventKind Fleet",
        "runtime.names": "find_hypothesis is_sure",
    },
)
