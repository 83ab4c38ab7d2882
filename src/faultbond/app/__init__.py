"""What each verb does, by composing the layers below. Large libraries are loaded when a verb needs them."""

from faultbond.app.analysing import Wishes, analyse, print_code, trace
from faultbond.app.checking import check
from faultbond.app.deciding import accept, reject
from faultbond.app.demonstration import demo
from faultbond.app.fitting import FitWishes, check_data, fit
from faultbond.app.simulating import Imperfections, simulate
from faultbond.app.watching import Wanted, run

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
