// What a person does: a dialog that says what will happen, takes a comment, and sends it.

import { act } from "./connection.js";
import { make, percentText } from "./elements.js";

const SHELVINGS = [[15, "15 min"], [30, "30 min"], [60, "1 h"], [120, "2 h"], [240, "4 h"], [480, "8 h"], [1440, "24 h"]];
const USUAL = 60; // min

// Of each action: how it reads in the journal, and what came of it, its button, whether it changes what the model believes, what it will do, and whether a reason is asked.
export const ACTIONS = {
  acknowledge: { past: "acknowledged the alarm", label: "Acknowledge", says: "You have seen the alarm. It stays until its cause is gone or somebody accepts a diagnosis; nothing else changes." },
  shelve: { past: "shelved the alarm", label: "Shelve", says: "The alarm does not call for a while, and then comes back by itself. The asset is still watched.", asksReason: true },
  unshelve: { past: "unshelved the alarm", label: "Unshelve", says: "The alarm calls again at once." },
  suppress: { past: "suppressed the alarms", label: "Suppress", says: "Alarms of this asset do not call until somebody ends this. It is still watched.", asksReason: true },
  unsuppress: { past: "ended the suppression", label: "End suppression", says: "Alarms of this asset call again." },
  "out of service": { past: "took it out of service", label: "Take out of service", says: "Alarms of this asset do not call until it is put in service again, as during maintenance.", asksReason: true },
  "in service": { past: "put it in service", label: "Put in service", says: "The asset is in service again, and its alarms call." },
  accept: { past: "accepted", end: "; the alarm ended", label: "Accept", isDecision: true, says: "The diagnosis becomes the model from now on: what is expected follows the new values, and the alarm ends. A new one comes if more changes." },
  reject: { past: "rejected", label: "Reject", isDecision: true, says: "This explanation is not taken any more; the others are ranked without it. The alarm stays." },
  repaired: { past: "repaired", end: "; the alarm ended", label: "Repaired", isDecision: true, says: "The part was repaired: it counts as healthy again, with its nominal value, and the alarm ends. A new one comes if the fault is still there." },
  undo: { past: "undid", label: "Undo", says: "What was done is taken back, as if it had not been done. Both stay in the journal." },
};

export const titleOf = (row) => row.names || row.suspects.filter((item) => item.component).map((item) => item.component).join(" with ") || row.suspects[0].name;
const targetOf = (row) => row.target ?? row.suspects.map((item) => item.name);

// Ask for what is needed for an action on an asset, and do it. asset: its view; entry: of the journal, which is undone.
export function askFor(action, asset, { entry = null, done } = {}) {
  const dialog = document.getElementById("dialog"), { name } = asset.summary, about = ACTIONS[action];
  const problem = make("p", { class: "problem-line", role: "alert", hidden: true });
  const comment = make("textarea", { id: "deed-comment", rows: 2, maxLength: 2000, required: Boolean(about.asksReason) });
  const minutes = make("select", { id: "deed-minutes" }, SHELVINGS.map(([value, label]) => make("option", { value: String(value), selected: value === USUAL }, label)));
  const choices = about.isDecision ? choicesOf(asset.rows) : null;
  const confirm = make("button", { type: "submit", class: "main" }, about.label);
  const form = make("form", { method: "dialog" },
    make("h2", { id: "dialog-title" }, headingOf(action, name, entry)),
    make("p", { class: "says" }, about.says),
    choices,
    action === "shelve" ? make("label", { for: "deed-minutes" }, make("span", {}, "For how long"), minutes) : null,
    make("label", { for: "deed-comment" }, make("span", {}, about.asksReason ? "Reason" : "Comment, if any"), comment),
    problem,
    make("div", { class: "dialog-end" }, make("button", { type: "button", on: { click: () => dialog.close() } }, "Cancel"), confirm));
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    confirm.disabled = true;
    problem.hidden = true;
    const deed = { action, comment: comment.value.trim() };
    if (action === "shelve") deed.minutes = Number(minutes.value);
    if (entry) deed.undone = entry.number;
    if (choices) deed.target = JSON.parse(new FormData(form).get("candidate"));
    try {
      const kept = await act(name, deed);
      dialog.close();
      done(kept);
    } catch (error) {
      problem.textContent = error.message;
      problem.hidden = false;
      confirm.disabled = false;
    }
  });
  form.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) form.requestSubmit();
  });
  dialog.replaceChildren(form);
  dialog.showModal();
  (form.querySelector("input:checked") ?? (action === "shelve" ? minutes : comment)).focus();
}

function headingOf(action, name, entry) {
  if (entry) return `Undo entry ${entry.number} of ${name}: ${entry.action} by ${entry.who}?`;
  const what = { acknowledge: `Acknowledge the alarm of ${name}?`, shelve: `Shelve the alarm of ${name}?`, accept: `Accept a diagnosis of ${name}?`, reject: `Reject an explanation of ${name}?`, repaired: `Was a part of ${name} repaired?` };
  return what[action] ?? `${ACTIONS[action].label}: ${name}?`;
}

function choicesOf(rows) {
  const options = rows.slice(0, 12).map((row, k) => make("label", { class: "option" },
    make("input", { type: "radio", name: "candidate", value: JSON.stringify(targetOf(row)), checked: k === 0 }),
    make("span", {}, make("b", {}, titleOf(row)), ...row.suspects.map((item) => make("span", { class: "what" }, valueText(item)))),
    make("span", { class: "percent" }, percentText(row))));
  return make("fieldset", {}, make("legend", {}, "Which one"), options);
}

const valueText = (item) => `${item.name}: ${item.nominal ? `${item.nominal} → ` : ""}${item.estimate}`;
