"""Whether probabilities mean what they say: of the claims of 90 %, 90 % should be right; as a table and as a plot."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import sqrt
from pathlib import Path

from benchmarks.trust.cases import DISTURBED, EXPECTED
from benchmarks.trust.play import Claim, Run

LATE = {"tank": 300.0, "dc_motor": 5.0, "dc_motor_current": 5.0}  # s since the alarm, from which claims have to hold
TENTHS = 10
SIZE, MARGIN, FEW = 320, 46, 50
INK, PALE, LATE_COLOUR, EARLY_COLOUR, EXPECTED_COLOUR = "#222222", "#bbbbbb", "#1f5fa8", "#c4541a", "#3a8a3a"
Cells = tuple[str, str, str, str]


def calibration_rows(runs: Mapping[str, Sequence[Run]]) -> list[Cells]:
    """Give, by tenths of the claimed probability, the mean claim and the part that was right.

    Of late claims, of early ones, and of late ones in the runs whose faults are drawn from what the model expects. Then
    how often the group holds the truth, of the same claims.
    """
    series = (
        ("late", claims_of(runs, late=True), "99 %"),
        ("early", claims_of(runs, late=False), "90 %"),
        (f"late, {EXPECTED}", expected_claims(runs), ""),
    )
    rows: list[Cells] = []
    for word, claims, _ in series:
        for tenth, inside in tenths(claims):
            claimed, right = means(inside)
            name = f"{word}, {10 * tenth} to {10 * tenth + 10} %"
            rows.append((name, f"{100 * claimed:.1f} %", f"{100 * right:.1f} %", str(len(inside))))
    for word, claims, asked in series:
        if claims:
            held = f"{100 * sum(claim.group for claim in claims) / len(claims):.1f} %"
            rows.append((f"{word}: the group holds the truth", asked, held, str(len(claims))))
    return rows


def claims_of(runs: Mapping[str, Sequence[Run]], *, late: bool) -> list[Claim]:
    """Give the claims of the usual runs from the moment on from which they have to hold, or those before.

    Runs that are disturbed are left out: they have the faults, plants and noise of other ones.
    """
    usual = [found for key, found in runs.items() if key.partition(".")[0] not in (*DISTURBED, EXPECTED)]
    return _claims(usual, late=late)


def expected_claims(runs: Mapping[str, Sequence[Run]]) -> list[Claim]:
    """Give the late claims of the runs whose faults are drawn from what the model expects."""
    return _claims([found for key, found in runs.items() if key.partition(".")[0] == EXPECTED], late=True)


def _claims(chosen: Iterable[Sequence[Run]], *, late: bool) -> list[Claim]:
    return [
        claim for found in chosen for run in found for claim in run.claims if (claim.after >= LATE[run.folder]) == late
    ]


def tenths(claims: Sequence[Claim]) -> Iterator[tuple[int, list[Claim]]]:
    """Give the claims in each tenth of probability that has some."""
    for tenth in range(TENTHS):
        inside = [claim for claim in claims if min(int(claim.best * TENTHS), TENTHS - 1) == tenth]
        if inside:
            yield tenth, inside


def means(claims: Sequence[Claim]) -> tuple[float, float]:
    """Give the mean claim, and the part that was right."""
    return sum(c.best for c in claims) / len(claims), sum(c.right for c in claims) / len(claims)


def write_plot(runs: Mapping[str, Sequence[Run]], path: Path) -> None:
    """Write the table as SVG; open marks stand for fewer than 50 claims, bars for one standard deviation."""
    series = (
        (claims_of(runs, late=True), LATE_COLOUR, "late claims"),
        (claims_of(runs, late=False), EARLY_COLOUR, "early claims"),
        (expected_claims(runs), EXPECTED_COLOUR, "late, expected faults"),
    )
    parts = [_frame()]
    for row, (chosen, colour, label) in enumerate(series):
        parts += [_mark(claims, colour) for _, claims in tenths(chosen)]
        x, y = MARGIN + SIZE - 140, MARGIN + SIZE - 56 + 18 * row
        parts.append(f'<circle cx="{x}" cy="{y}" r="4" fill="{colour}"/>')
        parts.append(f'<text x="{x + 10}" y="{y + 4}" fill="{INK}">{label}</text>')
    whole = SIZE + 2 * MARGIN
    font = 'font-family="sans-serif" font-size="12"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {whole} {whole}" {font}>'
    path.write_text("\n".join([head, *parts, "</svg>", ""]), encoding="utf-8")


def _mark(claims: Sequence[Claim], colour: str) -> str:
    n, (claimed, right) = len(claims), means(claims)
    spread = sqrt(max(right * (1.0 - right), 0.25 / n) / n)
    x, y, top, bottom = _x(claimed), _y(right), _y(min(right + spread, 1.0)), _y(max(right - spread, 0.0))
    bar = f'<line x1="{x:.1f}" y1="{top:.1f}" x2="{x:.1f}" y2="{bottom:.1f}" stroke="{colour}"/>'
    return f'{bar}<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour if n >= FEW else "white"}" stroke="{colour}"/>'


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
