"""The picture of docs/architecture.md, from the imports of the code: `python tests/docs/rooms.py`, as `make docs` does.

Rooms of one level stand in one row. An arrow says who imports whom; what is reached by a longer way is not drawn, and
what everything imports (`errors`, `types`, `arrays`, `lazy`) has no arrows.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "shared"))

from imports import LEVELS, MODULES, SOURCE, name_of, units_imported

PICTURE = SOURCE.parents[1] / "docs" / "images" / "rooms.svg"
GROUND = ("errors", "types", "arrays", "lazy", "interrupt", "__init__")
ASIDE = {
    "report": 0.15,
    "thesis": 0.85,
    "contract": 0.8,
    "sets": 0.3,
    "core": 0.55,
}  # part of the width, where a room stands in the way
WIDTH, ROW, HIGH, WIDE = 1000, 92, 46, 150
INK, PALE = "#222222", "#9aa7b5"


def drawn() -> str:
    """Give the picture as SVG."""
    arrows = {unit: targets - set(GROUND) for unit, targets in units_imported().items() if unit not in GROUND}
    arrows["synthesis"], arrows["core"] = arrows["synthesis"] | {"core"}, set()  # its text is read, nobody imports it
    rows: dict[int, list[str]] = {}
    for unit in sorted(arrows):
        rows.setdefault(LEVELS.get(unit, 0), []).append(unit)
    levels = sorted(rows, reverse=True)
    height = ROW * len(levels)
    places = {
        unit: (WIDTH * ASIDE.get(unit, (k + 1) / (len(rows[level]) + 1)), ROW * (row + 0.5))
        for row, level in enumerate(levels)
        for k, unit in enumerate(rows[level])
    }
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="sans-serif">',
        "<title>The rooms of faultbond, and who imports whom</title>",
        f'<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path d="M0 0 8 4 0 8z" fill="{PALE}"/></marker></defs>',
    ]
    for unit, targets in sorted(arrows.items()):
        for target in sorted(_direct(targets, arrows)):
            (x, y), (x2, y2) = places[unit], places[target]
            parts.append(
                f'<path d="M{x:.0f} {y + HIGH / 2:.0f}C{x:.0f} {y + ROW / 2:.0f} {x2:.0f} {y2 - ROW / 2:.0f} '
                f'{x2:.0f} {y2 - HIGH / 2 - 1:.0f}" fill="none" stroke="{PALE}" stroke-width="1.4" '
                'marker-end="url(#tip)"/>'
            )
    for unit, (x, y) in sorted(places.items()):
        parts += [
            f'<rect x="{x - WIDE / 2:.0f}" y="{y - HIGH / 2:.0f}" width="{WIDE}" height="{HIGH}" rx="4" '
            f'fill="#ffffff" stroke="{INK}"/>',
            f'<text x="{x:.0f}" y="{y - 2:.0f}" text-anchor="middle" font-size="15" fill="{INK}">{unit}</text>',
            f'<text x="{x:.0f}" y="{y + 15:.0f}" text-anchor="middle" font-size="11" fill="{INK}">{_size(unit)}</text>',
        ]
    return "\n".join([*parts, "</svg>", ""])


def _direct(targets: set[str], arrows: dict[str, set[str]]) -> set[str]:
    """Give those that are not reached by way of another."""
    seen: set[str] = set()
    left = [further for target in targets for further in arrows[target]]
    while left:
        unit = left.pop()
        if unit not in seen:
            seen.add(unit)
            left += arrows[unit]
    return targets - seen


def _size(unit: str) -> str:
    """Give how many modules a unit has; files of C of the core."""
    if unit == "core":
        return f"{sum(path.suffix in ('.c', '.h') for path in (SOURCE / unit).iterdir())} files of C"
    count = sum(name_of(path).removesuffix(".py").split("/")[0] == unit for path in MODULES if path.stem != "__init__")
    return f"{count} module{'s' * (count != 1)}"


if __name__ == "__main__":
    PICTURE.write_text(drawn(), encoding="utf-8")
