"""From the address of a source to the source."""

import difflib
import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from urllib.parse import unquote

from faultbond.errors import FaultbondError, ModelError
from faultbond.io.faults import FaultRequest, parse_fault
from faultbond.io.times import finite_number
from faultbond.service.sources.base import Source, Subscriber
from faultbond.service.sources.growing_file import GrowingFile, Replay
from faultbond.service.sources.options import SourceOptions
from faultbond.service.sources.simulated import SimulatedPlant, SimulationWishes
from faultbond.service.sources.standard_input import StandardInput

FORMS = "sim:, file:PATH or -"
SETTING = re.compile(r"[a-z_]+=")
LATEST_FAULT = 1e9  # s after the begin; what is later was meant as a date

Details = Mapping[str, Sequence[str]]


def open_source(address: str, subscribers: Sequence[Subscriber], options: SourceOptions | None = None) -> Source:
    """Give the source of an address; nothing is connected before its arrivals are asked for.

    Parameters
    ----------
    address : `sim:`, `file:PATH` or `-`, with settings behind a `?`; docs/service.md
    subscribers : the assets that it feeds
    options : what the site says beside the address

    Raises
    ------
    FaultbondError
        Where the address is none, has a setting that is not known, or needs a package that is not installed.
    """
    options, scheme = options or SourceOptions(), _scheme(address)
    if not subscribers:
        raise FaultbondError(f"source {shown_address(address)}: no asset reads it.")
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
        self._where, self._settings = f"source {shown_address(place)}", settings
        for name, values in settings.items():
            if name not in known:
                near = difflib.get_close_matches(name, known, n=1)
                hint = f" Did you mean {near[0]}?" if near else f" There are {', '.join(known)}."
                raise self.mistake(f"there is no setting {name!r}.{hint}")
            if len(values) > 1 and name != "fault":
                raise self.mistake(f"{name} is given {len(values)} times.")

    def mistake(self, message: str) -> FaultbondError:
        """Give the error that says what is wrong with the address."""
        return FaultbondError(f"{self._where}: {message}")

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


def _simulated(place: str, settings: Details, subscribers: Sequence[Subscriber], options: SourceOptions) -> Source:
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
            raise asked.mistake(str(error).removeprefix("--fault ")) from error
        if fault.start > LATEST_FAULT:
            raise asked.mistake(f"fault={text}: TIME is in seconds after the simulation began, not a date.")
        found.append(fault)
    return tuple(found)


def _file(place: str, settings: Details, subscribers: Sequence[Subscriber], options: SourceOptions) -> Source:
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


Opened = Callable[[str, Details, Sequence[Subscriber], SourceOptions], Source]
OPENED: Mapping[str, Opened] = {"sim": _simulated, "file": _file}
