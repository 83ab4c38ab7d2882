"""Where a store is, as people write it; a password is never shown."""

from pathlib import Path

import pytest

from faultbond.errors import StoreError
from faultbond.service.store.address import SCHEMA, ServerAddress, shown_store, store_address


@pytest.mark.parametrize("text", ["plant.sqlite", "C:\\plant.sqlite", "/var/lib/plant:8.db"])
def test_a_file_is_a_file(text: str) -> None:
    """All that is no address."""
    assert store_address(text) == Path(text)
    assert shown_store(text) == text


@pytest.mark.parametrize(
    ("text", "shown", "schema"),
    [
        ("postgresql://ann@db.local/plant", "postgresql://ann@db.local/plant", SCHEMA),
        ("postgres://ann:se%40cret@db.local:5433/plant", "postgres://ann@db.local:5433/plant", SCHEMA),
        ("postgresql:///plant?host=/run/pg&password=secret", "postgresql:///plant", SCHEMA),
        (
            "postgresql://ann:secret@[::1]:5433/plant?schema=hall_7",
            "postgresql://ann@[::1]:5433/plant?schema=hall_7",
            "hall_7",
        ),
        ("postgresql://ann:secret@one,two:1/plant?sslmode=require", "postgresql://ann@one,two:1/plant", SCHEMA),
    ],
)
def test_an_address_is_shown_without_its_password(text: str, shown: str, schema: str) -> None:
    """The driver is given all that it knows, and a schema is ours."""
    found = store_address(text)
    assert isinstance(found, ServerAddress)
    assert (found.shown, found.schema, shown_store(text)) == (shown, schema, shown)
    assert "schema=" not in found.conninfo
    for setting in ("secret", "se%40cret", "sslmode=require"):
        assert (setting in found.conninfo) == (setting in text)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("mysql://ann:secret@db/plant", "expected a file, or postgresql://USER@HOST"),
        ("postgresql://ann:sec/ret@db/plant", "in a password write / @ : . # as %2F"),
        ("postgresql://ann:sec@ret@db/plant", "in a password write"),
        ("postgresql://ann:sec#ret@db/plant", "in a password write"),
        ("postgresql://ann:sec?ret@db/plant", "in a password write"),
        ("postgresql://ann:5?ret@db/plant", "in a password write"),
        ("postgresql://ann:secret@db/plant?schema=Hall 7", "schema=Hall 7: a name has small letters"),
        ("postgresql://ann:secret@[::1/plant", "in a password write"),
    ],
)
def test_what_is_no_address_is_refused(text: str, reason: str) -> None:
    """In one line, which does not repeat what may be a password."""
    with pytest.raises(StoreError, match=reason) as error:
        store_address(text)
    assert "sec" not in str(error.value)
    assert "ret@" not in str(error.value)
    assert "\n" not in str(error.value)
