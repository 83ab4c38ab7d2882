"""The functions that fault analysis needs of a plant, as questions to its component network.

Source: thesis 4.2.1 (states), 4.2.2 (parameters, signals at a suspended component), 4.2.3 (rates), 4.2.4 (outputs).
"""

from collections.abc import Sequence
from itertools import combinations

from faultbond.algebra.route import Question
from faultbond.equations.component_network import ComponentNetwork, SignalAt


def states(network: ComponentNetwork) -> tuple[Question, ...]:
    """Ask for each state from the present and as many past observations as it takes. Source: thesis 4.2.1."""
    return tuple(
        Question(targets=((state, 0),), observed=network.observed, title=f"state {state}") for state in _states(network)
    )


def states_at_start(network: ComponentNetwork) -> tuple[Question, ...]:
    """Ask for each state one frame back, from the present observation and the past. Source: thesis 4.2.1."""
    return tuple(
        Question(targets=((state, 1),), observed=network.observed, title=f"state {state} at the start")
        for state in _states(network)
    )


def states_from_rates(network: ComponentNetwork) -> tuple[Question, ...]:
    """Ask for each state from the rates of all states and one observation, if need be from earlier ones as well.

    Source: thesis 4.2.1, figure 4.6, footnote 4.
    """
    return tuple(
        Question(
            targets=((state, 0),),
            observed=network.observed,
            known=_rates(network),
            title=f"state {state} from the rates",
        )
        for state in _states(network)
    )


def _states(network: ComponentNetwork) -> tuple[str, ...]:
    """The signals that are states; stores on one junction may share one."""
    return tuple(dict.fromkeys(state.signal for state in network.states))


def _rates(network: ComponentNetwork) -> frozenset[SignalAt]:
    return frozenset((state.rate, 0) for state in network.states)


def rates(network: ComponentNetwork) -> tuple[tuple[Question, Question], ...]:
    """Ask for each state now and, by the same route, one frame earlier; the difference is its rate times dt.

    The route of the second is that of the first, one frame earlier. The shorter way, to find the rate from the laws
    around the store, sums signals of very different size and is biased. Source: thesis 4.2.3.
    """
    before = tuple(
        Question(
            targets=((state, 1),),
            observed=network.observed,
            newest=1,
            title=f"state {state} one sample before",
        )
        for state in _states(network)
    )
    return tuple(zip(states(network), before, strict=True))


def outputs(network: ComponentNetwork) -> tuple[Question, ...]:
    """Ask for each output along causality from the states at the start and all else that is measured.

    Source: thesis 4.2.4, table 4.1.
    """
    start = frozenset((state.signal, 1) for state in network.states)
    return tuple(
        Question(
            targets=((output, 0),),
            observed=network.observed,
            known=start,
            hidden=frozenset({(output, 0)}),
            frames=1,
            causal=True,
            title=f"output {output}",
        )
        for output in network.outputs
    )


def either_side(network: ComponentNetwork) -> tuple[Question, ...]:
    """Ask for the signals at each suspected component, which is suspended, from one observation and the rates.

    Its parameter then follows from many pairs of them. Source: thesis 4.2.2, second function.
    """
    return tuple(
        Question(
            targets=tuple(dict.fromkeys((signal, back) for item in suspended for signal, back in item.signals)),
            observed=network.observed,
            known=_rates(network),
            suspended=frozenset(item.name for item in suspended),
            frames=1,
            title=f"signals at {parameter}",
        )
        for parameter in network.suspects
        if (suspended := [item for item in network.equations if parameter in item.parameters])
    )


def parameters(network: ComponentNetwork, names: Sequence[str]) -> Question:
    """Ask for the parameters of a set of suspended components. Source: thesis 4.2.2, first function."""
    names = tuple(dict.fromkeys(names))
    kind = "parameter" if len(names) == 1 else "parameters"
    return Question(targets=names, unknown=names, observed=network.observed, title=f"{kind} {', '.join(names)}")


def parameter_sets(network: ComponentNetwork, max_faults: int) -> tuple[Question, ...]:
    """Ask for every set of at most `max_faults` suspects, small sets first."""
    return tuple(
        parameters(network, names)
        for size in range(1, max_faults + 1)
        for names in combinations(network.suspects, size)
    )


def all_questions(network: ComponentNetwork, max_faults: int) -> tuple[Question, ...]:
    """Give every question of this module; that of a rate once for now and once for one frame earlier.

    Of what stands within a lag of several stages nothing is asked: nobody has named it.
    """
    stages = {state.signal for state in network.states if state.is_stage}
    of_states = (
        *states(network),
        *states_at_start(network),
        *states_from_rates(network),
        *(question for pair in rates(network) for question in pair[1:]),
    )
    return (
        *(item for item in of_states if not any(target[0] in stages for target in item.targets)),
        *outputs(network),
        *either_side(network),
        *parameter_sets(network, max_faults),
    )
