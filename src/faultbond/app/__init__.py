"""What each verb does, by composing the layers below. Large libraries are loaded when a verb needs them."""

from faultbond.app.analysis import analyse, print_code, trace
from faultbond.app.decision import accept, reject
from faultbond.app.demonstration import demo
from faultbond.app.identification import FitWishes, check_data, fit
from faultbond.app.model_check import check
from faultbond.app.plant_run import Wanted, run
from faultbond.app.simulation import Imperfections, simulate
from faultbond.app.wishes import Wishes

__all__ = [
    "FitWishes",
    "Imperfections",
    "Wanted",
    "Wishes",
    "accept",
    "analyse",
    "check",
    "check_data",
    "demo",
    "fit",
    "print_code",
    "reject",
    "run",
    "simulate",
    "trace",
]
