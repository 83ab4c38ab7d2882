"""From what a site says of its sinks to the sinks."""

import base64
import binascii
import ssl
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import SplitResult, urlsplit

from faultbond.errors import FaultbondError
from faultbond.service.contract.sink import Sink
from faultbond.service.sinks.options import SinkOptions
from faultbond.service.sinks.webhook import Hook, Webhook
from faultbond.service.sources.opening import client_context

METRICS = "metrics"  # the address of what a program asks for that measures: it needs no sink, only a token
FORMS = (
    f"mqtt://HOST/PREFIX, mqtts://HOST/PREFIX, https://HOST/PATH, http://HOST/PATH, opc.tcp://HOST:PORT or {METRICS}"
)
LEAST_SECRET = 16  # bytes
SIGNING = "whsec_"  # begins a secret in Base64, as Standard Webhooks has it


def open_sinks(told: Sequence[SinkOptions], filters: Mapping[str, str]) -> tuple[Sink, ...]:
    """Give the sinks of a site; nothing is connected before they are opened.

    Parameters
    ----------
    told : what the site says of them
    filters : of MQTT topics that its sources read, by asset

    Raises
    ------
    FaultbondError
        Where an address is none, a file cannot be read, a package is not installed, or it would tell where it reads.
    """
    return tuple(_opened(_Asked(options), filters) for options in told if options.to != METRICS)


def metrics_token(told: Sequence[SinkOptions]) -> str:
    """Give what a program shows that asks for measures; empty: there is no such thing.

    Raises
    ------
    FaultbondError
        Where its file cannot be read.
    """
    asked = [_Asked(options) for options in told if options.to == METRICS]
    if len(asked) > 1:
        raise asked[1].mistake(f"there is {asked[0].options.name} for {METRICS} already.")
    if not asked:
        return ""
    asked[0].refuse_all_but("token_file")
    token = asked[0].secret("token_file").decode()
    if not token:
        raise asked[0].mistake("name a `token_file`; people with a log-in need none of this.")
    return token


def is_read(prefix: str, wanted: str) -> bool:
    """Whether a filter of MQTT topics has topics below a prefix, or the prefix itself.

    Example
    -------
    >>> is_read("plant/found", "plant/+"), is_read("plant/found", "plant/+/flow/#"), is_read("found", "plant/#")
    (True, True, False)
    """
    levels = wanted.split("/")
    levels = levels[2:] if levels[0] == "$share" else levels
    for own, level in zip(prefix.split("/"), levels, strict=False):
        if level == "#":
            return True
        if level not in ("+", own):
            return False
    return len(levels) >= len(prefix.split("/"))


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is said of a sink; mistakes in it are told by its place."""

    options: SinkOptions

    def mistake(self, message: str) -> FaultbondError:
        """Give the error that says what is wrong."""
        return FaultbondError(f"{self.options.where}: {message}")

    def address(self) -> SplitResult:
        """Give the parts of the address; it has a host."""
        try:
            parts = urlsplit(self.options.to)
            port = parts.port
        except ValueError as error:
            raise self.mistake(f"to: its host or port cannot be read ({error}).") from error
        if not parts.hostname or port == 0 or not self.options.to.isprintable() or " " in self.options.to:
            raise self.mistake(f"to: name the host, as in {FORMS}.")
        if parts.password is not None:
            raise self.mistake("a password does not stand in an address. Write it into a file, `password_file`.")
        return parts

    def refuse_all_but(self, *known: str) -> None:
        """Refuse what does not belong to this kind of sink."""
        given = ("user", "password_file", "authority", "certificate", "key", "token_file", "secret_file", "give_up")
        for key in given:
            if getattr(self.options, key) and key not in known:
                raise self.mistake(f"`{key}` means nothing with {self.options.to.partition('://')[0]}.")

    def secret(self, key: str) -> bytes:
        """Give what a file has; nothing where none is named."""
        file = getattr(self.options, key)
        if not file:
            return b""
        try:
            found = Path(file).read_bytes().strip()
        except OSError as error:
            raise self.mistake(f"{key} {file} cannot be read ({error.strerror or error}).") from error
        if not found or not found.isascii() or not found.decode().isprintable():
            raise self.mistake(f"{key} {file} has to hold one line of printable text.")
        return found

    def tls(self) -> ssl.SSLContext:
        """Give by what the other side is known, and what it knows us by."""
        options = self.options
        try:
            return client_context(options.authority, options.certificate, options.key)
        except OSError as error:
            raise self.mistake(f"authority, certificate or key cannot be used ({error}).") from error


def _opened(asked: _Asked, filters: Mapping[str, str]) -> Sink:
    scheme, colon, _ = asked.options.to.partition("://")
    opened = OPENED.get(scheme.lower()) if colon else None
    if opened is None:
        raise asked.mistake(f"to: expected {FORMS}.")
    return opened(asked, filters)


def _webhook(asked: _Asked, filters: Mapping[str, str]) -> Sink:
    asked.refuse_all_but("authority", "certificate", "key", "token_file", "secret_file", "give_up")
    parts, options = asked.address(), asked.options
    is_secret = parts.scheme == "https"
    if parts.username is not None:
        raise asked.mistake("no user stands in the address. Write what is shown there into a file, `token_file`.")
    return Webhook(
        options.name,
        Hook(
            host=parts.hostname or "",
            port=parts.port or (443 if is_secret else 80),
            path=f"{parts.path or '/'}{f'?{parts.query}' if parts.query else ''}",
            named=parts.netloc,
            shown=f"{parts.scheme}://{parts.netloc}",
            tls=asked.tls() if is_secret else None,
            token=asked.secret("token_file").decode(),
            secret=_signing_secret(asked),
        ),
        kinds=frozenset(options.kinds),
        give_up=options.give_up,
    )


def _signing_secret(asked: _Asked) -> bytes:
    found = asked.secret("secret_file")
    if found.startswith(SIGNING.encode()):
        try:
            found = base64.b64decode(found[len(SIGNING) :], validate=True)
        except binascii.Error as error:
            raise asked.mistake(f"what stands behind {SIGNING} in secret_file is no Base64.") from error
    if found and len(found) < LEAST_SECRET:
        raise asked.mistake(f"secret_file: the secret is short; take {LEAST_SECRET} bytes or more.")
    return found


def _mqtt(asked: _Asked, filters: Mapping[str, str]) -> Sink:
    try:
        from faultbond.service.sinks.mqtt import MqttSink, TargetBroker  # noqa: PLC0415 - needs aiomqtt
    except ImportError as error:
        raise asked.mistake('MQTT needs aiomqtt. Install it with: pip install "faultbond[mqtt]"') from error
    asked.refuse_all_but("user", "password_file", "authority", "certificate", "key", "give_up")
    parts, options = asked.address(), asked.options
    prefix = parts.path.strip("/")
    if not prefix or set(prefix) & set("+#") or prefix.startswith("$") or "//" in prefix or parts.query:
        raise asked.mistake(
            f"{prefix!r} is no prefix of topics. Write it behind the host, as in mqtt://HOST/faultbond."
        )
    for asset, wanted in filters.items():
        if is_read(prefix, wanted):
            raise asked.mistake(f"it would tell on topics that {asset} reads, {wanted}. Take another prefix.")
    user, password = options.user or parts.username or None, asked.secret("password_file").decode() or None
    if password and not user:
        raise asked.mistake("there is a password without a `user`.")
    is_secret = parts.scheme == "mqtts"
    broker = TargetBroker(
        host=parts.hostname or "",
        port=parts.port or (8883 if is_secret else 1883),
        prefix=prefix,
        shown=options.to,
        user=user,
        password=password,
        tls=asked.tls() if is_secret else None,
    )
    return MqttSink(options.name, broker, kinds=frozenset(options.kinds), give_up=options.give_up)


def _opcua(asked: _Asked, filters: Mapping[str, str]) -> Sink:
    try:
        from faultbond.service.sinks.opcua import OpcUaSink, OwnServer  # noqa: PLC0415 - needs asyncua
        from faultbond.service.sources.opcua_identity import read_identity  # noqa: PLC0415 - the same
    except ImportError as error:
        raise asked.mistake('OPC UA needs asyncua. Install it with: pip install "faultbond[opcua]"') from error
    asked.refuse_all_but("user", "password_file", "certificate", "key")
    parts, options = asked.address(), asked.options
    password = asked.secret("password_file").decode()
    if not (options.certificate and options.key and options.user and password):
        raise asked.mistake("give a `certificate` and its `key`, and the `user` and `password_file` of who may read.")
    try:
        read_identity(options.certificate, options.key)
    except FaultbondError as error:
        raise asked.mistake(str(error)) from error
    if parts.port is None:
        raise asked.mistake("name the port at which clients read, such as 4841.")
    return OpcUaSink(
        options.name,
        OwnServer(
            url=options.to,
            certificate=options.certificate,
            key=options.key,
            user=options.user,
            password=password,
        ),
    )


OPENED: Mapping[str, Callable[[_Asked, Mapping[str, str]], Sink]] = {
    "http": _webhook,
    "https": _webhook,
    "mqtt": _mqtt,
    "mqtts": _mqtt,
    "opc.tcp": _opcua,
}
