"""Notebooks as pages: their text, their code, and what they printed when they were last run; nothing is run here."""

import json
from collections.abc import Iterator
from typing import Any

FENCE = "````"  # longer than any in a notebook


def as_markdown(text: str) -> str:
    """Give the Markdown of a notebook."""
    return "\n\n".join(part for cell in json.loads(text)["cells"] for part in _parts(cell)) + "\n"


def _parts(cell: dict[str, Any]) -> Iterator[str]:
    """Give a cell, and below it what it printed."""
    source = _joined(cell["source"]).strip("\n")
    if cell["cell_type"] != "code":
        yield source
    elif source:
        yield f"{FENCE}python\n{source}\n{FENCE}"
    for output in cell.get("outputs", ()):
        yield from _output(output)


def _output(output: dict[str, Any]) -> Iterator[str]:
    """Give what was printed, in the richest form that there is."""
    data = output.get("data", {})
    if "image/svg+xml" in data or "text/html" in data:
        html = _joined(data.get("image/svg+xml") or data["text/html"])
        lines = "\n".join(line for line in html.splitlines() if line.strip())  # a line without text would end it
        yield f'<div class="output">\n{lines}\n</div>'
    elif "image/png" in data:
        yield f'<div class="output"><img alt="" src="data:image/png;base64,{_joined(data["image/png"]).strip()}"></div>'
    else:
        printed = _joined(output.get("text") or data.get("text/plain") or "").strip("\n")
        if printed:
            yield f"{FENCE}text\n{printed}\n{FENCE}"


def _joined(text: str | list[str]) -> str:
    return text if isinstance(text, str) else "".join(text)
