// The playground: a text, what it computes, and pictures of that. Every element with the class "swb-playground" becomes one.
import { EXAMPLES } from "./examples.mjs";
import { picture } from "./picture.mjs";

// As many switches can be told apart in a picture and are in the table.
const MOST = 500;
const KINDS = { cross: "crosses", enter: "begins to slide", leave: "slides no more", spontaneous: "leaves, though it could stay" };

const VERDICTS = { local_optimum: "a local optimum", kink: "a local optimum at a kink", not_optimal: "not optimal", unknown: "not known whether optimal" };

function make(name, properties = {}, ...inside) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...inside);
  return made;
}

/** A worker, which is loaded again after it was ended. */
class Runner {
  constructor() { this.count = 0; }
  run(text) {
    this.worker ??= new Worker(new URL("./worker.mjs", import.meta.url), { type: "module" });
    const id = ++this.count, worker = this.worker;
    return new Promise((resolve, reject) => {
      this.give_up = () => reject(new Error("stopped"));
      worker.onmessage = ({ data }) => {
        if (data.id !== id) return;
        if (data.error) reject(Object.assign(new Error(data.error.message), data.error));
        else resolve(data.result);
      };
      worker.onerror = (event) => {
        this.end();
        reject(new Error(event.message || "the worker could not be loaded"));
      };
      worker.postMessage({ id, text });
    });
  }
  end() {
    this.worker?.terminate();
    this.worker = null;
  }
  stop() {
    this.end();
    this.give_up?.();
  }
}

const modes = (list) => (list.length > 1 ? `{${list.join(", ")}}` : String(list[0] ?? "none"));
const time = (seconds) => (seconds < 1 ? `${(1000 * seconds).toFixed(seconds < 0.01 ? 1 : 0)} ms` : `${seconds.toFixed(2)} s`);
const words = (name) => name.replaceAll("_", " ");
const digits = (value, n) => String(Number(value.toPrecision(n)));

/** What changed in a jump, by name. */
function changes(jump, names) {
  const changed = names.flatMap((name, i) => (jump.before[i] === jump.after[i] ? [] : [`${name}: ${digits(jump.before[i], 6)} → ${digits(jump.after[i], 6)}`]));
  return changed.join(", ") || "nothing changes";
}

function table(found) {
  const rows = [
    ...found.switches.map((s) => ({ t: s.t, what: KINDS[s.kind], how: `modes ${modes(s.before)} → ${modes(s.after)}` })),
    ...found.jumps.map((j) => ({ t: j.t, what: "jumps", how: changes(j, found.names) })),
  ].sort((a, b) => a.t - b.t);
  if (!rows.length) return make("p", { textContent: "No switches." });
  const body = make("tbody");
  for (const { t, what, how } of rows.slice(0, MOST)) body.append(make("tr", {}, ...[String(t), what, how].map((textContent) => make("td", { textContent }))));
  const head = make("thead", {}, make("tr", {}, ...["t", "what", "how"].map((textContent) => make("th", { textContent }))));
  const made = make("table", { className: "swb-switches" }, head, body);
  // long tables are folded
  const many = rows.length > MOST ? `${rows.length} switches, too many to be marked in the picture: the first ${MOST}` : `${rows.length} switches`;
  return rows.length <= 12 ? made : make("details", {}, make("summary", { textContent: many }), made);
}

function marks(found) {
  if (found.switches.length + found.jumps.length > MOST) return [];
  return [
    ...found.switches.map((s) => ({ t: s.t, text: `${KINDS[s.kind]} at ${s.t}` })),
    ...found.jumps.map((j) => ({ t: j.t, jump: true, text: `${changes(j, found.names)} at ${j.t}` })),
  ];
}

function panels(found) { return found.names.map((name, i) => ({ name, t: found.t, values: found.x.map((row) => row[i]) })); }

function shown(found, line, extra, width) {
  const parts = [make("p", { className: found.success ? "swb-good" : "swb-bad", textContent: line })];
  for (const text of [found.reason, found.message]) if (text) parts.push(make("p", { textContent: text }));
  const drawn = { panels: [...panels(found), ...extra], shaded: found.sliding, marks: marks(found) };
  if (found.t.length) parts.push(picture({ ...drawn, start: 0, end: found.t_end, width }));
  parts.push(table(found));
  parts.push(make("details", {}, make("summary", { textContent: "what the library made of the model" }), make("pre", { textContent: found.report })));
  return parts;
}

function simulation(found, width) {
  const count = found.switches.length + found.jumps.length;
  const line = `${words(found.outcome)}: t = ${digits(found.t_end, 12)}, ${found.steps} steps, ${count} switch${count === 1 ? "" : "es"}, ${time(found.seconds)}`;
  return shown(found, line, [], width);
}

function solution(found, width) {
  const { accuracy } = found;
  const compared = !accuracy ? "" : accuracy.reached ? `, ${accuracy.worst.toExponential(1)} from its simulation` : ", its simulation ends early";
  const cost = Number.isFinite(found.cost) ? `cost ${digits(found.cost, 12)}, ${VERDICTS[found.verdict]}${compared}, ` : "";
  const drawn = found.success ? "" : "; what is drawn is no solution";
  const line = `${words(found.outcome)}: ${cost}${found.iterations} iterations, ${time(found.seconds)}${drawn}`;
  const extra = found.control_names.map((name, i) => ({ name, steps: true, t: found.control_times, values: found.controls.map((row) => row[i]) }));
  return shown(found, line, extra, width);
}

function playground(place) {
  const runner = new Runner();
  const choice = make("select", { title: "examples" }, ...Object.keys(EXAMPLES).map((name) => make("option", { value: name, textContent: name })));
  const editor = make("textarea", { spellcheck: false, rows: 16 });
  editor.setAttribute("aria-label", "model and task");
  const run = make("button", { type: "button", textContent: "Run", title: "Ctrl+Enter", className: "md-button md-button--primary" });
  const stop = make("button", { type: "button", textContent: "Stop", className: "md-button", disabled: true });
  const output = make("div", { className: "swb-output" });
  output.setAttribute("aria-live", "polite");
  place.replaceChildren(make("div", { className: "swb-bar" }, choice, run, stop), editor, output);

  const busy = (yes) => {
    run.disabled = yes;
    stop.disabled = !yes;
    place.dataset.state = yes ? "runs" : "ready";
  };
  const start = async () => {
    if (run.disabled) return;
    busy(true);
    output.replaceChildren(make("p", { textContent: runner.worker ? "runs ..." : "loads the library ..." }));
    try {
      const { simulation: simulated, solution: solved } = await runner.run(editor.value);
      const width = Math.min(720, Math.max(320, output.clientWidth));
      output.replaceChildren(...(simulated ? simulation(simulated, width) : []), ...(solved ? solution(solved, width) : []));
      place.found = { simulation: simulated, solution: solved };
    } catch (error) {
      place.found = { error: error.message };
      output.replaceChildren(make("p", { className: "swb-bad", textContent: error.message }));
      if (error.line) {
        const lines = editor.value.split("\n").slice(0, error.line);
        const to = lines.join("\n").length, from = to - lines.at(-1).length + error.column - 1;
        editor.setSelectionRange(Math.min(from, to), to);
        output.append(make("pre", { textContent: `${lines.at(-1)}\n${" ".repeat(error.column - 1)}^` }));
      }
    }
    busy(false);
  };
  const show = () => {
    editor.value = EXAMPLES[choice.value];
    editor.rows = editor.value.split("\n").length;
    output.replaceChildren();
    place.found = null;
  };
  run.onclick = start;
  stop.onclick = () => runner.stop();
  choice.onchange = show;
  editor.onkeydown = (event) => {
    // the theme has keys of its own
    event.stopPropagation();
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) start();
  };
  show();
  busy(false);
}

document.querySelectorAll(".swb-playground").forEach(playground);
