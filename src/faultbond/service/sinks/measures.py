"""What is measured of a service and its assets, under the names that others rely on.

Labels are `asset`, `component` (a component, sensor or input of it) and `sink`, all of them named by the site and its
models; never a hypothesis, of which there may be any number.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from faultbond.service.contract.face import Shown
from faultbond.service.contract.messages import Monitoring
from faultbond.service.sinks.openmetrics import Family, MetricKind

PREFIX = "faultbond"
COUNTED: Mapping[str, tuple[str, str]] = {  # counts of an asset: what they are called, and what they mean
    "samples": ("samples", "Grid points that have passed."),
    "missing": ("missing_samples", "Grid points at which a value was absent or not finite."),
    "late": ("late_rows", "Rows older than the newest one."),
    "duplicate": ("duplicate_rows", "Rows whose time was seen before."),
    "untimed": ("untimed_rows", "Rows whose time could not be read."),
    "unused": ("unused_rows", "Rows whose grid point was served by another one."),
    "clock_jumps": ("clock_jumps", "Grid points at which it went on after a change of the clock or a long gap."),
    "saturated": ("saturated_values", "Values at an end of their range."),
    "frozen": ("frozen_values", "Values of sensors that stay the same."),
    "dropped": ("dropped_rows", "Rows that waited too long and were dropped."),
    "bad": ("bad_values", "Values whose quality was bad."),
    "uncertain": ("uncertain_values", "Values whose quality was uncertain."),
    "unreadable": ("unreadable_messages", "Rows, messages or values that could not be read."),
    "unknown": ("unknown_messages", "Messages with no column of the asset."),
    "oversized": ("oversized_messages", "Messages that were too large."),
    "retained": ("retained_messages", "Old messages that the broker had kept."),
    "overflow": ("overflows", "Values before which the server dropped some."),
    "unborn": ("unborn_values", "Values that no birth of Sparkplug B has named."),
    "sequence gap": ("sequence_gaps", "Messages of Sparkplug B that do not follow the one before them."),
    "deaths": ("deaths", "Deaths of edge nodes and devices of Sparkplug B."),
    "source lost": ("sources_lost", "Times that its source was lost."),
    "begun anew": ("sources_begun_anew", "Files or simulations that had to be begun anew."),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AssetMeasures:
    """What is measured of an asset.

    summary: see `face.Face`. is_active, is_unseen: its alarm, whatever hides that. detector: by sensor, its sum over
    the limit of that. suspicion: by component, the probability that it is at fault. arrived: when a sensor gave a
    value last, Unix s; None: none has. counts: by name, of grid and source.
    """

    summary: Shown
    is_active: bool
    is_unseen: bool
    detector: Mapping[str, float]
    suspicion: Mapping[str, float]
    arrived: float | None
    counts: Mapping[str, int]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ServiceMeasures:
    """What is measured of the service. sources: by asset, whether its source works. sinks: as `health` tells them."""

    version: str
    sources: Mapping[str, bool]
    store_works: bool
    sinks: Mapping[str, Shown]
    viewers: int


def families(assets: Sequence[AssetMeasures], service: ServiceMeasures) -> Iterator[Family]:
    """Give all that is measured."""
    yield _of_all("build", MetricKind.INFO, "Version of faultbond.", 1.0, version=service.version)
    yield from _of_assets(assets)
    yield from _of_components(assets)
    for name, (called, meaning) in COUNTED.items():
        counted = [(item, float(item.counts.get(name, 0))) for item in assets]
        yield _by_asset(f"asset_{called}", MetricKind.COUNTER, meaning, counted)
    numbers = [({"asset": name}, float(works)) for name, works in service.sources.items()]
    yield Family(f"{PREFIX}_source_ok", MetricKind.GAUGE, "1 while the source of the asset works.", numbers)
    yield _of_all("store_ok", MetricKind.GAUGE, "1 while the store can be written.", float(service.store_works))
    yield _of_all("viewers", MetricKind.GAUGE, "Pages that are open.", float(service.viewers))
    for name, kind, key, meaning in (
        ("ok", MetricKind.GAUGE, "ok", "1 while the sink tells what it is given."),
        ("waiting_records", MetricKind.GAUGE, "behind", "Records that wait to be told, about."),
        ("told_records", MetricKind.COUNTER, "told", "Records that the other side has taken, since the start."),
        (
            "given_up_records",
            MetricKind.COUNTER,
            "given_up_records",
            "Records that could not be told, since the start.",
        ),
    ):
        told = [({"sink": sink}, float(health[key])) for sink, health in service.sinks.items()]
        yield Family(f"{PREFIX}_sink_{name}", kind, meaning, told)


def _of_assets(assets: Sequence[AssetMeasures]) -> Iterator[Family]:
    """Give what is so of assets now."""
    gauge = MetricKind.GAUGE
    for name, meaning, numbers in (
        (
            "status",
            "NAMUR NE 107: 0 normal, 1 failure, 2 check function, 3 out of specification, 4 maintenance required.",
            [(item, float(item.summary["status_code"])) for item in assets],
        ),
        (
            "running",
            "1 while samples come and are judged.",
            [(item, float(item.summary["monitoring"] == Monitoring.RUNNING.value)) for item in assets],
        ),
        (
            "alarm_active",
            "1 from a detection until a diagnosis is accepted, or the fault mended.",
            [(item, float(item.is_active)) for item in assets],
        ),
        (
            "alarm_unacknowledged",
            "1 while nobody has acknowledged an alarm.",
            [(item, float(item.is_unseen)) for item in assets],
        ),
        (
            "best_hypothesis_probability_ratio",
            "Probability of the likeliest explanation, while there is an alarm.",
            [(item, float(item.summary["best"]["probability"])) for item in assets if item.summary["best"]],
        ),
        (
            "last_arrival_timestamp_seconds",
            "When rows with a value of any sensor came last.",
            [(item, item.arrived) for item in assets if item.arrived is not None],
        ),
    ):
        yield _by_asset(f"asset_{name}", gauge, meaning, numbers)


def _of_components(assets: Sequence[AssetMeasures]) -> Iterator[Family]:
    """Give what is so of components, sensors and inputs now."""
    for name, meaning, key in (
        (
            "detector_statistic_ratio",
            "Detector of a sensor, its sum over the limit; above 1 is an alarm.",
            "detector",
        ),
        ("fault_probability_ratio", "Probability that a component is at fault, while there is an alarm.", "suspicion"),
    ):
        numbers = [
            ({"asset": item.summary["name"], "component": part}, number)
            for item in assets
            for part, number in getattr(item, key).items()
        ]
        yield Family(f"{PREFIX}_component_{name}", MetricKind.GAUGE, meaning, numbers)


def _by_asset(name: str, kind: MetricKind, meaning: str, numbers: Sequence[tuple[AssetMeasures, float]]) -> Family:
    labelled = [({"asset": item.summary["name"]}, number) for item, number in numbers]
    return Family(f"{PREFIX}_{name}", kind, meaning, labelled)


def _of_all(name: str, kind: MetricKind, meaning: str, number: float, **labels: str) -> Family:
    return Family(f"{PREFIX}_{name}", kind, meaning, [(labels, number)])
