// What a run has found so far, in words; the same sentences as those of the report (report/verdict.py, suspects.py).

const SIGNIFICANT = 2;    // standard deviations
const WILD = 0.1;         // of its value, by which a drift may move in a sample
const OTHERWISE = 0.05;  // a kind with at least this share is told beside the likeliest one
const NAMED_SETS = 4;     // candidates of a group named in a sentence
const NEGLIGIBLE = 0.001;
const MOVES = " (this value still moves)";
const KIND_WORDS = {
  step: "a step", drift: "a drift", intermittent: "a fault that comes and goes", bias: "a bias", gain: "a wrong gain",
  stuck: "one that is stuck", noise: "a sensor that scatters", ramp: "a ramp that has ended",
};
const KIND_ENDS = { step: "", drift: " drifting", ramp: " changed over a while", intermittent: " coming and going" };

// What is known of a suspect, by its name in the records.
const about = (name) => MODEL.suspects[name] || { title: name, owner: name, part: name, unit: "", factor: 1, offset: 0 };
const fromSi = (item, value) => value == null ? value : (value - item.offset) / item.factor;
const differenceFromSi = (item, value) => value == null ? value : value / item.factor;

const suspectsOf = (candidate) => Object.entries(candidate.parameters);
const isInstrument = (name) => name.includes(".");
const titleOf = (candidate) => suspectsOf(candidate).map(([name]) => about(name).title).join(" with ");
function titleAndKind(candidate) {
  const suspects = suspectsOf(candidate);
  if (suspects.length === 1 || candidate.kind === "intermittent") {
    return titleOf(candidate) + (KIND_ENDS[candidate.kind] ?? ` ${candidate.kind}`);
  }
  return suspects.map(([name, item]) => about(name).title + ending(name, item)).join(" with ");
}
// What kind of fault one of several suspects has, where that is not a step.
function ending(name, item) {
  if (item.rate != null) return KIND_ENDS.drift;
  if (item.began != null) return KIND_ENDS.ramp;
  return isInstrument(name) ? ` ${name.split(".")[1]}` : "";
}
const ownersOf = (candidate) => joined([...new Set(suspectsOf(candidate).map(([name]) => about(name).owner))]);
const isOff = (item) => Math.abs(item.estimate - (item.nominal || 0)) >= SIGNIFICANT * item.sd;

function bestGroup(diagnosis) {
  const [first, ...others] = diagnosis.candidates;
  return [first, ...others.filter((candidate) => candidate.group)];
}

function isUndetermined(name, item) {
  if (!isNumber(item.sd) || !isNumber(item.estimate)) return true;
  const { change } = about(name);
  return isNumber(change) && item.sd >= MODEL.undetermined * change;
}

function listed(names) {
  const more = names.length - NAMED_SETS;
  return joined(more > 0 ? [...names.slice(0, NAMED_SETS), `${more} more`] : names);
}

function rateText(unit, item) {
  const [seconds, , word] = paceOf(item.rate, item.estimate);
  const [rate, sd] = [item.rate, item.rate_sd].map((value) => differenceFromSi(unit, Math.abs(value || 0)) * seconds);
  return `${withUnit(rate, unit.unit, sd)} per ${word}`;
}

function courseText(item) {
  const took = Math.max(item.ended - item.began, 0);
  return `in about ${durationText(took, 2)} up to about ${coarseClockText(item.ended, took)}${item.moved ? "" : ", and has stayed there since"}`;
}

// What is wrong with a sensor or an input.
function misreading(name, item) {
  const unit = about(name), { word } = unit;
  const value = fromSi(unit, item.estimate), sd = differenceFromSi(unit, item.sd);
  if (word === "stuck") return `it is stuck at ${withUnit(value, unit.unit, sd)}`;
  if (!isOff(item)) return `its ${word} may still be ${word === "bias" ? "0" : "right"}`;
  if (word === "gain") {
    const change = changeText(item.nominal || 0, item.estimate, item.sd);
    const times = `${numberText(value, sd)} times`, rest = `${unit.shownIn}${change ? ` (gain, ${change})` : ""}`;
    return unit.isInput ? `it acts ${times} what is recorded${rest}` : `it reads ${times} the right value${rest}`;
  }
  const size = withUnit(Math.abs(value), unit.unit, sd);
  if (word === "noise") {
    const times = numberText(item.estimate / (item.nominal || 1), null, 2);
    return `it scatters by ${size}, ${times} times as much as the model file says (noise)`;
  }
  const isHigh = item.estimate > 0;
  const text = unit.isInput ? `it acts ${size} ${isHigh ? "above" : "below"} what is recorded` : `it reads ${size} too ${isHigh ? "high" : "low"}`;
  if (item.began != null) return `${text} (bias); it came to that ${courseText(item)}`;
  if (item.rate == null) return `${text} (bias)`;
  if (Math.abs(item.rate) < SIGNIFICANT * (item.rate_sd || 0)) return `${text} now, and drifts at a rate that is not known yet`;
  return `${text} now, and this ${item.rate * item.estimate > 0 ? "grows" : "shrinks"} by ${rateText(unit, item)} (drift)`;
}

// What happened to a parameter that drifts; limits and when they are reached stand in the report.
function driftText(name, item, estimate, bracket, unclear) {
  const unit = about(name), isMoving = Math.abs(item.rate) >= SIGNIFICANT * (item.rate_sd || 0);
  if (!isMoving && !isOff(item)) return `${unclear}, or move at a rate that is not known yet`;
  const text = `${name} is ${estimate} now${bracket}`, size = Math.max(Math.abs(item.nominal || 0), Math.abs(item.estimate));
  const step = Math.abs(item.rate) * (MODEL.sampleTime || 0);
  if (isMoving && size > 0 && step > WILD * size) return `${text}, and moves too fast to be a drift`;
  const verb = item.rate > 0 ? "rises" : "falls";
  return `${text} and ${isMoving ? `${verb} by ${rateText(unit, item)}` : "moves at a rate that is not known yet"}`;
}

// What happened to a suspect of a candidate, as half a sentence.
function changeOf(candidate, name, item) {
  const unit = about(name), isAlone = suspectsOf(candidate).length === 1;
  const isPassing = candidate.kind === "intermittent";
  const passing = isPassing ? ` while the fault is there; it is ${candidate.present ? "there" : "gone"} now` : "";
  if (item.stopped != null) {
    const told = `its record has stood still since ${clockText(item.stopped)}, so its meter has stuck`;
    return isAlone ? `${told}, and what acts is not known` : told.replace(/^its /, `${unit.signal}'s `);
  }
  if (isUndetermined(name, item)) {
    const its = isAlone ? `its ${unit.word}` : `the ${unit.word} of ${unit.signal}`;
    return `${isInstrument(name) ? its : name} is not determined by the data`;
  }
  if (isInstrument(name)) {
    const told = misreading(name, item) + passing;
    return isAlone ? told : told.replace(/^it /, `${unit.signal} `).replace(/^its /, `${unit.signal}'s `);
  }
  const estimate = withUnit(fromSi(unit, item.estimate), unit.unit, differenceFromSi(unit, item.sd));
  const healthy = numberText(fromSi(unit, item.nominal || 0)), change = changeText(item.nominal || 0, item.estimate, item.sd);
  const bracket = change ? ` (${change})` : "", unclear = `${name} may still be ${withUnit(fromSi(unit, item.nominal || 0), unit.unit)}`;
  if (candidate.kind === "drift" && item.rate != null) return driftText(name, item, estimate, bracket, unclear);
  if (isPassing) return `${name} is ${estimate}${bracket} instead of ${healthy}${passing}`;
  if (!isOff(item)) return unclear;
  const text = `${name} ${item.estimate > (item.nominal || 0) ? "rose" : "fell"} from ${healthy} to ${estimate}${bracket}`;
  return item.began != null ? `${text} ${courseText(item)}` : text;
}

function unexplainedSentence(found) {
  const [since, until] = [clockText(found.since), clockText(found.until)];
  const when = since === until ? `at ${since}` : `between ${since} and ${until}, on average`;
  const size = numberText(found.sd, null, 2), deviations = size === "1" ? "standard deviation" : "standard deviations";
  return `None of the modelled faults explains this: the best fit is still ${size} ${deviations} off in ${found.signal} ${when}.`;
}

// Whether a model is held to be off as what counts as healthy had to move, and not as it alarmed on healthy data.
const hasWalked = (diagnosis) => diagnosis.mismatch > MODEL.falseAlarms / (MODEL.falseAlarms + 1) + 1e-9;
const knownAlarms = () => `it is known to alarm on healthy data (\`false_alarms: ${MODEL.falseAlarms}\`)`;

function supersededSentence(before) {
  const [was, does] = before.components.length > 1 ? ["were", "do"] : ["was", "does"];
  return `Up to ${clockText(before.until)} ${joined(before.components)} ${was} sure to be at fault, and ${does} not explain what came then. ` +
    "Either something else changed besides, or that was wrong: no fault is claimed. Faults that come one after the other are told " +
    "one by one where the first is accepted, as `--accept auto` does.";
}

// That the likeliest hypothesis takes along what it leaves healthy.
function strainedSentence(diagnosis) {
  const [was, counts, that] = diagnosis.strained.length === 1 ? ["it was", "counts", "it"] : ["they were", "count", "they"];
  return `What comes nearest explains the data only with ${joined(diagnosis.strained)} far from where ${was}, which ${counts} as healthy then. ` +
    `Either ${that} changed besides, at another time, or the model is off there (${probabilityText(diagnosis.mismatch)}${NO_BREAK}%): ` +
    "no fault is claimed.";
}

// Why no candidate is claimed of what began with this alarm; empty where one is.
function noClaim(diagnosis, detection) {
  const most = `Most likely the model is off (${probabilityText(diagnosis.mismatch)}${NO_BREAK}%)`;
  if (diagnosis.superseded) return supersededSentence(diagnosis.superseded);
  if (diagnosis.strained) return strainedSentence(diagnosis);
  if (diagnosis.elsewhere) {
    const names = joined(diagnosis.elsewhere), alone = diagnosis.elsewhere.length === 1;
    const off = alone ? "is far from where it is declared" : "are far from where they are declared";
    if (diagnosis.elsewhere.every((name) => MODEL.suspects[name].mayFail)) { // what no run with the model shows
      return `Most likely nothing that was tested changed (${probabilityText(diagnosis.mismatch)}${NO_BREAK}%): ${names}, which ${alone ? "was" : "were"} not, ${off}.`;
    }
    return `${most}: no suspect changed, but ${names}, which ${alone ? "counts" : "count"} as healthy, ${off}. Of what may fail say ` +
      `\`suspect: yes\`; else mend what moves ${alone ? "it" : "them"}.`;
  }
  if (diagnosis.mismatch && !(detection.walk && hasWalked(diagnosis)))
    return `${most}: ${knownAlarms()}. \`faultbond fit\` with \`--until-quiet\` and healthy recordings finds what it leaves out.`;
  if (diagnosis.mismatch) {
    const name = detection.walk.parameter;
    if (MODEL.suspects[name]?.mayFail) {
      return `${name} had to move too far while an input was where no recording of the fit had it. A law that is off there does that ` +
        `as well as a fault (${probabilityText(diagnosis.mismatch)}${NO_BREAK}%): no fault is claimed.`;
    }
    return `${most}: ${name}, which counts as healthy, had to move too far. ` +
      `Declare the accuracy of ${name} larger${wanderText(name)}, or mend what moves it.`;
  }
  if (diagnosis.unexplained) return unexplainedSentence(diagnosis.unexplained);
  if (!(diagnosis.within_accuracy > diagnosis.candidates[0].probability)) return "";
  return `Something was otherwise, but nothing is further off than healthy parts may be (\`accuracy\`, \`healthy_change\`, \`healthy_bias\`), ${certaintyText(diagnosis.within_accuracy)}: no fault is claimed.`;
}

function actionText(item) {
  if (item.check === "input") {
    const unit = MODEL.inputs.find((input) => input.name === item.target);
    const value = item.value == null ? "" : ` to ${withUnit(fromSi(unit, item.value), unit.unit, null, 3)}`;
    return `move ${item.target}${value}${item.within == null ? "" : ` and wait ${durationText(item.within, 2)}`}`;
  }
  if (item.check === "signal") return `measure ${item.target} by hand`;
  const part = MODEL.parts[item.target];
  return part ? `look at ${part}` : `check ${(MODEL.instruments[item.target] || item.target)}`;
}

function nearest(best, group, changes) {
  if (group.length > 1) return `Nearest come ${listed(group.map(titleOf))}.`;
  const isCouple = best.kind === "drift" && suspectsOf(best).some(([, item]) => item.rate == null);
  const isChange = ["step", "ramp"].includes(best.kind) && !suspectsOf(best).some(([name]) => isInstrument(name));
  const what = best.kind === "drift" && !isCouple ? "a drift" : isChange ? "a change" : "a fault";
  return `Nearest comes ${what} of ${ownersOf(best)}: ${changes}.`;
}

function apart(diagnosis, group, best) {
  const names = listed(group.map((item) => `${titleAndKind(item)} (${(100 * item.probability).toFixed(0)}${NO_BREAK}%)`));
  const shared = suspectsOf(best).filter(([name]) => group.every((other) => name in other.parameters));
  const hint = shared.length ? ` All contain ${joined(shared.map(([name]) => `${name} of ${about(name).owner}`))}.` : "";
  const advice = diagnosis.advice[0];
  if (!advice) return `Cannot yet be told apart: ${names}; more data, or a change of input, would be needed.${hint}`;
  const bestNext = shared.length ? "To tell what else, best" : "Best";
  return `Cannot yet be told apart: ${names}.${hint} ${bestNext} next: ${actionText(advice)}.`;
}

function certaintyOf(diagnosis) {
  const best = diagnosis.candidates[0], left = diagnosis.untested;
  const sure = certaintyText(best.probability);
  if (!left || !left.sets) return `, ${sure}`;
  if (left.probability >= 1) return `, ${sure} among the sets tested`;
  const least = certaintyText(best.probability * (1 - left.probability));
  return least === sure ? `, ${sure}` : `, at least ${least}`;
}

function otherwiseText(best) {
  const others = Object.entries(best.kinds).filter(([kind, share]) => kind !== best.kind && share >= OTHERWISE);
  return others.length ? ` Of its kind less is sure: it may also be ${others.map(([kind, share]) => `${KIND_WORDS[kind]} (${(100 * share).toFixed(0)}${NO_BREAK}%)`).join(" or ")}.` : "";
}

// That a parameter may be declared to wander, or to wander more; nothing of one that says how something lags.
function wanderText(name) {
  if (MODEL.lags.includes(name)) return "";
  return MODEL.wanders.includes(name) ? ", or its `wander` larger or longer" : ", or that it wanders";
}

// What a diagnosis says, in plain words.
function verdictSentence(diagnosis, detection) {
  const group = bestGroup(diagnosis), best = group[0], suspects = suspectsOf(best);
  const changes = suspects.map(([name, item]) => changeOf(best, name, item) + (item.moved && item.stopped == null ? MOVES : "")).join("; ");
  const off = noClaim(diagnosis, detection);
  if (off) return diagnosis.elsewhere ? off : `${off} ${nearest(best, group, changes)}`; // else no suspect changed
  if (group.length > 1) return apart(diagnosis, group, best);
  const isOne = best.components.length === 1, owners = ownersOf(best);
  if (suspects.length === 1 && suspects[0][1].stopped != null) return `Most likely ${owners} is at fault: ${changes}${certaintyOf(diagnosis)}.`;
  const isMixed = suspects.some(([name]) => isInstrument(name)) || (best.kind === "drift" && suspects.some(([, item]) => item.rate == null));
  let event = `${owners} ${isOne ? "is" : "are"} at fault`;
  if (best.kind === "intermittent") event = `a fault of ${owners} comes and goes`;
  else if (["step", "ramp", "drift"].includes(best.kind) && !isMixed) event = `${owners} ${best.kind !== "drift" ? "changed" : isOne ? "drifts" : "drift"}`;
  return `Most likely ${event}: ${changes}${certaintyOf(diagnosis)}.${otherwiseText(best)}`;
}

// That the alarm was a short while ago, so that the verdict may change; empty where it was not.
function earlySentence(diagnosis, detection) {
  if (!MODEL.sampleTime) return "";
  const since = Math.round((diagnosis.time - detection.time) / MODEL.sampleTime);
  if (since >= MODEL.lastRenewal) return "";
  return `This is early, ${withNoun(since, "sample")} after the alarm: up to ${MODEL.lastRenewal} it may still change.`;
}

const EVENLY = "each percentage above has an even share of that in it.";

// How likely it is that the model is off, and how likely the first is if it is right.
function mismatchText(diagnosis) {
  const off = diagnosis.mismatch;
  const what = `${diagnosis.superseded ? "more changed, later, or " : diagnosis.strained ? "more changed, or " : ""}the model is off`;
  const told = `With ${probabilityText(off)}${NO_BREAK}% ${what}: ${EVENLY}`;
  if (off >= 1 || diagnosis.count < 2) return told;
  const right = (diagnosis.candidates[0].probability - diagnosis.even) / (1 - off);
  return `${told} If it is right after all, the first is at ${probabilityText(right)}${NO_BREAK}%.`;
}

// What may be true beside the candidates.
function besideText(diagnosis) {
  const told = [], left = diagnosis.untested;
  if (diagnosis.mismatch && !diagnosis.unexplained) told.push(mismatchText(diagnosis));
  if (diagnosis.within_accuracy >= NEGLIGIBLE && !diagnosis.unexplained)
    told.push(`With ${probabilityText(diagnosis.within_accuracy)}${NO_BREAK}% nothing that is tested changed by more than it may while healthy: ${EVENLY}`);
  if (left && left.sets)
    told.push(`Another ${left.sets} sets were not tested; ` + (left.probability >= 1
      ? "how likely it is that the truth is among them cannot be told."
      : `the truth is among them with at most ${(Math.ceil(1000 * left.probability - 1e-9) / 10).toFixed(1)}${NO_BREAK}%.`));
  return told.join(" ");
}

// How likely it is that each component is at fault, or each sensor or input.
function faultProbabilities(diagnosis) {
  const parts = {}, instruments = {};
  for (const candidate of diagnosis.candidates) {
    const found = { parts: new Set(), instruments: new Set() };
    for (const [name] of suspectsOf(candidate)) found[isInstrument(name) ? "instruments" : "parts"].add(about(name).part);
    for (const name of found.parts) parts[name] = Math.min(1, (parts[name] || 0) + candidate.probability);
    for (const name of found.instruments) instruments[name] = Math.min(1, (instruments[name] || 0) + candidate.probability);
  }
  return { parts, instruments };
}
