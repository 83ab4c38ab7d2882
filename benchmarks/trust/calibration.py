"""Whether probabilities mean what they say: of the claims of 90 %, 90 % should be right."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from benchmarks.trust.cases import DISTURBED, EXPECTED
from benchmarks.trust.play import Claim, Run

LATE = {"tank": 300.0, "dc_motor": 5.0, "dc_motor_current": 5.0}  # s since the alarm, from which claims have to hold
TENTHS = 10
Cells = tuple[str, str, str, str]


def calibration_rows(runs: Mapping[str, Sequence[Run]]) -> list[Cells]:
    """Give, by tenths of the claimed probability, the mean claim and the part that was right.

    Of late claims, of early ones, and of late ones in the runs whose faults are drawn from what the model expects.
    """
    late, early = claims_of(runs, late=True), claims_of(runs, late=False)
    return [*_tenths("late", late), *_tenths("early", early), *_tenths(f"late, {EXPECTED}", expected_claims(runs))]


def coverage_rows(runs: Mapping[str, Sequence[Run]]) -> list[Cells]:
    """Give how often the group holds the truth, of the same claims."""
    found = []
    for word, claims, asked in (
        ("late", claims_of(runs, late=True), "99 %"),
        ("early", claims_of(runs, late=False), "90 %"),
        (f"late, {EXPECTED}", expected_claims(runs), ""),
    ):
        if claims:
            held = sum(claim.group for claim in claims)
            part = f"{100 * held / len(claims):.1f} %"
            found.append((f"{word}: the group holds the truth", asked, part, str(len(claims))))
    return found


def claims_of(runs: Mapping[str, Sequence[Run]], *, late: bool) -> list[Claim]:
    """Give the claims of the usual runs from the moment on from which they have to hold, or those before.

    Runs that are disturbed are left out: they have the faults, plants and noise of other ones.
    """
    usual = [found for key, found in runs.items() if _kind(key) not in (*DISTURBED, EXPECTED)]
    return _claims(usual, late=late)


def expected_claims(runs: Mapping[str, Sequence[Run]]) -> list[Claim]:
    """Give the late claims of the runs whose faults are drawn from what the model expects."""
    return _claims([found for key, found in runs.items() if _kind(key) == EXPECTED], late=True)


def _kind(key: str) -> str:
    return key.partition(".")[0]


def _claims(chosen: Iterable[Sequence[Run]], *, late: bool) -> list[Claim]:
    return [
        claim for found in chosen for run in found for claim in run.claims if (claim.after >= LATE[run.folder]) == late
    ]


def _tenths(word: str, claims: Sequence[Claim]) -> Iterator[Cells]:
    for tenth in range(TENTHS):
        inside = [claim for claim in claims if min(int(claim.best * TENTHS), TENTHS - 1) == tenth]
        if inside:
            mean, right = sum(c.best for c in inside) / len(inside), sum(c.right for c in inside) / len(inside)
            name = f"{word}, {10 * tenth} to {10 * tenth + 10} %"
            yield name, f"{100 * mean:.1f} %", f"{100 * right:.1f} %", str(len(inside))
