// Runs texts away from the page, which stays alive; the page ends this worker where a text takes too long.
import { Switchback } from "./switchback.mjs";

let library = null;

onmessage = async ({ data: { id, text } }) => {
  try {
    if (!library || library.broken) {
      const answer = await fetch(new URL("./switchback.wasm", import.meta.url));
      if (!answer.ok) throw new Error(`switchback.wasm could not be loaded: ${answer.status} ${answer.statusText}`);
      library = await Switchback.load(answer.arrayBuffer());
    }
    postMessage({ id, result: library.run(text), version: library.version });
  } catch (error) {
    postMessage({ id, error: { message: error.message, line: error.line ?? null, column: error.column ?? null } });
  }
};
