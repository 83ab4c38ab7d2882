// The off-line desk: recordings that people bring, watched afterwards, one after the other.

import { Refusal, bring, desk, order, remove, resultPath } from "./connection.js";
import { capital, make, momentText, percentText, renew, reportLinks, worded } from "./elements.js";

const BUSY = 1500, IDLE = 10000; // ms between two questions, while something is at work or waits, and else
const SHOWN = 5;                 // candidates of an analysis
const LARGEST = 2 ** 20;         // bytes of a model or a table
const VERDICTS = { fault: "Fault found", healthy: "No fault found", none: "No verdict" };
const STATES = { waiting: "Waits", "at work": "At work", failed: "Failed", stopped: "Stopped", "cut off": "Cut off" };
const RESULTS = { report: "Report", records: "Records", analysis: "What could be found" };

const panel = (key, title, ...content) =>
  make("section", { class: `panel ${key}`, "aria-labelledby": `of-${key}` }, make("h2", { id: `of-${key}` }, title), ...content);
const field = (id, label, input, hint) =>
  make("div", { class: "field" }, make("label", { for: id }, make("span", {}, label), input), hint ? make("p", { class: "hint", id: `${id}-hint` }, hint) : null);

export class DeskView {
  constructor(place, { tell }) {
    Object.assign(this, { tell, isOver: false, isSending: false, state: null });
    this.limits = make("p", { class: "hint" });
    this.recording = make("input", { type: "file", id: "desk-recording", required: true, "aria-describedby": "desk-recording-hint" });
    this.asset = make("select", { id: "desk-asset" });
    this.model = make("input", { type: "file", id: "desk-model", accept: ".yaml,.yml", "aria-describedby": "desk-model-hint" });
    this.tables = make("input", { type: "file", id: "desk-tables", accept: ".csv", multiple: true, "aria-describedby": "desk-tables-hint" });
    this.analyse = make("input", { type: "checkbox", id: "desk-analyse" });
    this.problem = make("p", { class: "problem-line", role: "alert", hidden: true });
    this.start = make("button", { type: "submit", class: "main" }, "Start");
    this.sending = make("p", { class: "hint", role: "status" });
    this.form = make("form", { class: "desk" },
      field("desk-recording", "Recording", this.recording, " "),
      make("fieldset", {}, make("legend", {}, "Model"), this.choice("asset", "Of an asset", true), this.choice("file", "A file", false)),
      this.ofAsset = field("desk-asset", "Asset", this.asset),
      this.ofFile = make("div", { class: "fields" },
        field("desk-model", "Model file", this.model, "YAML"),
        field("desk-tables", "Tables that it names, if any", this.tables, "CSV, under the names in the model")),
      make("label", { class: "tick", for: "desk-analyse" }, this.analyse, make("span", {}, "Tell also which faults could be found (takes longer)")),
      this.problem, make("div", { class: "desk-end" }, this.start, this.sending));
    this.form.addEventListener("submit", (event) => { event.preventDefault(); this.send(); });
    this.form.addEventListener("change", () => this.showChoice());
    this.list = make("ol", { class: "jobs" });
    place.replaceChildren(
      make("h1", { class: "unseen" }, "Off line"),
      panel("desk-new", "Analyse a recording", make("p", {}, "It is watched as if it came now, in a process of its own. What is watched live is not touched."), this.limits, this.form),
      panel("desk-jobs", "Analyses", this.list));
    this.showChoice();
    this.learn();
  }

  choice(value, text, checked) {
    return make("label", { class: "pick" }, make("input", { type: "radio", name: "desk-model-of", value, defaultChecked: checked }), make("span", {}, text));
  }

  get isByFile() {
    return new FormData(this.form).get("desk-model-of") === "file";
  }

  showChoice() {
    this.ofAsset.hidden = this.isByFile;
    this.ofFile.hidden = !this.isByFile;
    this.model.required = this.isByFile;
  }

  stop() {
    this.isOver = true;
    clearTimeout(this.timer);
  }

  show(state) {
    this.state = state;
    this.start.disabled = state.isLost || this.isSending;
    for (const button of this.list.querySelectorAll("button")) button.disabled = state.isLost;
  }

  // Ask how all stand, and again after a while.
  async learn() {
    clearTimeout(this.timer);
    let told = null;
    try {
      told = await desk();
    } catch (error) {
      if (error.status === 401) this.stop();
    }
    if (this.isOver) return;
    if (told) this.showAll(told);
    const isBusy = told?.jobs.some((job) => job.state === "waiting" || job.state === "at work");
    this.timer = setTimeout(() => this.learn(), isBusy ? BUSY : IDLE);
  }

  showAll({ now, limits, assets, jobs }) {
    this.upload = limits.upload;
    this.limits.textContent = `A recording has ${sizeText(limits.upload)} at most. An analysis may take ${spanText(limits.seconds)} and ${sizeText(limits.memory)} of memory; the newest ${limits.jobs} are kept, for ${spanText(86400 * limits.days)}.`;
    this.recording.accept = limits.parquet ? ".csv,.parquet,.pq" : ".csv";
    document.getElementById("desk-recording-hint").textContent = limits.parquet ? "CSV or Parquet" : "CSV";
    renew(this.asset, assets, () => assets.map((name) => make("option", { value: name }, name)));
    renew(this.list, [jobs.map((job) => job.id), !jobs.length], () =>
      jobs.length ? jobs.map((job) => make("li", { "data-job": job.id })) : make("li", { class: "hint" }, "Nothing was analysed yet."));
    jobs.forEach((job, k) => renew(this.list.children[k], { job, time: job.state === "at work" ? Math.floor(now) : 0 }, () => this.row(job, now)));
    if (this.state) this.show(this.state);
  }

  row(job, now) {
    const isWarning = ["failed", "stopped", "cut off"].includes(job.state), isFault = job.verdict === "fault";
    const word = job.state === "done" ? VERDICTS[job.verdict] : job.state === "waiting" && job.place ? `Waits, ${job.place} in the queue` : STATES[job.state];
    const files = job.files.slice(job.asset ? 1 : 2).map((item) => item.name);
    const spent = job.ended ?? (job.state === "at work" ? now : null);
    return [
      make("div", { class: "job-head" },
        make("b", { class: `job-state ${isFault ? "is-fault" : isWarning ? "is-warning" : ""}` }, word),
        make("span", { class: "job-name" }, job.files[0].name),
        make("span", { class: "job-of" }, job.asset ? `by the model of ${job.asset}` : `by ${[job.model, ...files].join(", ")}`)),
      job.state === "at work" ? this.share(job) : null,
      job.said && job.said !== `${word}.` ? make("p", { class: "job-said" }, worded(job.said)) : null,
      job.candidates.length ? make("ol", { class: "job-candidates" }, job.candidates.filter((item, k) => item.group || k < 3).slice(0, SHOWN).map(candidateOf)) : null,
      job.remarks.length ? make("ul", { class: "notes" }, job.remarks.map((text) => make("li", {}, worded(capital(text))))) : null,
      make("div", { class: "job-end" },
        job.results.map((what) => this.result(job, what)),
        make("button", { type: "button", "data-remove": job.id, "aria-label": `${job.ended ? "Remove" : "Stop"} the analysis of ${job.files[0].name}`, on: { click: () => this.ask(job) } }, job.ended ? "Remove" : "Stop"),
        make("span", { class: "moment" }, `${job.who}, ${momentText(job.at)}${spent && job.began ? `, ${job.ended ? "took" : "for"} ${spanText(Math.max(1, Math.round(spent - job.began)))}` : ""}`)),
    ];
  }

  share(job) {
    const label = `Read of ${job.files[0].name}`;
    return job.share == null ? make("progress", { "aria-label": label }) : make("progress", { "aria-label": label, value: job.share, max: 1 });
  }

  result(job, what) {
    const base = job.files[0].name.replace(/\.[^.]*$/, "");
    const file = `${base}.${{ report: "html", records: "jsonl", analysis: "txt" }[what]}`, href = resultPath(job.id, what);
    if (what !== "records") return reportLinks(href, file, RESULTS[what]);
    return make("span", { class: "job-result" }, make("a", { class: "report", href, download: file, "aria-label": "Download records" }, "Records"));
  }

  async send() {
    this.isSending = true;
    this.start.disabled = true;
    this.problem.hidden = true;
    this.tell("");
    try {
      const wanted = { analyse: this.analyse.checked };
      this.check(this.recording.files[0], "recording");
      if (this.isByFile) {
        this.check(this.model.files[0], "model");
        for (const file of this.tables.files) this.check(file, "table");
      }
      if (this.isByFile) {
        wanted.model = await this.bring(this.model.files[0], "model");
        wanted.tables = [];
        for (const file of this.tables.files) wanted.tables.push(await this.bring(file, "table"));
      } else wanted.asset = this.asset.value;
      wanted.recording = await this.bring(this.recording.files[0], "recording");
      await order(wanted);
      this.form.reset();
      this.showChoice();
      this.tell("The analysis waits for its turn.");
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      this.problem.textContent = error.message;
      this.problem.hidden = false;
    } finally {
      this.isSending = false;
      this.sending.textContent = "";
      this.start.disabled = Boolean(this.state?.isLost);
      this.learn();
    }
  }

  // Refuse what is too large before any of it is sent, as the service would: it ends the connection then, and a browser may not tell why.
  check(file, kind) {
    const most = kind === "recording" ? this.upload : Math.min(this.upload, LARGEST);
    if (file.size > most) throw new Refusal(413, `It is too large. A ${kind} has ${sizeText(most)} at most.`);
  }

  async bring(file, kind) {
    this.sending.textContent = `Sending ${file.name}, ${sizeText(file.size)}.`;
    return (await bring(file, kind)).id;
  }

  ask(job) {
    const dialog = document.getElementById("dialog"), name = job.files[0].name, word = job.ended ? "Remove" : "Stop";
    const problem = make("p", { class: "problem-line", role: "alert", hidden: true });
    const confirm = make("button", { type: "submit", class: "main" }, word);
    const form = make("form", { method: "dialog" },
      make("h2", { id: "dialog-title" }, `${word} the analysis of ${name}?`),
      make("p", { class: "says" }, "It is removed with all its files. The journal keeps that it was."), problem,
      make("div", { class: "dialog-end" }, make("button", { type: "button", on: { click: () => dialog.close() } }, "Cancel"), confirm));
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      confirm.disabled = true;
      try {
        await remove(job.id);
        dialog.close();
        this.tell(`The analysis of ${name} is removed.`);
        this.learn();
      } catch (error) {
        problem.textContent = error.message;
        problem.hidden = false;
        confirm.disabled = false;
      }
    });
    dialog.replaceChildren(form);
    dialog.showModal();
    confirm.focus();
  }
}

const candidateOf = ({ names, components, kind, percent, change, group }) => {
  const what = components.length ? components.join(" with ") : names.join(" with ");
  return make("li", { class: group ? "group" : "" }, make("b", {}, what), kind ? ` ${kind}` : "", make("span", { class: "job-names" }, [names.join(", "), change].filter(Boolean).join(" ")), make("span", { class: "percent" }, percentText({ percent })));
};

const UNITS = [[1e9, "GB"], [1e6, "MB"], [1e3, "kB"]];
const sizeText = (bytes) => {
  const [factor, unit] = UNITS.find(([least]) => bytes >= least) ?? [1, "bytes"];
  return `${Number((bytes / factor).toPrecision(3))}${NO_BREAK}${unit}`;
};
const SPANS = [[86400, "days"], [3600, "h"], [60, "min"]];
const spanText = (seconds) => {
  const [factor, unit] = SPANS.find(([least]) => seconds >= 2 * least) ?? [1, "s"];
  return `${Number((seconds / factor).toPrecision(2))}${NO_BREAK}${unit}`;
};
