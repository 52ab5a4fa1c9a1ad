// Switchback by WebAssembly: models as text, event-driven simulation, optimal control. Runs in browsers, in workers and under node.
import { constant, parse, parseExpression, SourceError } from "./language.mjs";
import { ENUMS, RECORDS, SIGNATURES } from "./interface.mjs";

const OPERATORS = ENUMS.swb_operator;
const CONDITIONS = new Set(["POSITIVE", "NOT", "AND", "OR"]);
const TAKE_CONDITIONS = new Set(["NOT", "AND", "OR"]);

/** An error that the library reports. */
export class SwitchbackError extends Error {
  constructor(message, status) {
    super(message);
    this.name = "SwitchbackError";
    this.status = status;
  }
}

/** The little of WASI that a library without files needs: a clock, random numbers, and text for the console. */
function system(module, instance) {
  const view = () => new DataView(instance().exports.memory.buffer);
  const bytes = (at, n) => new Uint8Array(instance().exports.memory.buffer, at >>> 0, n);
  const lines = { 1: "", 2: "" };
  const [SUCCESS, BAD_FILE, NOT_THERE] = [0, 8, 52];
  const calls = {
    clock_time_get(which, _, out) {
      const milliseconds = which === 0 ? Date.now() : performance.now();
      view().setBigUint64(out >>> 0, BigInt(Math.round(milliseconds * 1e6)), true);
      return SUCCESS;
    },
    clock_res_get(_, out) {
      view().setBigUint64(out >>> 0, 1000n, true);
      return SUCCESS;
    },
    random_get(at, n) {
      // getRandomValues gives at most 65536 bytes at once
      for (let k = 0; k < n; k += 65536) crypto.getRandomValues(bytes(at + k, Math.min(65536, n - k)));
      return SUCCESS;
    },
    fd_write(file, pieces, n, out) {
      if (!(file in lines)) return BAD_FILE;
      let total = 0;
      for (let k = 0; k < n; k++) {
        const [at, length] = [0, 4].map((o) => view().getUint32((pieces >>> 0) + 8 * k + o, true));
        lines[file] += new TextDecoder().decode(bytes(at, length).slice());
        total += length;
      }
      const whole = lines[file].split("\n");
      lines[file] = whole.pop();
      for (const line of whole) (file === 1 ? console.log : console.error)(line);
      view().setUint32(out >>> 0, total, true);
      return SUCCESS;
    },
    fd_prestat_get: () => BAD_FILE,
    environ_sizes_get(count, size) {
      view().setUint32(count >>> 0, 0, true);
      view().setUint32(size >>> 0, 0, true);
      return SUCCESS;
    },
    environ_get: () => SUCCESS,
    sched_yield: () => SUCCESS,
    proc_exit(code) { throw new Error(`the library ended with ${code}`); },
  };
  const imports = {};
  for (const { module: from, name } of WebAssembly.Module.imports(module)) (imports[from] ??= {})[name] = calls[name] ?? (() => NOT_THERE);
  return imports;
}

/** What a call needs of the memory of the module and the objects it makes: all of it is freed when the call has ended. */
class Scope {
  constructor(library) {
    this.library = library;
    this.undo = [];
  }
  space(size) {
    // addresses from 2 GB on come as negative numbers
    const at = this.library.exports.malloc(Math.max(size, 8)) >>> 0;
    if (!at) throw new SwitchbackError("there is no memory left", null);
    this.undo.push(() => this.library.exports.free(at));
    return at;
  }
  text(text) {
    const coded = new TextEncoder().encode(`${text}\0`);
    const at = this.space(coded.length);
    new Uint8Array(this.library.memory, at, coded.length).set(coded);
    return at;
  }
  doubles(values) {
    const at = this.space(8 * values.length);
    new Float64Array(this.library.memory, at, values.length).set(values);
    return at;
  }
  integers(values) {
    const at = this.space(8 * values.length);
    new BigInt64Array(this.library.memory, at, values.length).set(values.map(BigInt));
    return at;
  }
  /** Numbers that a call writes: `fill(place)` makes it. */
  read(Kind, n, fill) {
    const at = this.space(Kind.BYTES_PER_ELEMENT * n);
    fill(at);
    return Array.from(new Kind(this.library.memory, at, n), Number);
  }
  one(Kind, fill) { return this.read(Kind, 1, fill)[0]; }
  /** A text that a call writes, of which it says the size first. */
  words(name, ...first) {
    const size = this.one(BigInt64Array, (at) => this.call(name, ...first, 0, 0, at));
    const at = this.space(size);
    this.call(name, ...first, at, size, 0);
    return this.library.string(at);
  }
  /** Records that a call writes, as objects. */
  records(type, n, fill) {
    const { size, fields } = RECORDS[type];
    const at = this.space(size * Math.max(n, 1));
    fill(n ? at : 0, size);
    const view = new DataView(this.library.memory, at, size * n);
    return Array.from({ length: n }, (_, k) => Object.fromEntries(Object.entries(fields).map(([name, [offset, kind]]) => {
      const place = k * size + offset;
      return [name, kind === "f64" ? view.getFloat64(place, true) : kind === "i64" ? Number(view.getBigInt64(place, true)) : kind === "u64" ? view.getBigUint64(place, true) : view.getInt32(place, true)];
    })));
  }
  /** An object that the library makes, freed by `free`. */
  object(free, name, ...parameters) {
    const handle = this.one(Uint32Array, (at) => this.call(name, ...parameters, at));
    this.undo.push(() => this.library.call(free, handle));
    return handle;
  }
  call(name, ...parameters) { return this.library.checked(name, parameters); }
  end() { while (this.undo.length) this.undo.pop()(); }
}

/** Variables of a model, and its expressions in a graph of the library. */
class Expressions {
  constructor(scope, model) {
    Object.assign(this, { scope, model, graph: scope.object("swb_expr_free", "swb_expr_create"), known: new Map() });
    const blocks = { states: "X", controls: "U", parameters: "P" };
    for (const [kind, block] of Object.entries(blocks)) model[kind].forEach((v, i) => this.known.set(v.name, { id: this.input(block, i) }));
    this.known.set("t", { id: this.input("T", 0) });
  }
  input(block, index) {
    return this.scope.one(BigInt64Array, (at) => this.scope.call("swb_expr_inputs", this.graph, ENUMS.swb_input[block], index, at, 1));
  }
  number(value) {
    const of = this.scope.doubles([value]);
    return this.scope.one(BigInt64Array, (at) => this.scope.call("swb_expr_constants", this.graph, of, 1, at, 1));
  }
  /** The number of an expression in the graph, and whether it is a condition. */
  any(node) {
    const value = constant(node);
    if (value !== null) {
      if (!Number.isFinite(value)) throw new SourceError(`this is ${value}`, node.at);
      return { id: this.number(value) };
    }
    if (node.op === "name") {
      const found = this.known.get(node.name);
      if (!found) throw new SourceError(`there is no "${node.name}" above; there are ${[...this.known.keys()].join(", ")}`, node.at);
      return found;
    }
    const of = node.of.map((inner, i) => {
      const wanted = TAKE_CONDITIONS.has(node.op) || (node.op === "WHERE" && i === 0);
      const made = this.any(inner);
      if (wanted !== Boolean(made.condition))
        throw new SourceError(wanted ? "a condition is needed here, such as v > 0" : "a number is needed here, not a condition", inner.at);
      return made.id;
    });
    const places = [0, 1, 2].map((i) => (i < of.length ? this.scope.integers([of[i]]) : 0));
    const id = this.scope.one(BigInt64Array, (at) => this.scope.call("swb_expr_apply", this.graph, OPERATORS[node.op], ...places, at, 1));
    return { id, condition: CONDITIONS.has(node.op) };
  }
  of(node) {
    const made = this.any(node);
    if (made.condition) throw new SourceError("a number is needed here, not a condition", node.at);
    return made.id;
  }
  /** A function for costs and constraints. */
  function(name, nodes) {
    const { states, controls, parameters } = this.model;
    const ids = this.scope.integers(nodes.map((node) => this.of(node)));
    return this.scope.object("swb_function_free", "swb_expr_function", this.graph, this.scope.text(name),
      states.length, controls.length, parameters.length, ids, nodes.length);
  }
}

/** The module, running: one for each thread. After a call that ended in a fault of the module it is to be loaded again (`broken`). */
export class Switchback {
  /** Of bytes of the module, or of a promise of them. */
  static async load(bytes) {
    const module = await WebAssembly.compile(await bytes);
    const self = new Switchback();
    self.instance = await WebAssembly.instantiate(module, system(module, () => self.instance));
    self.exports = self.instance.exports;
    self.broken = false;
    self.exports._initialize?.();
    return self;
  }

  get memory() { return this.exports.memory.buffer; }
  get version() { return this.string(this.call("swb_version")); }

  string(at) {
    const bytes = new Uint8Array(this.memory, at >>> 0);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }

  call(name, ...parameters) {
    const kinds = SIGNATURES[name];
    if (this.broken) throw new SwitchbackError("the module had a fault: load it again", null);
    if (kinds.length !== parameters.length) throw new TypeError(`${name} takes ${kinds.length} arguments, not ${parameters.length}`);
    const given = parameters.map((p, i) => (kinds[i] === "l" ? BigInt(p) : p));
    try {
      return this.exports[name](...given);
    } catch (fault) {
      this.broken = true;
      throw fault instanceof WebAssembly.RuntimeError ? new SwitchbackError(`the module had a fault: ${fault.message}`, null) : fault;
    }
  }

  checked(name, parameters) {
    const status = this.call(name, ...parameters);
    if (status !== ENUMS.swb_status.OK) throw new SwitchbackError(this.string(this.call("swb_last_error")), status);
  }

  scoped(work) {
    const scope = new Scope(this);
    try {
      return work(scope);
    } finally {
      if (!this.broken) scope.end();
    }
  }

  /** A word of an enumeration, as the library spells it: "reached", "local_optimum". */
  named(function_, value) { return this.string(this.call(function_, value)); }

  /** Expressions, system and report of a model. */
  build(scope, model) {
    const { states, controls, parameters } = model;
    const e = new Expressions(scope, model);
    const index = (name, at) => {
      const found = states.findIndex((s) => s.name === name);
      if (found < 0) throw new SourceError(`there is no state "${name}"; there are ${states.map((s) => s.name).join(", ")}`, at);
      return found;
    };
    const rhs = new Array(states.length).fill(null);
    const first = states.length - model.discrete;
    for (let i = first; i < states.length; i++) rhs[i] = e.number(0);
    const jumps = [];
    for (const s of model.statements) {
      if (s.kind === "define") e.known.set(s.name, e.any(s.node));
      else if (s.kind === "derivative") {
        const i = index(s.name, s.at);
        if (rhs[i] !== null) throw new SourceError(`"${s.name}" has a derivative already`, s.at);
        rhs[i] = e.of(s.node);
      } else if (s.kind === "hysteresis") {
        const i = index(s.name, s.at);
        const [value, on, off] = s.of;
        const above = e.of({ op: "SUB", of: [value, on], at: s.at });
        const below = e.of({ op: "SUB", of: [value, off], at: s.at });
        jumps.push({ guard: above, falling: 0, from: [i, 0], to: [i, 1], resets: [] });
        jumps.push({ guard: below, falling: 1, from: [i, 1], to: [i, 0], resets: [] });
      } else {
        const resets = s.resets.map((r) => [index(r.name, r.at), e.of(r.node)]);
        jumps.push({ guard: e.of(s.guard), falling: s.falling ? 1 : 0, resets });
      }
    }
    const missing = rhs.findIndex((r) => r === null);
    if (missing >= 0) throw new SourceError(`"${states[missing].name}" has no derivative: write ${states[missing].name}' = ...`, states[missing].at);
    const names = [...states, ...controls, ...parameters].map((v) => v.name).join("\n");
    const made = scope.object("swb_model_free", "swb_model_create", e.graph, scope.text("model"),
      states.length, controls.length, parameters.length, scope.integers(rhs), scope.text(names), 0);
    if (model.discrete) {
      const values = states.slice(first).map((s) => s.value);
      scope.call("swb_model_set_discrete", made, scope.doubles(values), values.length);
    }
    for (const { guard, falling, from, to, resets } of jumps) {
      const at = (pair) => (pair ? [scope.integers([pair[0]]), 1, scope.doubles([pair[1]]), 1] : [0, 0, 0, 0]);
      const [fs, nfs, fv, nfv] = at(from);
      const [ts, nts, tv, ntv] = at(to);
      const n = resets.length;
      const where = n ? scope.integers(resets.map((r) => r[0])) : 0;
      const what = n ? scope.integers(resets.map((r) => r[1])) : 0;
      scope.call("swb_model_add_transition", made, e.graph, guard, falling, fs, nfs, fv, nfv, where, n, what, n, ts, nts, tv, ntv, 0);
    }
    const report = scope.words("swb_model_report", made, 0);
    return { e, report, system: scope.object("swb_system_free", "swb_model_system", made) };
  }

  /** Settings with options by name. */
  settings(scope, options) {
    const { size } = RECORDS.swb_settings;
    const settings = scope.space(size);
    scope.call("swb_settings_init", settings, size);
    const set = (kind, name, value) => scope.call(`swb_settings_set_${kind}`, settings, scope.text(name), value);
    for (const { name, value, at } of options) {
      try {
        if (typeof value === "string") set("string", name, scope.text(value));
        else if (!Number.isInteger(value)) set("double", name, value);
        else {
          try {
            set("int", name, value);
          } catch (error) {
            if (error.status !== ENUMS.swb_status.ERR_OPTION) throw error;
            set("double", name, value);
          }
        }
      } catch (error) {
        throw at && error instanceof SwitchbackError ? new SourceError(error.message, at) : error;
      }
    }
    return settings;
  }

  /**
   * Simulate a model from the values of its variables on, over `duration`.
   *
   * outcome, success, reason   how it ended
   * t, x                       times, and the states at each of them; behind a jump its time is there twice
   * switches                   [{t, kind, subsystem, before, after}], lists of active modes before and after
   * jumps                      [{t, transition, before, after}], states before and after
   * sliding                    [[start, end]], when several modes of a subsystem are active
   */
  simulate(model, duration, { points = 600, options = [] } = {}) {
    const clock = performance.now();
    return this.scoped((s) => {
      const { system, report } = this.build(s, model);
      const integrator = s.object("swb_integrator_free", "swb_integrator_create", system, this.settings(s, [{ name: "dense", value: 1 }, ...options]));
      const values = (kind) => model[kind].map((v) => v.value);
      const nx = model.states.length;
      if (model.parameters.length) s.call("swb_integrator_set_params", integrator, s.doubles(values("parameters")), model.parameters.length);
      s.call("swb_integrator_reinit", integrator, 0, s.doubles(values("states")), nx);
      if (model.controls.length) s.call("swb_integrator_set_controls", integrator, s.doubles(values("controls")), model.controls.length);
      s.one(Int32Array, (at) => s.call("swb_integrator_advance", integrator, duration, at));
      const run = s.object("swb_run_free", "swb_integrator_get_run", integrator);
      const [info] = s.records("swb_run_info", 1, (at, size) => s.call("swb_run_get_info", run, at, size));
      const [stats] = s.records("swb_run_stats", 1, (at, size) => s.call("swb_run_get_stats", run, at, size));
      const modes = s.read(BigInt64Array, info.n_subsystems, (at) => s.call("swb_run_modes", run, at, info.n_subsystems));
      const kinds = Object.keys(ENUMS.swb_event_kind);
      const events = s.records("swb_event", info.n_events, (at, size) => s.call("swb_run_events", run, at, info.n_events, size));
      const switches = events.map((e, i) => {
        const n = modes[e.subsystem];
        const both = s.read(Int32Array, 2 * n, (at) => s.call("swb_run_event_modes", run, i, at, at + 4 * n, n));
        return { t: e.t, kind: kinds[e.kind].toLowerCase(), subsystem: e.subsystem, before: active(both.slice(0, n)), after: active(both.slice(n)) };
      });
      const made = s.records("swb_jump", info.n_jumps, (at, size) => s.call("swb_run_jumps", run, at, info.n_jumps, size));
      const jumps = made.map((j, i) => jump(j, nx, (before, after) => s.call("swb_run_jump_states", run, i, before, after, nx), s));
      // where steps are shorter than distances in a picture, their ends do not matter
      const n = info.n_pieces > 0 && info.n_pieces < 20 * points ? info.n_pieces + 1 : 0;
      const steps = s.read(Float64Array, n, (at) => s.call("swb_run_times", run, at, n));
      const times = info.n_pieces > 0 ? grid(steps, info.t_start, info.t_end, points) : [];
      const at = s.doubles(times);
      const rows = times.length ? s.read(Float64Array, times.length * nx, (to) => s.call("swb_run_evaluate", run, at, times.length, 0, to, times.length * nx)) : [];
      const steady = modes.map((n, k) => active(s.read(Int32Array, n, (to) => s.call("swb_integrator_get_active", integrator, k, to, n))));
      return {
        outcome: this.named("swb_run_outcome_name", info.outcome),
        success: info.outcome === ENUMS.swb_run_outcome.REACHED,
        reason: s.words("swb_run_reason", run),
        duration, t_end: info.t_end,
        ...withJumps(times, rows, nx, jumps),
        x_end: s.read(Float64Array, nx, (to) => s.call("swb_run_state", run, to, nx)),
        switches, jumps, steps: stats.steps,
        sliding: slidingOf(switches, steady, info.t_start, info.t_end),
        names: model.states.map((v) => v.name),
        report,
        seconds: (performance.now() - clock) / 1000,
      };
    });
  }

  /**
   * Solve an optimal control problem of a model, from the values of its states on.
   *
   * horizon, stages, time   of the controls, which are constant in each stage; `time`: bounds of a free horizon, or null
   * rate, final             costs along the horizon and at its end: texts or expressions of `parseExpression`, or null
   * bounds                  of states and controls: {F: [-3, 3]}, or as `parse` gives them, [{of, lower, upper}]
   * terminal                constraints at the end in the same form; a number is both bounds
   *
   * The answer has outcome, success, cost, verdict, reason, message, controls (a row for each stage) from `control_times` on, t, x,
   * switches, jumps and sliding as those of `simulate`, and accuracy, {reached, worst} against a simulation of the controls, or null.
   */
  solveOcp(model, { horizon, stages, time = null, rate = null, final = null, bounds = [], terminal = [] }, { points = 600, options = [] } = {}) {
    const clock = performance.now();
    [bounds, terminal] = [limits(bounds), limits(terminal)];
    return this.scoped((s) => {
      const { e, system, report } = this.build(s, model);
      const [nx, nu, np] = [model.states.length, model.controls.length, model.parameters.length];
      const ocp = s.object("swb_ocp_free", "swb_ocp_create", system, horizon, stages, this.settings(s, options));
      if (rate) s.call("swb_ocp_set_lagrange", ocp, e.function("rate", [expression(rate)]));
      if (final) s.call("swb_ocp_set_mayer", ocp, e.function("final", [expression(final)]));
      s.call("swb_ocp_set_initial_state", ocp, s.doubles(model.states.map((v) => v.value)), nx);
      if (np) s.call("swb_ocp_set_params", ocp, s.doubles(model.parameters.map((v) => v.value)), np);
      if (terminal.length) {
        const f = e.function("end", terminal.map((c) => c.of));
        const [low, high] = [s.doubles(terminal.map((c) => c.lower)), s.doubles(terminal.map((c) => c.upper))];
        s.call("swb_ocp_add_terminal", ocp, f, low, terminal.length, high, terminal.length);
      }
      for (const [kind, name] of [["states", "swb_ocp_set_state_bounds"], ["controls", "swb_ocp_set_control_bounds"]]) {
        const n = model[kind].length;
        const lower = new Array(n).fill(-Infinity), upper = new Array(n).fill(Infinity);
        for (const b of bounds) {
          const i = model[kind].findIndex((v) => v.name === b.of.name);
          if (i >= 0) [lower[i], upper[i]] = [Math.max(lower[i], b.lower), Math.min(upper[i], b.upper)];
        }
        if (n) s.call(name, ocp, s.doubles(lower), n, s.doubles(upper), n);
      }
      for (const b of bounds) {
        const known = [...model.states, ...model.controls].some((v) => v.name === b.of.name);
        if (!known) throw new SourceError("bounds are those of a state or a control", b.of.at);
      }
      if (time) s.call("swb_ocp_set_free_time", ocp, ENUMS.swb_free_time.HORIZON, ...time);
      const outcome = s.one(Int32Array, (at) => s.call("swb_ocp_solve", ocp, at));
      const u = s.read(Float64Array, stages * nu, (at) => s.call("swb_ocp_get_controls", ocp, at, stages * nu));
      const durations = s.read(Float64Array, stages, (at) => s.call("swb_ocp_get_durations", ocp, at, stages));
      const [stats] = s.records("swb_stats", 1, (at, size) => s.call("swb_ocp_get_stats", ocp, at, size));
      const count = s.one(BigInt64Array, (at) => s.call("swb_ocp_jump_count", ocp, at));
      const made = s.records("swb_ocp_jump", count, (at, size) => s.call("swb_ocp_jumps", ocp, at, count, size));
      const jumps = made.map((j, i) => jump(j, nx, (before, after) => s.call("swb_ocp_jump_states", ocp, i, before, after, nx), s));
      const control_times = [0];
      for (const d of durations) control_times.push(control_times.at(-1) + d);
      return {
        outcome: this.named("swb_outcome_name", outcome),
        success: outcome === ENUMS.swb_outcome.SOLVED,
        message: s.words("swb_ocp_get_message", ocp),
        cost: s.one(Float64Array, (at) => s.call("swb_ocp_get_cost", ocp, at)),
        ...this.judged(s, ocp),
        controls: rowsOf(u, nu), control_times,
        ...this.trajectory(s, ocp, nx, jumps, points),
        jumps, iterations: stats.iterations,
        names: model.states.map((v) => v.name),
        control_names: model.controls.map((v) => v.name),
        report,
        seconds: (performance.now() - clock) / 1000,
      };
    });
  }

  /** Verdict and accuracy, which are there where the option `accuracy` is on and there is a point to judge. */
  judged(s, ocp) {
    const there = (ask) => {
      try {
        return ask();
      } catch (error) {
        if (error.status === ENUMS.swb_status.ERR_STATE) return null;
        throw error;
      }
    };
    const optimality = there(() => s.records("swb_optimality", 1, (at, size) => s.call("swb_ocp_get_optimality", ocp, at, size))[0]);
    const accuracy = there(() => s.records("swb_accuracy", 1, (at, size) => s.call("swb_ocp_get_accuracy", ocp, at, size))[0]);
    return {
      verdict: optimality ? this.named("swb_verdict_name", optimality.verdict) : "unknown",
      reason: optimality ? s.words("swb_ocp_get_optimality_reason", ocp) : "",
      accuracy: accuracy && { reached: accuracy.reached === 1, worst: accuracy.worst },
    };
  }

  trajectory(s, ocp, nx, jumps, points) {
    const trajectory = s.object("swb_trajectory_free", "swb_ocp_get_trajectory", ocp);
    const [info] = s.records("swb_trajectory_info", 1, (at, size) => s.call("swb_trajectory_get_info", trajectory, at, size));
    const n = info.n_elements ? info.n_elements + 1 : 0;
    const ends = s.read(Float64Array, n, (at) => s.call("swb_trajectory_times", trajectory, at, n));
    const times = n ? grid(ends, info.t_start, info.t_end, points) : [];
    const at = s.doubles(times);
    const rows = n ? s.read(Float64Array, times.length * nx, (to) => s.call("swb_trajectory_state_at", trajectory, at, times.length, to, times.length * nx)) : [];
    const modes = s.read(BigInt64Array, info.n_subsystems, (to) => s.call("swb_trajectory_modes", trajectory, to, info.n_subsystems));
    const flags = s.read(Int32Array, info.n_elements * info.n_modes, (to) => s.call("swb_trajectory_active", trajectory, to, info.n_elements * info.n_modes));
    const found = s.records("swb_switch", info.n_switches, (to, size) => s.call("swb_trajectory_switches", trajectory, to, info.n_switches, size));
    const kinds = Object.keys(ENUMS.swb_switch_kind);
    const first = modes.map((_, k) => modes.slice(0, k).reduce((a, b) => a + b, 0));
    const of = (element, k) => active(flags.slice(element * info.n_modes + first[k], element * info.n_modes + first[k] + modes[k]));
    const sliding = [];
    for (let element = 0; element < info.n_elements; element++)
      if (modes.some((_, k) => of(element, k).length > 1)) sliding.push([ends[element], ends[element + 1]]);
    return {
      ...withJumps(times, rows, nx, jumps),
      t_end: info.t_end,
      switches: found.map((w) => ({
        t: w.t, kind: kinds[w.kind].toLowerCase(), subsystem: w.subsystem,
        before: bits(w.before), after: bits(w.after),
      })),
      sliding: joined(sliding),
    };
  }

  /** What a text of the playground asks for: {simulation, solution}, each of them null where it is not asked for. */
  run(text, settings = {}) {
    const task = parse(text);
    if (!task.states.length) throw new SourceError("there are no states: write states q = 0", { line: 1, column: 1 });
    if (task.simulate === null && task.solve === null)
      throw new SourceError("there is nothing to do: write simulate 10, or solve 2 in 10 stages", { line: text.split("\n").length, column: 1 });
    const idle = [...task.bounds, ...task.terminal, task.rate, task.final].find((part) => part);
    if (task.solve === null && idle)
      throw new SourceError("bounds, costs and constraints belong to optimal control: write solve 2 in 10 stages", idle.at ?? idle.of.at);
    const given = { ...settings, options: task.options };
    return {
      simulation: task.simulate === null ? null : this.simulate(task, task.simulate, given),
      solution: task.solve === null ? null : this.solveOcp(task, { ...task.solve, ...task }, given),
    };
  }
}

/** A model by names and equations: `Model({states: ["q", "v"], controls: ["F"]}, "q' = v\nv' = F - sign(v)")`, for `simulate`, `solveOcp`. */
export function Model({ states, controls = [], parameters = [] }, equations) {
  const line = (word, given) => {
    const pairs = Array.isArray(given) ? given : Object.entries(given).map(([name, value]) => `${name} = ${value}`);
    return pairs.length ? `${word} ${pairs.join(", ")}` : "";
  };
  // mistakes are counted in lines of the equations
  const head = [line("states", states), line("controls", controls), line("parameters", parameters)];
  try {
    return parse([...head, equations].join("\n"));
  } catch (error) {
    throw error instanceof SourceError && error.line > 3
      ? new SourceError(error.message.replace(/^line .*?: /, ""), { line: error.line - 3, column: error.column })
      : error;
  }
}

function expression(given) { return typeof given === "string" ? parseExpression(given) : given; }

function limits(given) {
  if (Array.isArray(given)) return given;
  return Object.entries(given).map(([of, range]) => {
    const [lower, upper] = Array.isArray(range) ? range : [range, range];
    return { of: parseExpression(of), lower, upper };
  });
}

function active(flags) { return flags.flatMap((on, mode) => (on ? [mode] : [])); }

/** Modes of a mask, which has no place for those from 64 on. */
function bits(mask) {
  return Array.from({ length: 64 }, (_, mode) => mode).filter((mode) => (mask >> BigInt(mode)) & 1n);
}

function jump(record, nx, fill, scope) {
  const both = scope.read(Float64Array, 2 * nx, (at) => fill(at, at + 8 * nx));
  return { t: record.t, transition: record.transition, before: both.slice(0, nx), after: both.slice(nx) };
}

function rowsOf(values, n) {
  return n ? Array.from({ length: values.length / n }, (_, i) => values.slice(n * i, n * (i + 1))) : [];
}

/** Times for a picture: an even grid, and where steps end, so that corners are corners. */
function grid(steps, start, end, points) {
  const even = Array.from({ length: points + 1 }, (_, i) => start + ((end - start) * i) / points);
  return [...new Set([...even, ...steps].filter((t) => t >= start && t <= end))].sort((a, b) => a - b);
}

/** States at times, with the time of a jump twice: states before it and behind it. */
function withJumps(times, values, nx, jumps) {
  const rows = rowsOf(values, nx);
  const t = [], x = [];
  const waiting = jumps.slice();
  times.forEach((time, i) => {
    for (; waiting.length && waiting[0].t <= time; waiting.shift()) {
      const { t: at, before, after } = waiting[0];
      t.push(at, at);
      x.push(before, after);
    }
    // a row at the time of a jump is one of the two that are there
    if (t.at(-1) !== time) {
      t.push(time);
      x.push(rows[i]);
    }
  });
  return { t, x };
}

/** Intervals that touch are one. */
function joined(intervals) {
  const found = [];
  for (const [start, end] of [...intervals].sort((a, b) => a[0] - b[0])) {
    const last = found.at(-1);
    if (last && start <= last[1]) last[1] = Math.max(last[1], end);
    else found.push([start, end]);
  }
  return found;
}

function slidingOf(switches, steady, start, end) {
  const found = [];
  steady.forEach((modes, k) => {
    const own = switches.filter((e) => e.subsystem === k);
    const from = [start, ...own.map((e) => e.t)];
    const during = own.length ? [own[0].before, ...own.map((e) => e.after)] : [modes];
    during.forEach((m, i) => m.length > 1 && found.push([from[i], from[i + 1] ?? end]));
  });
  return joined(found);
}

export { parse, SourceError };
