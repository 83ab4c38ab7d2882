"""Small line charts as SVG, the same bytes for the same numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.report.chart import thin

INK, PALE, GRID = "#222222", "#b8bec6", "#e4e7ea"
COLORS = ("#1f5fa8", "#c4541a", "#2e8540", "#8250a0", "#a07000", "#0f8a94", "#c0357f")
POINTS, FEW = 360, 120  # of a curve, of a pale one
WIDTH, HEIGHT = 300.0, 130.0  # of a panel's frame
LEFT, TOP, GAP, BELOW = 52.0, 34.0, 66.0, 22.0
LETTER = 5.7  # width of a letter of the legend
TICKS = 5


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A line; a broken one is dashed, one without a label is pale and stands in no legend. x, y : (n,)."""

    label: str
    x: FloatArray
    y: FloatArray
    color: int = 0
    dashed: bool = False
    dots: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """Curves in a frame; `low` and `high` are the range of the scale where that of the curves is not wanted."""

    title: str
    curves: tuple[Curve, ...]
    below: str = "s"
    low: float | None = None
    high: float | None = None
    mark: float | None = None


def panel(
    title: str,
    *curves: Curve,
    below: str = "s",
    low: float | None = None,
    high: float | None = None,
    mark: float | None = None,
) -> Panel:
    """Give a panel; its parts are those of `Panel`."""
    return Panel(title, curves, below, low, high, mark)


def draw(panels: Sequence[Panel], columns: int = 2) -> str:
    """Give the panels side by side and below each other as one SVG."""
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    width, height = columns * (WIDTH + GAP) + 8.0, rows * (HEIGHT + TOP + BELOW)
    parts = [
        _panel(item, LEFT + (k % columns) * (WIDTH + GAP), TOP + (k // columns) * (HEIGHT + TOP + BELOW))
        for k, item in enumerate(panels)
    ]
    size = f'viewBox="0 0 {width:g} {height:g}" width="{width:g}" height="{height:g}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="11">'
    return f'{head}\n<rect width="100%" height="100%" fill="#ffffff"/>\n' + "\n".join(parts) + "\n</svg>\n"


def _panel(panel: Panel, left: float, top: float) -> str:
    x = _range([item.x for item in panel.curves], None, None)
    y = _range([item.y for item in panel.curves], panel.low, panel.high)
    parts = [_grid(x, y, left, top), _text(left, top - 20, panel.title, weight="bold"), _legend(panel, left, top)]
    if panel.mark is not None and x[0] < panel.mark < x[1]:
        at = left + WIDTH * (panel.mark - x[0]) / (x[1] - x[0])
        parts.append(f'<path d="M{at:.0f} {top:g}v{HEIGHT:g}" stroke="{INK}" stroke-dasharray="1 3"/>')
    drawn = sorted(panel.curves, key=lambda item: bool(item.label))
    parts += [_curve(item, x, y, left, top) for item in drawn]
    parts.append(f'<rect x="{left:g}" y="{top:g}" width="{WIDTH:g}" height="{HEIGHT:g}" fill="none" stroke="{INK}"/>')
    parts.append(_text(left + WIDTH, top + HEIGHT + 13, panel.below, anchor="end"))
    return "\n".join(filter(None, parts))


def _range(values: Sequence[FloatArray], low: float | None, high: float | None) -> tuple[float, float]:
    whole = np.concatenate([item[np.isfinite(item)] for item in values])
    least = float(np.min(whole, initial=np.inf)) if low is None else low
    most = float(np.max(whole, initial=-np.inf)) if high is None else high
    if not np.isfinite([least, most]).all():
        return 0.0, 1.0
    return (least, most) if most > least else (least - 0.5, least + 0.5)


def _ticks(low: float, high: float) -> list[float]:
    """Give round values inside a range."""
    raw = (high - low) / TICKS
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(part * power for part in (1.0, 2.0, 2.5, 5.0, 10.0) if part * power >= raw * 0.999)
    first = int(np.ceil(low / step - 1e-9))
    return [k * step for k in range(first, int(np.floor(high / step + 1e-9)) + 1)]


def _grid(x: tuple[float, float], y: tuple[float, float], left: float, top: float) -> str:
    parts = []
    bottom = top + HEIGHT
    for value in _ticks(*y):
        at = bottom - HEIGHT * (value - y[0]) / (y[1] - y[0])
        parts.append(f'<path d="M{left:g} {at:.1f}h{WIDTH:g}" stroke="{GRID}"/>')
        parts.append(_text(left - 4, at + 4, f"{value:.4g}", anchor="end"))
    for value in _ticks(*x):
        at = left + WIDTH * (value - x[0]) / (x[1] - x[0])
        if at < left + WIDTH - 22:
            parts.append(_text(at, bottom + 13, f"{value:g}", anchor="middle"))
    return "".join(parts)


def _curve(curve: Curve, x: tuple[float, float], y: tuple[float, float], left: float, top: float) -> str:
    """Give a curve; what is beyond the scale is drawn along its edge."""
    color = COLORS[curve.color % len(COLORS)] if curve.label else PALE
    chosen = np.arange(curve.x.size) if curve.dots else thin([curve.y], POINTS if curve.label else FEW)
    across = left + WIDTH * (curve.x[chosen] - x[0]) / (x[1] - x[0])
    up = top + HEIGHT * (1.0 - np.clip((curve.y[chosen] - y[0]) / (y[1] - y[0]), 0.0, 1.0))
    there = np.isfinite(up)
    if curve.dots:
        spots = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(across[there], up[there], strict=True))
        return f'<path d="{spots}" stroke="{color}" stroke-width="1.6" stroke-linecap="round"/>' if spots else ""
    path, pen = [], "M"
    for a, b, ok in zip(across, up, there, strict=True):
        if ok:
            path.append(f"{pen}{a:.1f} {b:.1f}")
        pen = "L" if ok else "M"
    dash = ' stroke-dasharray="4 2"' if curve.dashed else ""
    return f'<path d="{"".join(path)}" fill="none" stroke="{color}" stroke-width="1.2"{dash}/>' if path else ""


def _legend(panel: Panel, left: float, top: float) -> str:
    parts, at = [], left
    for item in panel.curves:
        if item.label:
            color = COLORS[item.color % len(COLORS)]
            dash = ' stroke-dasharray="4 2"' if item.dashed else ""
            parts.append(f'<path d="M{at:.0f} {top - 8:g}h12" stroke="{color}" stroke-width="2"{dash}/>')
            parts.append(_text(at + 15, top - 5, item.label))
            at += 22.0 + LETTER * len(item.label)
    return "".join(parts)


def _text(x: float, y: float, words: str, *, anchor: str = "start", weight: str = "") -> str:
    shown = words.replace("&", "&amp;").replace("<", "&lt;")
    more = (f' text-anchor="{anchor}"' if anchor != "start" else "") + (f' font-weight="{weight}"' if weight else "")
    return f'<text x="{x:.0f}" y="{y:.0f}" fill="{INK}"{more}>{shown}</text>'
