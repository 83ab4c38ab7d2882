"""Reports for people: what was found in words, on the terminal, and on a page with charts and the bond graph.

In: a model and what a verb found. Out: text on a console, an HTML page, and the records of all verbs but `run`.
Read `numbers`, `suspects`, `checks`, `verdict`, `terminal`, `html`, `run_figures`, `chart`; then one module a verb:
`inventory` (check), `health` (check --data), `analysis` and `closed_forms`, `fit_result` and `fit_page`, `observed`.
"""

from typing import TYPE_CHECKING

from faultbond.lazy import lazily

if TYPE_CHECKING:
    from faultbond.report.drawing import draw
    from faultbond.report.html import render_report
    from faultbond.report.terminal import print_diagnosis
    from faultbond.report.verdict import RunCounts, unfalsifiable_text, verdict_sentence

__all__ = ["RunCounts", "draw", "print_diagnosis", "render_report", "unfalsifiable_text", "verdict_sentence"]

__getattr__ = lazily(
    "faultbond.report",
    {
        "drawing": "draw",
        "html": "render_report",
        "terminal": "print_diagnosis",
        "verdict": "RunCounts unfalsifiable_text verdict_sentence",
    },
)
