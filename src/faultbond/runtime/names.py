"""Hypotheses by the names that people know: of parameters, components, sensors and inputs."""

from collections.abc import Sequence
from difflib import get_close_matches

from faultbond.contract.findings import Candidate, Diagnosis
from faultbond.contract.spec import EngineSpec
from faultbond.errors import FaultbondError

LISTED = 24  # names in a message


def find_hypothesis(spec: EngineSpec, components: Sequence[str]) -> int:
    """Give the index of the hypothesis with these components, or parameters, or of this sensor or input.

    A sensor or input may also be called as a candidate calls it: `flow.bias` is of `flow`.

    Raises
    ------
    FaultbondError
        Where there is none, or several, or nothing is named.
    """
    if not components:
        raise FaultbondError("nothing is named. Name the components or parameters of one candidate of the diagnosis.")
    components = [name.partition(".")[0] for name in components]
    wanted = frozenset(components)
    found = []
    for k in range(spec.n_hypotheses):
        owners = frozenset(spec.parameters[i].component for i in spec.members(k)) | _instruments(spec, k)
        if wanted in (owners, hypothesis_names(spec, k)):
            found.append(k)
    if len(found) == 1:
        return found[0]
    words = ", ".join(components)
    known = _known_names(spec)
    strange = [name for name in components if name not in known]
    if strange:
        told = f"{', '.join(known[:LISTED])}{f' and {len(known) - LISTED} more' if len(known) > LISTED else ''}"
        near = [name for word in strange for name in _near(word, known)]
        cure = f"Did you mean {' and '.join(near)}?" if near else f"There are {told}."
        stated = {name for item in spec.parameters for name in (item.component, item.name)}
        untested = [name for name in strange if name in stated]
        if untested:
            raise FaultbondError(f"{', '.join(untested)}: not tested; `check` tells why. There are {told}.")
        raise FaultbondError(f"{', '.join(strange)}: nothing that is suspected is called so. {cure}")
    if found:
        raise FaultbondError(f"{words}: several candidates have these components. Name their parameters instead.")
    raise FaultbondError(
        f"{words}: no candidate has just these components. Name those of one candidate of the diagnosis."
    )


def _near(word: str, known: Sequence[str]) -> list[str]:
    """Give the known name that is most like a misspelt one; none where none is."""
    by_lower = {name.lower(): name for name in reversed(known)}
    return [by_lower[name] for name in get_close_matches(word[:100].lower(), by_lower, n=1)]


def _known_names(spec: EngineSpec) -> tuple[str, ...]:
    """Give the names that a hypothesis may be called by: of components, parameters, sensors and inputs."""
    suspects = [spec.parameters[i] for i in sorted({i for k in range(spec.n_hypotheses) for i in spec.members(k)})]
    names = [name for item in suspects for name in (item.component, item.name)]
    return tuple(dict.fromkeys([*names, *(item.name for item in spec.instruments)]))


def hypothesis_names(spec: EngineSpec, hypothesis: int) -> frozenset[str]:
    """Give the parameters of a hypothesis, and its sensors or inputs."""
    return frozenset(spec.parameters[i].name for i in spec.members(hypothesis)) | _instruments(spec, hypothesis)


def _instruments(spec: EngineSpec, hypothesis: int) -> frozenset[str]:
    return frozenset(item.name for item in spec.instruments_in(hypothesis))


def candidate_names(candidate: Candidate) -> frozenset[str]:
    """Give the parameters of a candidate, and its sensor or input."""
    return frozenset(name.partition(".")[0] for name in candidate.parameters)


def is_sure(diagnosis: Diagnosis, level: float) -> bool:
    """Whether the best candidate and its kind are likely enough, it is alone in its group, and explains the data."""
    if not diagnosis.candidates:
        return False
    best = diagnosis.candidates[0]
    alone = sum(item.group for item in diagnosis.candidates) == 1
    share = best.kinds[0][1] if best.kinds else 1.0
    return best.probability * share >= level and alone and diagnosis.unexplained is None
