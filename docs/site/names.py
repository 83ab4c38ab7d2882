"""The reference of the Python names: which ones, in which order, and their docstrings as the site's own markup."""

import re
from dataclasses import is_dataclass
from enum import Enum
from inspect import isclass, isroutine

import faultbond

KINDS = ("Functions", "Classes", "Data", "Values that a name may have", "Errors", "Others")
SECTION = re.compile(r"^-{3,}$")
ENTRY = re.compile(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*) : (.*)$")
SPAN = re.compile(r"(`+[^`]+`+)")


def kind_of(thing: object) -> str:
    """Give the heading under which a public name stands."""
    if not isclass(thing):
        return "Functions" if isroutine(thing) else "Others"
    if issubclass(thing, BaseException):
        return "Errors"
    if issubclass(thing, Enum):
        return "Values that a name may have"
    return "Data" if is_dataclass(thing) else "Classes"


def names_as_text() -> str:
    """Give the page of all public names, as directives."""
    found: dict[str, list[str]] = {kind: [] for kind in KINDS}
    for name in faultbond.__all__:
        thing = getattr(faultbond, name)
        directive = {"Functions": "autofunction", "Errors": "autoexception", "Others": "autodata"}
        how = directive.get(kind_of(thing), "autoclass")
        members = ["   :members:"] if how == "autoclass" else []
        members += ["   :undoc-members:"] if isclass(thing) and issubclass(thing, Enum) else []
        found[kind_of(thing)] += ["", "```{eval-rst}", f".. {how}:: faultbond.{name}", *members, "```"]
    return "\n".join(line for kind, lines in found.items() if lines for line in ("", f"## {kind}", *lines)) + "\n"


def rewritten(*arguments: object) -> None:
    """Rewrite the lines of a docstring, in place: sections, lists of names, and what the markup would misread."""
    lines = arguments[-1]
    assert isinstance(lines, list)  # noqa: S101 - so Sphinx calls it
    lines[:] = _rewritten(lines)


def _rewritten(lines: list[str]) -> list[str]:
    """Give a docstring in numpy's form as markup."""
    found: list[str] = []
    section = ""
    for number, line in enumerate(lines):
        below = lines[number + 1] if number + 1 < len(lines) else ""
        if SECTION.match(below) and line and not line[0].isspace():
            section = line
            found += ["", f".. rubric:: {line}", ""]
        elif SECTION.match(line):
            continue
        elif line.lstrip().startswith((">>>", "...")) or section.startswith("Example"):
            found.append(line)
        elif entry := ENTRY.match(line):
            found += ["", f"``{entry[1]}``", f"    {_safe(entry[2])}"]
        elif found and line and _is_within(found) and not line[0].isspace():
            found += ["", _safe(line)] if section == "Raises" else [f"    {_safe(line)}"]
        else:
            indent = len(line) - len(line.lstrip())
            found.append(line[:indent] + _safe(line[indent:]))
    return found


def _is_within(found: list[str]) -> bool:
    """Whether the line before is of an entry of a list, which goes on."""
    return found[-1].startswith("    ")


def _safe(text: str) -> str:
    """Give a line in which only what stands between backticks is marked."""
    parts = SPAN.split(text)
    return "".join(
        f"``{part.strip('` ')}``" if number % 2 else re.sub(r"([\\*|_])", r"\\\1", part)
        for number, part in enumerate(parts)
    )
