"""What a person decided of a candidate, in words, and how the others stand."""

from faultbond.model.graph import BondGraph
from faultbond.report.numbers import clock_text, probability_text
from faultbond.report.verdict import LISTED_SETS, set_name
from faultbond.runtime.history import Accepted, Candidate, Diagnosis

LISTED = 2 * LISTED_SETS  # candidates of a ranking


def accepted_text(graph: BondGraph, accepted: Accepted) -> str:
    """Say what became the new normal."""
    return f"Accepted at {clock_text(accepted.time)}: {_told(graph, accepted.candidate)}. It is the new normal."


def rejected_text(graph: BondGraph, rejected: Accepted) -> str:
    """Say what was ruled out."""
    return f"Rejected at {clock_text(rejected.time)}: {_told(graph, rejected.candidate)}."


def ranking_text(graph: BondGraph, diagnosis: Diagnosis) -> str:
    """Give a line for each of the best candidates."""
    best = diagnosis.candidates[:LISTED]
    lines = [f"{probability_text(item.probability):>6} %  {_named(graph, item)}" for item in best]
    more = len(diagnosis.candidates) - len(best)
    return "\n".join(["Now:", *lines, *([f"   ... and {more} more"] if more else [])])


def _told(graph: BondGraph, candidate: Candidate) -> str:
    return f"{_named(graph, candidate)} ({probability_text(candidate.probability)} %)"


def _named(graph: BondGraph, candidate: Candidate) -> str:
    return f"{set_name(graph, candidate)}, {candidate.kind.value}"
