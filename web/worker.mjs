// Runs texts away from the page, which stays alive; the page ends this worker where a text takes too long.
import { Switchback } from "./switchback.mjs";

let library = null;
// The memory of a module grows and never shrinks: behind a run that needed more than this, in bytes, the next one gets a new module.
const KEPT = 2 ** 28;

async function load() {
  const answer = await fetch(new URL("./switchback.wasm", import.meta.url));
  if (!answer.ok) throw new Error(`switchback.wasm could not be loaded: ${answer.status} ${answer.statusText}`);
  return Switchback.load(answer.arrayBuffer());
}

onmessage = async ({ data: { id, text } }) => {
  try {
    library ??= await load();
    postMessage({ id, result: library.run(text), version: library.version });
  } catch (error) {
    postMessage({ id, error: { message: error.message, line: error.line ?? null, column: error.column ?? null } });
  }
  if (library && (library.broken || library.memory.byteLength > KEPT)) library = null;
};
