// The language of the playground: a model and a task as lines of text. What it says is in docs/playground.md.

/** A mistake in a text, with its place: lines and columns count from 1. */
export class SourceError extends Error {
  constructor(message, at) {
    super(`line ${at.line}, column ${at.column}: ${message}`);
    this.name = "SourceError";
    Object.assign(this, { line: at.line, column: at.column });
  }
}

/** Functions of the language: the operator of the library, and how many arguments it takes. */
export const FUNCTIONS = {
  sqrt: ["SQRT", 1], exp: ["EXP", 1], log: ["LOG", 1], sin: ["SIN", 1], cos: ["COS", 1], tan: ["TAN", 1],
  asin: ["ASIN", 1], acos: ["ACOS", 1], atan: ["ATAN", 1], sinh: ["SINH", 1], cosh: ["COSH", 1], tanh: ["TANH", 1],
  erf: ["ERF", 1], atan2: ["ATAN2", 2], sign: ["SIGN", 1], abs: ["ABS", 1], min: ["MIN", 2], max: ["MAX", 2],
  where: ["WHERE", 3], clip: ["CLIP", 3], relay: ["RELAY", 3], dead_zone: ["DEAD_ZONE", 2],
};

const BINARY = { "+": "ADD", "-": "SUB", "*": "MUL", "/": "DIV", "^": "POW" };
const WORDS = ["states", "controls", "parameters", "simulate", "solve", "minimise", "minimize", "at", "when", "option", "and", "or", "not", "t", "pi"];
const TOKEN = /\s+|#.*|(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|([A-Za-z_]\w*)|(<=|>=|\*\*|[-+*/^()<>=,:'])/y;

function tokens(text, line) {
  const found = [];
  TOKEN.lastIndex = 0;
  while (TOKEN.lastIndex < text.length) {
    const at = { line, column: TOKEN.lastIndex + 1 };
    const match = TOKEN.exec(text);
    if (!match) throw new SourceError(`"${text[at.column - 1]}" is not understood`, at);
    const [, number, name, mark] = match;
    if (number !== undefined) found.push({ kind: "number", text: number, at });
    else if (name !== undefined) found.push({ kind: "name", text: name, at });
    else if (mark !== undefined) found.push({ kind: "mark", text: mark === "**" ? "^" : mark, at });
  }
  found.push({ kind: "end", text: "the end of the line", at: { line, column: text.length + 1 } });
  return found;
}

/** The words of one line, read from left to right. */
class Reader {
  constructor(text, line) {
    this.tokens = tokens(text, line);
    this.place = 0;
  }

  get next() { return this.tokens[this.place]; }
  get ended() { return this.next.kind === "end"; }
  is(text, ahead = 0) {
    const token = this.tokens[Math.min(this.place + ahead, this.tokens.length - 1)];
    return token.text === text && token.kind !== "end";
  }
  take(text) {
    if (!this.is(text)) return null;
    return this.tokens[this.place++];
  }
  need(text) {
    return this.take(text) ?? this.fail(`"${text}" is missing before ${this.shown()}`);
  }
  name(what) {
    if (this.next.kind !== "name") this.fail(`${what} is missing before ${this.shown()}`);
    return this.tokens[this.place++];
  }
  shown() { return this.ended ? this.next.text : `"${this.next.text}"`; }
  fail(message, at = this.next.at) { throw new SourceError(message, at); }
  end() { if (!this.ended) this.fail(`${this.shown()} is not expected here`); }

  list(item) {
    const items = [item()];
    while (this.take(",")) items.push(item());
    return items;
  }

  expression() {
    let left = this.conjunction();
    for (let token; (token = this.take("or")); ) left = { op: "OR", of: [left, this.conjunction()], at: token.at };
    return left;
  }
  conjunction() {
    let left = this.negation();
    for (let token; (token = this.take("and")); ) left = { op: "AND", of: [left, this.negation()], at: token.at };
    return left;
  }
  negation() {
    const token = this.take("not");
    return token ? { op: "NOT", of: [this.negation()], at: token.at } : this.comparison();
  }
  relation() {
    return this.take("<") ?? this.take("<=") ?? this.take(">") ?? this.take(">=");
  }
  comparison() {
    const left = this.sum();
    const token = this.relation();
    if (!token) return left;
    const right = this.sum();
    // a > b is a - b > 0; on the surface itself the solution is Filippov's, so that > and >= are the same
    const of = token.text[0] === ">" ? [left, right] : [right, left];
    return { op: "POSITIVE", of: [{ op: "SUB", of, at: token.at }], at: token.at };
  }
  sum() {
    let left = this.product();
    for (let token; (token = this.take("+") ?? this.take("-")); )
      left = { op: BINARY[token.text], of: [left, this.product()], at: token.at };
    return left;
  }
  product() {
    let left = this.factor();
    for (let token; (token = this.take("*") ?? this.take("/")); )
      left = { op: BINARY[token.text], of: [left, this.factor()], at: token.at };
    return left;
  }
  factor() {
    const token = this.take("-");
    if (token) return { op: "NEG", of: [this.factor()], at: token.at };
    this.take("+");
    return this.power();
  }
  power() {
    const base = this.primary();
    const token = this.take("^");
    // from right to left: a^b^c = a^(b^c), and a^-b
    return token ? { op: "POW", of: [base, this.factor()], at: token.at } : base;
  }
  primary() {
    const token = this.next;
    if (token.kind === "number") {
      this.place++;
      return { op: "number", value: Number(token.text), at: token.at };
    }
    if (this.take("(")) {
      const inner = this.expression();
      this.need(")");
      return inner;
    }
    if (token.kind !== "name") this.fail(`a number, a name or "(" is missing before ${this.shown()}`);
    this.place++;
    if (!this.take("(")) return { op: "name", name: token.text, at: token.at };
    const known = FUNCTIONS[token.text];
    if (!Object.hasOwn(FUNCTIONS, token.text))
      this.fail(`there is no function "${token.text}"; there are ${Object.keys(FUNCTIONS).join(", ")}`, token.at);
    const of = this.is(")") ? [] : this.list(() => this.expression());
    this.need(")");
    if (of.length !== known[1]) this.fail(`${token.text} takes ${known[1]} arguments, not ${of.length}`, token.at);
    return { op: known[0], of, at: token.at };
  }

  /** `a = b`, `a <= b` or `a <= b <= c`, of sums. */
  chain() {
    const parts = [this.sum()], marks = [];
    for (let token; (token = this.take("=") ?? this.relation()); ) {
      marks.push(token);
      parts.push(this.sum());
    }
    return { parts, marks };
  }
}

/** The expression that a text is. */
export function parseExpression(text) {
  const reader = new Reader(text, 1);
  const found = reader.expression();
  reader.end();
  return found;
}

const ARITHMETIC = {
  NEG: (a) => -a, ADD: (a, b) => a + b, SUB: (a, b) => a - b, MUL: (a, b) => a * b, DIV: (a, b) => a / b, POW: (a, b) => a ** b,
  SQRT: Math.sqrt, EXP: Math.exp, LOG: Math.log, SIN: Math.sin, COS: Math.cos, TAN: Math.tan,
};

/** The number that an expression without variables is; null for any other. */
export function constant(node) {
  if (node.op === "number") return node.value;
  if (node.op === "name") return node.name === "pi" ? Math.PI : null;
  const of = node.of.map(constant);
  return of.includes(null) || !ARITHMETIC[node.op] ? null : ARITHMETIC[node.op](...of);
}

function number(node, what) {
  const value = constant(node);
  if (value === null) throw new SourceError(`${what} is a number, without names of variables`, node.at);
  return value;
}

/** Lower and upper bound and what they bound, of a chain. */
function bounded({ parts, marks }) {
  const [first] = marks;
  if (!first) throw new SourceError('"=", "<=" or ">=" is missing', parts[0].at);
  if (first.text === "=") {
    if (parts.length > 2) throw new SourceError('one "=" is enough', marks[1].at);
    const value = number(parts[1], "the right side");
    return { of: parts[0], lower: value, upper: value };
  }
  const last = marks.at(-1);
  if (marks.length > 2 || last.text === "=" || last.text[0] !== first.text[0])
    throw new SourceError("bounds are written as in 0 <= v <= 1, or one of both", last.at);
  const ordered = first.text[0] === "<" ? parts : parts.slice().reverse();
  if (ordered.length === 3) return { of: ordered[1], lower: number(ordered[0], "a bound"), upper: number(ordered[2], "a bound") };
  const below = constant(ordered[0]);
  return below === null
    ? { of: ordered[0], lower: -Infinity, upper: number(ordered[1], "a bound") }
    : { of: ordered[1], lower: below, upper: Infinity };
}

/**
 * A text as data: variables with their values, statements in their order, bounds, and the task.
 *
 * states, controls, parameters   [{name, value, at}]; discrete values of `hysteresis` are among the states, behind the others
 * statements                     {kind: "define" | "derivative", name, node}, {kind: "hysteresis", name, of: [value, on, off]},
 *                                {kind: "when", guard, falling, resets: [{name, node}]}
 * bounds, terminal               [{of, lower, upper}]
 * rate, final                    costs, or null
 * simulate                       a duration, or null
 * solve                          {horizon, stages, time: [shortest, longest] or null}, or null
 * options                        [{name, value}]
 */
export function parse(text) {
  const found = {
    states: [], controls: [], parameters: [], statements: [], bounds: [], terminal: [], rate: null, final: null, simulate: null, solve: null,
    options: [],
  };
  const names = new Map();
  const discrete = [];
  const enter = (token, what) => {
    if (WORDS.includes(token.text) || Object.hasOwn(FUNCTIONS, token.text) || token.text === "hysteresis")
      throw new SourceError(`"${token.text}" has a meaning of its own: take another name`, token.at);
    if (names.has(token.text)) throw new SourceError(`"${token.text}" is ${names.get(token.text)} already`, token.at);
    names.set(token.text, what);
  };
  const declarations = { states: "a state", controls: "a control", parameters: "a parameter" };
  const once = (key, token) => {
    if (found[key] !== null) throw new SourceError(`"${token.text}" is there twice`, token.at);
  };

  text.split(/\r?\n/).forEach((line, index) => {
    const r = new Reader(line, index + 1);
    if (r.ended) return;
    const first = r.next;
    const word = first.kind === "name" && !["=", "'"].some((mark) => r.is(mark, 1)) ? first.text : "";
    if (Object.hasOwn(declarations, word)) {
      r.place++;
      found[word].push(...r.list(() => {
        const name = r.name("a name");
        enter(name, declarations[word]);
        const value = r.take("=") ? number(r.sum(), "the value") : 0;
        return { name: name.text, value, at: name.at };
      }));
    } else if (word === "simulate") {
      once("simulate", r.take(word));
      found.simulate = number(r.sum(), "the duration");
    } else if (word === "solve") {
      once("solve", r.take(word));
      const horizon = number(r.sum(), "the horizon");
      r.need("in");
      const stages = r.sum();
      r.need("stages");
      let time = null;
      if (r.take(",")) {
        r.need("time"); r.need("from");
        const shortest = number(r.sum(), "the shortest time");
        r.need("to");
        time = [shortest, number(r.sum(), "the longest time")];
      }
      const count = number(stages, "how many stages");
      if (!Number.isInteger(count) || count < 1) throw new SourceError("stages are counted: 1 or more", stages.at);
      found.solve = { horizon, stages: count, time };
    } else if (word === "minimise" || word === "minimize") {
      r.place++;
      const key = r.take("at") ? (r.need("end"), "final") : "rate";
      once(key, first);
      found[key] = r.expression();
    } else if (word === "at") {
      r.place++;
      r.need("end");
      found.terminal.push(...r.list(() => bounded(r.chain())));
    } else if (word === "option") {
      r.place++;
      const name = r.name("the name of an option");
      r.need("=");
      const value = r.next.kind === "name" ? r.name("a value").text : number(r.sum(), "the value");
      found.options.push({ name: name.text, value, at: name.at });
    } else if (word === "when") {
      r.place++;
      const left = r.sum();
      const mark = r.relation() ?? r.fail('"<" or ">" is missing: the jump is made where this becomes true');
      const guard = { op: "SUB", of: [left, r.sum()], at: mark.at };
      r.need(":");
      const resets = r.list(() => {
        const name = r.name("a state");
        r.need("=");
        return { name: name.text, node: r.expression(), at: name.at };
      });
      found.statements.push({ kind: "when", guard, falling: mark.text[0] === "<", resets, at: first.at });
    } else if (first.kind === "name" && r.is("'", 1)) {
      r.place += 2;
      r.need("=");
      found.statements.push({ kind: "derivative", name: first.text, node: r.expression(), at: first.at });
    } else if (first.kind === "name" && r.is("=", 1)) {
      r.place += 2;
      enter(first, "defined");
      if (r.is("hysteresis") && r.is("(", 1)) {
        const { at } = r.name("hysteresis");
        r.need("(");
        const of = r.list(() => r.expression());
        r.need(")");
        if (of.length !== 3) throw new SourceError("hysteresis takes a value, where it goes on and where it goes off", at);
        const [on, off] = of.slice(1).map(constant);
        if (on !== null && off !== null && !(off < on))
          throw new SourceError("hysteresis goes on above its second argument and off below its third, which is smaller", at);
        discrete.push({ name: first.text, value: 0, at: first.at });
        found.statements.push({ kind: "hysteresis", name: first.text, of, at: first.at });
      } else {
        found.statements.push({ kind: "define", name: first.text, node: r.expression(), at: first.at });
      }
    } else {
      const start = r.place;
      const chain = r.chain();
      if (!chain.marks.length) {
        r.place = start;
        r.fail(`a line begins with states, controls, parameters, when, simulate, solve, minimise, at end or option, or says q' = ..., name = ... or bounds`);
      }
      found.bounds.push({ ...bounded(chain), at: first.at });
    }
    r.end();
  });
  found.discrete = discrete.length;
  found.states.push(...discrete);
  return found;
}
