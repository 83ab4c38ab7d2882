"""faultbond: from a bond graph to a fault detection and diagnosis engine.

Here are the names that are quick to load. An engine is built by `faultbond.synthesis.engine.build_engine`, recordings
are read by `faultbond.io`, plants are simulated by `faultbond.simulate`, pages are made by `faultbond.report`.
"""

from faultbond.interrupt import is_program  # noqa: F401 - first, since what follows takes a while

# isort: split
from typing import TYPE_CHECKING

from faultbond.lazy import lazily

if TYPE_CHECKING:
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
    from faultbond.runtime.monitor import Monitor
    from faultbond.runtime.names import find_hypothesis, is_sure

__all__ = [
    "Advice",
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
    "EventKind",
    "FaultbondError",
    "Fleet",
    "GenerationError",
    "ModelBuilder",
    "ModelError",
    "Monitor",
    "RecordingError",
    "Report",
    "Reports",
    "Sample",
    "Samples",
    "Status",
    "StructureError",
    "Suspect",
    "dump_model",
    "find_hypothesis",
    "is_sure",
    "load_model",
    "parse_model",
]

__getattr__ = lazily(
    "faultbond",
    {
        "contract.findings": "Advice Candidate Decision Detection Diagnosis Suspect",
        "contract.samples": "Report Reports Sample Samples Status",
        "contract.spec": "Engine EngineSpec",
        "errors": "CausalityError FaultbondError GenerationError ModelError RecordingError StructureError",
        "model.builder": "ModelBuilder",
        "model.graph": "BondGraph",
        "model.text": "dump_model load_model parse_model",
        "runtime.core": "Core",
        "runtime.fleet": "AssetEvent EventKind Fleet",
        "runtime.monitor": "Monitor",
        "runtime.names": "find_hypothesis is_sure",
    },
)
