"""The detector with many realisations of noise as C: its limits, and the loops of `realisations.c`."""

from importlib.resources import files

from faultbond.contract.spec import Thresholds
from faultbond.synthesis.plan_tables import sum_settings


def detector_text(settings: Thresholds) -> str:
    """Give the source of what puts a detector with some limits on trial, see `analysis.realisations`."""
    limits = (f"#define {name} {value}" for name, value in sum_settings(settings).items())
    loops = files("faultbond.synthesis").joinpath("realisations.c").read_text(encoding="utf-8")
    return "\n".join([*limits, loops])
