"""How the candidates stand after one of them was rejected."""

from faultbond.model.graph import BondGraph
from faultbond.report.numbers import clock_text, probability_text
from faultbond.report.verdict import LISTED_SETS, set_name
from faultbond.runtime.history import Accepted, Candidate, Diagnosis

LISTED = 2 * LISTED_SETS  # candidates of a ranking


def rejected_sentence(graph: BondGraph, rejected: Accepted) -> str:
    """Say what was ruled out."""
    share = probability_text(rejected.candidate.probability)
    return f"Rejected at {clock_text(rejected.time)}: {_named(graph, rejected.candidate)} ({share} %)."


def ranking_text(graph: BondGraph, diagnosis: Diagnosis) -> str:
    """Give a line for each of the best candidates."""
    left = [item for item in diagnosis.candidates if item.probability > 0.0]
    lines = [f"{probability_text(item.probability):>6} %  {_named(graph, item)}" for item in left[:LISTED]]
    more = [f"         ... and {len(left) - LISTED} more"] if len(left) > LISTED else []
    return "\n".join(["What is left:", *lines, *more])


def _named(graph: BondGraph, candidate: Candidate) -> str:
    return f"{set_name(graph, candidate)}, {candidate.kind.value}"
