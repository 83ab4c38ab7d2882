// Runs the program of the model beside the page, so that the page stays quick: bytes of a recording go in, and what the
// program says of them comes out, in the order in which it happens.
"use strict";

const PORTION = 8192; // bytes passed at a time: what is found is on the screen soon

let program;          // what the module exports
let samples = [];     // numbers of the samples since the last message
let remarks = [];     // what is said beside the records,
let lines = [];       // records since then, each with the number of samples that came before it
let passed = 0;       // samples
let begun = "";       // of a line that is not whole yet
let decoder = new TextDecoder();

const page = {
  remark(at) { remarks.push(textAt(at)); },
  samples(at, count) {
    samples.push(new Float64Array(program.memory.buffer, at, count * program.sample_numbers()).slice());
    passed += count;
  },
  records(at, size) {
    begun += decoder.decode(new Uint8Array(program.memory.buffer, at, size), { stream: true });
    if (!begun.endsWith("\n")) return; // a long line comes in parts
    lines.push({ at: passed, text: begun.slice(0, -1) });
    begun = "";
  },
};

function textAt(at) {
  const memory = new Uint8Array(program.memory.buffer, at);
  return new TextDecoder().decode(memory.subarray(0, memory.indexOf(0)));
}

const told = () => textAt(program.text());

function send(more) {
  postMessage({ samples, lines, remarks, ...more }, samples.map((part) => part.buffer));
  samples = [];
  remarks = [];
  lines = [];
}

// Pass bytes; whether the recording is refused.
function pass(bytes, isLast) {
  const room = Math.min(PORTION, program.room_size());
  for (let from = 0; from < bytes.length || (isLast && from === 0); from += room) {
    const part = bytes.subarray(from, from + room);
    new Uint8Array(program.memory.buffer, program.room(), part.length).set(part);
    const refused = program.take(part.length, isLast && from + room >= bytes.length ? 1 : 0);
    read += part.length;
    if (refused) return true;
    send({ share: size ? read / size : 1 });
  }
  return false;
}

let read = 0, size = 0; // bytes of the recording

async function watch(recording) {
  size = recording.size;
  const stream = recording.stream().getReader();
  for (;;) {
    const { done, value } = await stream.read();
    if (pass(done ? new Uint8Array(0) : value, done)) return { code: 2, text: told() };
    if (done) break;
  }
  const code = program.end();
  return { code, text: told() };
}

onmessage = async ({ data }) => {
  try {
    const { instance } = await WebAssembly.instantiate(data.module, { page });
    program = instance.exports;
    program._initialize();
    if (!program.begin()) throw new Error("the core is of another model than the page");
    const over = await watch(data.recording);
    send({ share: 1, over });
  } catch (problem) {
    send({ share: 1, over: { code: 3, text: String(problem.message || problem) } });
  }
};
