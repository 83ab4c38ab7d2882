"""The tables and figures of the thesis, computed anew beside what it prints: writes docs/thesis.md and its pictures.

    python -m benchmarks.thesis

Only what is between the marks of the page is written.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from benchmarks.shared.page import as_markdown, write_part
from benchmarks.thesis import appendix, routes, static
from benchmarks.thesis import chapter5 as circuit
from benchmarks.thesis import chapter6 as conflict
from benchmarks.thesis import chapter7 as detecting
from benchmarks.thesis import chapter7_multiple as multiple
from benchmarks.thesis import chapter7_single as single
from benchmarks.thesis import hypotheses as motor
from benchmarks.thesis import sets as conflicts
from benchmarks.thesis.page import COLUMNS, DIFFERS, HEADER, SAME, Shown, as_text, write_pictures

PAGE = Path(__file__).resolve().parents[2] / "docs" / "thesis.md"
SUMMARY = "corrections"
ERRATUM = "erratum: "


def _all(*makers: Callable[[], Shown]) -> Callable[[], tuple[Shown, ...]]:
    return lambda: tuple(make() for make in makers)


PARTS: Mapping[str, Callable[[], tuple[Shown, ...]]] = {
    "chapter-3": _all(
        *(routes.table_3_1, static.figures_3_4_and_3_5, static.full_adder, static.table_3_3),
        *(partial(static.table_of_figure_3_14, 0), partial(static.table_of_figure_3_14, 1), static.figure_3_17),
        *(static.table_3_6, routes.figures_3_18_and_3_19, static.section_3_10),
    ),
    "figure-3-19": _all(routes.figure_3_19),
    "chapter-4": _all(
        *(routes.section_4_1, routes.table_4_1, routes.section_4_2_1, routes.section_4_2_2, routes.section_4_2_3),
        routes.section_4_3,
    ),
    "section-5-3": _all(
        *(circuit.figure_5_3, circuit.figure_5_4, circuit.figure_5_5, circuit.figure_5_6, circuit.figure_5_8),
        *(circuit.figure_5_9, circuit.figure_5_10),
    ),
    "section-5-4": _all(
        *(circuit.figure_5_11, circuit.figure_5_12, circuit.figure_5_13, circuit.figure_5_14, circuit.figure_5_15)
    ),
    "chapter-6": _all(
        *(conflicts.table_6_1, conflicts.table_6_2, conflicts.conflicts_of_6_1, motor.section_6_1_2),
        *(motor.long_record, conflicts.figure_6_13, conflicts.table_6_4, motor.tables_6_5_and_6_6),
        *(motor.section_6_5, motor.twin_faults),
    ),
    "section-6-2-1": _all(conflict.figure_6_3, conflict.figure_6_4, conflict.figure_6_5),
    "section-6-2-2": conflict.noisy,
    "reach": _all(motor.three_components),
    "section-6-6": _all(conflicts.section_6_6),
    "section-7-1": _all(detecting.figure_7_4, detecting.figure_7_5),
    "section-7-2": detecting.figures,
    "section-7-3": single.figures,
    "section-7-4": _all(
        *(multiple.figure_7_34, multiple.figure_7_35, multiple.figure_7_36, multiple.figure_7_37),
        *(multiple.figure_7_38, multiple.figure_7_39, multiple.figure_7_40),
    ),
    "appendix-a": _all(*(appendix.voltage_alone, appendix.section_a_3, appendix.table_a_1, appendix.closed_forms)),
}


def summary(page: str) -> str:
    """Give, from the tables of a page, how many values agree, every correction of the thesis and what differs."""
    corrected: dict[tuple[str, str], list[str]] = {}
    differing: dict[tuple[str, str], list[str]] = {}
    same = 0
    for title, cells in _lines(page):
        remark = cells[-1]
        _, mark, correction = remark.partition(ERRATUM)
        if remark.startswith(SAME):
            same += 1
        elif remark.startswith(DIFFERS):
            differing.setdefault((title, remark.removeprefix(DIFFERS)), []).append(cells[0])
        elif mark:
            corrected.setdefault((title, correction), []).append(cells[0])
    right, other = (sum(map(len, found.values())) for found in (corrected, differing))
    return "\n\n".join(
        (
            f"Of {same + right + other} printed values, statements and shapes {same} agree with ours, {right} are "
            f"corrected, and {other} differ for another reason. The corrections:",
            as_markdown(("where", "of what", "what is right"), _listed(corrected)),
            "What differs, and why:",
            as_markdown(("where", "of what", "why"), _listed(differing)),
        )
    )


def _lines(page: str) -> Iterator[tuple[str, list[str]]]:
    """Give the lines of all tables with the headings above them."""
    title = ""
    for line in page.splitlines():
        title = line.removeprefix("### ") if line.startswith("### ") else title
        cells = [cell.strip() for cell in line.split("|")][1:-1]
        if len(cells) in (len(HEADER), len(COLUMNS)) and title:
            yield title, cells


def _listed(found: Mapping[tuple[str, str], Sequence[str]]) -> list[tuple[str, str, str]]:
    return [(_link(title), _what(lines), text) for (title, text), lines in found.items()]


def _what(lines: Sequence[str]) -> str:
    return lines[0] if len(lines) == 1 else f"{len(lines)} values"


def _link(title: str) -> str:
    anchor = re.sub(r"[^a-z0-9 _-]", "", title.lower()).replace(" ", "-")
    return f"[{title.partition(':')[0]}](#{anchor})"


def main() -> None:
    """Put all tables and figures into the page, then what they sum up to."""
    for name, compute in PARTS.items():
        part = compute()
        write_part(PAGE, name, as_text(part))
        write_pictures(part)
    write_part(PAGE, SUMMARY, summary(PAGE.read_text(encoding="utf-8")))
