"""What a service watches, and how: from the command line, or from a file `site.yaml`."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from faultbond.app.plant import WatchedPlant, find_plant
from faultbond.app.wishes import DEMO, Wanted
from faultbond.errors import FaultbondError, ModelError
from faultbond.io.examples import example
from faultbond.model.document import read_document
from faultbond.model.source import NAME, Items, Node, Source, Table, Text
from faultbond.model.yaml_nodes import read_yaml
from faultbond.service.sources.options import SourceOptions
from faultbond.types import TimeGrid

HOST, PORT = "127.0.0.1", 8350
STORE = Path("faultbond.sqlite")
SIMULATED = "sim:"
SHOWN = "sim:?speed=10"  # of the built-in plant: its fault comes after half a minute
ROLES = ("view", "operate", "engineer")
_KEYS = ("name", "store", "listen", "source", "connection", "accept", "assets", "users", "keep")
_CONNECTION = ("user", "password_file", "authority", "certificate", "key", "server_certificate")
_ASSET = ("model", "source", "accept", "topic", "nodes", "hold")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SiteAsset:
    """An asset.

    source: address of its source. accept: probability from which a rule accepts, or None. topic, nodes, hold: see
    `SourceOptions`; empty where the source finds its values by itself, hold None where the model says what holds.
    """

    name: str
    plant: WatchedPlant
    source: str = SIMULATED
    accept: float | None = None
    topic: str = ""
    nodes: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    hold: tuple[str, ...] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class User:
    """Who may log in. password: its hash, as `faultbond serve --hash` writes it. role: one of `ROLES`."""

    name: str
    password: str
    role: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Site:
    """All that a service is told.

    store: file, or address of a database. days: for how long rows and curves are kept; None: for ever. users: none:
    whoever sits at this machine is an engineer. connection: names and files of the log-in at sources, as the fields of
    `SourceOptions`.
    """

    name: str
    assets: tuple[SiteAsset, ...]
    store: str = str(STORE)
    host: str = HOST
    port: int = PORT
    days: float | None = None
    users: Mapping[str, User] = field(default_factory=lambda: MappingProxyType({}))
    connection: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    def options(self, address: str) -> SourceOptions:
        """Give what is said of a source beside its address."""
        fed = [item for item in self.assets if item.source == address]
        more: dict[str, Any] = dict(self.connection)
        hold = {item.name: item.hold for item in fed if item.hold is not None}
        return SourceOptions(
            nodes={item.name: item.nodes for item in fed if item.nodes},
            topics={item.name: item.topic for item in fed if item.topic},
            hold=hold or None,
            **more,
        )


def site_of(
    models: Sequence[Path], *, source: str | None, store: str | None, port: int | None, accept: float | None
) -> Site:
    """Give the site that a command line names; without a model the built-in tank.

    Raises
    ------
    FaultbondError
        Where a model cannot be read, or two would have the same name.
    """
    paths = list(models) or [example(DEMO) / "model.yaml"]
    assets = list[SiteAsset]()
    for path in paths:
        name = path.stem if path.stem != "model" else path.resolve().parent.name
        if any(item.name == name for item in assets):
            raise FaultbondError(f"{path}: there is an asset {name} already. Name them in a site file, by --site.")
        usual = SIMULATED if models else SHOWN
        assets.append(SiteAsset(name=name, plant=_plant(path), source=source or usual, accept=accept))
    names = ", ".join(item.name for item in assets)
    return Site(name=names, assets=tuple(assets), store=store or str(STORE), port=PORT if port is None else port)


def read_site(path: Path, *, port: int | None = None) -> Site:
    """Give the site of a file; paths in it are taken from where it lies. port: another one than the file says.

    Raises
    ------
    ModelError
        Where the file cannot be read or says what no site has, by its line.
    """
    document = read_document(path)
    source = Source(document.label)
    top = read_yaml(document.text, source)
    told = _table(top, source, _KEYS)
    listed = told.get("assets")
    if not isinstance(listed, Table) or not listed.entries:
        raise source.error(top.line, "no assets; write `assets: {NAME: {model: FILE}}`")
    listen = _table(told["listen"], source, ("address", "port")) if "listen" in told else {}
    keep = _table(told["keep"], source, ("days",)) if "keep" in told else {}
    connection = _table(told["connection"], source, _CONNECTION) if "connection" in told else {}
    usual = _text(told.get("source"), source) or SIMULATED
    accept = _number(told.get("accept"), source, 0.5, 1.0)
    own = _number(listen.get("port"), source, 0.0, 65535.0)
    return Site(
        name=_text(told.get("name"), source) or path.stem,
        assets=tuple(_assets(listed, source, path.parent, usual, accept)),
        store=_beside(path.parent, _text(told.get("store"), source) or str(STORE)),
        host=_text(listen.get("address"), source) or HOST,
        port=port if port is not None else PORT if own is None else int(own),
        days=_number(keep.get("days"), source, 1e-3, 1e6),
        users=MappingProxyType(dict(_users(told.get("users"), source))),
        connection=MappingProxyType(
            {
                name: _text(node, source) if name == "user" else str(path.parent / _text(node, source))
                for name, node in connection.items()
            }
        ),
    )


def _assets(listed: Table, source: Source, folder: Path, usual: str, accept: float | None) -> Iterator[SiteAsset]:
    for entry in listed.entries:
        if not NAME.fullmatch(entry.key):
            raise source.error(entry.line, f"asset `{entry.key}`: a name has letters, digits and _, a letter first")
        told = _table(entry.value, source, _ASSET)
        model = _text(told.get("model"), source)
        if not model:
            raise source.error(entry.line, f"asset {entry.key} has no model; write `model: FILE`")
        own = _number(told.get("accept"), source, 0.5, 1.0)
        yield SiteAsset(
            name=entry.key,
            plant=_plant(folder / model),
            source=_text(told.get("source"), source) or usual,
            accept=accept if own is None else own,
            topic=_text(told.get("topic"), source),
            nodes=MappingProxyType(dict(_texts(told.get("nodes"), source))),
            hold=_listed(told["hold"], source) if "hold" in told else None,
        )


def _users(node: Node | None, source: Source) -> Iterator[tuple[str, User]]:
    if node is None:
        return
    if not isinstance(node, Table):
        raise source.error(node.line, "users; write `users: {NAME: {role: operate, password: HASH}}`")
    for entry in node.entries:
        told = _table(entry.value, source, ("role", "password"))
        role, password = (_text(told.get(key), source) for key in ("role", "password"))
        if role not in ROLES or not password:
            raise source.error(entry.line, f"user {entry.key} needs a role, one of {', '.join(ROLES)}, and a password")
        yield entry.key, User(name=entry.key, role=role, password=password)


def _plant(path: Path) -> WatchedPlant:
    plant = find_plant(path, Wanted())
    if plant.graph.grid is TimeGrid.NONE:
        raise ModelError(f"{path}: a network without time has no samples to watch. Give a model with a sample_time.")
    return plant


def _beside(folder: Path, store: str) -> str:
    """Give a file of a site as it is found from here; an address of a database stays."""
    return store if "://" in store else str(folder / store)


def _table(node: Node, source: Source, keys: Sequence[str]) -> dict[str, Node]:
    if not isinstance(node, Table):
        raise source.error(node.line, f"expected a table with {', '.join(keys)}")
    for entry in node.entries:
        if entry.key not in keys:
            raise source.error(entry.line, f"unknown key `{entry.key}`; there are {', '.join(keys)}")
    return {entry.key: entry.value for entry in node.entries}


def _texts(node: Node | None, source: Source) -> Iterator[tuple[str, str]]:
    if node is None:
        return
    if not isinstance(node, Table):
        raise source.error(node.line, "expected a table of texts, `COLUMN: NODE`")
    for entry in node.entries:
        yield entry.key, _text(entry.value, source)


def _listed(node: Node, source: Source) -> tuple[str, ...]:
    if not isinstance(node, Items):
        raise source.error(node.line, "expected a list of columns, `[flow, level]`")
    return tuple(_text(item, source) for item in node.items)


def _text(node: Node | None, source: Source) -> str:
    if node is None:
        return ""
    if not isinstance(node, Text):
        raise source.error(node.line, "expected a text")
    return node.value


def _number(node: Node | None, source: Source, least: float, most: float) -> float | None:
    text = _text(node, source)
    if node is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not least <= value <= most:
        raise source.error(node.line, f"`{text}`: expected a number from {least:g} to {most:g}")
    return value
