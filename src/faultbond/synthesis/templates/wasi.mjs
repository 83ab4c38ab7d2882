// Runs the program of the target wasm32-wasi: node wasi.mjs watch.wasm [arguments] < rows.csv
import { readFile } from "node:fs/promises";
import { argv, exit } from "node:process";
import { WASI } from "node:wasi";

const wasi = new WASI({ version: "preview1", args: ["watch", ...argv.slice(3)], preopens: { ".": "." }, returnOnExit: true });
const module = await WebAssembly.compile(await readFile(argv[2]));
exit(wasi.start(await WebAssembly.instantiate(module, wasi.getImportObject())));
