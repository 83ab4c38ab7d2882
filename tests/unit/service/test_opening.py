"""From an address to its source, and what is wrong with an address."""

import ssl
from pathlib import Path

import pytest

from arriving import tank_subscriber
from faultbond.errors import FaultbondError
from faultbond.service.sources.growing_file import GrowingFile, Replay
from faultbond.service.sources.opening import client_context, open_source, shown_address, split_address
from faultbond.service.sources.simulated import SimulatedPlant
from faultbond.service.sources.standard_input import StandardInput


def test_each_address_has_its_source(tmp_path: Path) -> None:
    """The kind is told by what stands before the colon; the address is shown as it was given."""
    path = tmp_path / "a?b.csv"
    for address, kind in (
        ("-", StandardInput),
        ("sim:", SimulatedPlant),
        ("sim:?speed=10&seed=3&fault=K1=x1.85@60&fault=K6=x3@60,10/20&noise=1", SimulatedPlant),
        ("sim:?fault=none&speed=max", SimulatedPlant),
        (f"file:{path}", GrowingFile),
        (f"file:{path}?speed=10", Replay),
        (f"file:{path}?speed=max", Replay),
    ):
        source = open_source(address, [tank_subscriber()])
        assert isinstance(source, kind)
        assert source.address == address
    assert open_source(f"file://{path}", [tank_subscriber()]).address == f"file:{path}"


def test_no_source_is_asked_by_what_came_before_tls_1_2() -> None:
    """Whatever the system leaves to its OpenSSL."""
    assert client_context("", "", "").minimum_version >= ssl.TLSVersion.TLSv1_2


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("", "expected sim:"),
        ("simm:", "Did you mean sim:?"),
        ("http://plant", "source 'http://plant': expected sim:, file:PATH"),
        ("/", "write file:/ to follow the file"),
        ("file:", "name the file, as in file:plant.csv"),
        ("file:/tmp", "this is a folder"),
        ("file:plant.csv?speed=0", "speed=0: expected a number above 0, or max"),
        ("file:plant.csv?speed=fast", "speed=fast: expected a number above 0, or max"),
        ("file:plant.csv?sped=1", "no setting 'sped'. Did you mean speed?"),
        ("file:plant.parquet", "a Parquet file does not grow"),
        ("sim:tank", "nothing stands between sim: and the settings"),
        ("sim:?speed=1&speed=2", "speed is given 2 times"),
        ("sim:?seed=-1", "seed=-1: expected a whole number"),
        ("sim:?noise=yes", "noise=yes: expected 0 or 1"),
        ("sim:?fault=K1=x2", "expected NAME=VALUE@TIME"),
        ("sim:?fault=K9=x2@60", "source sim: "),
        ("sim:?fault=K9=x2@60", "no parameter K9"),
        ("sim:?fault=K1=x2@2026-01-01T00:00:00Z", "not a date"),
    ],
)
def test_mistakes_are_told_in_one_line(address: str, message: str) -> None:
    """What is wrong, what was expected, and what it may have been."""
    with pytest.raises(FaultbondError) as caught:
        open_source(address, [tank_subscriber()])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert type(caught.value) is FaultbondError


def test_a_source_feeds_somebody() -> None:
    """One that no asset reads is a mistake of the site."""
    with pytest.raises(FaultbondError, match="source 'sim:': no asset reads it"):
        open_source("sim:", [])


def test_settings_stand_behind_the_last_question_mark() -> None:
    """A `?` of a path stays one, and a sign in a number stays what it is."""
    assert split_address("file:a?b.csv") == ("file:a?b.csv", {})
    assert split_address("file:a?b.csv?speed=2") == ("file:a?b.csv", {"speed": ["2"]})
    assert split_address("sim:?fault=K1=1e+3@5&x=%20") == ("sim:", {"fault": ["K1=1e+3@5"], "x": [" "]})
    assert shown_address("mqtt://me:secret@host/x") == "mqtt://me:***@host/x"
    assert shown_address("mqtt://me@host/x") == "mqtt://me@host/x"
