"""What births, data and deaths of Sparkplug B become: rows, counts, and whether an asset has data."""

import asyncio
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("aiomqtt", reason="there is no aiomqtt: pip install 'faultbond[mqtt]'")
pytest.importorskip("google.protobuf", reason="there is no protobuf: pip install 'faultbond[mqtt]'")

from arriving import COLUMNS, Gathered, subscriber
from faultbond.errors import FaultbondError
from faultbond.io.recording import Column
from faultbond.model.graph import Unit
from faultbond.service.sources import sparkplug
from faultbond.service.sources.intake import Intake
from faultbond.service.sources.opening import open_source
from faultbond.service.sources.options import SourceOptions
from faultbond.service.sources.queue import ArrivalQueue
from faultbond.service.sources.sparkplug import EdgeNodes
from faultbond.service.sources.sparkplug_payload import SparkplugPayload, typed_value
from sparkplug_node import (
    BOOLEAN,
    DATASET,
    DOUBLE,
    FLOAT,
    INT8,
    INT32,
    STRING,
    EdgeNode,
    Message,
    counted,
    metric,
    payload,
    whole,
)

HOLDS = SourceOptions(hold={"one": ("u",)})
ALONE = SourceOptions(hold={"one": ()}, together=0.0)
PUMP = "spBv1.0/hall/+/gateway/pump"
ROW = [("u", 50.0), ("y", 2.5), ("z", 20.0)]
SI = [50.0, 2500.0, 293.15]


def named(at: float, *, first: int = 0) -> list[bytes]:
    """Give the metrics of a birth, with aliases."""
    return [metric(name, value, alias=first + k, at=at) for k, (name, value) in enumerate(ROW)]


def by_alias(at: float, *, first: int = 0) -> list[bytes]:
    """Give the same values as data tell them: without names and types."""
    return [metric(None, value, alias=first + k, at=at, is_typed=False) for k, (_, value) in enumerate(ROW)]


def heard(
    messages: Sequence[Message | tuple[str, bytes, bool]], options: SourceOptions | None = None, topic: str = PUMP
) -> Gathered:
    """Let an asset hear messages, of which some say that the broker had them from before."""

    async def play() -> Gathered:
        queue = ArrivalQueue([subscriber()], 1000)
        intake = Intake(subscriber(), options or ALONE, queue)
        nodes = EdgeNodes([(topic, intake)])
        for name, data, *kept in messages:
            nodes.take(name, data, is_kept=any(kept))
        intake.close()
        return Gathered(list(queue.drain()))

    return asyncio.run(play())


def stale(found: Gathered) -> str | None:
    """Give what was told last of whether the values are of now."""
    return next((item.stale for item in found.arrivals if item.stale is not None), None)


def test_a_birth_names_what_data_tell_by_alias() -> None:
    """Each is a row at the time of its metrics, in the units of the model."""
    node = EdgeNode()
    messages = [node.birth(), node.device_birth(*named(10.0)), node.data(*by_alias(11.0)), node.data(*by_alias(12.5))]
    found = heard(messages)
    np.testing.assert_allclose(found.rows(), [[10.0, *SI], [11.0, *SI], [12.5, *SI]])
    assert found.counts() == {}
    assert stale(found) == ""


def test_a_column_is_the_end_of_a_metrics_path() -> None:
    """Of the node, of a device, in folders; other names, commands and the session's number are passed over."""
    node = EdgeNode()
    values = [metric("Tank/u", 50.0), metric("Tank/Level/y", 2.5), metric("z", 20.0), metric("other", 1.0)]
    commands = [metric("Node Control/y", 7.0), metric("Device Control/z", 7.0)]
    assert heard([node.birth(*values, *commands, at=3.0)], topic="spBv1.0/hall/+/gateway").rows().tolist() == [
        [3.0, *SI]
    ]
    found = heard([node.device_birth(metric("xy", 1.0))])
    assert found.counts() == {"unknown": 1}


def test_of_two_columns_that_end_a_path_the_longer_is_meant() -> None:
    """As where devices have metrics of one name."""
    names = ("y", "pump/y", "fan/Motor/y")
    columns = replace(COLUMNS, outputs=tuple(Column(header=name, unit=Unit("Pa"), role=name) for name in names))
    node = EdgeNode()

    async def play() -> Gathered:
        queue = ArrivalQueue([subscriber("one", columns)], 1000)
        intake = Intake(subscriber("one", columns), ALONE, queue)
        nodes = EdgeNodes([("spBv1.0/hall/+/gateway/#", intake)])
        for device, name, value in (("pump", "y", 1.0), ("fan", "Motor/y", 2.0), ("vent", "Motor/y", 3.0)):
            nodes.take(*node.data(metric(name, value, at=1.0), device=device), is_kept=False)
        intake.close()
        return Gathered(list(queue.drain()))

    np.testing.assert_allclose(asyncio.run(play()).rows(), [[1.0, math.nan, 3.0, 1.0, 2.0]])


@pytest.mark.parametrize(
    ("topic", "reads"),
    [
        (PUMP, True),
        ("spBv1.0/hall/+/gateway", False),
        ("spBv1.0/hall/+/gateway/#", True),
        ("spBv1.0/hall/+/gateway/+", True),
        ("spBv1.0/hall/+/#", True),
        ("spBv1.0/+/+/+/pump", True),
        ("spBv1.0/hall/+/gateway/fan", False),
        ("spBv1.0/yard/+/gateway/pump", False),
    ],
)
def test_a_filter_says_whose_values_are_read(topic: str, *, reads: bool) -> None:
    """Of one device, of the node alone, or of all of it; a device that is not read takes no part, and is no gap."""
    node = EdgeNode()
    found = heard([node.birth(), node.device_birth(*named(1.0)), node.data(*by_alias(2.0))], topic=topic)
    assert sum(len(item.rows) for item in found.arrivals) == 2 * reads
    assert found.counts() == {}


def test_two_devices_have_aliases_of_their_own() -> None:
    """The same alias means what the birth of its device says."""
    node = EdgeNode()
    other = [metric("y", 9.0, alias=0, at=1.0), metric("u", 1.0, alias=1, at=1.0), metric("z", 1.0, alias=2, at=1.0)]
    messages = [node.device_birth(*named(1.0)), node.device_birth(*other, device="fan"), node.data(*by_alias(2.0))]
    np.testing.assert_allclose(heard(messages).rows(), [[1.0, *SI], [2.0, *SI]])


def test_a_value_has_its_time_else_that_of_its_payload() -> None:
    """Without either it is the moment of arrival; an older one, as of history, is a row that the grid judges."""
    node = EdgeNode()
    birth = node.device_birth(*[metric(name, value) for name, value in ROW], at=5.0)
    old = node.data(*[metric(name, value, at=4.0, is_historical=True) for name, value in ROW], at=6.0)
    now = node.data(*[metric(name, value) for name, value in ROW], at=None)
    rows = heard([birth, old, now]).rows()
    assert sorted(rows[:, 0])[:2] == [4.0, 5.0]
    assert max(rows[:, 0]) > 1.7e9


def test_null_is_missing_and_quality_is_heeded() -> None:
    """Of Sparkplug (192 good, 500 stale, 0 bad), of OPC and of Ignition; null is no fault of the instrument."""
    node = EdgeNode()
    rows = [
        [metric("u", at=1.0), metric("y", 2.5, at=1.0, quality=192), metric("z", 20.0, at=1.0, quality=500)],
        [metric("u", 50.0, at=2.0, quality=64), metric("y", 2.5, at=2.0, quality=0), metric("z", 20.0, at=2.0)],
        [
            metric("u", 50.0, at=3.0, quality=1073742081),
            metric("y", 2.5, at=3.0, quality=-2147483136),
            metric("z", 20.0, at=3.0, quality=203),
        ],
    ]
    found = heard([node.birth(), *[node.device_birth(*rows[0])], *[node.data(*row) for row in rows[1:]]])
    expected = [[1.0, math.nan, 2500.0, math.nan], [2.0, 50.0, math.nan, 293.15], [3.0, 50.0, math.nan, 293.15]]
    np.testing.assert_allclose(found.rows(), expected)
    assert found.counts() == {"bad": 3, "uncertain": 2}
    null = metric("y", 7.0, at=1.0) + whole(7, 1)
    assert np.isnan(heard([node.device_birth(metric("u", 50.0, at=1.0), null)]).rows()[0, 2]), "whatever it has beside"


def test_whole_numbers_are_read_by_the_type_of_their_birth() -> None:
    """Signed ones are two's complement; other types are numbers, too; a data set is none."""
    node = EdgeNode()
    birth = node.device_birth(
        metric("y", 1, INT8, alias=0, at=1.0),
        metric("z", 1, INT32, alias=1, at=1.0),
        metric("u", True, BOOLEAN, at=1.0),
    )
    below = node.data(
        metric(None, -5, INT8, alias=0, at=2.0, is_typed=False),
        metric(None, -2, INT32, alias=1, at=2.0, is_typed=False),
        metric("u", "21.5", STRING, at=2.0),
    )
    odd = node.data(
        metric("u", 0.5, FLOAT, at=3.0), metric("y", b"", DATASET, at=3.0), metric("z", "warm", STRING, at=3.0)
    )
    found = heard([birth, below, odd])
    expected = [[1.0, 1.0, 1000.0, 274.15], [2.0, 21.5, -5000.0, 271.15], [3.0, 0.5, math.nan, math.nan]]
    np.testing.assert_allclose(found.rows(), expected)
    assert found.counts() == {"unreadable": 2}


@settings(deadline=None)
@given(st.integers(1, 8), st.integers(0, 2**64 - 1))
def test_a_whole_number_lies_in_the_range_of_its_type(datatype: int, travels: int) -> None:
    """And a signed one that is in range comes back from its complement, of whichever width."""
    bits = 8 << (datatype - 1) % 4
    value = travels % 2**bits - (2 ** (bits - 1) if datatype < 5 else 0)
    widths = {bits, 32, 64} if bits <= 32 else {64}
    assert {typed_value(value % 2**width, datatype) for width in widths} == {value}


# What nobody has named, and what is lost.


def test_values_without_a_birth_are_counted_and_told() -> None:
    """By alias, or whole numbers without a type; no rebirth is asked for, the next birth is waited for."""
    node = EdgeNode()
    before = node.data(*by_alias(1.0), metric("u", 5, INT32, at=1.0, is_typed=False))
    found = heard([before])
    assert found.counts() == {"unborn": 4}
    assert stale(found) == "device pump of gateway sends what only its birth would name, and this has not been seen yet"
    found = heard([before, node.device_birth(*named(2.0)), node.data(*by_alias(3.0))])
    np.testing.assert_allclose(found.rows(), [[2.0, *SI], [3.0, *SI]])
    assert stale(found) == ""


def test_values_that_say_their_names_need_no_birth() -> None:
    """As those of nodes without aliases, after a start of the service."""
    node = EdgeNode()
    found = heard([node.data(*[metric(name, value, at=1.0) for name, value in ROW])])
    np.testing.assert_allclose(found.rows(), [[1.0, *SI]])
    assert (found.counts(), stale(found)) == ({}, "")


def test_births_that_a_broker_kept_give_the_names_alone() -> None:
    """What they measured is of the past; what follows is read at once, and is no gap."""
    node = EdgeNode()
    births = [node.birth(), node.device_birth(*named(1.0))]
    kept = [(f"$sparkplug/certificates/{name}", data, True) for name, data in births]
    node.seq = 200
    found = heard([*kept, node.data(*by_alias(2.0)), node.data(*by_alias(3.0))])
    np.testing.assert_allclose(found.rows(), [[2.0, *SI], [3.0, *SI]])
    assert found.counts() == {}
    assert heard([item[:2] for item in kept]).arrivals == [], "a new one came as the birth itself, too"
    assert heard([(*node.data(*named(1.0)), True), (*node.device_death(), True)]).counts() == {"retained": 2}


def test_what_was_seen_of_now_goes_before_a_birth_that_was_kept() -> None:
    """A death, or the birth of another session; a death after it is of it."""
    node, other = EdgeNode(), EdgeNode()
    births = [node.birth(), node.device_birth(*named(1.0))]
    kept = [(f"$sparkplug/certificates/{name}", data, True) for name, data in births]
    dead = {"deaths": 1, "unborn": 3}
    assert heard([*births, node.device_death(), *kept, node.data(*by_alias(2.0))]).counts() == dead
    assert heard([node.death(), *kept, node.data(*by_alias(2.0))]).counts() == dead
    assert heard([*kept, node.death(), node.data(*by_alias(2.0))]).counts() == dead
    new = [other.birth(at=5.0), other.device_birth(*named(5.0, first=7), at=5.0)]
    assert len(heard([*new, *kept, other.data(*by_alias(6.0, first=7))]).rows()) == 2


def test_sequence_numbers_wrap_and_gaps_are_counted() -> None:
    """After 255 comes 0; what is lost or out of turn is a gap, also of another device of the node."""
    node = EdgeNode()
    begun = [node.birth(), node.device_birth(*named(0.0))]
    data = [node.data(*by_alias(1.0 + k)) for k in range(600)]
    assert heard([*begun, *data]).counts() == {}
    assert len(heard([*begun, *data]).rows()) == 601
    without = [*data[:100], *data[103:]]
    assert heard([*begun, *without]).counts() == {"sequence gap": 1}
    fan = [node.birth(), node.device_birth(*named(0.0)), node.data(device="fan"), node.data(*by_alias(1.0))]
    assert heard(fan).counts() == {}
    assert heard([*fan[:2], fan[3]]).counts() == {"sequence gap": 1}
    assert heard([*begun, node.birth(at=1.0), node.device_birth(*named(1.0), at=1.0)]).counts() == {}


# Deaths.


def test_after_its_death_a_device_has_no_data_until_its_birth() -> None:
    """What comes by name meanwhile is counted; the input that held holds no more."""
    node = EdgeNode()
    begun = [node.birth(), node.device_birth(*named(1.0))]
    dead = [*begun, node.device_death(), node.data(*named(2.0))]
    found = heard(dead, HOLDS)
    assert found.counts() == {"deaths": 1, "unborn": 3}
    assert stale(found) == "device pump of gateway is dead, and what it sent is of the past until its next birth"
    assert heard([node.device_death(), node.data(*named(2.0))]).counts() == {"deaths": 1, "unborn": 3}
    without_input = node.device_birth(*named(3.0)[1:], at=3.0)
    found = heard([*dead, without_input], HOLDS)
    np.testing.assert_allclose(found.rows()[-1], [3.0, math.nan, *SI[1:]])
    assert stale(found) == ""


def test_a_dead_node_takes_its_devices_along() -> None:
    """After its birth a device is to be born, too; until then its values are not read."""
    node = EdgeNode(bd_seq=4)
    begun = [node.birth(), node.device_birth(*named(1.0)), node.death()]
    found = heard([*begun, node.data(*by_alias(2.0))])
    assert found.counts() == {"deaths": 1, "unborn": 3}
    assert stale(found) == "edge node gateway is dead, and what it sent is of the past until its next birth"
    again = EdgeNode(bd_seq=5)
    risen = [*begun, again.birth(at=3.0)]
    found = heard([*risen, again.data(*by_alias(4.0), device="pump")])
    assert found.counts() == {"deaths": 1, "unborn": 3}
    assert "gateway is dead" in str(stale(found))
    again = EdgeNode(bd_seq=5)
    risen = [*begun, again.birth(at=3.0), again.device_birth(*named(3.0), at=3.0), again.data(*by_alias(4.0))]
    found = heard(risen)
    assert (found.counts(), stale(found)) == ({"deaths": 1}, "")
    np.testing.assert_allclose(found.rows()[:, 0], [1.0, 3.0, 4.0])


def test_a_death_of_another_session_says_nothing() -> None:
    """A will that comes after the next birth is known by its number."""
    old, new = EdgeNode(bd_seq=7), EdgeNode(bd_seq=8)
    begun = [old.birth(), new.birth(at=1.0), new.device_birth(*named(1.0), at=1.0)]
    found = heard([*begun, old.death(), new.data(*by_alias(2.0))])
    assert (found.counts(), stale(found)) == ({"unknown": 1}, "")
    assert len(found.rows()) == 2
    assert "dead" in str(stale(heard([*begun, new.death()])))


def test_a_node_born_anew_without_its_device_has_none() -> None:
    """Until the device is born again; where its birth overtook that of the node, it has been."""
    node = EdgeNode()
    begun = [node.birth(), node.device_birth(*named(1.0), at=1.0), node.birth(at=5.0)]
    found = heard([*begun, node.data(*by_alias(6.0))])
    assert stale(found) == "device pump of gateway has not been born again since its node was"
    assert found.counts() == {"unborn": 3}
    early = node.device_birth(*named(5.1), at=5.1)
    found = heard([*begun[:2], early, node.birth(at=5.0), node.data(*by_alias(6.0))])
    np.testing.assert_allclose(found.rows()[:, 0], [1.0, 5.1, 6.0])
    assert stale(found) == ""
    named_only = heard([EdgeNode().data(*named(1.0)), EdgeNode().birth(at=5.0)])
    assert "not been born again" in str(stale(named_only)), "also one whose birth was never seen"


def test_an_asset_lives_while_one_of_its_devices_does() -> None:
    """The columns of the dead one are missing."""
    node = EdgeNode()
    messages = [
        node.birth(),
        node.device_birth(*named(1.0)[:2], device="pump"),
        node.device_birth(*named(1.0)[2:], device="fan"),
        node.device_death("fan"),
        node.data(*by_alias(2.0)[:2]),
    ]
    found = heard(messages, topic="spBv1.0/hall/+/gateway/#")
    np.testing.assert_allclose(found.rows(), [[1.0, *SI], [2.0, 50.0, 2500.0, math.nan]])
    assert (found.counts(), stale(found)) == ({"deaths": 1}, "")


# Damaged payloads.


def test_of_too_many_devices_the_first_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """Until its next birth; those that nobody reads take no room."""
    monkeypatch.setattr(sparkplug, "MOST_DEVICES", 2)
    node = EdgeNode()
    born = [node.birth(), *(node.device_birth(*named(1.0), device=name) for name in ("first", "second", "third"))]
    some = [node.data(*by_alias(2.0), device=name) for name in ("second", "third")]
    assert heard([*born, *some], topic="spBv1.0/hall/+/gateway/#").counts() == {}
    lost = node.data(*by_alias(3.0), device="first")
    assert heard([*born, *some, lost], topic="spBv1.0/hall/+/gateway/#").counts() == {"unborn": 3}
    node = EdgeNode()
    of_nobody = (node.device_birth(device=f"other {k}") for k in range(5))
    begun = [node.birth(), node.device_birth(*named(1.0)), *of_nobody]
    assert heard([*begun, node.data(*by_alias(2.0))]).counts() == {}


def test_what_is_no_payload_is_counted() -> None:
    """Not protobuf, a text that is none, one that is compressed, a megabyte, too many metrics."""
    topic = EdgeNode().topic("DDATA", "pump")
    for data, name in (
        (b"\xff", "unreadable"),
        (b"{}", "unreadable"),
        (payload([metric("u", 1.0)])[:-3], "unreadable"),
        (payload([counted(1, b"\xff\xfe") + whole(10, 1)]), "unreadable"),
        (counted(4, "SPBV1.0_COMPRESSED") + counted(5, b"x"), "unreadable"),
        (counted(5, b" " * 2**20), "oversized"),
        (payload([b""] * 10_001), "oversized"),
    ):
        assert heard([(topic, data)]).counts()[name] == 1
    node = EdgeNode()
    for name in (
        node.topic("NCMD"),
        "spBv1.0/STATE/host",
        "spBv1.0/hall/DDATA/gateway",
        "spBv1.0/hall/NDATA/gateway/a/b",
    ):
        assert heard([(name, b"\xff")], topic="spBv1.0/+/+/#").counts() == {}


def test_fields_that_nobody_knows_are_passed_over() -> None:
    """As those of later versions, or of a vendor."""
    item = metric("u", 50.0, at=1.0) + counted(8, b"\x0a\x01a") + counted(99, b"more") + whole(6, 1)
    found = heard([(EdgeNode().topic("DDATA", "pump"), payload([item]) + counted(77, "more"))])
    np.testing.assert_allclose(found.rows(), [[1.0, 50.0, math.nan, math.nan]])


KINDS = ("NBIRTH", "DBIRTH", "NDATA", "DDATA", "NDEATH", "DDEATH")


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """Give a payload of which bytes were changed, taken away or put in."""
    metrics = [metric("bdSeq", 3, DOUBLE), *named(1.0), *by_alias(2.0), metric("y", -1, INT32, quality=0)]
    data = bytearray(payload(metrics, at=1.0, seq=draw(st.integers(0, 300))))
    for _ in range(draw(st.integers(1, 6))):
        place = draw(st.integers(0, len(data) - 1)) if data else 0
        data[place : place + draw(st.integers(0, 4))] = draw(st.binary(max_size=4))
    return bytes(data)


@settings(deadline=None)
@given(st.lists(st.tuples(st.sampled_from(KINDS), st.one_of(st.binary(max_size=60), damaged()), st.booleans())))
def test_nothing_that_comes_stops_it(messages: list[tuple[str, bytes, bool]]) -> None:
    """Whatever the bytes, each payload is either read or counted, and a birth and data behind it are read."""
    node = EdgeNode(bd_seq=9)
    odd = [(node.topic(kind, "pump" if kind[0] == "D" else ""), data, kept) for kind, data, kept in messages]

    def readable(data: bytes) -> bool:
        try:
            list(SparkplugPayload.of(data).metrics())
        except ValueError:
            return False
        return True

    of_now = [node.birth(at=9e9), node.device_birth(*named(9e9), at=9e9), node.data(*by_alias(9e9 + 1))]
    found = heard([*odd, *of_now])
    counts = found.counts()
    refused = sum(not readable(data) for name, data, kept in odd if "BIRTH" in name or not kept)
    assert counts.get("unreadable", 0) >= refused
    assert counts.get("retained", 0) == sum(kept and "BIRTH" not in name for name, _, kept in odd)
    rows = found.rows()
    np.testing.assert_allclose(rows[np.isin(rows[:, 0], [9e9, 9e9 + 1])][-2:, 1:], [SI, SI])


# Addresses.


@pytest.mark.parametrize(
    "topic",
    ["spBv1.0", "spBv1.0/#", "spBv1.0/hall/DDATA/gateway/pump", "spBv1.0/hall/+/gateway/pump/flow", "spBv1.0/hall/#"],
)
def test_a_filter_that_misses_births_is_told(topic: str) -> None:
    """With the form that is meant, and nothing is connected."""
    with pytest.raises(FaultbondError, match=r"is no topic of Sparkplug B for one\. Write spBv1\.0/GROUP/\+/NODE or "):
        open_source(f"mqtt://host/{topic}", [subscriber()])
