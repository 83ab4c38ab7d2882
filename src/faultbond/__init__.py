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
    from faultbond.runtime.accepting import accept, find_hypothesis, is_sure, reject
    from faultbond.runtime.monitor import finish, step
    from faultbond.runtime.state import Report, Sample, State, Status, init

__all__ = [
    "Advice",
    "BondGraph",
    "Candidate",
    "CausalityError",
    "Decision",
    "Detection",
    "Diagnosis",
    "Engine",
    "EngineSpec",
    "FaultbondError",
    "GenerationError",
    "ModelBuilder",
    "ModelError",
    "RecordingError",
    "Report",
    "Sample",
    "State",
    "Status",
    "StructureError",
    "Suspect",
    "accept",
    "dump_model",
    "find_hypothesis",
    "finish",
    "init",
    "is_sure",
    "load_model",
    "parse_model",
    "reject",
    "step",
]

__getattr__ = lazily(
    "faultbond",
    {
        "contract.findings": "Advice Candidate Decision Detection Diagnosis Suspect",
        "contract.spec": "Engine EngineSpec",
        "errors": "CausalityError FaultbondError GenerationError ModelError RecordingError StructureError",
        "model.builder": "ModelBuilder",
        "model.graph": "BondGraph",
        "model.text": "dump_model load_model parse_model",
        "runtime.accepting": "accept find_hypothesis is_sure reject",
        "runtime.monitor": "finish step",
        "runtime.state": "Report Sample State Status init",
    },
)
