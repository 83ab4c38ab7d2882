"""What of an SVG may stand in a page, and what is refused."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from faultbond.errors import ModelError
from faultbond.service.safe_svg import MOST_DRAWN, SVG, safe_svg


def read(inside: str, root: str = 'viewBox="0 0 9 9"') -> tuple[str, tuple[str, ...]]:
    """Give what is left of a drawing, and what was left out."""
    found = safe_svg(f'<svg xmlns="{SVG}" xmlns:xlink="http://www.w3.org/1999/xlink" {root}>{inside}</svg>', "a.svg")
    return ET.tostring(found.root, encoding="unicode"), found.dropped


@pytest.mark.parametrize(
    "kept",
    [
        '<path id="pipe" class="line" d="M0 0 L9 9" stroke="#123" transform="rotate(30 1 2)" />',
        '<g style="fill:rgb(1 2 3);stroke:var(--ink, #fff);clip-path:url(#a)"><text x="1">R 1 &lt; 2</text></g>',
        '<defs><linearGradient id="g"><stop offset="1" stop-color="red" /></linearGradient></defs>',
        '<symbol id="s"><circle r="1" /></symbol><use href="#s" />',
        "<style>.a, g &gt; .b{fill:none;stroke:light-dark(#000, #fff)}</style>",
    ],
)
def test_what_draws_stays(kept: str) -> None:
    """As it stands."""
    text, dropped = read(kept)
    assert (kept in text, dropped) == (True, ())


@pytest.mark.parametrize(
    ("hostile", "told"),
    [
        ("<script>alert(1)</script>", "the element script"),
        ('<script xmlns="http://www.w3.org/1999/xhtml">alert(1)</script>', "notes of drawing programs"),
        ("<foreignObject><b>alert</b></foreignObject>", "the element foreignObject"),
        ('<image href="https://evil.example/a.png"/>', "the element image"),
        ('<set attributeName="href" to="javascript:alert(1)"/>', "the element set"),
        ('<g onload="alert(1)"/>', "the attribute onload"),
        ('<a href="javascript:alert(1)"><rect/></a>', "links"),
        ('<use href="https://evil.example/a.svg#b"/>', "links"),
        ('<use xlink:href="data:image/svg+xml,alert"/>', "links"),
        ('<rect fill="url(https://evil.example/a)"/>', "the attribute fill"),
        ("<rect style=\"fill: url('//evil.example/a')\"/>", "the style fill"),
        ('<rect style="fill: u\\72l(//evil.example/a)"/>', "the style fill"),
        ('<rect style="fill: URL(#a) url(//evil.example)"/>', "the style fill"),
        ('<rect style="fill: \\75 rgb(//evil.example/a)"/>', "the style fill"),
        ('<rect style="cursor: url(evil.cur)"/>', "the style cursor"),
        ('<rect style="stroke: image-set(evil 1x)"/>', "the style stroke"),
        ("<style>@import 'https://evil.example/a.css'; .a{fill:red}</style>", "rules of styles"),
        ("<style>@font-face{src:url(https://evil.example/a)}</style>", "rules of styles"),
        ("<style>@media all{.a{fill:url(//evil.example/a)}}</style>", "rules of styles"),
        ("<style>.a{background:url(//evil.example/a)}</style>", "the style background"),
        ("<style>.a{fill:/**/url(/**/evil.example)}</style>", "the style fill"),
        ("<style>:host{display:none}</style>", "rules of styles"),
        ("<style>.a{.b{fill:blue}}</style>", "rules of styles"),
        ('<g id="a"><use href="#b"/><use href="#b"/></g><g id="b"><use href="#a"/></g>', "uses of what uses others"),
    ],
)
def test_what_runs_or_fetches_goes(hostile: str, told: str) -> None:
    """And is told; what is beside it stays."""
    text, dropped = read(f'<rect id="tank"/>{hostile}')
    assert dropped == (told,)
    assert '<rect id="tank" />' in text
    assert not re.search(r"alert|evil|@|\bon\w+=|javascript|:host", text)


def test_plain_rules_beside_hostile_ones_stay() -> None:
    """Behind an import, and behind a rule within another."""
    text, _ = read("<style>@import url(a.css); .a{fill:red;x:y} @media print{.b{fill:red}} .c{fill:blue}</style>")
    assert re.findall(r"[^<>]+(?=</style>)", text) == [".a{fill:red}\n.c{fill:blue}"]


def test_a_drawing_is_as_large_as_its_room() -> None:
    """A size becomes a view box where there is none, and is no more."""
    assert 'viewBox="0 0 30 20.5"' in read("", 'width="30px" height="20.5"')[0]
    assert not re.search("width|height", read("", 'viewBox="0 0 9 9" width="9mm" height="9mm"')[0])


USE = '<use href="#a"/>'
BOMB = '<!DOCTYPE svg [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>\n<svg>&b;</svg>'
TYPE = '<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN"\n "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd">'


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (f"\n{BOMB}", "a.svg:2: a document type with entities is not read"),
        (f"{TYPE}{BOMB}", "a document type with entities is not read"),
        ('<!DOCTYPE svg SYSTEM "a>b" [<!ATTLIST g id CDATA "x">]><svg/>', "a document type with entities is not read"),
        (f"{TYPE}\n<svg>&b;</svg>", "a.svg:3: not XML: undefined entity"),
        ("<svg>\n<g></svg>", "a.svg:2: not XML: mismatched tag"),
        ("name: water tank", "a.svg:1: not XML: syntax error"),
        ("", "not XML: no element found"),
        ("<svg viewBox='0 0 9 9'/>", "a.svg: no SVG; expected <svg xmlns="),
        (f"<svg xmlns='{SVG}' width='9mm' height='9mm'/>", "has no viewBox, and no width and height in px"),
        (f"<svg xmlns='{SVG}' viewBox='0 0 9 9'>{'<g>' * 101}{'</g>' * 101}</svg>", "more than 100 elements within"),
        (
            f"<svg xmlns='{SVG}' viewBox='0 0 9 9'><g id='a'>{'<g/>' * 999}</g>{USE * 99}</svg>",
            f"it draws 100100 elements, and {MOST_DRAWN} are the most",
        ),
    ],
)
def test_what_is_refused(text: str, told: str) -> None:
    """In a line, with what to do."""
    with pytest.raises(ModelError) as refused:
        safe_svg(text, "a.svg")
    assert told in str(refused.value)


def test_a_document_type_that_says_nothing_is_passed_over() -> None:
    """As drawing programs write it; lines are counted as they stand."""
    assert safe_svg(f"{TYPE}<svg xmlns='{SVG}' viewBox='0 0 9 9'/>", "a.svg").dropped == ()


def test_pictures_of_programs_keep_all_that_draws() -> None:
    """What this project's own programs draw needs nothing that goes."""
    for name in ("angles", "moved_input", "rooms"):
        found = safe_svg((Path("docs/images") / f"{name}.svg").read_text(), name)
        assert not [what for what in found.dropped if what not in {"the element metadata", "notes of drawing programs"}]
