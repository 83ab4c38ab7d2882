"""The page with the thesis' tables holds what the program computes, and says of every difference what is right."""

import re
from collections.abc import Iterator, Sequence
from functools import cache

import pytest
from benchmarks.thesis.chapters import PAGE, PARTS, SUMMARY, summary
from benchmarks.thesis.hypotheses import exact_count, is_possible
from benchmarks.thesis.page import FOLDER, Figure, Table, as_text, equal, is_printed, number, printed_value, row

from faultbond.algebra.route import Route
from faultbond.algebra.solving.backward_euler import NumericPlant
from faultbond.algebra.solving.solution import Solution
from faultbond.algebra.solving.solve import SolvingLimits, solve
from faultbond.equations.component_network import ComponentNetwork

NUMBER = re.compile(r"(?<![A-Za-z_])-?\d+\.?\d*(?:e-?\d+)?")
PRINTED, PIXELS = 1.0, 2.0  # units of the last digit by which a number of the text may differ, and pixels of a picture
POINTS = re.compile(rf"(?:{NUMBER.pattern}[ ,]*)+")
MOST = 0.9  # of the numbers of a picture that have to be the same
TEXT = PAGE.read_text(encoding="utf-8")


@pytest.fixture(scope="module", autouse=True)
def solved_once() -> Iterator[None]:
    """Solve each route of a plant once, with whatever settings the plant is watched."""
    known: dict[object, Solution] = {}

    def solved(network: ComponentNetwork, route: Route, plant: NumericPlant, limits: SolvingLimits) -> Solution:
        key = network, route, repr(plant), repr(limits)
        if key not in known:
            known[key] = solve(network, route, plant, limits)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("faultbond.thesis.offline.functions.solve", solved)
        yield


def part(name: str) -> str:
    """Give what stands between the marks of a part."""
    match = re.search(rf"<!-- {name}: begin -->\n(.*?)\n<!-- {name}: end -->", TEXT, flags=re.DOTALL)
    assert match, name
    return match[1]


@cache
def computed(name: str) -> Sequence[Table | Figure]:
    """Compute a part, once."""
    return PARTS[name]()


@pytest.mark.parametrize("name", PARTS)
def test_page_is_what_is_computed(name: str) -> None:
    """Each part of the page is what its tables and figures give now: byte for byte, but for what processors round."""
    figures = [item for item in computed(name) if isinstance(item, Figure)]
    if not figures:
        assert part(name) == as_text(computed(name))
    assert alike(part(name), as_text(computed(name)), PRINTED)
    for figure in figures:
        assert same_picture((FOLDER / figure.name).read_text(encoding="utf-8"), figure.picture), figure.number


def alike(one: str, two: str, digits: float) -> bool:
    """Whether texts differ in numbers only, and these by no more than 1 % and some units of the last digit printed."""
    if NUMBER.sub("#", one) != NUMBER.sub("#", two):
        return False
    pairs = zip(NUMBER.findall(one), NUMBER.findall(two), strict=True)
    return all(abs(float(a) - float(b)) <= digits * unit(a, b) + 0.01 * abs(float(a)) for a, b in pairs if a != b)


def same_picture(one: str, two: str) -> bool:
    """Whether pictures have the same curves and words, with nearly all points within some pixels.

    A few may be elsewhere: single samples of ill-conditioned formulas hang on how a processor rounds.
    """
    if POINTS.sub("#", one) != POINTS.sub("#", two):
        return False
    first, second = NUMBER.findall(one), NUMBER.findall(two)
    near = sum(abs(float(a) - float(b)) <= PIXELS + 0.01 * abs(float(a)) for a, b in zip(first, second, strict=False))
    return near >= MOST * max(len(first), len(second))


def test_pictures_differ_by_more_than_a_few_points() -> None:
    """Another word, a curve less, or a tenth of the points moved makes another picture; a single point does not."""
    curve = "".join(f"{x},{x % 7}.5 " for x in range(100))
    assert same_picture(f"<a>{curve}</a>K1", f"<a>{curve.replace('50,1.5', '50,90.5')}</a>K1")
    assert not same_picture(f"<a>{curve}</a>K1", f"<a>{curve}</a>K2")
    assert not same_picture(f"<a>{curve}</a><a>1,2</a>", f"<a>{curve}</a>")
    assert not same_picture(f"<a>{curve}</a>", f"<a>{curve.replace('.5', '0.5')}</a>")


def unit(*numbers: str) -> float:
    """Give the largest unit of the last digit among some numbers as printed."""
    return max(10.0 ** -len(item.partition("e")[0].partition(".")[2]) for item in numbers)


def test_only_rounding_may_differ() -> None:
    """A last digit may differ, a word, a digit before it, or a number more may not."""
    assert alike("K1 7.3 % after 4.02 min", "K1 7.4 % after 4.02 min", PRINTED)
    assert not alike("K1 7.3 %", "K1 7.9 %", PRINTED)
    assert not alike("K1 7.3 %", "K2 7.3 %", PRINTED)
    assert not alike("leak 7.3 %", "pipe 7.3 %", PRINTED)
    assert not alike("7.3 %", "7.3 % 1", PRINTED)


def test_every_picture_is_shown() -> None:
    """The page shows each picture of the folder once, and no other."""
    shown = re.findall(r"\]\(images/thesis/([^)]+)\)", TEXT)
    assert sorted(shown) == sorted(path.name for path in FOLDER.iterdir())


def test_every_result_figure_is_there() -> None:
    """The figures of 3.9, 5, 6.2 and 7 that show results stand under their numbers, in order within a chapter."""
    numbers = [tuple(map(int, item.split("."))) for item in re.findall(r"^### Figure (\d+\.\d+):", TEXT, flags=re.M)]
    for chapter, first, last, drawings in ((3, 19, 19, set()), (5, 3, 15, {7}), (6, 3, 12, set()), (7, 4, 40, set())):
        found = [figure for number, figure in numbers if number == chapter and first <= figure <= last]
        assert found == [k for k in range(first, last + 1) if k not in drawings]


def test_three_components_agree_with_algebra() -> None:
    """What three components can explain is on the page as algebra tells it, and the search found no more than that."""
    found = re.findall(r"^\| {(.*)} \| always \| (\d+) of 25; (\d+) by algebra", part("reach"), flags=re.M)
    assert len(found) == 10
    for names, reached, exact in found:
        assert int(reached) <= int(exact) == exact_count(names.split(", "))


def test_summary_is_that_of_the_page() -> None:
    """The list of corrections at the top holds those of the tables, and nothing else."""
    assert part(SUMMARY) == summary(TEXT)


def test_page_has_no_other_parts() -> None:
    """Every part of the page has tables that write it."""
    assert {*re.findall(r"<!-- ([a-z0-9-]+): begin -->", TEXT)} == {SUMMARY, *PARTS}


def test_links_lead_to_headings() -> None:
    """Each correction links to the heading of its table."""
    headings = re.findall(r"^### (.*)$", TEXT, flags=re.M)
    anchors = {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}
    found = re.findall(r"\]\(#([^)]+)\)", part(SUMMARY))
    assert found
    assert [anchor for anchor in found if anchor not in anchors] == []


def test_no_difference_without_a_remark() -> None:
    """A value that is not the printed one needs a remark."""
    with pytest.raises(ValueError, match="M1: 5, printed 4, and no remark says why"):
        number("M1", "4", 5)
    assert equal("minimal sets", "{B}", "{B}, {A, C}", "erratum: two").same is False
    with pytest.raises(ValueError, match=r"alarm: never, printed 6\.7 s, and no remark says why"):
        row("alarm | 6.7 s", "never", same=False)
    assert row("alarm | 6.7 s", "never", same=False, otherwise="small").cells[-1] == "differs: small"
    assert row("alarm | 6.7 s", "6.7 s", same=True, otherwise="small").cells[-1] == "same"


def test_printed_numbers() -> None:
    """Mixed fractions are read as printed; a decimal agrees within half a unit of its last digit."""
    assert [float(printed_value(text)) for text in ("-5 1/3", "27 3/4", "-0.4", "8")] == [-16 / 3, 27.75, -0.4, 8.0]
    assert is_printed("3.987", 3.98742)
    assert not is_printed("3.987", 3.9876)
    assert is_printed("2 2/3", printed_value("8/3"))
    assert not is_printed("2 2/3", 2.6667)


def test_a_table_names_its_place() -> None:
    """A table begins with its heading and its place in the thesis."""
    table = Table("Table 9", "9.1, page 9", "A system.", lines=(number("x", "1.0", 1),))
    assert table.text.splitlines()[0:3] == ["### Table 9", "", "Thesis 9.1, page 9. A system."]


@pytest.mark.parametrize("triple", ["RLJ", "RLK", "RJK", "RCK", "LJK", "LCK", "JCK"])
def test_the_nominal_motor_is_possible(triple: str) -> None:
    """The nominal lumps are within reach of every triple; lumps that need friction below zero are not of any."""
    r, ell, k, j, c = 3.0, 2.5, 2.0, 1.5, 0.4
    assert is_possible(triple, ell * j / k, (j * r + ell * c) / k, (r * c + k**2) / k)
    assert not is_possible("RLJ", ell * j / k, (j * r + ell * c) / k, 0.5 * k)
