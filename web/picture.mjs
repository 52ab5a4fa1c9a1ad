// Pictures of runs and optimal controls as SVG.
const NAMESPACE = "http://www.w3.org/2000/svg";
const [LEFT, RIGHT, HEIGHT, GAP] = [64, 12, 104, 24];

function element(name, attributes, ...inside) {
  const made = document.createElementNS(NAMESPACE, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...inside);
  return made;
}

/** Round numbers between two values, at most about n of them. */
export function ticks(low, high, n) {
  const raw = (high - low) / n;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= raw * (1 - 1e-9));
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.floor(high / step + 1e-9) - first;
  return Array.from({ length: count + 1 }, (_, i) => Number(((first + i) * step).toPrecision(12)));
}

/** A number as a label: without zeros that say nothing. */
const label = (value) => (value !== 0 && (Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3) ? value.toExponential().replace("e+", "e") : String(value));

/**
 * Panels with a common axis of time.
 *
 * panels    [{name, t, values, steps}]: lines, or steps that hold until the next time
 * shaded    [[start, end]]
 * marks     [{t, text, jump}]
 * width     in pixels, of which letters have the same number wherever the picture is
 */
export function picture({ panels, start, end, shaded, marks, width }) {
  const span = end - start || 1;
  const x = (t) => LEFT + ((t - start) / span) * (width - LEFT - RIGHT);
  const total = panels.length * (HEIGHT + GAP) + 24;
  const svg = element("svg", { viewBox: `0 0 ${width} ${total}`, class: "swb-picture", role: "img" });
  panels.forEach((panel, i) => {
    const top = i * (HEIGHT + GAP) + GAP - 4, bottom = top + HEIGHT;
    const finite = panel.values.filter(Number.isFinite);
    let low = finite.reduce((a, b) => Math.min(a, b), Infinity), high = finite.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!finite.length) [low, high] = [0, 1];
    // a constant gets room around it
    const margin = high > low ? 0.06 * (high - low) : 0.5 * (Math.abs(high) || 1);
    [low, high] = [low - margin, high + margin];
    const y = (value) => bottom - ((value - low) / (high - low)) * HEIGHT;
    for (const [a, b] of shaded) svg.append(element("rect", { x: x(a), y: top, width: Math.max(x(b) - x(a), 0.5), height: HEIGHT, class: "swb-sliding" }));
    for (const tick of ticks(low, high, 3)) {
      svg.append(element("line", { x1: LEFT, x2: width - RIGHT, y1: y(tick), y2: y(tick), class: "swb-grid" }));
      svg.append(element("text", { x: LEFT - 6, y: y(tick) + 4, "text-anchor": "end" }, label(tick)));
    }
    for (const mark of marks) {
      const line = element("line", { x1: x(mark.t), x2: x(mark.t), y1: top, y2: bottom, class: mark.jump ? "swb-jump" : "swb-switch" });
      line.append(element("title", {}, mark.text));
      svg.append(line);
    }
    svg.append(element("rect", { x: LEFT, y: top, width: width - LEFT - RIGHT, height: HEIGHT, class: "swb-frame" }));
    const points = [];
    panel.t.forEach((t, k) => {
      if (panel.steps && k > 0) points.push(`${x(t).toFixed(2)},${y(panel.values[k - 1]).toFixed(2)}`);
      if (k < panel.values.length) points.push(`${x(t).toFixed(2)},${y(panel.values[k]).toFixed(2)}`);
    });
    svg.append(element("polyline", { points: points.join(" "), class: panel.steps ? "swb-control" : "swb-state" }));
    svg.append(element("text", { x: LEFT, y: top - 6, class: "swb-name" }, panel.name));
  });
  const bottom = panels.length * (HEIGHT + GAP) - 4;
  // labels of time need some 60 pixels each
  for (const tick of ticks(start, end, Math.min(8, (width - LEFT) / 60))) {
    svg.append(element("line", { x1: x(tick), x2: x(tick), y1: bottom, y2: bottom + 5, class: "swb-tick" }));
    svg.append(element("text", { x: x(tick), y: bottom + 18, "text-anchor": "middle" }, label(tick)));
  }
  return svg;
}
