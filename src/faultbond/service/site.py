"""What a service watches, and how: from the command line, or from a file `site.yaml`."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import quote, unquote

from faultbond.app.plant import WatchedPlant, find_plant
from faultbond.app.wishes import DEMO, Wanted
from faultbond.errors import FaultbondError, Mistakes, ModelError
from faultbond.io.examples import example
from faultbond.model.document import read_document
from faultbond.model.keys import TEXT, Key, Keys
from faultbond.model.source import Entry, Source, choice, shown, shown_path
from faultbond.model.spot import Spot, check_name
from faultbond.model.yaml_nodes import read_yaml
from faultbond.service.offline.limits import OfflineLimits
from faultbond.service.process_picture import ProcessPicture, read_process_picture
from faultbond.service.sinks.options import KINDS, SinkOptions
from faultbond.service.site_numbers import read_number, read_size
from faultbond.service.site_offline import read_limits
from faultbond.service.sources.opening import OPENED, shown_address, topic_filters
from faultbond.service.sources.options import SourceOptions
from faultbond.service.sources.sparkplug_topic import is_sparkplug, whole_node
from faultbond.service.web.security import check_hash
from faultbond.types import LOWEST_LEVEL, TimeGrid

HOST, PORT = "127.0.0.1", 8350
STORE = Path("faultbond.sqlite")
SIMULATED = "sim:"
STREAM = "-"  # standard input
SHOWN = "sim:?speed=5&fault=K1=x1.85@300"  # of the built-in plant: after a minute, when much flows through the pipe
LEAST_STORE = 10**7  # bytes of a store that is bounded: what is never forgotten has to fit, too
FILE, SMALLER = "site file", "let several services watch the site, each with a file of its own"
ROLES = ("view", "operate", "engineer")

ASSETS = "write `assets: {NAME: {model: FILE}}`"
_INPUTS = re.compile(r"(?<=[?&]inputs=)[^&]+")  # in the address of a simulation
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
        "keep": Key({}, "for how many `days`, and in how much room, rows and curves are kept"),
        "offline": Key({}, "limits of analyses of what people bring; `no`: there are none"),
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
KEEP_KEYS = Keys({"days": Key({}), "size": Key({}, "of the store, from which on the oldest go")})
CONNECTION_KEYS = Keys(
    {"user": Key(TEXT)}
    | dict.fromkeys(("password_file", "authority", "certificate", "key", "server_certificate"), _FILE)
)
ASSET_KEYS = Keys(
    {
        "model": Key(TEXT, missing="write `model: FILE`"),
        "source": Key(TEXT),
        "picture": Key(TEXT, "an SVG of the plant whose ids are names of the model"),
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
OF_SOURCES = {  # keys of an asset that mean something with some sources only: their schemes, and who that is
    "topic": (("mqtt", "mqtts"), "mqtt:// and mqtts://"),
    "nodes": (("opc.tcp",), "opc.tcp://"),
    "hold": (("mqtt", "mqtts", "opc.tcp"), "mqtt://, mqtts:// and opc.tcp://"),
}
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

    source: address of its source. where: start of a message about that, with file and line. accept: probability from
    which a rule accepts, or None. topic, nodes, hold: see `SourceOptions`; empty where the source finds its values by
    itself, hold None where the model says what holds. picture: of the plant, beside its bond graph, or None.
    """

    name: str
    plant: WatchedPlant
    source: str = SIMULATED
    where: str = ""
    accept: float | None = None
    topic: str = ""
    nodes: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    hold: tuple[str, ...] | None = None
    picture: ProcessPicture | None = None


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
    rows and curves are kept; None: for ever. size: bytes of the store from which on the oldest of them go; None: it has
    no bound. users: none: whoever sits at this machine is an engineer. connection: names and files of the log-in at
    sources, as the fields of `SourceOptions`. tell: whom it tells. offline: limits of analyses of what people bring;
    None: there are none. places: starts of messages about what the file says of `store`, `listen`, `connection` and
    keys in `listen`, with file and line.
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
    size: int | None = None
    users: Mapping[str, User] = field(default_factory=lambda: MappingProxyType({}))
    connection: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    tell: tuple[SinkOptions, ...] = ()
    offline: OfflineLimits | None = None
    places: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

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

    def at(self, key: str) -> str:
        """Give the start of a message about what the file says of `key`, or of all of `listen`."""
        return self.places.get(key) or (self.places.get("listen", "") if key in LISTEN_KEYS.known else "")

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

    The picture of a model is the SVG of its name beside it, if that shows something of the plant: others may lie there.

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
        plant, picture = _plant(path), None
        with suppress(ModelError):
            picture = read_process_picture(path.with_suffix(".svg"), plant.graph)
        assets.append(SiteAsset(name=name, plant=plant, source=source or usual, accept=accept, picture=picture))
    names = ", ".join(item.name for item in assets)
    kept = store or str(STORE)
    return Site(
        name=names,
        assets=tuple(assets),
        store=kept,
        port=PORT if port is None else port,
        offline=OfflineLimits(folder=_offline_folder(Path("faultbond"), kept)),
    )


def chosen_site(
    models: Sequence[Path],
    *,
    file: Path | None,
    source: str | None,
    store: str | None,
    port: int | None,
    accept: float | None,
    mistakes: Mistakes,
) -> Site:
    """Give the site of a file, or without one that of the other words.

    Raises
    ------
    FaultbondError
        Where both are given, or one is wrong.
    """
    if file is None:
        return site_of(models, source=source, store=store, port=port, accept=accept)
    if models or source or store or accept:
        raise FaultbondError(f"{file}: models, source, store and accept stand in the site file. Leave them out here.")
    return read_site(file, port=port, mistakes=mistakes)


def read_site(path: Path, *, port: int | None = None, mistakes: Mistakes | None = None) -> Site:
    """Give the site of a file; paths in it are taken from where it lies.

    Parameters
    ----------
    path : the file
    port : another one than the file says
    mistakes : takes what is wrong, and the site is given as far as it can be read; None: that is raised

    Raises
    ------
    FaultbondError
        Where the file cannot be read or says what no site has, all of it by its lines.
    """
    found = mistakes or Mistakes()
    document = read_document(path, FILE, SMALLER)
    source, folder = Source(document.label, what=FILE, smaller=SMALLER), path.parent
    told = Spot(source, "site", Entry("", read_yaml(document.text, source))).fields(SITE_KEYS, "", note=found.note)

    def section(key: str, keys: Keys) -> dict[str, Spot]:
        return found.or_else(lambda: told[key].fields(keys, note=found.note) if key in told else {}, {})

    listen, keep, connection = (
        section(*item) for item in (("listen", LISTEN_KEYS), ("keep", KEEP_KEYS), ("connection", CONNECTION_KEYS))
    )
    encryption: dict[str, Any] = found.or_else(lambda: _encryption(listen, folder), {})
    own = found.or_else(lambda: read_number(listen, "port", 0.0, 65535.0), None)
    store = _beside(folder, found.or_else(lambda: _text(told, "store", str(STORE)), str(STORE)))
    usual = OfflineLimits(folder=_offline_folder(path.with_suffix(""), store))
    site = Site(
        name=found.or_else(lambda: _text(told, "name", path.stem), path.stem),
        assets=tuple(_assets(told, folder, found)),
        store=store,
        host=found.or_else(lambda: _text(listen, "address", HOST), HOST),
        port=port if port is not None else PORT if own is None else int(own),
        **encryption,
        days=found.or_else(lambda: read_number(keep, "days", 1e-3, 1e6), None),
        size=found.or_else(lambda: read_size(keep, "size", LEAST_STORE), None),
        users=MappingProxyType(dict(_users(told["users"], found)) if "users" in told else {}),
        connection=MappingProxyType(dict(_connection(connection, folder, found))),
        tell=tuple(_sinks(told["tell"], folder, found)) if "tell" in told else (),
        offline=found.or_else(lambda: _limits(told, folder, usual), None),
        places=MappingProxyType({key: _place(place) for key, place in {**told, **listen}.items()}),
    )
    if mistakes is None:
        found.tell()
    return site


def _limits(told: Mapping[str, Spot], folder: Path, usual: OfflineLimits) -> OfflineLimits | None:
    return read_limits(told["offline"], folder, usual) if "offline" in told else usual


def _place(spot: Spot) -> str:
    """Give where something stands, as the start of a message that has words of its own."""
    return spot.source.at(spot.entry)


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


def _assets(told: Mapping[str, Spot], folder: Path, mistakes: Mistakes) -> Iterator[SiteAsset]:
    """Read the assets; what one does not say is what the site says."""
    usual = mistakes.or_else(lambda: _text(told, "source", SIMULATED), SIMULATED)
    accept = mistakes.or_else(lambda: read_number(told, "accept", LOWEST_LEVEL, 1.0), None)
    with mistakes.noted():
        if "assets" in told and not told["assets"].entries():
            raise told["assets"].error(f" are none; {ASSETS}")
    for place in _things(told, "assets", "asset", mistakes):
        with mistakes.noted():
            check_name(place.source, place.entry, "assets")
            fields = place.fields(ASSET_KEYS, note=mistakes.note)
            address = _address(_text(fields, "source", usual), folder)
            with mistakes.noted():
                _refuse_stray(fields, address)
            if "model" in fields:
                own = read_number(fields, "accept", LOWEST_LEVEL, 1.0)
                plant, picture = _plant(_model(fields["model"], folder)), None
                if "picture" in fields:
                    with mistakes.noted():
                        picture = _picture(fields["picture"], folder, plant)
                yield SiteAsset(
                    name=place.name,
                    plant=plant,
                    source=address,
                    where=_place(fields.get("source") or told.get("source") or place),
                    accept=accept if own is None else own,
                    topic=_text(fields, "topic"),
                    nodes=MappingProxyType(_nodes(fields)),
                    hold=tuple(item.text() for item in fields["hold"].items()) if "hold" in fields else None,
                    picture=picture,
                )


def _address(source: str, folder: Path) -> str:
    """Give the address of a source; a file is taken from where the site file lies."""
    scheme, colon, path = source.partition(":")
    if scheme.lower() == "sim":
        return _INPUTS.sub(lambda found: quote(str(folder / unquote(found[0]))), source)
    is_own = scheme.lower() == "file" and path and not path.startswith(("/", "~"))
    return f"{scheme}{colon}{folder / path}" if is_own else source


def _things(told: Mapping[str, Spot], key: str, word: str, mistakes: Mistakes) -> Sequence[Spot]:
    """Give the named things of a section, as many as can be read."""
    return mistakes.or_else(lambda: list(told[key].things(word, checked=False)), []) if key in told else []


def _refuse_stray(fields: Mapping[str, Spot], address: str) -> None:
    """Refuse what means nothing with a source."""
    scheme = address.partition(":")[0].lower()
    for key, (known, kind) in OF_SOURCES.items():
        if key in fields and scheme in (*OPENED, STREAM) and scheme not in known:
            raise fields[key].error(f" means nothing with the source {shown_address(address)}; it is of {kind}")


def _nodes(fields: Mapping[str, Spot]) -> dict[str, str]:
    return (
        {entry.name: entry.text() for entry in fields["nodes"].things("node", checked=False)}
        if "nodes" in fields
        else {}
    )


def _model(place: Spot, folder: Path) -> Path:
    """Give the model file of an asset, which is there."""
    path = folder / place.text()
    if not path.is_file():
        raise place.error(f": there is no file {shown_path(str(path))}")
    return path


def _picture(place: Spot, folder: Path, plant: WatchedPlant) -> ProcessPicture:
    path = folder / place.text()
    try:
        return read_process_picture(path, plant.graph)
    except ModelError as error:
        raise place.error(f": {error}") from None


def _users(listed: Spot, mistakes: Mistakes) -> Iterator[tuple[str, User]]:
    for place in _things({"users": listed}, "users", "user", mistakes):
        with mistakes.noted():
            fields = place.fields(USER_KEYS, note=mistakes.note)
            role = password = ""
            if "role" in fields:
                with mistakes.noted():
                    role = _role(fields["role"])
            if "password" in fields:
                with mistakes.noted():
                    password = _hash(fields["password"])
            yield place.name, User(name=place.name, role=role, password=password)


def _role(place: Spot) -> str:
    role = place.text()
    if role not in ROLES:
        raise place.error(f" `{shown(role)}` is no role; {choice(role, ROLES)}")
    return role


def _hash(place: Spot) -> str:
    password = place.text()
    try:
        check_hash(password)
    except FaultbondError:
        raise place.error(" is to be a hash, as `faultbond serve --hash` prints it") from None
    return password


def _connection(told: Mapping[str, Spot], folder: Path, mistakes: Mistakes) -> Iterator[tuple[str, str]]:
    """Give what logs in at sources; all but the name are files."""
    for key, place in told.items():
        with mistakes.noted():
            yield key, place.text() if key == "user" else _file(place, folder)


def _file(place: Spot, folder: Path) -> str:
    """Give a file that can be read."""
    path = folder / place.text()
    try:
        with path.open("rb"):
            return str(path)
    except OSError as error:
        raise place.error(f": {shown_path(str(path))} cannot be read: {error.strerror or error}") from None


def _sinks(told: Spot, folder: Path, mistakes: Mistakes) -> Iterator[SinkOptions]:
    """Read whom the service tells."""
    for place in _things({"tell": told}, "tell", "tell", mistakes):
        with mistakes.noted():
            check_name(place.source, place.entry, "tell")
            fields = place.fields(SINK_KEYS, note=mistakes.note)
            files = {
                key: mistakes.or_else(partial(_file, fields[key], folder), "") for key in SINK_FILES if key in fields
            }
            kinds: tuple[str, ...] = mistakes.or_else(partial(_kinds, fields), ())
            if "to" in fields:
                yield SinkOptions(
                    name=place.name,
                    to=fields["to"].text(),
                    where=place.where(""),
                    kinds=kinds,
                    user=_text(fields, "user"),
                    give_up=fields["give_up"].seconds() if "give_up" in fields else None,
                    **files,
                )


def _kinds(fields: Mapping[str, Spot]) -> tuple[str, ...]:
    return tuple(_kind(item) for item in fields["kinds"].one_or_more()) if "kinds" in fields else KINDS


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


def _offline_folder(site: Path, store: str) -> str:
    """Give where files that people bring are kept: beside the store, or the site file where the store is elsewhere."""
    return f"{site if '://' in store else store}-offline"


def _text(fields: Mapping[str, Spot], key: str, missing: str = "") -> str:
    return fields[key].text() if key in fields else missing
