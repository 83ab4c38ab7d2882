"""Numbers, units, times and lists as a person reads them: no more digits than the standard deviation supports."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import Enum

from faultbond.arrays import FloatArray
from faultbond.model.parser import number_text

TIMES, MINUS, NO_BREAK = "\N{MULTIPLICATION SIGN}", "\N{MINUS SIGN}", "\N{NO-BREAK SPACE}"
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
UNIX_CLOCK = 1e8  # seconds; a clock beyond this (March 1973) counts Unix seconds
NO_DATE = 253402300799.0  # s; the calendar ends with the year 9999
TINY = 1e-300  # smaller numbers are 0
UNLIKE = 9  # powers of ten between a value and its standard deviation beyond which one of them is all that is known
VAST = 1e9  # beyond it a change in per cent, or a time, is told by its power of ten
PLAIN_EXPONENTS = range(-3, 5)  # powers of ten that are written out
PACES = ((1.0, "s"), (60.0, "min"), (3600.0, "h"), (86400.0, "d"))
NEARLY_SURE = 98.9  # per cent; from there on a probability is rounded down: 98.97 is no 99.0
HANDY = 0.01  # part of a size by which it changes at least in the unit of time that is taken


def short(value: float) -> str:
    """Write a number with two digits, and without a power of ten up to a million."""
    return number_text(float(f"{value:.2g}"))


def rounded_up(value: float) -> str:
    """Write a size with two digits, rounded up."""
    place = math.floor(math.log10(value)) - 1 if value > 0.0 else 0
    return short(math.ceil(value / 10.0**place - 1e-9) * 10.0**place)


class Notation(Enum):
    """How powers and units are spelled: as in the model file, or as in print."""

    FILE = "file"  # 4.43e11 Pa*s^2/m^6
    PRINT = "print"  # powers and units raised, with signs of multiplication


@dataclass(frozen=True, slots=True)
class Figure:
    """A rounded number with its standard deviation; both are multiples of 10**exponent. `sd` may be empty."""

    value: str
    sd: str
    exponent: int

    def number(self, notation: Notation = Notation.FILE) -> str:
        """Give the value alone; zero has no power of ten."""
        if not self.value.strip("-0."):
            return self.value.strip("-")
        return with_power(_signed(self.value, notation), self.exponent, notation)

    def both(self, notation: Notation = Notation.FILE) -> str:
        """Give value ± standard deviation."""
        if not self.sd:
            return self.number(notation)
        if notation is Notation.FILE or self.exponent == 0:
            return f"{self.number(notation)} ± {with_power(self.sd, self.exponent, notation)}"
        return with_power(f"({_signed(self.value, notation)} ± {self.sd})", self.exponent, notation)


def _signed(number: str, notation: Notation) -> str:
    """Give a number with the minus sign of a notation."""
    return number if notation is Notation.FILE else number.replace("-", MINUS)


def with_power(mantissa: str, exponent: int, notation: Notation) -> str:
    """Join a mantissa and a power of ten."""
    if exponent == 0:
        return mantissa
    if notation is Notation.FILE:
        return f"{mantissa}e{exponent}"
    return f"{mantissa} {TIMES} {power_of_ten(exponent)}"


def power_of_ten(exponent: int) -> str:
    """Give 10ⁿ with a raised exponent."""
    return "10" + str(exponent).translate(SUPERSCRIPTS)


def exponent_of(value: float) -> int:
    """Give the power of ten by which a number of this size is best written; 0: written out."""
    if abs(value) < TINY or not math.isfinite(value):
        return 0
    exponent = math.floor(math.log10(abs(value)))
    return 0 if exponent in PLAIN_EXPONENTS else exponent


def last_place(sd: float) -> int:
    """Give the power of ten of the last digit worth printing: two digits of a `sd` that starts with 1 or 2, else one.

    Source: the rounding rule of the Particle Data Group, with a simpler border.
    """
    place = math.floor(math.log10(sd))
    return place - 1 if sd < 2.95 * 10.0**place else place


def figure(value: float, sd: float | None = None, digits: int = 6) -> Figure:
    """Round a number to the digits that its standard deviation supports.

    Parameters
    ----------
    value : number, any unit
    sd : its standard deviation in the same unit; None, 0 or not finite: unknown or exact, `digits` are kept
    digits : significant digits where there is no standard deviation

    Returns
    -------
    the rounded texts; of a number without standard deviation trailing zeros are dropped
    """
    if not math.isfinite(value):
        return Figure("unknown", "", 0)
    if sd is None or not math.isfinite(sd) or sd < TINY:
        return _exact(value, digits)
    exponent = exponent_of(max(abs(value), sd))
    place = last_place(sd)
    if abs(exponent - place) > UNLIKE or exponent > -math.log10(TINY):
        return _exact(value, digits)
    decimals = max(0, exponent - place)
    shift = 10.0**exponent
    mantissa, error = (f"{round(number, -place) / shift + 0.0:.{decimals}f}" for number in (value, sd))  # no -0
    return Figure(mantissa, error, exponent)


def _exact(value: float, digits: int) -> Figure:
    exponent = exponent_of(float(f"{value:.{digits}g}"))
    mantissa = value / 10.0**exponent
    text = f"{mantissa:.{digits}g}"
    return Figure(format(float(text), "f").rstrip("0").rstrip(".") if "e" in text else text, "", exponent)


def unit_text(unit: str, notation: Notation = Notation.FILE) -> str:
    """Give a unit as it is spelled in that notation; empty where there is none."""
    if unit in ("", "1", "dimensionless"):
        return ""
    if notation is Notation.FILE:
        return unit
    short = re.sub(r"\bpercent\b", "%", unit)
    raised = re.sub(r"(?:\^|\*\*)(-?\d+)(?![\d.])", lambda hit: hit[1].translate(SUPERSCRIPTS), short)
    return raised.replace("**", "^").replace("*", "·")


def with_unit(
    value: float, unit: str, notation: Notation = Notation.FILE, *, sd: float | None = None, digits: int = 6
) -> str:
    """Give a number, rounded as by `figure`, and its unit."""
    return f"{figure(value, sd, digits).number(notation)} {unit_text(unit, notation)}".rstrip()


def kept_together(text: str) -> str:
    """Give a text in which no number stands in another line than its per cent sign or its unit of time."""
    numbers = re.sub(r"(\d) (s|min|h|d|UTC)\b", rf"\1{NO_BREAK}\2", text)
    return numbers.replace(" %", f"{NO_BREAK}%")


def with_noun(number: int, noun: str) -> str:
    """Give a number with its noun: `1 set`, `2 sets`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def recording_text(name: str, time: FloatArray) -> str:
    """Say how long a recording is: number of samples at `time` (n,), s, and how long they take."""
    return f"{name}: {len(time)} samples, {duration_text(float(time[-1] - time[0]))}"


def join(words: Sequence[str]) -> str:
    """Join words with commas and a last `and`."""
    return " and ".join(part for part in (", ".join(words[:-1]), *words[-1:]) if part)


def probability_text(probability: float) -> str:
    """Give a probability in per cent; never 0 or 100, and near 100 rounded down, as a verdict is."""
    percent = 100.0 * probability
    if percent < 0.1:
        return "<0.1"
    if percent > 99.9:
        return ">99.9"
    return f"{_floored(percent):.1f}" if percent >= NEARLY_SURE else f"{percent:.1f}"


def certainty_text(probability: float) -> str:
    """Say how sure a verdict is, rounded down so that it is never overstated."""
    if probability > 0.999:
        return "more than 99.9 % sure"
    if probability < 0.01:
        return "less than 1 % sure"
    percent = 100.0 * probability
    return f"{_floored(percent):.1f} % sure" if percent >= 99.0 else f"{math.floor(percent)} % sure"


def _floored(percent: float) -> float:
    """Round down to a tenth; what is a tenth but for the arithmetic stays."""
    return math.floor(10.0 * percent + 1e-9) / 10.0


def change_text(nominal: float, estimate: float, sd: float) -> str:
    """Give the relative change in per cent, `+84 %`; empty where the nominal value is 0."""
    if nominal == 0.0 or not math.isfinite(estimate):
        return ""
    percent = 100.0 * (estimate - nominal) / abs(nominal)
    relative_sd = 100.0 * sd / abs(nominal)
    if abs(percent) >= VAST:
        return f"{_vast(percent)} %"
    coarse = not math.isfinite(relative_sd) or relative_sd >= 1.0 or abs(percent) >= 20.0
    text = f"{percent:+.0f}" if coarse else f"{percent:+.1f}"
    return ("0" if float(text) == 0.0 else text.replace("-", MINUS)) + " %"


def share_text(part: float, digits: int = 2) -> str:
    """Give a part of a value in per cent; from ten times the value on in how many times it is."""
    times = part >= 10.0
    number = number_text(float(f"{part if times else 100.0 * part:.{digits}g}"))
    return f"{number} times" if times else f"{number} %"


def duration_text(seconds: float, digits: int = 3) -> str:
    """Give a length of time in the unit in which it is a handy number, with so many significant digits."""
    length, name = next((item for item in PACES[:0:-1] if abs(seconds) >= 2.0 * item[0]), PACES[0])
    value = seconds / length
    if abs(value) >= VAST:
        return f"{_vast(value).lstrip('+')} {name}"
    text = f"{value:.{digits}g}"
    return f"{value:.0f} {name}" if "e" in text and abs(value) >= 1.0 else f"{text} {name}"


def pace(rate: float, size: float) -> tuple[float, str]:
    """Give the unit of time, in seconds and by name, in which a value of a size changes visibly at a rate (per s)."""
    for seconds, name in PACES:
        if abs(rate) * seconds >= HANDY * abs(size):
            return seconds, name
    return PACES[-1]


def _vast(value: float) -> str:
    """Give a signed number of which only the size matters."""
    return f"{value:+.0e}".replace("e+", "e").replace("-", MINUS) if math.isfinite(value) else "unknown"


def is_unix(time: float) -> bool:
    """Tell whether a clock reading counts Unix seconds."""
    return time >= UNIX_CLOCK


def clock_text(time: float) -> str:
    """Give a reading of the recording's clock: seconds as written, or date and time where they are Unix seconds."""
    if not math.isfinite(time):
        return "an unknown time"
    if abs(time) >= NO_DATE:
        return f"{figure(time).number()} s"
    if not is_unix(time):
        return f"{figure(time, digits=9).number()} s" if time < 1e5 else f"{time:.12g} s"
    moment = datetime.fromtimestamp(round(time, 3), UTC)
    text = moment.strftime("%Y-%m-%d %H:%M:%S")
    return text + (f".{moment.microsecond // 1000:03d}" if moment.microsecond >= 1000 else "") + " UTC"


def coarse_clock_text(time: float, width: float) -> str:
    """Give a reading of the recording's clock, rounded to a tenth of its uncertainty `width` (s) or finer."""
    if abs(time) >= NO_DATE or not math.isfinite(time):
        return clock_text(time)
    if is_unix(time):
        step = max((step for step in (1.0, 60.0, 3600.0) if 10.0 * step <= width), default=1.0)
        text = clock_text(step * round(time / step))
        return text.replace(":00 UTC", " UTC") if step >= 60.0 else text
    place = math.floor(math.log10(width)) - 1 if width > 0.0 and math.isfinite(width) else -3
    return clock_text(round(time, -place))
