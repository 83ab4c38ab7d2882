"""What a model is told to lack, and what it cannot show, in words: by its laws, numbers and suspects alone."""

from collections.abc import Iterator

from faultbond.contract.claims import claimed_parameter
from faultbond.contract.spec import EngineSpec
from faultbond.equations.passivity import Active, active_elements
from faultbond.model.graph import BondGraph
from faultbond.report.numbers import join, with_unit

HALF = 0.5  # of a value; who looks after a plant wants to know of a change by so much
MOVED = 1.0  # accuracies by which a healthy parameter seems to move; more is told of a model


def doubtful(graph: BondGraph) -> Iterator[tuple[str, str]]:
    """Give the parameters of a model that seem to change by more than their accuracies, and what to say of each."""
    for item in graph.parameters:
        times = item.healthy_change / item.accuracy if item.accuracy > 0.0 else 0.0
        if times > MOVED:
            yield (
                item.name,
                f"{item.name} seems to move by {times:.1f} accuracies (sd) while healthy: the law of {item.owner}, or "
                "what is measured there, lacks something; a fault has to be larger to be told for sure",
            )


def active_texts(graph: BondGraph) -> list[str]:
    """Say which elements give what they can only take or store, which numbers are why, and what to do."""
    return [_active_text(graph, item) for item in active_elements(graph)]


def _active_text(graph: BondGraph, found: Active) -> str:
    part = found.component
    gives = f"the content of {part.name} falls as it is filled" if part.type.is_store else f"{part.name} gives power"
    if not found.numbers:
        return (
            f"{gives} by its law, with the numbers above zero, too: turn a sign in the law ({graph.file}:{part.line})"
        )
    stated = {item.name: (item.nominal, item.unit, item.line) for item in graph.parameters}
    stated |= {item.name: (item.value, item.unit, item.line) for item in graph.constants}
    told = []
    for name in found.numbers:
        value, unit, _ = stated[name]
        told.append(f"{name} is {with_unit(unit.from_si(value), unit.text)}")
    where = f"{graph.file}:{stated[found.numbers[0]][2] or part.line}"
    return f"{join(told)}, so {gives}: state it above zero, or turn the sign in the law ({where})"


def active_sentence(graph: BondGraph) -> str:
    """Say the same in sentences after an alarm; empty where every element is what it is called."""
    told = "; ".join(active_texts(graph))
    return f"{told}. Mend that first: no alarm of such a model tells anything of the plant." if told else ""


def unclaimed_suspects(spec: EngineSpec) -> tuple[str, ...]:
    """Name the suspects that seem to move so far while healthy that a change by less than half is no fault."""
    return tuple(
        item.name
        for k, item in enumerate(spec.parameters)
        if item.suspect and item.healthy_change and claimed_parameter(spec, k) >= HALF * abs(item.nominal) > 0.0
    )


def unclaimed_sentence(spec: EngineSpec) -> str:
    """Say of which parameters only large changes are told, so that no fault of theirs means little; empty of none."""
    names = unclaimed_suspects(spec)
    if not names:
        return ""
    theirs = "it" if len(names) == 1 else "them"
    return (
        f"Of {join(names)} only changes by more than half would be told: healthy data seem to move {theirs} so far "
        "(`healthy_change`)."
    )


def hidden_suspects(spec: EngineSpec) -> tuple[str, ...]:
    """Name the suspects that no hypothesis changes alone, nor would explain anything."""
    told = {
        k for chosen in (*spec.hypotheses, *spec.reserve, *spec.explain_anything) if len(chosen) == 1 for k in chosen
    }
    return tuple(item.name for k, item in enumerate(spec.parameters) if item.suspect and k not in told)


def hidden_instruments(spec: EngineSpec) -> tuple[str, ...]:
    """Name the sensors and inputs whose faults an unknown input may hide, which no hypothesis is about either."""
    kinds = (("sensor", spec.outputs), ("input", spec.inputs))
    return tuple(f"{kind} {item.name}" for kind, items in kinds for item in items if item.hidden)


def hidden_sentence(spec: EngineSpec) -> str:
    """Say after an alarm what it was not put down to, since no data seemed to fix it; empty where all was tested."""
    changed, wrong = list(hidden_suspects(spec)), list(hidden_instruments(spec))
    asked = [f"{join(changed)} changed"] if changed else []
    asked += [f"{join(wrong)} {'is' if len(wrong) == 1 else 'are'} wrong"] if wrong else []
    told = f"It was not tested whether {', or whether '.join(asked)}, of which no run with the model showed anything"
    return f"{told}: such a fault is put down to others." if asked else ""
