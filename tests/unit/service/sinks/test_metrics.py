"""What programs measure of a service: a text that their parser reads, with names that a dashboard can rely on."""

import asyncio
import json
import re
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

from faultbond.io.grid import Counts
from faultbond.service.sinks.measures import COUNTED
from faultbond.service.sinks.openmetrics import Family, MetricKind, exposition
from faultbond.service.site import Site, SiteAsset
from faultbond.service.sources.opening import open_source
from faultbond.service.station import Service
from faultbond.service.store.opening import open_store
from loop_asset import RECORDING, plant
from telling import Told

parser = pytest.importorskip("prometheus_client.openmetrics.parser", reason="there is no prometheus_client")

PAGE, BOARD = Path("docs/service.md").resolve(), Path("docs/grafana.json").resolve()
NAME = re.compile(r"\bfaultbond_[a-z_]+")
LABELS = {"asset", "component", "sink", "version"}
Numbers = dict[str, list[tuple[dict[str, str], float]]]


def numbers_of(text: str) -> Numbers:
    """Give labels and values by name, as a strict parser reads them."""
    found: Numbers = {}
    for family in parser.text_string_to_metric_families(text):
        assert family.documentation
        for sample in family.samples:
            found.setdefault(sample.name, []).append((sample.labels, sample.value))
    return found


def measured(folder: Path, source: str, is_so: Callable[[Service], bool]) -> tuple[Numbers, dict[str, Any]]:
    """Give what is measured of a service, and how its asset stands, once something is so."""
    asset = SiteAsset(name="loop", plant=plant(), source=source)
    site = Site(name="hall", assets=(asset, replace(asset, name="other")))
    store = open_store(folder / "kept.sqlite", reserve=0)

    async def all_of_it() -> tuple[Numbers, dict[str, Any]]:
        service = Service(site, store, open_source, sinks=[Told("tickets")])
        running = asyncio.create_task(service.run())
        while not is_so(service):
            await asyncio.sleep(0.05)
        found = numbers_of(service.metrics(3)), service.asset("loop")
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        return found

    try:
        return asyncio.run(asyncio.wait_for(all_of_it(), 90.0))
    finally:
        store.close()


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[Numbers, dict[str, Any]]:
    """What is measured of two loops with a fault that was found and named."""

    def is_named(service: Service) -> bool:
        told = service.health()["parts"]["tell tickets"]
        shown = service.site()["assets"]
        return all(item["best"] and item["samples"] > 1500 for item in shown) and told["behind"] == 0 < told["told"]

    return measured(tmp_path_factory.mktemp("found"), f"file:{RECORDING}?speed=max", is_named)


def of(numbers: Numbers, name: str, **labels: str) -> float:
    """Give the one number of a name with these labels."""
    (value,) = [value for told, value in numbers[name] if told == labels]
    return value


def test_what_is_measured_is_what_the_page_shows(found: tuple[Numbers, dict[str, Any]]) -> None:
    """Status, alarm, probabilities, detector and counts of an asset; and the parts of the service."""
    numbers, asset = found
    shown = asset["summary"]
    for name, value in (
        ("faultbond_asset_status", shown["status_code"]),
        ("faultbond_asset_alarm_active", 1.0),
        ("faultbond_asset_alarm_unacknowledged", 1.0),
        ("faultbond_asset_best_hypothesis_probability_ratio", shown["best"]["probability"]),
        ("faultbond_asset_samples_total", shown["samples"]),
        ("faultbond_asset_missing_samples_total", asset["counts"].get("missing", 0)),
        ("faultbond_asset_dropped_rows_total", 0.0),
    ):
        assert of(numbers, name, asset="loop") == pytest.approx(value), name
    blamed = {labels["component"]: value for labels, value in numbers["faultbond_component_fault_probability_ratio"]}
    assert blamed.keys() == asset["suspicion"].keys()
    assert max(blamed.values()) > 0.3
    detector = {labels["component"] for labels, _ in numbers["faultbond_component_detector_statistic_ratio"]}
    assert detector == {item["name"] for item in asset["signals"] if item["role"] == "sensor"}
    assert of(numbers, "faultbond_store_ok") == of(numbers, "faultbond_sink_ok", sink="tickets") == 1.0
    assert of(numbers, "faultbond_sink_told_records_total", sink="tickets") > 1.0
    assert of(numbers, "faultbond_sink_given_up_records_total", sink="tickets") == 0.0
    assert of(numbers, "faultbond_viewers") == 3.0
    assert numbers["faultbond_build_info"][0][1] == 1.0


def test_nothing_is_said_of_what_is_not_known(tmp_path: Path) -> None:
    """A service without a row has no probability, no detector and no arrival; its source is in trouble."""
    numbers, _ = measured(tmp_path, "file:no.csv", lambda service: not service.health()["ok"])
    assert of(numbers, "faultbond_asset_running", asset="loop") == of(numbers, "faultbond_source_ok", asset="loop") == 0
    for name in (
        "faultbond_asset_best_hypothesis_probability_ratio",
        "faultbond_component_detector_statistic_ratio",
        "faultbond_component_fault_probability_ratio",
        "faultbond_asset_last_arrival_timestamp_seconds",
    ):
        assert name not in numbers


def test_all_has_the_labels_that_there_are(found: tuple[Numbers, dict[str, Any]]) -> None:
    """Asset, component and sink; the number of series does not grow with that of hypotheses."""
    assert {key for told in found[0].values() for labels, _ in told for key in labels} <= LABELS


def test_every_count_of_the_grid_and_of_the_page_is_measured() -> None:
    """What is counted has a name there."""
    assert {item.name for item in fields(Counts)} <= COUNTED.keys()
    text = PAGE.read_text(encoding="utf-8").partition("\n### Counts\n")[2].partition("\n## ")[0]
    told = {word for line in text.splitlines() if line[:3] == "| `" for word in re.findall(r"`([^`]+)`", line[:40])}
    assert len(told) > 6
    assert told <= COUNTED.keys()


def test_every_name_is_on_the_page(found: tuple[Numbers, dict[str, Any]]) -> None:
    """And the page has no other."""
    text = PAGE.read_text(encoding="utf-8")
    assert set(found[0]) == set(NAME.findall(text))


def test_the_dashboard_asks_for_what_there_is(found: tuple[Numbers, dict[str, Any]]) -> None:
    """By names and labels that are measured, counters by how they grow."""
    board = json.loads(BOARD.read_text(encoding="utf-8"))
    asked = [target["expr"] for panel in board["panels"] for target in panel["targets"]]
    asked += [item["definition"] for item in board["templating"]["list"] if item["type"] == "query"]
    assert len(asked) > 20
    names = {name for text in asked for name in NAME.findall(text)}
    assert names <= set(found[0])
    for text in asked:
        assert re.findall(r"\{(\w+)[=~]", text) in ([], ["asset"])
        for name in NAME.findall(text):
            assert name.endswith("_total") == bool(re.search(rf"(rate|increase)\({name}", text)), text
    legends = [target["legendFormat"] for panel in board["panels"] for target in panel["targets"]]
    assert {word for text in legends for word in re.findall("{{(.*?)}}", text)} <= LABELS
    ids = [panel["id"] for panel in board["panels"]]
    assert len(ids) == len(set(ids))


@pytest.mark.parametrize("label", ['a"b', "a\\b", "a\nb", "a\\nb", "pümp", "", "{}=,"])
def test_any_label_comes_through_the_parser(label: str) -> None:
    """As it was."""
    text = exposition([Family("x", MetricKind.GAUGE, f"Of {label}.", [({"a": label, "b": "c"}, 0.1)])])
    assert numbers_of(text) == {"x": [({"a": label, "b": "c"}, 0.1)]}


@pytest.mark.parametrize("value", [0.0, 1e-300, 1.0 / 3.0, 123456789.0, 1764000000.25, float("inf")])
def test_any_number_comes_through_the_parser(value: float) -> None:
    """With fifteen digits; counters under their full name."""
    counter = Family("n", MetricKind.COUNTER, "N.", [({}, 2.0)])
    numbers = numbers_of(exposition([Family("x", MetricKind.GAUGE, "X.", [({}, value)]), counter]))
    assert of(numbers, "x") == pytest.approx(value, rel=1e-14)
    assert numbers["n_total"] == [({}, 2.0)]
