"""What each verb does, by composing the layers below. Large libraries are loaded when a verb needs them.

In: what the command line was told, as `wishes`. Out: files, records and text, and the verdict that the exit code tells.
Read `any_run`, `plant_run`, `course`, `method_face`, `methods`, `kept_run`, `decision`; then a module a verb.
"""

from typing import TYPE_CHECKING

from faultbond.lazy import lazily

if TYPE_CHECKING:
    from faultbond.app.analysis import analyse, print_code, trace
    from faultbond.app.any_run import run
    from faultbond.app.browser import generated_page
    from faultbond.app.decision import accept, reject
    from faultbond.app.demonstration import demo
    from faultbond.app.fmu import generated_fmu
    from faultbond.app.generation import generated
    from faultbond.app.identification import check_data, fit
    from faultbond.app.installation import doctor
    from faultbond.app.model_check import check
    from faultbond.app.simulation import simulate
    from faultbond.app.wishes import FitWishes, Imperfections, Wanted, Wishes

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
    "doctor",
    "fit",
    "generated",
    "generated_fmu",
    "generated_page",
    "print_code",
    "reject",
    "run",
    "simulate",
    "trace",
]

__getattr__ = lazily(
    "faultbond.app",
    {
        "analysis": "analyse print_code trace",
        "browser": "generated_page",
        "decision": "accept reject",
        "demonstration": "demo",
        "fmu": "generated_fmu",
        "generation": "generated",
        "identification": "check_data fit",
        "installation": "doctor",
        "model_check": "check",
        "any_run": "run",
        "simulation": "simulate",
        "wishes": "FitWishes Imperfections Wanted Wishes",
    },
)
