"""What puts a detector on trial in many realisations of noise, as the verbs build it."""

from faultbond.analysis.realisations import CompiledDetector, load_detector
from faultbond.contract.spec import Thresholds
from faultbond.io.cache import loadable
from faultbond.synthesis.compile import compile_library, required_compiler
from faultbond.synthesis.realisations_text import detector_text


def compiled_detector(settings: Thresholds) -> CompiledDetector:
    """Build what puts a detector with some limits on trial.

    Raises
    ------
    GenerationError
        Where there is no C compiler, it fails, or what was built cannot be loaded.
    """
    with loadable([compile_library(detector_text(settings), required_compiler())]) as (path,):
        return load_detector(path)
