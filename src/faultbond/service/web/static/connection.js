// The way to the service: questions, deeds, and the stream of what happens, which is taken up again whenever it ends.

const SILENCE = 6000;          // ms without a sign of life after which the service counts as lost; one comes every 2 s
const PAUSES = [500, 1000, 2000, 5000, 10000]; // ms before it is tried again

// An answer that is not 2xx: its sentence for the person, and its status.
export class Refusal extends Error {
  constructor(status, text) {
    super(text);
    this.status = status;
  }
}

let token = "";

async function answered(response) {
  const told = await response.json().catch(() => ({}));
  if (!response.ok) throw new Refusal(response.status, told.error ?? `The service answered ${response.status}.`);
  return told;
}

async function reached(path, options = {}) {
  try {
    return await fetch(path, { cache: "no-store", credentials: "same-origin", ...options });
  } catch (error) {
    if (options.signal?.aborted) throw error;
    throw new Refusal(0, "The service does not answer. Nothing was changed; try again when the page is live.");
  }
}

const asked = async (path, options) => answered(await reached(path, options));

function sent(path, body) {
  const headers = { "content-type": "application/json", "x-faultbond-token": token };
  return asked(path, { method: "POST", headers, body: JSON.stringify(body) });
}

const pathOf = (asset) => `api/v1/assets/${encodeURIComponent(asset)}`;

export async function who() {
  const me = await asked("api/v1/me");
  token = me.token;
  return me;
}

export const login = (name, password) => sent("api/v1/login", { name, password });
export const logout = () => sent("api/v1/logout", {});
export const act = (asset, deed) => sent(`${pathOf(asset)}/deeds`, deed);
export async function pictureOf(asset) {
  const response = await reached(`${pathOf(asset)}/picture`);
  return response.ok ? response.text() : "";
}
export const reportPath = (asset) => `${pathOf(asset)}/report`;

// The off-line desk. A file goes as it is, so that none is ever whole in memory.
const DESK = "api/v1/offline";
export const desk = () => asked(DESK);
export const order = (wanted) => sent(`${DESK}/jobs`, wanted);
export const remove = (job) => asked(`${DESK}/jobs/${job}`, { method: "DELETE", headers: { "x-faultbond-token": token } });
export const resultPath = (job, what) => `${DESK}/jobs/${job}/${what}`;

export function bring(file, kind) {
  const headers = { "content-type": "application/octet-stream", "x-faultbond-token": token };
  return asked(`${DESK}/files?${new URLSearchParams({ kind, name: file.name })}`, { method: "POST", headers, body: file });
}

export function curves(asset, { begin, end, most }, signal) {
  const query = new URLSearchParams({ most: String(most) });
  if (begin != null) query.set("begin", String(begin));
  if (end != null) query.set("end", String(end));
  return asked(`${pathOf(asset)}/curves?${query}`, { signal });
}

// The events in a text of server-sent events, and what is left of it.
export function eventsOf(text) {
  const blocks = text.split("\n\n"), rest = blocks.pop(), events = [];
  for (const block of blocks) {
    let name = "message", data = "";
    for (const line of block.split("\n")) {
      if (line.startsWith("event: ")) name = line.slice(7);
      else if (line.startsWith("data: ")) data += line.slice(6);
    }
    if (data) events.push([name, JSON.parse(data)]);
  }
  return { events, rest };
}

// Follows what happens until it is stopped. heard: each event; live: the stream stands; lost: it does not, and why.
export class Stream {
  constructor(asset, { heard, live, lost }) {
    Object.assign(this, { asset, heard, live, lost, isOver: false, tries: 0, isStanding: false });
    this.watch = setInterval(() => this.check(), 1000);
    this.hurry = () => this.wake?.();
    addEventListener("online", this.hurry);
    document.addEventListener("visibilitychange", this.hurry);
    this.run();
  }

  stop() {
    this.isOver = true;
    clearInterval(this.watch);
    removeEventListener("online", this.hurry);
    document.removeEventListener("visibilitychange", this.hurry);
    this.abort?.abort();
    this.wake?.();
  }

  check() {
    if (!this.isStanding || Date.now() - this.heardAt < SILENCE) return;
    this.fail(new Refusal(0, "Nothing was heard of the service."));
    this.abort.abort();
  }

  fail(error) {
    this.isStanding = false;
    if (!this.isOver) this.lost(error);
  }

  async run() {
    while (!this.isOver) {
      this.abort = new AbortController();
      const opening = setTimeout(() => this.abort.abort(), SILENCE);
      try {
        await this.read(opening);
        this.fail(new Refusal(0, "The service ended the connection."));
      } catch (error) {
        this.fail(error);
        if (error.status === 401) return;
      } finally {
        clearTimeout(opening);
      }
      if (!this.isOver) await this.pause();
    }
  }

  async read(opening) {
    const query = this.asset == null ? "" : `?asset=${encodeURIComponent(this.asset)}`;
    const response = await fetch(`api/v1/events${query}`, { cache: "no-store", signal: this.abort.signal });
    if (!response.ok) await answered(response);
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    for (let text = ""; ;) {
      const { value, done } = await reader.read();
      if (done || this.isOver) return;
      clearTimeout(opening);
      this.heardAt = Date.now();
      if (!this.isStanding) this.live();
      this.isStanding = true;
      this.tries = 0;
      const { events, rest } = eventsOf(text + value);
      text = rest;
      for (const [name, told] of events) this.heard(name, told);
    }
  }

  async pause() {
    const length = PAUSES[Math.min(this.tries++, PAUSES.length - 1)] * (0.8 + 0.4 * Math.random());
    await new Promise((resolve) => { this.wake = resolve; setTimeout(resolve, length); });
  }
}
