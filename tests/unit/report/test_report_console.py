"""Tables on terminals of any width."""

from io import StringIO
from typing import Any

import pytest
from rich.console import Console

from faultbond.report.console import PLAIN_WIDTH, headline, lines, set_plain, table

HEADER = ("component", "estimate ± sd", "unit")
ROWS = [("fan of the motor", "1.436e-4 ± 0.005e-4", "N*m*s^2/rad^2"), ("+ bearing", "0.004 ± 0.001", "N*m*s/rad")]


def printed(width: int, **wishes: Any) -> list[str]:
    """Print a table on a terminal of some width, and give its lines."""
    out = StringIO()
    table(Console(file=out, width=width), HEADER, ROWS, **wishes)
    return [line.rstrip() for line in out.getvalue().splitlines()]


@pytest.mark.parametrize("width", range(20, 90))
def test_no_number_and_no_word_is_broken(width: int) -> None:
    """However narrow a terminal is, every word stands whole in one line that fits."""
    lines = printed(width, whole=("estimate ± sd",))
    words = {word for row in (HEADER, *ROWS) for cell in row for word in cell.split()}
    least = max(map(len, words)) + len("estimate ± sd") + 4  # of a block: name and text
    assert width < least or words <= {word for line in lines for word in line.split()}
    assert all(len(line) <= width for line in lines)


def test_a_table_becomes_blocks_where_it_is_too_wide() -> None:
    """With the gaps that all have, then with narrow ones, then a line for each column of each row."""
    assert printed(70)[3].split("   ")[1:] == ["1.436e-4 ± 0.005e-4", "N*m*s^2/rad^2"]
    assert printed(46, whole=("estimate ± sd",))[3] == " fan of the 1.436e-4 ± 0.005e-4 N*m*s^2/rad^2"
    assert printed(44, whole=("estimate ± sd",))[:4] == [
        "",
        " component      fan of the motor",
        " estimate ± sd  1.436e-4 ± 0.005e-4",
        " unit           N*m*s^2/rad^2",
    ]


@pytest.mark.parametrize("label", ["time", "noise of " + ", ".join(f"sensor_{k}" for k in range(40))])
def test_texts_have_room_beside_labels_of_any_length(label: str) -> None:
    """A label that names forty things stands in several lines; none of it is left out, and neither is the text."""
    out = StringIO()
    lines(Console(file=out, width=60), [(label, "solved from the first samples"), ("start", "0 s")])
    printed_lines = out.getvalue().splitlines()
    told = " ".join(out.getvalue().split())
    assert all(word in told for word in label.split())
    assert "solved from the first samples" in printed_lines[0]
    assert printed_lines[-1].split() == ["start", "0", "s"]


@pytest.mark.parametrize("width", range(24, 60))
def test_no_number_stands_without_its_sign_or_its_time(width: int) -> None:
    """In a line beside a label as in a cell; what is longer than a line is broken all the same."""
    told = "Rth 3.7 %, F0 2.3 % and mu 5.5 % on healthy data, for 30 s or 2.5 min, as told by a" + 90 * "o"
    out = StringIO()
    console = Console(file=out, width=width)
    lines(console, [("moves", told)])
    table(console, ("moves", "text"), [("a", told)])
    shown = out.getvalue()
    assert "\N{NO-BREAK SPACE}" not in shown
    assert all(len(line) <= width for line in shown.splitlines())
    starts = {line.split()[0] for line in shown.splitlines() if line.strip()}
    assert starts.isdisjoint({"%", "%,", "s", "min,"})
    assert shown.count("3.7 %,") == shown.count("2.5 min,") == 2


def test_no_line_ends_with_blanks_where_the_output_is_a_file() -> None:
    """A table and a paragraph fill their lines on a terminal; a file keeps the words alone, however often it is set."""
    out = StringIO()
    console = Console(file=out)
    headline(console, "a pump", "pump.yaml")
    set_plain(console)
    table(console, HEADER, ROWS)
    console.print("words " * 40)
    shown = out.getvalue().splitlines()
    assert len(shown) > len(ROWS) + 4
    assert [line for line in shown if line != line.rstrip()] == []
    assert console.width == PLAIN_WIDTH
