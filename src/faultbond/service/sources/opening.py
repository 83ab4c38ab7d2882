"""From the address of a source to the source."""

import difflib
import math
import os
import re
import ssl
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

from faultbond.errors import FaultbondError, ModelError
from faultbond.io.faults import FaultRequest, parse_fault
from faultbond.io.times import finite_number
from faultbond.service.contract.source import LiveSource, Subscriber
from faultbond.service.sources.growing_file import GrowingFile, Replay
from faultbond.service.sources.intake import held_columns
from faultbond.service.sources.options import SourceOptions
from faultbond.service.sources.simulated import SimulatedPlant, SimulationWishes
from faultbond.service.sources.sparkplug_topic import FILTER, FORM, is_sparkplug
from faultbond.service.sources.standard_input import StandardInput

if TYPE_CHECKING:
    from faultbond.service.sources.sparkplug import EdgeNodes

FORMS = "sim:, file:PATH, -, mqtt://HOST/TOPIC, mqtts://HOST/TOPIC or opc.tcp://HOST:PORT"
SAFE = "Basic256Sha256"  # what OPC UA is encrypted by, if nothing else is said
SECRET = "FAULTBOND_SOURCE_PASSWORD"  # noqa: S105 - the name of the variable that holds it
SETTING = re.compile(r"[a-z_]+=")
LATEST_FAULT = 1e9  # s after the begin; what is later was meant as a date

Details = Mapping[str, Sequence[str]]


def open_source(address: str, subscribers: Sequence[Subscriber], options: SourceOptions | None = None) -> LiveSource:
    """Give the source of an address; nothing is connected before its arrivals are asked for.

    Parameters
    ----------
    address : `sim:`, `file:PATH`, `-`, `mqtt://HOST/TOPIC`, `mqtts://HOST/TOPIC` or `opc.tcp://HOST:PORT`, with
        settings behind a `?`
    subscribers : the assets that it feeds
    options : what the site says beside the address

    Raises
    ------
    FaultbondError
        Where the address is none, has a setting that is not known, or needs a package that is not installed.
    """
    options, scheme = options or SourceOptions(), _scheme(address)
    if not subscribers:
        raise FaultbondError(f"source {shown_address(address)!r}: no asset reads it.")
    if scheme == "-":
        return StandardInput(subscribers)
    place, settings = split_address(address)
    return OPENED[scheme](place, settings, subscribers, options)


def _scheme(address: str) -> str:
    """Give the kind of a source."""
    if address == "-":
        return "-"
    scheme, colon, _ = address.partition(":")
    if colon and scheme.lower() in OPENED:
        return scheme.lower()
    if address and Path(address.partition("?")[0]).exists():
        raise FaultbondError(f"source {address!r}: write file:{address} to follow the file.")
    near = difflib.get_close_matches(scheme.lower(), OPENED, n=1) if colon else []
    hint = f" Did you mean {near[0]}:?" if near else ""
    raise FaultbondError(f"source {shown_address(address)!r}: expected {FORMS}.{hint}")


def shown_address(address: str) -> str:
    """Give an address without its password."""
    return re.sub(r"(?<=://)([^/@:]*):[^/]*@", r"\1:***@", address)


def split_address(address: str) -> tuple[str, Details]:
    """Give an address without its settings, and these by name."""
    place, mark, rest = address.rpartition("?")
    if not mark or (rest and not SETTING.match(rest)):  # a `?` of the path
        return address, {}
    found: dict[str, list[str]] = {}
    for item in filter(None, rest.split("&")):
        name, _, value = item.partition("=")
        found.setdefault(name, []).append(unquote(value))
    return place, found


class _Asked:
    """The settings of an address, each to be read once; what is left is a mistake."""

    def __init__(self, place: str, settings: Details, known: Sequence[str]) -> None:
        shown = shown_address(place)
        self._where, self._settings = f"source {shown}{'' if shown.endswith(':') else ':'}", settings
        for name, values in settings.items():
            if name not in known:
                near = difflib.get_close_matches(name, known, n=1)
                hint = f" Did you mean {near[0]}?" if near else f" There are {', '.join(known)}."
                raise self.mistake(f"there is no setting {name!r}.{hint}")
            if len(values) > 1 and name != "fault":
                raise self.mistake(f"{name} is given {len(values)} times.")

    def mistake(self, message: str) -> FaultbondError:
        """Give the error that says what is wrong with the address."""
        return FaultbondError(f"{self._where} {message}")

    def all(self, name: str) -> Sequence[str]:
        """Give all values of a setting."""
        return self._settings.get(name, ())

    def text(self, name: str, default: str = "") -> str:
        """Give the value of a setting."""
        return next(iter(self.all(name)), default)

    def positive(self, name: str, default: float, *, highest: str = "") -> float:
        """Give a number above 0; `highest` is the word for infinity."""
        text = self.text(name)
        if not text:
            return default
        if highest and text == highest:
            return math.inf
        found = finite_number(text)
        if not found > 0.0:
            beside = f", or {highest}" if highest else ""
            raise self.mistake(f"{name}={text}: expected a number above 0{beside}.")
        return found

    def whole(self, name: str, default: int) -> int:
        """Give a whole number."""
        text = self.text(name) or str(default)
        if not text.isdecimal():
            raise self.mistake(f"{name}={text}: expected a whole number.")
        return int(text)

    def flag(self, name: str, *, default: bool) -> bool:
        """Give whether it is 1."""
        text = self.text(name)
        if text not in ("", "0", "1"):
            raise self.mistake(f"{name}={text}: expected 0 or 1.")
        return text == "1" if text else default


def _simulated(place: str, settings: Details, subscribers: Sequence[Subscriber], options: SourceOptions) -> LiveSource:
    asked = _Asked(place, settings, ("speed", "seed", "fault", "noise", "inputs"))
    if place.lower() != "sim:":
        raise asked.mistake("nothing stands between sim: and the settings, such as sim:?speed=10.")
    wishes = SimulationWishes(
        speed=asked.positive("speed", 1.0, highest="max"),
        seed=asked.whole("seed", 1),
        faults=_faults(asked, subscribers) if "fault" in settings else None,
        noise=asked.flag("noise", default=True),
        inputs=asked.text("inputs"),
    )
    shown = "&".join(f"{name}={value}" for name, values in settings.items() for value in values)
    return SimulatedPlant(subscribers, wishes, f"sim:?{shown}" if shown else "sim:")


def _faults(asked: _Asked, subscribers: Sequence[Subscriber]) -> tuple[FaultRequest, ...]:
    """Read the faults that are asked for; `none`: there is none."""
    from faultbond.simulate import fault_in_si  # noqa: PLC0415 - loads casadi and scipy

    found = []
    for text in asked.all("fault"):
        if text == "none":
            continue
        misfits = list[FaultbondError]()
        try:
            fault = parse_fault(text)
            for item in subscribers:
                try:
                    fault_in_si(fault, item.graph)
                except ModelError as error:
                    misfits.append(error)
            if len(misfits) == len(subscribers):  # no plant has such a parameter
                raise misfits[0]
        except FaultbondError as error:
            raise asked.mistake(str(error).removeprefix("fault ")) from error
        if fault.start > LATEST_FAULT:
            raise asked.mistake(f"fault={text}: TIME is in seconds after the simulation began, not a date.")
        found.append(fault)
    return tuple(found)


def _file(place: str, settings: Details, subscribers: Sequence[Subscriber], options: SourceOptions) -> LiveSource:
    asked = _Asked(place, settings, ("speed",))
    path = Path(re.sub(r"^file:(//(?=/))?", "", place, flags=re.IGNORECASE)).expanduser()
    if path == Path():
        raise asked.mistake("name the file, as in file:plant.csv.")
    if path.is_dir():
        raise asked.mistake("this is a folder. Name the file.")
    if "speed" in settings:
        return Replay(path, subscribers, asked.positive("speed", 1.0, highest="max"))
    if path.suffix.lower() in (".parquet", ".pq"):
        raise asked.mistake("a Parquet file does not grow by rows. Replay it, with ?speed=1 behind its name.")
    return GrowingFile(path, subscribers)


def _mqtt(place: str, settings: Details, subscribers: Sequence[Subscriber], options: SourceOptions) -> LiveSource:
    asked = _Asked(place, settings, ("births", "client", "qos", "session", "patience", "together"))
    scheme, _, rest = place.partition("://")
    host, port, user, password = _log_in(asked, rest.partition("/")[0], options)
    filters = topic_filters(place, [item.asset for item in subscribers], options)
    for asset, wanted in filters.items():
        if {"{", "}"} & set(wanted):
            raise asked.mistake(f"{wanted!r} is no topic for {asset}. In braces only {{asset}} stands for anything.")
        if not wanted or not _is_filter(wanted):
            raise asked.mistake(f"{wanted!r} is no topic for {asset}. Write it behind the host, as in HOST/plant/+.")
        if is_sparkplug(wanted) and not FILTER.fullmatch(wanted):
            raise asked.mistake(f"{wanted!r} is no topic of Sparkplug B for {asset}. Write {FORM}.")
    qos = asked.whole("qos", 1)
    if qos not in (0, 1, 2):
        raise asked.mistake(f"qos={qos}: expected 0, 1 or 2.")
    session = asked.flag("session", default=False)
    if session and not (asked.text("client") and qos):
        raise asked.mistake(
            "session=1: the broker knows by client=NAME for whom it keeps messages, and keeps none of qos=0."
        )
    options = _policy(asked, options, subscribers)
    tls = _tls(asked, options) if scheme.lower() == "mqtts" else None
    try:
        from faultbond.service.sources.mqtt import Broker, MqttSource  # noqa: PLC0415 - needs aiomqtt
    except ImportError as error:
        raise asked.mistake('MQTT needs aiomqtt. Install it with: pip install "faultbond[mqtt]"') from error
    broker = Broker(
        host=host,
        port=port or (8883 if tls else 1883),
        shown=shown_address(place),
        user=user,
        password=password,
        client=asked.text("client") or None,
        qos=qos,
        tls=tls,
        has_births=asked.flag("births", default=True),
        session=session,
    )
    return MqttSource(broker, filters, subscribers, options, _edge_nodes(asked, filters))


def _edge_nodes(asked: _Asked, filters: Mapping[str, str]) -> "type[EdgeNodes] | None":
    """Give what reads Sparkplug B; None where no filter is of it."""
    if not any(map(is_sparkplug, filters.values())):
        return None
    try:
        from faultbond.service.sources.sparkplug import EdgeNodes  # noqa: PLC0415 - needs protobuf
    except ImportError as error:
        raise asked.mistake('Sparkplug B needs protobuf. Install it with: pip install "faultbond[mqtt]"') from error
    return EdgeNodes


def topic_filters(address: str, assets: Sequence[str], options: SourceOptions) -> dict[str, str]:
    """Give what an MQTT source subscribes to for each of its assets."""
    topic = split_address(address)[0].partition("://")[2].partition("/")[2]
    return {name: options.topics.get(name, topic).replace("{asset}", name) for name in assets}


def _opcua(place: str, settings: Details, subscribers: Sequence[Subscriber], options: SourceOptions) -> LiveSource:
    asked = _Asked(place, settings, ("ns", "period", "security", "patience", "together"))
    authority, slash, path = place.partition("://")[2].partition("/")
    host, port, user, password = _log_in(asked, authority, options)
    options = _policy(asked, options, subscribers)
    try:
        from faultbond.service.sources.opcua import PERIOD, POLICIES, OpcUaSource, Server  # noqa: PLC0415 - needs asyncua
        from faultbond.service.sources.opcua_identity import certificate_of, read_identity  # noqa: PLC0415 - the same
    except ImportError as error:
        raise asked.mistake('OPC UA needs asyncua. Install it with: pip install "faultbond[opcua]"') from error
    policy = asked.text("security", "none" if options.unencrypted else SAFE)
    if policy not in ("none", *POLICIES):
        raise asked.mistake(f"security={policy}: expected {', '.join(POLICIES)} or none.")
    if policy != "none" and not (options.certificate and options.key):
        raise asked.mistake("give a certificate and its key, or say security=none to let others read and change it.")
    if policy != "none":
        try:
            read_identity(options.certificate, options.key)
            if options.server_certificate:
                certificate_of(options.server_certificate)
        except FaultbondError as error:
            raise asked.mistake(str(error)) from error
    named = f"[{host}]" if ":" in host else host
    server = Server(
        url=f"opc.tcp://{named}:{port or 4840}{slash}{path}",
        shown=shown_address(place),
        user=user,
        password=password,
        policy="" if policy == "none" else policy,
        certificate=options.certificate,
        key=options.key,
        server_certificate=options.server_certificate,
        period=asked.positive("period", PERIOD),
        space=asked.text("ns"),
    )
    return OpcUaSource(server, subscribers, options)


def _log_in(asked: _Asked, authority: str, options: SourceOptions) -> tuple[str, int | None, str | None, str | None]:
    """Give host, port, user and password; the password of a file goes before that of the environment or the address."""
    try:
        parts = urlsplit(f"//{authority}")
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise asked.mistake(f"its host or port cannot be read ({error}).") from error
    if not host:
        raise asked.mistake("name the host.")
    password = os.environ.get(SECRET) or (unquote(parts.password) if parts.password else None)
    if options.password_file:
        try:
            password = Path(options.password_file).read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            why = getattr(error, "strerror", None) or "it is not UTF-8"
            raise asked.mistake(f"the password file {options.password_file} cannot be read ({why}).") from error
    user = options.user or (unquote(parts.username) if parts.username else None)
    if password and not user:
        password = None  # of another source
    return host, port, user, password


def _policy(asked: _Asked, options: SourceOptions, subscribers: Sequence[Subscriber]) -> SourceOptions:
    """Give how values become rows, as the address says and, beside it, the site."""
    for item in subscribers:
        held_columns(item, options)
    patience, together = (asked.positive(name, math.nan) for name in ("patience", "together"))
    if not math.isnan(patience):
        options = replace(options, patience=patience)
    return options if math.isnan(together) else replace(options, together=together)


def _is_filter(topic: str) -> bool:
    """Whether a text is a filter of MQTT: `+` and `#` stand for whole levels, `#` for the last ones."""
    levels = topic.split("/")
    whole = all(level in ("+", "#") or not set(level) & set("+#") for level in levels)
    return whole and "#" not in levels[:-1] and "\0" not in topic


def _tls(asked: _Asked, options: SourceOptions) -> ssl.SSLContext:
    """Give what a broker is known by, and what it knows us by."""
    try:
        return client_context(options.authority, options.certificate, options.key)
    except (OSError, ssl.SSLError) as error:
        raise asked.mistake(f"authority, certificate or key cannot be used ({error}).") from error


def client_context(authority: str, certificate: str, key: str) -> ssl.SSLContext:
    """Give by what a server is known and what it knows us by, files each; empty: those of the system, and nothing.

    Raises
    ------
    OSError
        Where a file cannot be used.
    """
    context = ssl.create_default_context(cafile=authority or None)
    context.minimum_version = ssl.TLSVersion.TLSv1_2  # which some systems' Python leaves to their OpenSSL
    if certificate:
        context.load_cert_chain(certificate, key or None)
    return context


Opened = Callable[[str, Details, Sequence[Subscriber], SourceOptions], LiveSource]
OPENED: Mapping[str, Opened] = {"sim": _simulated, "file": _file, "mqtt": _mqtt, "mqtts": _mqtt, "opc.tcp": _opcua}
