"""Where a store is: a file, or a database by an address, which is shown without its password."""

import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qsl, quote, urlencode, urlsplit, urlunsplit

from faultbond.errors import StoreError

SCHEMA = "faultbond"  # that a store is in where the address names none
FORM = "postgresql://USER@HOST[:PORT]/DATABASE[?schema=NAME]"
_SCHEMES = ("postgresql", "postgres")
_NAME = re.compile(r"[a-z_][a-z0-9_]{0,62}")
_HOST = r"(?:[\w.%-]*|\[[0-9a-fA-F:.]+\])(?::\d+)?"
_HOSTS = re.compile(f"{_HOST}(?:,{_HOST})*")


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerAddress:
    """A store in a server. shown: without password. conninfo: for the driver. schema: that the store has for itself."""

    shown: str
    conninfo: str
    schema: str


def store_address(text: str) -> Path | ServerAddress:
    """Give where a store is.

    Raises
    ------
    StoreError
        Where it is neither a file nor an address of PostgreSQL; a password in it is not repeated.
    """
    scheme, mark, _ = text.partition("://")
    if not mark:
        return Path(text)
    if scheme not in _SCHEMES:
        raise StoreError(f"{scheme}://...: expected a file, or {FORM}.")
    try:
        place = urlsplit(text)
    except ValueError:
        raise _mistake(scheme) from None  # its text would show the password
    people, _, hosts = place.netloc.rpartition("@")
    if "@" in people + place.path + place.query + place.fragment or not _HOSTS.fullmatch(hosts):
        raise _mistake(scheme)
    settings = parse_qsl(place.query, keep_blank_values=True)
    schema = dict(settings).get("schema", SCHEMA)
    if not _NAME.fullmatch(schema):
        raise StoreError(f"{scheme}://...: schema={schema}: a name has small letters, digits and _, a letter first.")
    rest = urlencode([item for item in settings if item[0] != "schema"], quote_via=quote)
    user = f"{people.partition(':')[0]}@" if people else ""
    own = "" if schema == SCHEMA else f"?schema={schema}"
    return ServerAddress(
        shown=f"{scheme}://{user}{hosts}{place.path}{own}",
        conninfo=urlunsplit((place.scheme, place.netloc, place.path, rest, "")),
        schema=schema,
    )


def shown_store(text: str) -> str:
    """Give what a store is called to people: its file, or its address without the password.

    Raises
    ------
    StoreError
        Where it is neither.
    """
    found = store_address(text)
    return found.shown if isinstance(found, ServerAddress) else text


def _mistake(scheme: str) -> StoreError:
    return StoreError(f"{scheme}://...: expected {FORM}; in a password write / @ : ? # as %2F %40 %3A %3F %23.")
