"""The calibration plot: of the claims in each tenth of probability, the part that was right."""

from collections.abc import Mapping, Sequence
from math import sqrt
from pathlib import Path

from benchmarks.trust.calibration import TENTHS, claims_of, expected_claims
from benchmarks.trust.play import Claim, Run

SIZE, MARGIN, FEW = 320, 46, 50
INK, PALE, LATE_COLOUR, EARLY_COLOUR, EXPECTED_COLOUR = "#222222", "#bbbbbb", "#1f5fa8", "#c4541a", "#3a8a3a"


def write_plot(runs: Mapping[str, Sequence[Run]], path: Path) -> None:
    """Write the plot as SVG; open marks stand for fewer than 50 claims, bars for one standard deviation."""
    series = (
        (claims_of(runs, late=True), LATE_COLOUR, "late claims"),
        (claims_of(runs, late=False), EARLY_COLOUR, "early claims"),
        (expected_claims(runs), EXPECTED_COLOUR, "late, expected faults"),
    )
    parts = [_frame()]
    for row, (chosen, colour, label) in enumerate(series):
        parts += [_mark(claims, colour) for claims in _tenths(chosen) if claims]
        x, y = MARGIN + SIZE - 140, MARGIN + SIZE - 56 + 18 * row
        parts.append(f'<circle cx="{x}" cy="{y}" r="4" fill="{colour}"/>')
        parts.append(f'<text x="{x + 10}" y="{y + 4}" fill="{INK}">{label}</text>')
    whole = SIZE + 2 * MARGIN
    font = 'font-family="sans-serif" font-size="12"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {whole} {whole}" {font}>'
    path.write_text("\n".join([head, *parts, "</svg>", ""]), encoding="utf-8")


def _tenths(claims: Sequence[Claim]) -> list[list[Claim]]:
    found: list[list[Claim]] = [[] for _ in range(TENTHS)]
    for claim in claims:
        found[min(int(claim.best * TENTHS), TENTHS - 1)].append(claim)
    return found


def _mark(claims: Sequence[Claim], colour: str) -> str:
    n = len(claims)
    claimed, right = sum(c.best for c in claims) / n, sum(c.right for c in claims) / n
    spread = sqrt(max(right * (1.0 - right), 0.25 / n) / n)
    x, y = _x(claimed), _y(right)
    fill = colour if n >= FEW else "white"
    top, bottom = _y(min(right + spread, 1.0)), _y(max(right - spread, 0.0))
    bar = f'<line x1="{x:.1f}" y1="{top:.1f}" x2="{x:.1f}" y2="{bottom:.1f}"'
    return f'{bar} stroke="{colour}"/><circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{fill}" stroke="{colour}"/>'


def _frame() -> str:
    lines = [
        f'<rect width="{SIZE + 2 * MARGIN}" height="{SIZE + 2 * MARGIN}" fill="white"/>',
        f'<rect x="{MARGIN}" y="{MARGIN}" width="{SIZE}" height="{SIZE}" fill="none" stroke="{PALE}"/>',
        f'<line x1="{_x(0)}" y1="{_y(0)}" x2="{_x(1)}" y2="{_y(1)}" stroke="{PALE}" stroke-dasharray="4 3"/>',
    ]
    for tick in range(0, 101, 20):
        part = tick / 100
        lines.append(f'<text x="{_x(part)}" y="{_y(0) + 16}" text-anchor="middle" fill="{INK}">{tick}</text>')
        lines.append(f'<text x="{_x(0) - 6}" y="{_y(part) + 4}" text-anchor="end" fill="{INK}">{tick}</text>')
    middle = MARGIN + SIZE / 2
    lines.append(f'<text x="{middle}" y="{_y(0) + 34}" text-anchor="middle" fill="{INK}">claimed, %</text>')
    turned = f'transform="rotate(-90 14 {middle})"'
    lines.append(f'<text x="14" y="{middle}" text-anchor="middle" fill="{INK}" {turned}>right, %</text>')
    return "\n".join(lines)


def _x(part: float) -> float:
    return MARGIN + SIZE * part


def _y(part: float) -> float:
    return MARGIN + SIZE * (1.0 - part)
