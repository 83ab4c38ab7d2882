// The page: who asks, where one is, and what the service tells.

import { AssetView } from "./asset_view.js";
import { Stream, login, logout, who } from "./connection.js";
import { DeskView } from "./desk_view.js";
import { isUnacknowledged, make, renew } from "./elements.js";
import { Overview, linkOf } from "./overview.js";
import { Tour } from "./tour.js";

const TOLD = 8000; // ms for which a sentence stands
const byId = (id) => document.getElementById(id);
const state = { me: null, site: null, assets: new Map(), isLost: true, lostAt: null, offset: 0 };
let stream = null;
let view = null;

// ---- where one is

const isDesk = () => location.hash === "#offline"; // an asset of that name is #/offline
const placeNow = () => (isDesk() ? null : decodeURIComponent(location.hash.replace(/^#\/?/, "")) || null);
const titleNow = () => (isDesk() ? "Off line" : placeNow());

function go() {
  const asset = placeNow();
  stream?.stop();
  view?.stop?.();
  view = null;
  byId("dialog").close();
  byId("crumb").hidden = titleNow() == null;
  byId("crumb").textContent = titleNow() ?? "";
  byId("desk").hidden = !state.me.may_analyse || isDesk();
  if (isDesk() && !state.me.may_analyse) return void (location.hash = "#/");
  byId("main").replaceChildren(make("p", { class: "hint waiting" }, "Asking the service."));
  byId("main").dataset.place = "";
  stream = new Stream(asset, { heard, live, lost });
  tell("");
  scrollTo(0, 0);
}

function viewOf(asset) {
  if (view) return view;
  const main = byId("main");
  view = isDesk() ? new DeskView(main, { tell }) : asset == null ? new Overview(main) : new AssetView(main, asset, { tell });
  main.dataset.place = isDesk() ? "desk" : asset == null ? "overview" : "asset";
  return view;
}

// ---- what the service tells

function heard(name, told) {
  const asset = placeNow();
  if (name === "alive") state.offset = told.now - Date.now() / 1000;
  else if (name === "site") {
    state.site = told;
    state.assets = new Map(told.assets.map((item) => [item.name, item]));
  } else if (name === "service" && state.site) state.site.troubles = told.troubles;
  else if (name === "summary") state.assets.set(told.name, told);
  else if (name === "asset") {
    state.assets.set(told.summary.name, told.summary);
    if (told.summary.name === asset) viewOf(asset).learn(told, state);
  } else if (name === "samples" && told.asset === asset) return viewOf(asset).trends.heard(told);
  if (state.site) later();
}

let wanted = 0;

// Several events come together; the page is shown once.
function later() {
  wanted ||= requestAnimationFrame(() => { wanted = 0; show(); });
}

function show() {
  if (!state.site || !state.me) return;
  const asset = placeNow();
  if (asset == null || view) viewOf(asset).show(state);
  const unseen = [...state.assets.values()].filter((item) => isUnacknowledged(item.alarm));
  tour.show(state);
  byId("home").textContent = state.site.name;
  const { troubles } = state.site;
  byId("troubles").hidden = !troubles.length || state.isLost;
  renew(byId("troubles"), troubles, () => troubles.map((text) => make("p", {}, text)));
  byId("count").hidden = !unseen.length;
  byId("count").href = unseen.length === 1 ? linkOf(unseen[0].name) : "#/";
  byId("count").textContent = unseen.length === 1 ? "1 alarm to acknowledge" : `${unseen.length} alarms to acknowledge`;
  const { version, source } = state.site, sources = source.split(", ");
  renew(byId("about"), [version, source], () => [
    make("p", {}, `faultbond ${version}. It only watches: it is no safety function and writes nothing into the plant.`),
    make("details", {}, make("summary", {}, sources.length === 1 ? "Its source" : `Its ${sources.length} sources`), make("ul", {}, sources.map((text) => make("li", {}, text)))),
  ]);
  document.title = `${state.isLost ? "Not live: " : unseen.length ? `(${unseen.length}) ` : ""}${titleNow() ?? state.site.name}`;
}

// ---- whether it is live

const clock = (milliseconds) => `${new Date(milliseconds).toISOString().slice(11, 19)}${NO_BREAK}UTC`;
const serviceTime = () => Date.now() + 1000 * state.offset;

function live() {
  if (state.isLost && state.lostAt != null) tell("The service is there again.");
  Object.assign(state, { isLost: false, lostAt: null });
  document.body.classList.remove("is-lost");
  byId("lost").hidden = true;
  byId("lost").textContent = "";
  tick();
}

function lost(error) {
  if (error.status === 401) return askLogin();
  if (error.status === 404) return refused(error);
  if (!state.isLost || state.lostAt == null) {
    state.lostAt = stream.heardAt ?? Date.now();
    const since = clock(state.lostAt + 1000 * state.offset);
    byId("lost").textContent = state.site
      ? `Not live since ${since}. What stands below is what was known then; the page tries to reach the service again.`
      : `The service does not answer since ${since}; the page tries again.`;
  }
  state.isLost = true;
  document.body.classList.add("is-lost");
  byId("lost").hidden = false;
  tick();
  later();
}

function refused(error) {
  stream.stop();
  byId("main").replaceChildren(make("section", { class: "panel" }, make("h1", {}, error.message), make("p", {}, make("a", { href: "#/" }, "See all assets"))));
}

function tick() {
  const isLive = !state.isLost;
  byId("live").classList.toggle("is-live", isLive);
  byId("live-text").textContent = isLive ? `Live ${clock(serviceTime())}` : state.lostAt == null ? "Connecting" : `Not live since ${clock(state.lostAt + 1000 * state.offset)}`;
}

let telling = 0;

// A sentence about what was done, read out too; it goes by itself, but not while somebody points at it or is at its button.
function tell(text) {
  const place = byId("told");
  clearInterval(telling);
  if (text) telling = setInterval(() => { if (!place.matches(":hover, :focus-within")) tell(""); }, TOLD);
  place.replaceChildren(...(text ? [text, make("button", { type: "button", on: { click: () => tell("") } }, "Close")] : []));
}

// ---- who asks

async function begin() {
  try {
    state.me = await who();
  } catch (error) {
    if (error.status === 401) return askLogin();
    byId("lost").textContent = `${error.message} The page tries again.`;
    byId("lost").hidden = false;
    return void setTimeout(begin, 2000);
  }
  byId("person").textContent = `${state.me.name}, ${state.me.role}`;
  byId("person").hidden = false;
  byId("leave").hidden = !state.me.can_log_out;
  go();
}

function askLogin() {
  stream?.stop();
  view?.stop?.();
  view = null;
  Object.assign(state, { me: null, site: null, assets: new Map(), isLost: true, lostAt: null });
  for (const id of ["person", "leave", "count", "crumb", "lost", "troubles", "desk"]) byId(id).hidden = true;
  document.body.classList.remove("is-lost");
  tour.hide();
  byId("live-text").textContent = "Not logged in";
  byId("live").classList.remove("is-live");
  const problem = make("p", { class: "problem-line", role: "alert", hidden: true });
  const name = make("input", { id: "login-name", autocomplete: "username", required: true, maxLength: 200 });
  const password = make("input", { id: "login-password", type: "password", autocomplete: "current-password", required: true, maxLength: 1000 });
  const enter = make("button", { type: "submit", class: "main" }, "Log in");
  const form = make("form", { class: "panel login" }, make("h1", {}, "Log in"),
    make("label", { for: "login-name" }, make("span", {}, "Name"), name), make("label", { for: "login-password" }, make("span", {}, "Password"), password), problem, enter);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    enter.disabled = true;
    try {
      await login(name.value, password.value);
      await begin();
    } catch (error) {
      problem.textContent = error.message;
      problem.hidden = false;
      password.value = "";
      password.focus();
    }
    enter.disabled = false;
  });
  byId("main").replaceChildren(form);
  name.focus();
}

addEventListener("hashchange", () => { if (state.me) go(); });
byId("skip").addEventListener("click", () => byId("main").focus());
byId("leave").addEventListener("click", async () => {
  await logout().catch(() => {});
  askLogin();
});
const tour = new Tour({ button: byId("tour"), offer: byId("offer"), main: byId("main") });
setInterval(tick, 1000);
begin();
