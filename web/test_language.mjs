// usage: node web/test_language.mjs    the language of the playground: what texts mean, and where their mistakes are
import assert from "node:assert/strict";
import { EXAMPLES } from "./examples.mjs";
import { constant, parse, parseExpression, SourceError } from "./language.mjs";

const value = (text) => constant(parseExpression(text));

// precedence and associativity, against the arithmetic of JavaScript
for (const [text, expected] of [
  ["1 + 2*3", 7], ["2^3^2", 512], ["-2^2", -4], ["2^-1", 0.5], ["8/4/2", 1], ["1 - 2 - 3", -4], ["-(1 - 2)*3", 3], ["2**3", 8],
  [".5e1 + 1.", 6], ["- -1", 1], ["+3", 3], ["sin(pi/2)", 1], ["2*-3", -6], ["(1)", 1], ["x", null], ["min(1, 2)", null],
]) assert.equal(value(text), expected, text);

// the same for expressions drawn at random (a fixed seed), printed with spaces and without
let seed = 1;
const draw = (n) => (seed = (seed * 48271) % 2147483647) % n;
function random(depth) {
  if (depth === 0 || draw(5) === 0) return String(1 + draw(9));
  const op = ["+", "-", "*", "/"][draw(4)];
  const inner = `${random(depth - 1)} ${op} ${random(depth - 1)}`;
  return draw(2) ? `(${inner})` : draw(4) ? inner : `-(${inner})`;
}
for (let i = 0; i < 500; i++) {
  const text = random(4);
  const right = new Function(`return ${text}`)();
  for (const spaced of [text, text.replaceAll(" ", "")]) assert.ok(Object.is(value(spaced), right), spaced);
}

const car = parse(`
# a car
states q = 0, v = 2*3
controls u = 1
turbo = hysteresis(v, 15, 10)
q' = v           # speed
v' = (1 + 2*turbo)*u
-5 <= u <= 5
v >= -25
when q > 3: v = -v/2, q = 3
solve 10 in 10 stages, time from 1 to 60
minimise u^2
minimise at end t
at end q = 150, 0 <= v <= 1
option n_fe = 1
option integration = radau5`);
assert.deepEqual(car.states.map((s) => [s.name, s.value]), [["q", 0], ["v", 6], ["turbo", 0]]);
assert.equal(car.discrete, 1);
assert.deepEqual(car.statements.map((s) => s.kind), ["hysteresis", "derivative", "derivative", "when"]);
assert.deepEqual(car.bounds.map((b) => [b.of.name, b.lower, b.upper]), [["u", -5, 5], ["v", -25, Infinity]]);
assert.deepEqual(car.terminal.map((b) => [b.of.name, b.lower, b.upper]), [["q", 150, 150], ["v", 0, 1]]);
assert.deepEqual(car.solve, { horizon: 10, stages: 10, time: [1, 60] });
assert.deepEqual(car.options.map((o) => [o.name, o.value]), [["n_fe", 1], ["integration", "radau5"]]);
assert.equal(car.statements[3].falling, false);
assert.deepEqual(car.statements[3].resets.map((r) => r.name), ["v", "q"]);
assert.ok(car.rate && car.final);

// mistakes, with their line and column
for (const [text, line, column, words] of [
  ["q' = v +", 1, 9, "missing before the end of the line"],
  ["states q\nq' = sine(q)", 2, 6, 'no function "sine"'],
  ["q' = min(1)", 1, 6, "2 arguments, not 1"],
  ["q' = (1 + 2", 1, 12, '")" is missing'],
  ["q' = 1 2", 1, 8, "not expected"],
  ["q' = 1 $ 2", 1, 8, '"$" is not understood'],
  ["states q, q", 1, 11, "a state already"],
  ["states t", 1, 8, "a meaning of its own"],
  ["states q = p", 1, 12, "is a number"],
  ["solve 1 in 2.5 stages", 1, 12, "counted"],
  ["h = hysteresis(1, 2, 3)", 1, 5, "smaller"],
  ["0 <= v >= 1", 1, 8, "bounds"],
  ["when h = 0: v = 1", 1, 8, '"<" or ">"'],
  ["simulate 1\nsimulate 2", 2, 1, "twice"],
  ["hello world", 1, 1, "a line begins with"],
  ["q' = constructor(1)", 1, 6, "no function"],
]) {
  assert.throws(() => parse(text), (e) => {
    assert.ok(e instanceof SourceError, text);
    assert.deepEqual([e.line, e.column], [line, column], `${text}: ${e.message}`);
    assert.ok(e.message.includes(words), e.message);
    return true;
  });
}
// texts with characters and words lost, doubled or replaced: understood, or a mistake with a place inside of the text
const words = ["states", "q", "'", "=", "1", "+", "(", ")", "solve", "in", "stages", "<=", "at", "end", ",", ":", "when", "\n", " ", "hysteresis", "not", "-", "^"];
const sources = Object.values(EXAMPLES);
let understood = 0;
for (let i = 0; i < 3000; i++) {
  let text = sources[draw(sources.length)];
  for (let k = 0; k <= draw(3); k++) {
    const at = draw(text.length);
    text = text.slice(0, at) + (draw(2) ? words[draw(words.length)] : "") + text.slice(at + draw(3));
  }
  try {
    parse(text);
    understood++;
  } catch (error) {
    const lines = text.split("\n");
    assert.ok(error instanceof SourceError, `${error.stack}\n${text}`);
    assert.ok(error.column >= 1 && error.column <= lines[error.line - 1].length + 1, `${error.message}\n${text}`);
  }
}
assert.ok(understood > 100 && understood < 2900, `${understood} of 3000 texts are understood`);
console.log("the language of the playground: all as expected");
