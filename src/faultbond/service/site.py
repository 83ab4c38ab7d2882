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
from faultbond.model.keys import TEXT, Key, Keys
from faultbond.model.source import Entry, Source, choice, shown, shown_path
from faultbond.model.spot import Spot
from faultbond.model.yaml_nodes import read_yaml
from faultbond.service.sinks.options import KINDS, SinkOptions
from faultbond.service.sources.opening import topic_filters
from faultbond.service.sources.options import SourceOptions
from faultbond.service.sources.sparkplug_topic import is_sparkplug, whole_node
from faultbond.service.web.security import check_hash
from faultbond.types import LOWEST_LEVEL, TimeGrid

HOST, PORT = "127.0.0.1", 8350
STORE = Path("faultbond.sqlite")
SIMULATED = "sim:"
SHOWN = "sim:?speed=5&fault=K1=x1.85@300"  # of the built-in plant: after a minute, when much flows through the pipe
ROLES = ("view", "operate", "engineer")

ASSETS = "write `assets: {NAME: {model: FILE}}`"
_FILE = Key(TEXT, "a file, taken from where the site file lies")
SITE_KEYS = Keys(
    {
        "name": Key(TEXT, "what the page calls it"),
        "store": Key(TEXT, "file, or address of a database"),
        "listen": Key({}, "where the page is, and by which certificate"),
        "source": Key(TEXT, "address of the measurements of those assets that name none"),
        "connection": Key({}, "how to log in at sources"),
        "accept": Key({}, "probability from which a rule accepts a diagnosis"),
        "assets": Key({}, missing=ASSETS),
        "users": Key({}, "who may log in"),
        "tell": Key({}, "whom the service tells what it finds"),
        "keep": Key({}, "for how many `days` rows and curves are kept"),
    }
)
LISTEN_KEYS = Keys(
    {
        "address": Key(TEXT),
        "port": Key({}),
        "certificate": _FILE,
        "key": _FILE,
        "names": Key({}, "under which the page is asked, beside the address and those of the certificate"),
        "unencrypted": Key({}, "`yes`: others may come without TLS, as where a proxy that has it stands before"),
    }
)
KEEP_KEYS = Keys({"days": Key({})})
CONNECTION_KEYS = Keys(
    {"user": Key(TEXT)}
    | dict.fromkeys(("password_file", "authority", "certificate", "key", "server_certificate"), _FILE)
)
ASSET_KEYS = Keys(
    {
        "model": Key(TEXT, missing="write `model: FILE`"),
        "source": Key(TEXT),
        "accept": Key({}),
        "topic": Key(TEXT, "filter of its MQTT topics"),
        "nodes": Key({}, "OPC UA node by column"),
        "hold": Key({}, "columns whose last value holds until the next one"),
    }
)
USER_KEYS = Keys(
    {
        "role": Key({}, missing=f"write one of {', '.join(ROLES)}"),
        "password": Key(TEXT, missing="write the hash that `faultbond serve --hash` gives"),
    }
)
SINK_FILES = ("password_file", "authority", "certificate", "key", "token_file", "secret_file")
SINK_KEYS = Keys(
    {
        "to": Key(TEXT, "its address", missing="write `to: ADDRESS`"),
        "kinds": Key({}, "of records; default: all"),
        "user": Key(TEXT),
        "give_up": Key(TEXT, "time without success after which a record is passed over; default: never"),
    }
    | dict.fromkeys(SINK_FILES, _FILE),
    short="to",
)


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

    store: file, or address of a database. certificate, key: files for TLS of the page; empty: there is none. names:
    under which it is asked beside its address. unencrypted: whether others may come without TLS. days: for how long
    rows and curves are kept; None: for ever. users: none: whoever sits at this machine is an engineer. connection:
    names and files of the log-in at sources, as the fields of `SourceOptions`. tell: whom it tells.
    """

    name: str
    assets: tuple[SiteAsset, ...]
    store: str = str(STORE)
    host: str = HOST
    port: int = PORT
    certificate: str = ""
    key: str = ""
    names: tuple[str, ...] = ()
    unencrypted: bool = False
    days: float | None = None
    users: Mapping[str, User] = field(default_factory=lambda: MappingProxyType({}))
    connection: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    tell: tuple[SinkOptions, ...] = ()

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

    def topics(self) -> dict[str, str]:
        """Give the filters of MQTT topics that are read, by asset."""
        found: dict[str, str] = {}
        for address in dict.fromkeys(item.source for item in self.assets):
            if address.lower().startswith(("mqtt:", "mqtts:")):
                fed = [item.name for item in self.assets if item.source == address]
                for name, wanted in topic_filters(address, fed, self.options(address)).items():
                    found[name] = whole_node(wanted) if is_sparkplug(wanted) else wanted
        return found


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
    source, folder = Source(document.label), path.parent
    told = Spot(source, "site", Entry("", read_yaml(document.text, source))).fields(SITE_KEYS, prefix="")
    listen = told["listen"].fields(LISTEN_KEYS) if "listen" in told else {}
    keep = told["keep"].fields(KEEP_KEYS) if "keep" in told else {}
    own = _number(listen, "port", 0.0, 65535.0)
    return Site(
        name=_text(told, "name", path.stem),
        assets=tuple(_assets(told, folder)),
        store=_beside(folder, _text(told, "store", str(STORE))),
        host=_text(listen, "address", HOST),
        port=port if port is not None else PORT if own is None else int(own),
        **_encryption(listen, folder),
        days=_number(keep, "days", 1e-3, 1e6),
        users=MappingProxyType(dict(_users(told["users"])) if "users" in told else {}),
        connection=MappingProxyType(dict(_connection(told["connection"], folder)) if "connection" in told else {}),
        tell=tuple(_sinks(told["tell"], folder)) if "tell" in told else (),
    )


def _encryption(listen: Mapping[str, Spot], folder: Path) -> dict[str, Any]:
    """Give by what the page is known, as fields of `Site`."""
    for one, other in (("certificate", "key"), ("key", "certificate")):
        if one in listen and other not in listen:
            raise listen[one].error(f" is nothing without its `{other}`; name both files")
    unencrypted = "unencrypted" in listen and listen["unencrypted"].is_yes()
    if "certificate" in listen and unencrypted:
        raise listen["unencrypted"].error(" is not so with a certificate; leave one of them out")
    return {
        **{name: str(folder / listen[name].text()) for name in ("certificate", "key") if name in listen},
        "names": tuple(item.text() for item in listen["names"].one_or_more()) if "names" in listen else (),
        "unencrypted": unencrypted,
    }


def _assets(told: Mapping[str, Spot], folder: Path) -> Iterator[SiteAsset]:
    """Read the assets; what one does not say is what the site says."""
    if not told["assets"].entries():
        raise told["assets"].error(f" are none; {ASSETS}")
    usual, accept = _text(told, "source", SIMULATED), _number(told, "accept", LOWEST_LEVEL, 1.0)
    for place in told["assets"].things("asset"):
        fields = place.fields(ASSET_KEYS)
        own = _number(fields, "accept", LOWEST_LEVEL, 1.0)
        nodes = (
            {entry.name: entry.text() for entry in fields["nodes"].things("node", checked=False)}
            if "nodes" in fields
            else {}
        )
        yield SiteAsset(
            name=place.name,
            plant=_plant(_model(fields["model"], folder)),
            source=_text(fields, "source", usual),
            accept=accept if own is None else own,
            topic=_text(fields, "topic"),
            nodes=MappingProxyType(nodes),
            hold=tuple(item.text() for item in fields["hold"].items()) if "hold" in fields else None,
        )


def _model(place: Spot, folder: Path) -> Path:
    """Give the model file of an asset, which is there."""
    path = folder / place.text()
    if not path.is_file():
        raise place.error(f": there is no file {shown_path(str(path))}")
    return path


def _users(listed: Spot) -> Iterator[tuple[str, User]]:
    for place in listed.things("user", checked=False):
        fields = place.fields(USER_KEYS)
        role = fields["role"].text()
        if role not in ROLES:
            raise fields["role"].error(f" `{shown(role)}` is no role; {choice(role, ROLES)}")
        try:
            check_hash(password := fields["password"].text())
        except FaultbondError:
            raise fields["password"].error(" is to be a hash, as `faultbond serve --hash` prints it") from None
        yield place.name, User(name=place.name, role=role, password=password)


def _connection(told: Spot, folder: Path) -> Iterator[tuple[str, str]]:
    """Give what logs in at sources; all but the name are files."""
    for key, place in told.fields(CONNECTION_KEYS).items():
        yield key, place.text() if key == "user" else str(folder / place.text())


def _sinks(told: Spot, folder: Path) -> Iterator[SinkOptions]:
    """Read whom the service tells."""
    for place in told.things("tell"):
        fields = place.fields(SINK_KEYS)
        files = {key: str(folder / fields[key].text()) for key in SINK_FILES if key in fields}
        yield SinkOptions(
            name=place.name,
            to=fields["to"].text(),
            where=fields["to"].where(""),
            kinds=tuple(_kind(item) for item in fields["kinds"].one_or_more()) if "kinds" in fields else KINDS,
            user=_text(fields, "user"),
            give_up=fields["give_up"].seconds() if "give_up" in fields else None,
            **files,
        )


def _kind(place: Spot) -> str:
    """Give a kind of records."""
    found = place.text()
    if found not in KINDS:
        raise place.error(f" `{shown(found)}` is no kind of records; {choice(found, KINDS)}")
    return found


def _plant(path: Path) -> WatchedPlant:
    plant = find_plant(path, Wanted())
    if plant.graph.grid is TimeGrid.NONE:
        raise ModelError(f"{path}: a network without time has no samples to watch. Give a model with a sample_time.")
    return plant


def _beside(folder: Path, store: str) -> str:
    """Give a file of a site as it is found from here; an address of a database stays."""
    return store if "://" in store else str(folder / store)


def _text(fields: Mapping[str, Spot], key: str, missing: str = "") -> str:
    return fields[key].text() if key in fields else missing


def _number(fields: Mapping[str, Spot], key: str, least: float, most: float) -> float | None:
    """Give a number of a range, None where it is not said."""
    if key not in fields:
        return None
    place = fields[key]
    text = place.text()
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not least <= value <= most:
        raise place.error(f" is a number from {least:g} to {most:g}, not `{shown(text)}`")
    return value
