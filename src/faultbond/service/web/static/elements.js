// Small makers of elements, and what the condition of an asset looks like.

const SVG = "http://www.w3.org/2000/svg";

// An element with attributes and children; `on` holds listeners, and what is null is left out.
export function make(kind, attributes = {}, ...children) {
  const made = document.createElement(kind);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "on") Object.entries(value).forEach(([event, heard]) => made.addEventListener(event, heard));
    else if (name in made && typeof value !== "string") made[name] = value;
    else if (value != null) made.setAttribute(name, value);
  }
  made.append(...children.flat().filter((child) => child != null && child !== ""));
  return made;
}

// Replace what an element holds, but only where that is about something new, so that focus and selection stay.
export function renew(place, about, content) {
  const key = JSON.stringify(about);
  if (place.dataset.about === key) return false;
  place.dataset.about = key;
  place.replaceChildren(...[content()].flat().filter((child) => child != null && child !== ""));
  return true;
}

// How likely a candidate is; empty where the data contradict all of them.
export const percentText = ({ percent }) => (percent ? `${percent}${NO_BREAK}%` : "");

const CONDITIONS = { // by NAMUR NE 107, the most urgent first; beside them what is known of the watching itself
  FAILURE: { key: "failure", word: "Failure", rank: 0 },
  OFF_SPEC: { key: "off-spec", word: "Out of specification", rank: 1 },
  "no data": { key: "no-data", word: "No data", rank: 2 },
  stopped: { key: "no-data", word: "Not watched", rank: 3 },
  MAINTENANCE_REQUIRED: { key: "maintenance", word: "Maintenance required", rank: 4 },
  CHECK_FUNCTION: { key: "check", word: "Check function", rank: 5 },
  NORMAL: { key: "normal", word: "Normal", rank: 6 },
};
const FIGURES = { // shapes that differ without colour, with a letter or mark
  failure: ["M12 1.5a10.5 10.5 0 1 0 0 21a10.5 10.5 0 0 0 0-21z", "M7.8 7.8l8.4 8.4M16.2 7.8l-8.4 8.4"],
  "off-spec": ["M12 2 23 21.5H1z", "M12 9v6M12 17.6v1.4"],
  maintenance: ["M12 1 23 12 12 23 1 12z", "M8.3 15.5V9l3.7 4 3.7-4v6.5"],
  check: ["M1 2.5h22L12 22z", "M14.6 8.2a3.6 3.6 0 1 0 0 4.6"],
  normal: ["M12 3.5a8.5 8.5 0 1 0 0 17a8.5 8.5 0 0 0 0-17z", ""],
  "no-data": ["M12 3a9 9 0 1 0 0 18a9 9 0 0 0 0-18z", "M8 12h8"],
};

// What is known of an asset: never normal without data, and nothing while the service is lost.
export function conditionOf(summary, isLost) {
  const found = CONDITIONS[summary.monitoring] ?? CONDITIONS[summary.status] ?? CONDITIONS["no data"];
  if (!isLost) return found;
  return { key: "no-data", word: `Not known, was ${found.word.toLowerCase()}`, rank: found.rank };
}

export function symbol(condition) {
  const made = document.createElementNS(SVG, "svg");
  made.setAttribute("viewBox", "0 0 24 24");
  made.setAttribute("class", `ne ${condition.key}`);
  made.setAttribute("aria-hidden", "true");
  FIGURES[condition.key].forEach((data, k) => {
    const path = document.createElementNS(SVG, "path");
    path.setAttribute("d", data);
    path.setAttribute("class", k ? "mark" : "shape");
    made.append(path);
  });
  return made;
}

const SILENT = new Set(["shelved", "suppressed by design", "out of service"]);
const CALLING = new Set(["unacknowledged", "returned to normal, unacknowledged"]);
export const isSilenced = (alarm) => Boolean(alarm) && SILENT.has(alarm.state);
export const isUnacknowledged = (alarm) => Boolean(alarm) && CALLING.has(alarm.state);

// The state of an alarm in words, marked strongly only where somebody has to look.
export function alarmMark(alarm) {
  if (!alarm) return null;
  let text = alarm.state;
  if (alarm.state === "shelved" && alarm.shelved_until != null) text = `shelved until ${momentText(alarm.shelved_until)}`;
  else if (alarm.acknowledged_by != null && alarm.state === "acknowledged") text = `acknowledged by ${alarm.acknowledged_by}`;
  return make("span", { class: `alarm-mark ${isUnacknowledged(alarm) ? "is-new" : ""}` }, text);
}

// A time of the service or of a sample: of today the second, of another day the minute.
export function momentText(time) {
  if (time == null) return "never";
  if (!isNumber(time)) return clockText(time);
  if (!isUnix(time)) return clockText(Math.abs(time) < 1000 ? Number(time.toPrecision(4)) : Math.round(time));
  const text = new Date(Math.floor(time) * 1000).toISOString();
  const isToday = text.slice(0, 10) === new Date().toISOString().slice(0, 10);
  return `${isToday ? text.slice(11, 19) : `${text.slice(0, 10)}${NO_BREAK}${text.slice(11, 16)}`}${NO_BREAK}UTC`;
}

const TOLERANCE = 5;   // s by which a sample may be before the clock of the service
const PATIENCE = 300;  // s by which it may be behind while samples come in

// How the clock of an asset's samples, a date too, differs from that of the service; empty where it is the same, or counts from a beginning.
export function ownClockText({ time, monitoring }, { isLost, offset }) {
  const ahead = time - Date.now() / 1000 - offset;
  if (!isNumber(time) || !isUnix(time) || isLost || !(ahead > TOLERANCE || (monitoring === "running" && ahead < -PATIENCE))) return "";
  return `${durationText(Math.abs(ahead), 2)} ${ahead > 0 ? "ahead" : "behind"}`;
}

// Since when an asset is as it is: since its alarm, or by the clock of the service where that of its samples is another.
export const sinceText = (summary, state) =>
  momentText(summary.alarm?.since != null && isUnix(summary.alarm.since) && !ownClockText(summary, state) ? summary.alarm.since : summary.since);

// The first sentence of a text, and the rest of it; a number or a name with a point in it is no end of one.
export function headOf(text) {
  const [first, ...rest] = text.split(/(?<=\.) (?=[A-Z`])/);
  return [first, rest.join(" ")].filter(Boolean);
}

// A text in which what is typed stands between backticks, as elements.
export const worded = (text) => text.split("`").map((part, k) => (k % 2 ? make("code", {}, part) : part));

// A report, in a tab of its own or as a file.
export const reportLinks = (href, file, label) => make("span", { class: "job-result" },
  make("a", { class: "report", href, target: "_blank", rel: "noopener" }, label),
  make("a", { class: "report", href, download: file, "aria-label": `Download ${label.toLowerCase()}` }, "↓"));

export const capital = (text) => text.slice(0, 1).toUpperCase() + text.slice(1);

// Whole numbers with groups of three, as they are read.
export const countText = (number) => String(number).replace(/\B(?=(\d{3})+$)/g, "\u202f");
