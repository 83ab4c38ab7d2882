"""Reports of a run for people: terminal, HTML page, drawing of the bond graph."""

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
