"""The files of the page, read once. Those that other pages of faultbond use too are served from where they stand."""

import gzip
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable

TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
    ".LICENSE": "text/plain",
}
SHARED = {  # package -> files
    "faultbond.report": tuple(
        f"static/{name}"
        for name in ("report.css", "plot.css", "plot.js", "uPlot.min.css", "uPlot.iife.min.js", "uPlot.LICENSE")
    ),
    "faultbond": ("browser/numbers.js",),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PageFile:
    """A file as it is served. packed: by gzip. tag: tells whether a browser has it."""

    content: bytes
    packed: bytes
    media_type: str
    tag: str


@cache
def page_files() -> Mapping[str, PageFile]:
    """Give the files of the page by their names; nothing else is served, whatever is asked for."""
    own = resources.files("faultbond.service.web") / "static"
    found = {item.name: item for item in own.iterdir() if item.is_file()}
    for package, names in SHARED.items():
        for name in names:
            item = resources.files(package).joinpath(*name.split("/"))
            found[item.name] = item
    return {name: _read(item) for name, item in sorted(found.items()) if _ending(name) in TYPES}


def _ending(name: str) -> str:
    return name[name.rfind(".") :]


def _read(item: Traversable) -> PageFile:
    content = item.read_bytes()
    return PageFile(
        content=content,
        packed=gzip.compress(content, mtime=0),
        media_type=f"{TYPES[_ending(item.name)]}; charset=utf-8",
        tag=f'"{hashlib.sha256(content).hexdigest()[:32]}"',
    )
