// The page: takes recordings, lets the program run over them beside it, and shows at any speed what it found up to a moment.

const MODEL = JSON.parse(byId("model").textContent);
const SPEEDS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, Infinity];
const USUAL_LENGTH = 30; // s in which a recording is played where nobody chose a speed
const LONGEST_STEP = 10; // samples; a longer gap is passed as fast
const LEADING = 6;       // candidates with a line of their own
const COLOURS = 7;

function byId(id) { return document.getElementById(id); }

// run, its worker; shown: samples that are shown; owed: s of the recording's time that are due; isChosen: a speed is.
const state = { run: null, worker: null, shown: 0, owed: 0, isPlaying: false, isChosen: false, before: 0, isStale: true };
let charts = [];
let drawnLast = "";
let module = null;

async function unpacked(id) {
  const packed = Uint8Array.from(atob(byId(id).textContent.trim()), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

// ---- a run begins, goes on, and ends

async function begin(name, recording) {
  state.worker?.terminate();
  module ??= await unpacked("module");
  const worker = new Worker(URL.createObjectURL(new Blob([byId("worker").textContent], { type: "text/javascript" })));
  const run = new Run(name, recording.size);
  Object.assign(state, { run, worker, shown: 0, owed: 0, isPlaying: true, isStale: true });
  drawnLast = "";
  worker.onmessage = ({ data }) => { if (state.run === run) heard(run, data); };
  worker.onerror = (event) => { if (state.run === run) heard(run, { samples: [], lines: [], share: 1, over: { code: 3, text: event.message } }); };
  worker.postMessage({ module, recording });
  byId("source").textContent = name;
  byId("save").hidden = true;
  byId("position").disabled = false;
  tellProblem("");
}

function heard(run, message) {
  run.take(message);
  if (!state.isChosen && run.count > 1) byId("speed").value = String(usualSpeed(run.horizon - run.time(0)));
  const isRefused = Boolean(run.over) && !run.count; // nothing of the recording before it stays on the page
  if (run.count || isRefused) {
    byId("welcome").hidden = !isRefused;
    byId("board").classList.toggle("is-waiting", isRefused);
  }
  if (run.over) heardLast(run);
  state.isStale = true;
}

function heardLast(run) {
  state.worker.terminate();
  const isRefused = run.over.code >= 2 && run.over.code !== 4;
  tellProblem([...run.remarks.map((text) => named(text, run.name)), ...isRefused ? [problemText(run)] : []].join(" "));
  if (!run.count) state.isPlaying = false;
  const link = byId("save");
  if (link.href) URL.revokeObjectURL(link.href);
  link.href = URL.createObjectURL(new Blob(run.lines, { type: "application/x-ndjson" }));
  link.hidden = !run.lines.length;
}

// What the program says of a recording that it refuses, with the name of the file.
function problemText({ name, over }) {
  if (over.code === 3) return `The program failed: ${over.text}.`;
  return named(over.text, name);
}

const named = (text, name) => text.replace(/^(standard input|-)(?=:)/, name).replace(/^line (?=\d)/, `${name}: line `);

function tellProblem(text) {
  byId("problem").textContent = text;
  byId("problem").hidden = !text;
}

function usualSpeed(length) {
  const wanted = length / USUAL_LENGTH;
  return SPEEDS.find((speed) => speed >= 0.8 * wanted) ?? Infinity;
}

// ---- time passes

// How long the recording took from the sample before to this one, s.
function stepOf(run, k) {
  const step = run.time(k) - run.time(k - 1);
  return Math.min(Math.max(step, 0), LONGEST_STEP * (MODEL.sampleTime ?? Infinity));
}

function advance(seconds) {
  const { run } = state, speed = Number(byId("speed").value);
  if (speed === Infinity) state.shown = run.count;
  state.owed += seconds * speed;
  while (state.shown < run.count && state.owed >= stepOf(run, state.shown)) state.owed -= stepOf(run, state.shown++);
  if (state.shown < run.count) return;
  state.owed = 0; // it waits for the program
  if (run.over) state.isPlaying = false;
}

function frame(now) {
  const seconds = Math.min((now - state.before) / 1000, 0.25);
  state.before = now;
  if (state.run && state.isPlaying) {
    const { shown, isPlaying } = state;
    advance(seconds);
    state.isStale ||= shown !== state.shown || isPlaying !== state.isPlaying;
  }
  if (state.run && state.isStale) show();
  requestAnimationFrame(frame);
}

// ---- what is shown

function show() {
  const { run, shown } = state;
  state.isStale = false;
  const isAtEnd = Boolean(run.over) && shown === run.count;
  document.body.dataset.state = isAtEnd ? "over" : state.isPlaying ? "playing" : "paused";
  showPlayer(run, shown, isAtEnd);
  const found = { detection: run.detectionAt(shown), diagnosis: run.diagnosisAt(shown), isAtEnd };
  const key = [run.name, found.detection?.at, found.diagnosis?.at, isAtEnd, phaseOf(run, shown), run.over?.code].join();
  if (key !== drawnLast) showFindings(run, found);
  drawnLast = key;
  if (run.count) showCharts(run, shown, found);
}

function showPlayer(run, shown, isAtEnd) {
  const play = byId("play"), position = byId("position");
  play.classList.toggle("is-playing", state.isPlaying);
  play.setAttribute("aria-label", state.isPlaying ? "Pause" : isAtEnd ? "Play again" : "Play");
  const begin = run.time(0), length = run.horizon - begin || 1;
  const share = (k) => k ? 1000 * (run.time(k - 1) - begin) / length : 0;
  position.value = String(share(shown));
  position.style.setProperty("--shown", `${share(shown) / 10}%`);
  position.style.setProperty("--ready", `${share(run.count) / 10}%`);
  const now = clockText(run.time(shown - 1));
  position.setAttribute("aria-valuetext", run.count ? now : "at the start");
  byId("clock").textContent = run.count ? now + endText(run) : run.over ? "nothing to show" : "reading";
}

// Where the recording ends; a date has no room beside another on a phone.
function endText(run) {
  if (isUnix(run.time(0))) return "";
  return run.isOpen ? ` of about ${clockText(Number(run.horizon.toPrecision(3)))}` : ` of ${clockText(run.horizon)}`;
}

// What the program does at a sample: 0 to 2 it has not begun to watch.
const phaseOf = (run, shown) => shown ? Math.max(run.column("status")[shown - 1], 0) : 0;

function showFindings(run, { detection, diagnosis, isAtEnd }) {
  const [kind, sentence, more] = headline(run, detection, diagnosis, isAtEnd);
  byId("verdict").className = `verdict ${kind}`;
  byId("headline").textContent = sentence;
  byId("beside").textContent = more;
  byId("beside").hidden = !more;
  byId("facts").replaceChildren(...factsOf(run, detection, isAtEnd).map(([label, text]) => {
    const fact = document.createElement("div");
    fact.append(element("dt", label), element("dd", text));
    return fact;
  }));
  if (detection || isAtEnd) byId("told").textContent = isAtEnd ? sentence : alarmText(detection);
  showRanking(diagnosis);
  showHeat(diagnosis);
}

// State of the verdict, what it is, and what is to be said beside it.
function headline(run, detection, diagnosis, isAtEnd) {
  if (!run.count) return run.over ? ["open", "This recording cannot be watched.", ""] : ["ready", "Reading the recording.", ""];
  if (isAtEnd && run.over.code === 4) return ["open", `No verdict: ${run.over.text}.`, ""];
  if (diagnosis) return ["fault", verdictSentence(diagnosis, detection), earlySentence(diagnosis, detection)];
  if (detection) return ["fault", "A fault was detected; there is no diagnosis yet.", ""];
  if (isAtEnd && run.over.code === 0) return healthyHeadline(run);
  if (isAtEnd && run.over.code === 1) return ["partial", overSentence(run.ended.length), ""];
  if (isAtEnd) return ["open", "The recording could not be read to its end.", ""];
  const isWatching = phaseOf(run, state.shown) >= 3;
  return isWatching ? ["watching", "No fault so far.", ""] : ["watching", "Getting to know the plant.", `Alarms are off for the first ${withNoun(MODEL.warmUp, "sample")}.`];
}

// That no fault was found, and by which sensors, where some gave no value.
function healthyHeadline(run) {
  const silent = (run.end?.silent ?? []).filter((item) => item.role === "sensor");
  const never = silent.filter((item) => !item.values).map((item) => item.name);
  const heard = MODEL.sensors.map((item) => item.name).filter((name) => !never.includes(name));
  const few = heard.length <= NAMED_SETS ? joined(heard) : `${heard.length} of ${MODEL.sensors.length} sensors`;
  const span = durationText(run.time(run.count - 1) - run.time(0));
  return [silent.length ? "partial" : "healthy", `No fault found ${never.length ? `by ${few} ` : ""}in ${run.count} samples (${span}).`, ""];
}

// When a sensor or an input was silent: always, or in its longest silence.
function silenceText({ name, values, since, until }) {
  if (!values) return `${name} (no value)`;
  if (since == null) return `${name} before ${clockText(until)}`;
  return `${name} from ${clockText(since)} ${until == null ? "on" : `to ${clockText(until)}`}`;
}

// That no alarm is open any more, and nobody was told of a fault.
const overSentence = (count) =>
  `${count === 1 ? "The alarm was" : "Each alarm was"} over by itself: nothing was further off than healthy parts may be. No fault is claimed.`;

const alarmText = (detection) => `${MODEL.falseAlarms ? "Alarm" : "Fault detected"} at ${clockText(detection.time)}.`;

function factsOf(run, detection, isAtEnd) {
  const facts = [];
  if (detection) {
    facts.push(["Detected at", clockText(detection.time)], ["Estimated onset", clockText(detection.change_time)]);
    facts.push(["Delay", durationText(detection.time - detection.change_time)]);
    facts.push(["Seen in", joined(detection.signals) || detection.walk?.parameter || "slow error"]);
  }
  if (isAtEnd && run.end) facts.push(["Samples", String(run.end.samples)], ["Recording", defectsOf(run.end) || "complete"]);
  if (isAtEnd && run.end?.silent.length) facts.push(["Not watched", run.end.silent.map(silenceText).join("; ")]);
  return facts;
}

function defectsOf(end) {
  const names = ["missing", "late", "duplicate", "untimed", "unused", "saturated", "frozen", "wild"];
  const found = names.filter((name) => end[name]).map((name) => `${end[name]} ${name}`);
  if (end.clock_jumps) found.push(withNoun(end.clock_jumps, "clock jump"));
  if (end.outside) found.push(`${end.outside} not judged`);
  if (end.sensors_outside) found.push(`${withNoun(end.sensors_outside, "reading")} not judged`);
  return found.join(", ");
}

function element(kind, text, name = "") {
  const made = document.createElement(kind);
  made.textContent = text;
  if (name) made.className = name;
  return made;
}

function showRanking(diagnosis) {
  const shown = diagnosis ? diagnosis.candidates.filter((item, k) => k < SHOWN && (k < 3 || item.group || item.probability >= NEGLIGIBLE + diagnosis.even)) : [];
  const isSeveral = shown.filter((item, k) => item.group || k === 0).length > 1;
  const told = diagnosis ? `At ${clockText(diagnosis.time)}${isSeveral ? "; those marked ● cannot yet be told from the best" : ""}.` : "They are ranked once there is an alarm.";
  byId("ranked").textContent = told + (diagnosis?.unexplained ? " The data contradict them all: their order tells which comes nearest, and none is likely." : "");
  byId("ranking").replaceChildren(...shown.map((candidate, k) => rankOf(candidate, isSeveral && (candidate.group || k === 0), k === 0, Boolean(diagnosis.unexplained))));
  const left = diagnosis ? diagnosis.count - shown.length : 0;
  byId("remainder").textContent = [left > 0 ? `... and ${left} more.` : "", diagnosis ? besideText(diagnosis) : ""].join(" ").trim();
}

// A candidate of the ranking; where the data contradict all of them none has a probability that is worth a look.
function rankOf(candidate, isMarked, isFirst, isContradicted) {
  const made = element("li", "", candidate.group || isFirst ? "group" : "");
  const line = element("div", "", "line"), bar = element("span", "", "bar"), fill = element("i", "");
  line.append(element("span", titleOf(candidate), "name"), element("span", candidate.kind || "", "kind"));
  if (isMarked) line.append(element("span", "●", "mark"));
  if (!isContradicted) line.append(element("b", `${probabilityText(candidate.probability)} %`));
  fill.style.width = `${(100 * candidate.probability).toFixed(1)}%`;
  bar.append(fill);
  made.append(line, ...(isContradicted ? [] : [bar]), ...suspectsOf(candidate).map(([name, item]) => element("p", estimateText(name, item), "what")));
  return made;
}

// A suspect's value, and what it should be.
function estimateText(name, item) {
  const unit = about(name), word = unit.word || name;
  if (isUndetermined(name, item)) return `${word} is not determined by the data`;
  const estimate = spaced(bothText(fromSi(unit, item.estimate), differenceFromSi(unit, item.sd)), unit.unit);
  const change = item.nominal == null ? "" : changeText(item.nominal, item.estimate, item.sd);
  const nominal = item.nominal == null || unit.word ? "" : `; healthy ${numberText(fromSi(unit, item.nominal))}`;
  return `${word} ${estimate}${change ? ` (${change})` : ""}${nominal}`;
}

// ---- the drawing of the plant

const heats = new Map(); // what is coloured of each part of the drawing

const LEAST = 0.65; // of its size at which the letters of the drawing can be read, 9 px; where there is less room, it is moved

function prepareHeat() {
  for (const drawing of document.querySelectorAll("#drawing svg")) drawing.style.minWidth = `${LEAST * drawing.viewBox.baseVal.width}px`;
  for (const node of document.querySelectorAll("#drawing g.node")) {
    const paper = node.querySelector(".paper"), heat = paper.cloneNode();
    heat.setAttribute("class", "heat");
    heat.setAttribute("fill-opacity", "0");
    paper.after(heat);
    heats.set(node.dataset.name, { node, heat });
  }
}

function showHeat(diagnosis) {
  const isClaimed = diagnosis && !diagnosis.unexplained;
  for (const [name, { node, heat }] of heats) {
    const share = isClaimed ? diagnosis.parts[name] || 0 : 0;
    heat.setAttribute("fill-opacity", (MODEL.strongest * share).toFixed(3));
    node.classList.toggle("suspect", share >= 0.05);
  }
  for (const chip of document.querySelectorAll("[data-instrument]")) {
    const share = isClaimed ? diagnosis.instruments[chip.dataset.instrument] || 0 : 0;
    chip.style.setProperty("--heat", (MODEL.strongest * share).toFixed(3));
    chip.querySelector("b").textContent = share >= 0.005 ? `${probabilityText(share)} %` : "";
  }
}

// ---- the plots

const of = (name) => () => state.run.column(name);

function makeCharts() {
  const made = (place, options) => new Plot(byId(place).appendChild(document.createElement("figure")), { ...options, group: "played" });
  const sensors = MODEL.sensors.map(({ name, unit }) => made("sensors", {
    title: name, unit,
    lines: [
      { label: "measured", color: "measured", width: 1, values: of(`measured.${name}`) },
      { label: "expected", color: "expected", width: 1.6, values: of(`expected.${name}`), sd: of(`sd.${name}`) },
    ],
  }));
  sensors.forEach((chart, k) => { chart.sensor = MODEL.sensors[k].name; });
  const statistics = [...MODEL.sensors.map(({ name }) => [`CUSUM of ${name}`, `cusum.${name}`]), ...MODEL.slow.map(({ name, place }) => [name, `slow.${place}`])];
  const detector = made("detector", {
    title: "share of the limit", levels: [[1, "limit"]], lowest: 0,
    lines: statistics.map(([label, key], k) => ({ label, color: `line${k % COLOURS}`, width: 1.3, values: of(key) })),
  });
  const units = [...new Set(MODEL.inputs.map((item) => item.unit))];
  const inputs = units.map((unit) => {
    const items = MODEL.inputs.filter((item) => item.unit === unit);
    const lines = items.map(({ name }, k) => ({ label: name, color: `line${k % COLOURS}`, stepped: true, values: of(`input.${name}`) }));
    return made("inputs", { title: items.length > 1 ? "inputs" : items[0].name, unit, lines });
  });
  if (!units.length) document.querySelector(".acting").hidden = true;
  chances = made("chances", { title: "probability", unit: "%", lowest: 0, highest: 100, lines: [] });
  charts = [...sensors, detector, ...inputs];
}

// The first sample that is later than a time, among those that there are.
function sampleAfter(run, time, count) {
  let low = 0, high = count;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (run.time(middle) <= time) low = middle + 1;
    else high = middle;
  }
  return low;
}

function showCharts(run, shown, { detection, diagnosis }) {
  const marks = detection ? [{ time: detection.change_time, label: "onset" }, { time: detection.time, label: "alarm" }] : [];
  const view = { shown, begin: run.time(0), end: run.horizon, times: run.column("time"), marks, isClock: isUnix(run.time(0)) };
  const found = diagnosis?.unexplained;
  for (const chart of charts) chart.draw({ ...view, shade: found && found.signal === chart.sensor ? [found.since, found.until] : null });
  showChances(run, view);
}

let chances;

// Give a line to each of the best candidates: that which is best now, then those that once were most probable.
function showChances(run, view) {
  const diagnoses = run.diagnoses.filter((item) => item.at <= view.shown), times = diagnoses.map((item) => item.time);
  byId("chances").parentElement.classList.toggle("is-empty", !diagnoses.length);
  const peaks = {};
  for (const { chances: found } of diagnoses) for (const [key, chance] of Object.entries(found)) peaks[key] = Math.max(peaks[key] || 0, chance);
  const best = diagnoses.length ? keyOf(diagnoses[diagnoses.length - 1].candidates[0]) : "";
  const leading = Object.keys(peaks).sort((a, b) => (b === best) - (a === best) || peaks[b] - peaks[a]).slice(0, LEADING);
  const lineOf = (label, color, values, width) => ({ label, color, width, values: () => values });
  const lines = leading.map((key, k) => lineOf(key, `line${k % COLOURS}`, diagnoses.map((item) => 100 * (item.chances[key] || 0)), 2));
  const rest = diagnoses.map((item) => 100 * Math.max(0, 1 - leading.reduce((sum, key) => sum + (item.chances[key] || 0), 0)));
  if (Object.keys(peaks).length > leading.length) lines.push(lineOf("all others", "rest", rest, 1.3));
  chances.name(lines);
  chances.draw({ ...view, shown: times.length, times });
}

// ---- what a person does

function playOrPause() {
  const { run } = state;
  if (!run) return playBuiltIn();
  if (!run.count) return;
  if (!state.isPlaying && run.over && state.shown === run.count) state.shown = 0;
  state.isPlaying = !state.isPlaying;
  state.isStale = true;
}

async function playBuiltIn() {
  if (!MODEL.recording) return byId("file").click();
  await begin(MODEL.recording.name, new Blob([await unpacked("recording")]));
}

function seek(share) {
  const { run } = state;
  if (!run?.count) return;
  const time = run.time(0) + share * (run.horizon - run.time(0));
  state.shown = share >= 1 ? run.count : sampleAfter(run, time, run.count);
  state.owed = 0;
  state.isStale = true;
}

function takeFile(file) {
  if (file) begin(file.name, file);
}

function listen() {
  byId("play").addEventListener("click", playOrPause);
  byId("begin")?.addEventListener("click", playBuiltIn);
  byId("position").addEventListener("input", (event) => seek(Number(event.target.value) / 1000));
  byId("speed").addEventListener("change", () => { state.isChosen = true; });
  byId("file").addEventListener("change", (event) => { takeFile(event.target.files[0]); event.target.value = ""; });
  addEventListener("keydown", (event) => {
    if (event.key !== " " || event.target.closest("button, select, input, a, summary")) return;
    event.preventDefault();
    playOrPause();
  });
  addEventListener("dragover", (event) => { event.preventDefault(); byId("veil").hidden = false; });
  addEventListener("dragleave", (event) => { if (!event.relatedTarget) byId("veil").hidden = true; });
  addEventListener("drop", (event) => {
    event.preventDefault();
    byId("veil").hidden = true;
    takeFile(event.dataTransfer.files[0]);
  });
}

function offerSpeeds() {
  byId("speed").replaceChildren(...SPEEDS.map((speed) => new Option(speed === Infinity ? "at once" : `${TIMES}${NO_BREAK}${speed}`, String(speed))));
  const known = MODEL.recording;
  byId("speed").value = String(known ? usualSpeed(known.end - known.start) : 100);
}

offerSpeeds();
makeCharts();
prepareHeat();
listen();
document.body.dataset.state = "ready";
requestAnimationFrame(frame);
