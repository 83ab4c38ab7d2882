// Numbers, units and times as a person reads them; the same rules as those of the report (report/numbers.py).

const MINUS = "\u2212", TIMES = "\u00d7", NO_BREAK = "\u00a0";
const RAISED = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
const UNIX_CLOCK = 1e8;   // s; a clock beyond this counts Unix seconds
const PACES = [[1, "s", "second"], [60, "min", "minute"], [3600, "h", "hour"], [86400, "d", "day"]];
const HANDY = 0.01;       // part of a size by which it changes at least in the unit of time that is taken
const VAST = 1e9;         // beyond it only the size is told
const NEARLY_SURE = 98.9; // per cent; from there on a probability is rounded down: 98.97 is no 99.0

const isNumber = (value) => value != null && Number.isFinite(value);
const powerOfTen = (exponent) => "10" + [...String(exponent)].map((letter) => RAISED[letter]).join("");
const withPower = (mantissa, exponent) => exponent ? `${mantissa}${NO_BREAK}${TIMES}${NO_BREAK}${powerOfTen(exponent)}` : mantissa;
const spaced = (number, unit) => unit ? `${number}${NO_BREAK}${unit}` : number;

// The power of ten of a number; logarithms of powers of ten round.
function orderOf(value) {
  return Number(Math.abs(value).toExponential(15).split("e")[1]);
}

// The power of ten by which a number of this size is best written; 0: written out.
function exponentOf(value) {
  if (!isNumber(value) || value === 0) return 0;
  const order = orderOf(value);
  return order >= -3 && order <= 4 ? 0 : order;
}

// The power of ten of the last digit worth printing.
function lastPlace(sd) {
  const place = orderOf(sd);
  return sd < 2.95 * 10 ** place ? place - 1 : place;
}

// A number rounded to the digits that its standard deviation supports: texts of both, and their power of ten.
function figure(value, sd, digits = 6) {
  if (!isNumber(value)) return { value: "unknown", sd: "", exponent: 0 };
  if (!isNumber(sd) || sd <= 0) return exact(value, digits);
  const exponent = exponentOf(Math.max(Math.abs(value), sd)), place = lastPlace(sd);
  if (Math.abs(exponent - place) > 15) return exact(value, digits);
  const decimals = Math.max(0, exponent - place), coarse = 10 ** Math.max(place, 0);
  const [mantissa, error] = [value, sd].map((number) => {
    const whole = place > 0 ? Math.round(number / coarse) * coarse : number;
    return (whole / 10 ** exponent + 0).toFixed(decimals).replace(/^-(0\.?0*)$/, "$1");
  });
  return { value: mantissa, sd: error, exponent };
}

function exact(value, digits) {
  const exponent = exponentOf(Number(value.toPrecision(digits)));
  const mantissa = Number((value / 10 ** exponent).toPrecision(digits));
  return { value: String(mantissa), sd: "", exponent };
}

// A number without its deviation; zero has no power of ten.
function numberText(value, sd, digits) {
  const found = figure(value, sd, digits);
  const isZero = !/[1-9a-z]/.test(found.value);
  return isZero ? found.value.replace("-", "") : withPower(found.value.replace("-", MINUS), found.exponent);
}

function bothText(value, sd) {
  const found = figure(value, sd);
  if (!found.sd) return numberText(value, sd);
  found.value = found.value.replace("-", MINUS);
  return found.exponent ? withPower(`(${found.value} ± ${found.sd})`, found.exponent) : `${found.value} ± ${found.sd}`;
}

const withUnit = (value, unit, sd, digits) => spaced(numberText(value, sd, digits), unit);
const joined = (words) => words.length < 2 ? words.join("") : `${words.slice(0, -1).join(", ")} and ${words[words.length - 1]}`;
const withNoun = (number, noun) => `${number} ${noun}${number === 1 ? "" : "s"}`;
const floored = (percent) => Math.floor(10 * percent + 1e-9) / 10;

// A probability in per cent; never 0 or 100, and near 100 rounded down, as a verdict is.
function probabilityText(probability) {
  const percent = 100 * probability;
  if (percent < 0.1) return "<0.1";
  if (percent > 99.9) return ">99.9";
  return (percent >= NEARLY_SURE ? floored(percent) : percent).toFixed(1);
}

// How sure a verdict is, rounded down so that it is never overstated.
function certaintyText(probability) {
  if (probability > 0.999) return `more than 99.9${NO_BREAK}% sure`;
  if (probability < 0.01) return `less than 1${NO_BREAK}% sure`;
  const percent = 100 * probability;
  return percent >= 99 ? `${floored(percent).toFixed(1)}${NO_BREAK}% sure` : `${Math.floor(percent)}${NO_BREAK}% sure`;
}

// The relative change, `+84 %`; empty where the nominal value is 0.
function changeText(nominal, estimate, sd) {
  if (!nominal || !isNumber(estimate)) return "";
  const percent = 100 * (estimate - nominal) / Math.abs(nominal), relative = 100 * sd / Math.abs(nominal);
  if (Math.abs(percent) >= VAST) return `${vast(percent)}${NO_BREAK}%`;
  const isCoarse = !Number.isFinite(relative) || relative >= 1 || Math.abs(percent) >= 20;
  const text = percent.toFixed(isCoarse ? 0 : 1);
  if (Number(text) === 0) return `0${NO_BREAK}%`;
  return `${percent > 0 ? "+" : ""}${text.replace("-", MINUS)}${NO_BREAK}%`;
}

function vast(value) {
  return `${value > 0 ? "+" : MINUS}${Math.abs(value).toExponential(0).replace("e+", "e")}`;
}

// A length of time in the unit in which it is a handy number.
function durationText(seconds, digits = 3) {
  const [length, name] = PACES.filter(([each]) => each > 1 && Math.abs(seconds) >= 2 * each).pop() || PACES[0];
  const value = seconds / length;
  if (Math.abs(value) >= VAST) return spaced(vast(value).replace(/^\+/, ""), name);
  const rounded = Number(value.toPrecision(digits));
  return spaced(Math.abs(value) >= 10 ** digits ? value.toFixed(0) : String(rounded), name);
}

// The unit of time in which a value of a size changes visibly at a rate.
function paceOf(rate, size) {
  return PACES.find(([seconds]) => Math.abs(rate) * seconds >= HANDY * Math.abs(size)) || PACES[PACES.length - 1];
}

const isUnix = (time) => time >= UNIX_CLOCK;

// A reading of the recording's clock: seconds as written, or date and time where they are Unix seconds.
function clockText(time) {
  if (!isNumber(time)) return "an unknown time";
  if (Math.abs(time) >= 253402300799) return spaced(numberText(time), "s");
  if (!isUnix(time)) return spaced(time < 1e5 ? numberText(time, null, 9) : String(Number(time.toPrecision(12))), "s");
  const text = new Date(Math.round(time * 1000)).toISOString().replace("T", " ");
  return `${text.replace(/\.000Z$/, "").replace("Z", "")}${NO_BREAK}UTC`;
}

// The same, rounded to a tenth of its uncertainty or finer.
function coarseClockText(time, width) {
  if (!isNumber(time) || Math.abs(time) >= 253402300799) return clockText(time);
  if (isUnix(time)) {
    const step = [3600, 60, 1].find((each) => 10 * each <= width) || 1;
    const text = clockText(step * Math.round(time / step));
    return step >= 60 ? text.replace(`:00${NO_BREAK}UTC`, `${NO_BREAK}UTC`) : text;
  }
  const place = width > 0 && Number.isFinite(width) ? orderOf(width) - 1 : -3;
  return clockText(place > 0 ? Math.round(time / 10 ** place) * 10 ** place : Number(time.toFixed(-place)));
}
