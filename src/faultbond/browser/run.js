// One run of the program over a recording: what it has said so far, kept in the order in which it happened, so that the
// page can show any moment of it. The program runs ahead of what is shown.

const SHOWN = 8; // candidates of a diagnosis that are kept for the ranking
const CURVES = 500; // diagnoses kept for the curves; of a longer run every second one, then every fourth

// Numbers of each sample as the plots show them, by names; what the program gives is SI.
function columnsOfModel() {
  const slow = MODEL.slow.map((item) => ({ name: `slow.${item.place}`, show: (value) => Math.abs(value / item.limit), from: item.place }));
  const of = (kind, items, show) => items.map((item) => ({ name: `${kind}.${item.name}`, show: (value) => show(item, value) }));
  const all = [
    { name: "time", show: (value) => value },
    { name: "status", show: (value) => value },
    ...of("input", MODEL.inputs, fromSi),
    ...of("measured", MODEL.sensors, fromSi),
    ...of("expected", MODEL.sensors, fromSi),
    ...of("sd", MODEL.sensors, (item, value) => Math.sqrt(Math.max(value, 0)) / item.factor),
    ...of("cusum", MODEL.sensors, (item, value) => value / MODEL.cusumLimit),
  ].map((column, place) => ({ ...column, place }));
  const first = all.length;
  return [...all, ...slow.map((column) => ({ ...column, place: first + column.from }))];
}

class Run {
  constructor(name, size) {
    this.name = name;
    this.size = size;             // bytes of the recording
    this.share = 0;               // of it that has been read
    this.plan = columnsOfModel();
    this.width = 2 + MODEL.inputs.length + 4 * MODEL.sensors.length + MODEL.nSlow;
    this.columns = Object.fromEntries(this.plan.map(({ name: key }) => [key, []]));
    this.lines = [];              // records as the program wrote them
    this.remarks = [];            // what it said of the recording beside them
    this.detections = [];         // each with `at`, the number of samples that came before it
    this.diagnoses = [];
    this.ended = [];              // alarms for which something was accepted
    this.end = null;              // the last record
    this.over = null;             // exit code and words, once the program has ended
  }

  get count() { return this.columns.time.length; }
  column(name) { return this.columns[name]; }
  time(k) { return this.columns.time[Math.min(Math.max(k, 0), this.count - 1)]; }

  takeSamples(numbers) {
    for (let row = 0; row < numbers.length; row += this.width)
      for (const { name, show, place } of this.plan) {
        const value = show(numbers[row + place]);
        this.columns[name].push(isNumber(value) ? value : null); // null is a gap of a plot
      }
  }

  takeLine({ at, text }) {
    this.lines.push(text + "\n");
    const record = JSON.parse(text);
    if (record.record === "detection") this.detections.push({ ...record, at });
    if (record.record === "diagnosis" && record.candidates.length) this.diagnoses.push({ ...briefly(record), at });
    if (record.record === "accepted") this.ended.push({ ...record, at });
    if (record.record === "end") this.end = { ...record, at };
    if (this.diagnoses.length > CURVES) this.diagnoses = this.diagnoses.filter((item, k, all) => k % 2 === 0 || k === all.length - 1);
  }

  take({ samples, lines, remarks = [], share, over }) {
    this.remarks.push(...remarks);
    samples.forEach((numbers) => this.takeSamples(numbers));
    lines.forEach((line) => this.takeLine(line));
    this.share = share;
    if (over) this.over = over;
  }

  // What had been found when the first `shown` samples had passed.
  detectionAt(shown) {
    const detection = last(this.detections, shown), over = last(this.ended, shown);
    return over && over.at >= detection.at ? null : detection;
  }
  diagnosisAt(shown) {
    const detection = this.detectionAt(shown), found = last(this.diagnoses, shown);
    return detection && found && found.at >= detection.at ? found : null;
  }

  // Whether it is not known yet where the recording will end.
  get isOpen() { return !this.over && !(MODEL.recording && this.name === MODEL.recording.name); }

  // Where it will end, as far as that is known.
  get horizon() {
    const begin = this.time(0), now = this.time(this.count - 1);
    if (this.over || !this.share) return now;
    return Math.max(now, this.isOpen ? begin + (now - begin) / this.share : MODEL.recording.end);
  }
}

const last = (items, shown) => {
  let found = null;
  for (const item of items) if (item.at <= shown) found = item;
  return found;
};

// A diagnosis with all that is shown of it: all candidates by name and probability, the best ones whole.
function briefly(record) {
  const chances = {};
  for (const candidate of record.candidates) {
    const key = keyOf(candidate);
    chances[key] = (chances[key] || 0) + candidate.probability;
  }
  const { parts, instruments } = faultProbabilities(record);
  const group = bestGroup(record).length;
  const candidates = record.candidates.slice(0, Math.max(SHOWN, group));
  // what each tested set has of what tells none from another; no more than the least has
  const tested = record.candidates.map((item) => item.probability).filter((probability) => probability > 0);
  const even = Math.min(...tested, (record.mismatch + record.within_accuracy) / Math.max(tested.length, 1));
  return { ...record, even, candidates, chances, parts, instruments, count: record.candidates.length, rest: record.candidates[SHOWN]?.probability };
}

// What a candidate is called throughout a run, while the kind of fault of an instrument may change.
const keyOf = (candidate) => suspectsOf(candidate).map(([name]) => about(name).title).join(" with ");
