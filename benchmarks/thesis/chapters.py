"""The tables and figures of the thesis, computed anew beside what it prints: writes docs/thesis.md and its pictures.

    python -m benchmarks.thesis

Only what is between the marks of the page is written.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from benchmarks.shared.page import as_markdown, write_part
from benchmarks.thesis import appendix, reach, routes, static
from benchmarks.thesis import chapter3 as store
from benchmarks.thesis import chapter5 as circuit
from benchmarks.thesis import chapter5_index as alarms
from benchmarks.thesis import chapter6 as conflict
from benchmarks.thesis import chapter6_exact as exact
from benchmarks.thesis import chapter7 as detecting
from benchmarks.thesis import chapter7_multiple as multiple
from benchmarks.thesis import chapter7_single as single
from benchmarks.thesis import chapter7_valve as valve
from benchmarks.thesis import hypotheses as motor
from benchmarks.thesis import sets as conflicts
from benchmarks.thesis.page import COLUMNS, DIFFERS, HEADER, SAME, Figure, Table, as_text, write_pictures

PAGE = Path(__file__).resolve().parents[2] / "docs" / "thesis.md"
SUMMARY = "corrections"
ERRATUM = "erratum: "


def chapter_3() -> tuple[Table, ...]:
    """Give the tables of chapter 3."""
    return (
        routes.table_3_1(),
        static.figures_3_4_and_3_5(),
        static.full_adder(),
        static.table_3_3(),
        static.table_of_figure_3_14(0),
        static.table_of_figure_3_14(1),
        static.figure_3_17(),
        static.table_3_6(),
        routes.figure_3_19(),
        static.section_3_10(),
    )


def chapter_4() -> tuple[Table, ...]:
    """Give the tables of chapter 4."""
    return (
        routes.section_4_1(),
        routes.table_4_1(),
        routes.section_4_2_1(),
        routes.section_4_2_2(),
        routes.section_4_2_3(),
        routes.section_4_3(),
    )


def chapter_6() -> tuple[Table, ...]:
    """Give the tables of chapter 6 up to section 6.5, but for that of three components."""
    return (
        conflicts.table_6_1(),
        conflicts.table_6_2(),
        conflicts.conflicts_of_6_1(),
        motor.section_6_1_2(),
        motor.long_record(),
        conflicts.figure_6_13(),
        conflicts.table_6_4(),
        motor.tables_6_5_and_6_6(),
        motor.section_6_5(),
        motor.twin_faults(),
    )


def appendix_a() -> tuple[Table, ...]:
    """Give the tables of appendix A."""
    found = appendix.search()
    return appendix.voltage_alone(), appendix.section_a_3(found), appendix.table_a_1(found), appendix.closed_forms()


PARTS: Mapping[str, Callable[[], tuple[Table | Figure, ...]]] = {
    "chapter-3": chapter_3,
    "figure-3-19": store.figures,
    "chapter-4": chapter_4,
    "section-5-3": circuit.figures,
    "section-5-4": alarms.figures,
    "chapter-6": chapter_6,
    "section-6-2-1": exact.figures,
    "section-6-2-2": conflict.figures,
    "reach": lambda: (reach.three_components(),),
    "section-6-6": lambda: (conflicts.section_6_6(),),
    "section-7-1": valve.figures,
    "section-7-2": detecting.figures,
    "section-7-3": single.figures,
    "section-7-4": multiple.figures,
    "appendix-a": appendix_a,
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


if __name__ == "__main__":
    main()
