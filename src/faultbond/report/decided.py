"""How the candidates stand after one of them was rejected."""

from faultbond.contract.findings import Candidate, Decision, Diagnosis
from faultbond.model.graph import BondGraph
from faultbond.report.numbers import clock_text, probability_text
from faultbond.report.suspects import instrument_of
from faultbond.report.verdict import LISTED_SETS, set_name, unexplained_sentence, untested_sentence

LISTED = 2 * LISTED_SETS  # candidates of a ranking


def rejected_sentence(graph: BondGraph, rejected: Decision) -> str:
    """Say what was ruled out."""
    share = probability_text(rejected.candidate.probability)
    alone = any(instrument_of(suspect.parameter)[0] for suspect in rejected.candidate.suspects)
    more = "" if alone else ", and every set that contains it"
    return f"Rejected at {clock_text(rejected.time)}: {_named(graph, rejected.candidate)} ({share} %){more}."


def ranking_text(graph: BondGraph, diagnosis: Diagnosis) -> str:
    """Give a line for each of the best candidates, and what else may be true."""
    left = [item for item in diagnosis.candidates if item.probability > 0.0]
    lines = [f"{probability_text(item.probability):>6} %  {_named(graph, item)}" for item in left[:LISTED]]
    more = [f"         ... and {len(left) - LISTED} more"] if len(left) > LISTED else []
    doubts = [unexplained_sentence(diagnosis.unexplained)] if diagnosis.unexplained is not None else []
    untested = untested_sentence(diagnosis)
    return "\n".join(["What is left:", *lines, *more, *doubts, *([untested] if untested else [])])


def _named(graph: BondGraph, candidate: Candidate) -> str:
    return f"{set_name(graph, candidate)}, {candidate.kind.value}"
