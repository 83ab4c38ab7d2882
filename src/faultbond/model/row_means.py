"""Models whose samples are means of rows: noise, which a file states of a row, is that of the mean."""

import math
from dataclasses import replace

from faultbond.model.graph import BondGraph


def averaged(graph: BondGraph) -> BondGraph:
    """Give a plant whose noise is of rows with that of its samples: white noise is less in a mean by the root of n."""
    return _with_noise(graph, 1.0 / math.sqrt(graph.rows_per_sample))


def of_rows(graph: BondGraph) -> BondGraph:
    """Give the same plant row by row, as its recordings are: with the time between them, and their noise."""
    if graph.row_time is None:
        return graph
    by_rows = replace(graph, sample_time=graph.row_time, row_time=None)
    return _with_noise(by_rows, math.sqrt(graph.rows_per_sample))


def _with_noise(graph: BondGraph, factor: float) -> BondGraph:
    if factor == 1.0:
        return graph
    sensors = tuple(replace(item, noise=item.noise * factor) for item in graph.sensors)
    inputs = tuple(replace(item, noise=item.noise * factor) for item in graph.inputs)
    return replace(graph, sensors=sensors, inputs=inputs)
