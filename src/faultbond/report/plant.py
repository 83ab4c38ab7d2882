"""The plant that is analysed: shown at once, before anything that is slow to load."""

from rich.console import Console

from faultbond.contract.json_records import Record
from faultbond.equations.component_network import ComponentNetwork
from faultbond.model.graph import BondGraph
from faultbond.report.console import headline, lines
from faultbond.report.reservations import known_alarms


def print_plant(console: Console, graph: BondGraph, network: ComponentNetwork) -> None:
    """Print what is known of the plant and what is suspected, on a console set to the width of all listings."""
    headline(console, graph.name, graph.file)
    lines(
        console,
        [
            ("inputs", ", ".join(network.inputs) or "none"),
            ("sensors", ", ".join(network.outputs)),
            ("states", ", ".join(state.signal for state in network.states) or "none"),
            ("suspects", ", ".join(network.suspects) or "none: no parameter may change"),
            *([("known", f"{known_alarms(graph)}, so `run` claims no fault by it")] if graph.false_alarms else []),
        ],
    )


def plant_record(graph: BondGraph, network: ComponentNetwork) -> Record:
    """Give what names the plant; lists are empty until the sections that fill them."""
    return {
        "record": "analyse",
        "model": graph.name,
        "model_sha256": graph.sha256,
        "states": [state.signal for state in network.states],
        "inputs": list(network.inputs),
        "sensors": list(network.outputs),
        "suspects": list(network.suspects),
        "max_faults": graph.max_faults,
        "false_alarms": graph.false_alarms,
        "hypotheses": [],
        "groups": [],
        "near_groups": [],
        "detectable": {},
        "isolable": {},
        "routes": [],
        "smallest_fault": {},
        "sensor_advice": [],
        "input_advice": [],
    }
