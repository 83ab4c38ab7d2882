"""Whether probabilities mean what they say: of the claims of 90 %, 90 % should be right."""

from collections.abc import Iterator, Mapping, Sequence

from benchmarks.trust_cases import DISTURBED
from benchmarks.trust_play import Claim, Run

LATE = {"tank": 300.0, "dc_motor": 5.0, "dc_motor_current": 5.0}  # s since the alarm, from which claims have to hold
TENTHS = 10
Cells = tuple[str, str, str, str]


def calibration_rows(runs: Mapping[str, Sequence[Run]]) -> list[Cells]:
    """Give, by tenths of the claimed probability, the mean claim and the part that was right; late and early claims."""
    late, early = claims_of(runs, late=True), claims_of(runs, late=False)
    return [*_tenths("late", late), *_tenths("early", early)]


def coverage_rows(runs: Mapping[str, Sequence[Run]]) -> list[Cells]:
    """Give how often the group holds the truth, of late and of early claims."""
    found = []
    for word, late, asked in (("late", True, "99 %"), ("early", False, "90 %")):
        claims = claims_of(runs, late=late)
        if claims:
            held = sum(claim.group for claim in claims)
            part = f"{100 * held / len(claims):.1f} %"
            found.append((f"{word}: the group holds the truth", asked, part, str(len(claims))))
    return found


def claims_of(runs: Mapping[str, Sequence[Run]], *, late: bool) -> list[Claim]:
    """Give the claims of all runs from the moment on from which they have to hold, or those before.

    Runs that are disturbed are left out: they have the faults, plants and noise of other ones.
    """
    return [
        claim
        for found in runs.values()
        for run in found
        if run.key.partition(".")[0] not in DISTURBED
        for claim in run.claims
        if (claim.after >= LATE[run.folder]) == late
    ]


def _tenths(word: str, claims: Sequence[Claim]) -> Iterator[Cells]:
    for tenth in range(TENTHS):
        inside = [claim for claim in claims if min(int(claim.best * TENTHS), TENTHS - 1) == tenth]
        if inside:
            mean, right = sum(c.best for c in inside) / len(inside), sum(c.right for c in inside) / len(inside)
            name = f"{word}, {10 * tenth} to {10 * tenth + 10} %"
            yield name, f"{100 * mean:.1f} %", f"{100 * right:.1f} %", str(len(inside))
