"""usage: playground_look.py SITE FOLDER    run the playground of the site in headless Chromium, and keep pictures of it in FOLDER

The site is served from 127.0.0.1. Every example must run; its numbers are compared with what is known of them and with those of the library
that Python has. Mistakes must show a message, long work must stop, and memory must be free again. Left out where there is no Chromium, or no
playground in the site.
"""

import base64
import http.server
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from site_look import NAMES  # noqa: E402

#: Seconds that one step of a page may take on a busy machine.
PATIENCE = 180
HELPERS = """
window.place = document.querySelector(".swb-playground");
window.part = (name) => place.querySelector(name);
window.settled = async () => {
  while (place.dataset.state !== "ready" || !place.found) await new Promise((done) => setTimeout(done, 20));
  return place.found;
};
window.pressed = async () => {
  place.found = null;
  [...place.querySelectorAll("button")].find((b) => b.textContent === "Run").click();
  return await settled();
};
window.example = async (name) => {
  const choice = part("select");
  choice.value = name;
  choice.onchange();
  return await pressed();
};
window.text = async (written) => {
  part("textarea").value = written;
  const found = await pressed();
  return { ...found, shown: part(".swb-output").innerText };
};
"""
#: The memory of the module, in bytes, after a text was run some times and more times.
MEMORY = """(async () => {
  const { Switchback } = await import("./playground/switchback.mjs");
  const { EXAMPLES } = await import("./playground/examples.mjs");
  const library = await Switchback.load(fetch("playground/switchback.wasm").then((a) => a.arrayBuffer()));
  const sizes = [];
  for (let i = 0; i < 12; i++) {
    library.run(EXAMPLES["Mass on a belt"]);
    library.run(EXAMPLES["Best force on the belt"]);
    try { library.run("states q\\nq' = sign(q)\\noption nonsense = 1\\nsimulate 1"); } catch {}
    sizes.push(library.memory.byteLength);
  }
  return sizes;
})()"""
#: The README's problem by the calls that docs/playground.md shows, and the switch of the tutorial.
CALLS = """(async () => {
  const { Model, Switchback } = await import("./playground/switchback.mjs");
  const library = await Switchback.load(fetch("playground/switchback.wasm").then((a) => a.arrayBuffer()));
  const equations = "slip = 1 - v\\nq' = v\\nv' = F - q + sign(slip)/(1 + abs(slip))";
  const task = { horizon: 2, stages: 10, rate: "F^2", bounds: { F: [-3, 3] }, terminal: { q: 2, v: [0, 0] } };
  const belt = Model({ states: { q: 0, v: 1 }, parameters: { k: 1, mu: 0.5 } }, "q' = v\\nv' = -k*q - 0.1*v + mu*sign(1 - v)");
  let mistake = null;
  try { Model({ states: ["q"] }, "q' = 1\\nq' = +"); } catch (error) { mistake = [error.name, error.line, error.column]; }
  return [library.solveOcp(Model({ states: ["q", "v"], controls: ["F"] }, equations), task).cost, library.simulate(belt, 10).switches[0].t, mistake];
})()"""
#: Of these every operation is defined, and switches far from its surface.
OPERANDS = (0.3, -0.7, 1.9)
#: A program that is typed: a tank that flows over into another one, whose drain opens.
TANKS = """states a = 0, b = 0
controls u = 0.6
over = max(a - 1, 0)
a' = u - over
b' = over - where(b > 0.5, 0.2, 0)
simulate 4
0 <= u <= 2
minimise u^2
at end b = 1
solve 4 in 8 stages
"""
LONG = """states q = 0, v = 0
controls F
q' = v
v' = F - q + sign(1 - v)/(1 + abs(1 - v))
-3 <= F <= 3
minimise F^2
at end q = 2, v = 0
solve 2 in 4000 stages
"""


class Silent(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_: Any) -> None:
        pass


class Browser:
    """A Chromium, spoken to by its debugging protocol through pipes: descriptors 3 and 4 of the process."""

    def __init__(self, profile: str):
        program = next(filter(None, map(shutil.which, NAMES)))
        theirs_in, self.out = os.pipe()
        self.into, theirs_out = os.pipe()
        command = [program, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars", "--remote-debugging-pipe"]
        # the shell moves the two pipes to the descriptors that Chromium reads and writes
        shell = f'exec "$@" 3<&{theirs_in} 4>&{theirs_out}'
        self.process = subprocess.Popen(
            ["sh", "-c", shell, "sh", *command, f"--user-data-dir={profile}"], pass_fds=(theirs_in, theirs_out), stderr=subprocess.DEVNULL
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self.count, self.rest, self.session = 0, b"", None
        self.errors: list[str] = []
        self.loaded = False
        # reading from a browser that hangs ends when it is ended
        self.watch = threading.Timer(4 * PATIENCE, self.process.kill)
        self.watch.start()
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.ask("Page.enable")
        self.ask("Runtime.enable")
        self.ask("Emulation.setDeviceMetricsOverride", width=1200, height=1700, deviceScaleFactor=1, mobile=False)

    def message(self) -> dict[str, Any]:
        while b"\0" not in self.rest:
            more = os.read(self.into, 1 << 16)
            if not more:
                raise RuntimeError("Chromium ended")
            self.rest += more
        first, _, self.rest = self.rest.partition(b"\0")
        message = json.loads(first)
        self.loaded |= message.get("method") == "Page.loadEventFired"
        if message.get("method") == "Runtime.exceptionThrown":
            self.errors.append(message["params"]["exceptionDetails"].get("exception", {}).get("description", "an exception"))
        return message

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        self.count += 1
        question = {"id": self.count, "method": method, "params": parameters} | ({"sessionId": self.session} if self.session else {})
        os.write(self.out, json.dumps(question).encode() + b"\0")
        while True:
            answer = self.message()
            if answer.get("id") == self.count:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]

    def open(self, address: str) -> None:
        self.loaded = False
        self.ask("Page.navigate", url=address)
        while not self.loaded:
            self.message()
        self.run(HELPERS)

    def run(self, code: str) -> Any:
        """The value of an expression in the page, which is awaited."""
        answer = self.ask("Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True, timeout=1000 * PATIENCE)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"].get("exception", {}).get("description", "an exception"))
        return answer["result"].get("value")

    def typed(self, text: str, first: str, last: str) -> Any:
        """The answer after the text is typed over what is between two indices in the editor, and the mouse is pressed on Run."""
        where = self.run(f"""(() => {{
            const editor = part("textarea"), run = [...place.querySelectorAll("button")].find((b) => b.textContent === "Run");
            place.found = null;
            editor.focus();
            editor.setSelectionRange({first}, {last});
            run.scrollIntoView({{ block: "center", behavior: "instant" }});
            const box = run.getBoundingClientRect();
            return [box.x + box.width / 2, box.y + box.height / 2];
        }})()""")
        self.ask("Input.insertText", text=text)
        for kind in ("mousePressed", "mouseReleased"):
            self.ask("Input.dispatchMouseEvent", type=kind, x=where[0], y=where[1], button="left", clickCount=1)
        return self.run("settled()")

    def picture(self, path: Path) -> None:
        path.write_bytes(base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"]))

    def end(self) -> None:
        self.watch.cancel()
        self.process.kill()
        self.process.wait()


def operations() -> dict[str, float]:
    """Expressions of a, b and c with every function of the language, and their values."""
    a, b, c = OPERANDS
    values = {f"{f}({x})": getattr(math, f)(value) for f, x, value in (
        ("sqrt", "c", c), ("exp", "b", b), ("log", "c", c), ("sin", "b", b), ("cos", "b", b), ("tan", "b", b), ("asin", "b", b), ("acos", "b", b),
        ("atan", "b", b), ("sinh", "b", b), ("cosh", "b", b), ("tanh", "b", b), ("erf", "b", b),
    )}
    values |= {"atan2(b, a)": math.atan2(b, a), "sign(b)": -1, "abs(b)": -b, "min(a, b)": b, "max(a, b)": a, "clip(c, b, a)": a, "clip(b, -c, c)": b}
    values |= {"relay(b, 2, 3)": 3, "relay(a, 2, 3)": 2, "dead_zone(c, a)": c - a, "dead_zone(b, c)": 0, "where(a > b, 2, 3)": 2, "where(a < b, 2, 3)": 3}
    values |= {"where(a >= b and not b > c, 2, 3)": 2, "where(a < b or b <= c, 2, 3)": 2, "where(not (a < b or b < c), 2, 3)": 3}
    return values | {"a + b*c": a + b * c, "a - b/c": a - b / c, "-c^2": -(c**2), "c^b^3": c ** (b**3), "2^-c": 2**-c, "(a - b)*-c": (a - b) * -c, "pi - t*0": math.pi}


def native() -> dict[str, Any]:
    """The same problems by the library that Python has: switching times and costs, by the names of the examples."""
    import switchback_control as swb

    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples" / "python"))
    from hysteresis_car import car

    m = swb.Model(states="q v", controls="F")
    slip = 1 - m.v
    m.derivatives = [m.v, m.F - m.q + swb.sign(slip) / (1 + abs(slip))]
    ocp = swb.Ocp(m, horizon=2, n_stages=10, lagrange=m.F**2, initial_state=[0, 0], control_bounds=(-3, 3))
    ocp.add_terminal([m.q, m.v], [2, 0], [2, 0])
    relay = swb.Model(states="a b c")
    x, y, z = relay.x
    relay.derivatives = [swb.relay(z, -1, 1) - x, x - y, y - z]
    tanks = swb.Model(states="a b", controls="u")
    over = swb.maximum(tanks.a - 1, 0)
    tanks.derivatives = [tanks["u"] - over, over - swb.where(tanks.b > 0.5, 0.2, 0)]
    typed = swb.Ocp(tanks, horizon=4, n_stages=8, lagrange=tanks["u"]**2, initial_state=[0, 0], control_bounds=(0, 2))
    typed.add_terminal(tanks.b, 1, 1)
    return {
        "Tanks": (swb.simulate(tanks, [0, 0], 4, u=[0.6]).switch_times, typed.solve().cost),
        "Stick and slip": swb.simulate(m, [0, 0], 20, u=[0]).switch_times,
        "Relay in a loop": swb.simulate(relay, [0, 0, 0.2], 20).switch_times,
        "Best force on the belt": ocp.solve().cost,
        "Car with turbo": car(10)[0].solve().cost,
    }


def compared(found: dict[str, Any], expected: dict[str, Any]) -> list[str]:
    """What is wrong with the answers to the examples."""
    wrong = []

    def near(what: str, got: float, wanted: float, tolerance: float) -> None:
        error = abs(got - wanted) / max(1.0, abs(wanted))
        print(f"{what}: {got!r}, expected {wanted!r}: {error:.1e}, asked {tolerance:.0e}")
        if not error <= tolerance:
            wrong.append(f"{what} is {got!r} and not {wanted!r}")

    for name, answer in found.items():
        parts = [part for part in (answer.get("simulation"), answer.get("solution")) if part]
        if not parts or not all(part["success"] for part in parts):
            wrong.append(f"{name}: {answer.get('error') or [part['outcome'] for part in parts]}")
    if wrong:
        return wrong
    times = {name: [s["t"] for s in a["simulation"]["switches"]] for name, a in found.items() if a["simulation"]}
    near("switch of the tutorial", times["Mass on a belt"][0], 0.4, 1e-12)
    if len(times["Mass on a belt"]) != 1 or found["Mass on a belt"]["simulation"]["sliding"][0][0] != 0:
        wrong.append("the mass of the tutorial does not stick from the beginning to one switch")
    for name in ("Stick and slip", "Relay in a loop"):
        if len(times[name]) != len(expected[name]):
            wrong.append(f"{name} has {len(times[name])} switches and not {len(expected[name])}")
        # errors of the runs are those of the tolerance 1e-8, with the rounding of two machines behind that
        near(f"last switch of {name}", times[name][-1], float(expected[name][-1]), 1e-9)
    for name in ("Best force on the belt", "Car with turbo"):
        near(f"cost of {name}", found[name]["solution"]["cost"], float(expected[name]), 1e-9)
    near("known optimum of the car", found["Car with turbo"]["solution"]["cost"], 10.22925791133, 1e-9)
    fall = math.sqrt(2 / 9.81)
    for k, j in enumerate(found["Bouncing ball"]["simulation"]["jumps"]):
        # the first fall, then flights of twice 0.8^i times as long
        near(f"impact {k + 1} of the ball", j["t"], fall * (1 + 2 * sum(0.8**i for i in range(1, k + 1))), 1e-9)
    return wrong


def edits(browser: Browser, known: dict[str, Any], folder: Path) -> list[str]:
    """What is wrong where somebody edits an example, and types a program."""
    wrong = []
    browser.run('example("Mass on a belt")')
    place = 'editor.value.indexOf("mu = 0.5")'
    less = browser.typed("mu = 0.25", place, f'{place} + "mu = 0.5".length')
    # it slips where the spring and the air, q + 0.1, are as strong as the friction, and q is the time
    times = [s["t"] for s in (less.get("simulation") or {}).get("switches", [])]
    if len(times) != 1 or not abs(times[0] - 0.15) <= 1e-12:
        wrong.append(f"with less friction the mass slips at {times} and not at 0.15: {less.get('error')}")
    tanks = browser.typed(TANKS, "0", "editor.value.length")
    times = [s["t"] for s in (tanks.get("simulation") or {}).get("switches", [])]
    expected, cost = known["Tanks"]
    # the first tank is full at 1/0.6
    if len(times) != 2 or not abs(times[0] - 5 / 3) <= 1e-9 or not abs(times[1] - expected[1]) <= 1e-9 * expected[1]:
        wrong.append(f"two tanks that are typed switch at {times} and not at {[float(t) for t in expected]}: {tanks.get('error')}")
    got = (tanks.get("solution") or {}).get("cost", math.nan)
    if not abs(got - cost) <= 1e-9 * cost:
        wrong.append(f"two tanks that are typed cost {got} and not {cost}")
    print(f"typed: two tanks switch at {times}, expected {[float(t) for t in expected]}; cost {got}, expected {cost}")
    browser.picture(folder / "playground-typed.png")
    return wrong


def look(browser: Browser, address: str, folder: Path) -> list[str]:
    wrong = []
    browser.open(f"{address}/index.html")
    first = browser.run("pressed()")
    if not first.get("simulation"):
        wrong.append(f"the first page: {first}")
    browser.picture(folder / "playground-first-page.png")
    browser.open(f"{address}/playground.html")
    names = browser.run('[...part("select").options].map((o) => o.value)')
    found = {}
    for name in names:
        found[name] = browser.run(f"example({json.dumps(name)})")
        browser.run('place.scrollIntoView(); window.scrollBy(0, -60)')
        drawn = browser.run('part(".swb-picture")?.querySelectorAll("polyline").length ?? 0')
        if drawn < 1:
            wrong.append(f"{name} has no picture")
        browser.picture(folder / f"playground-{name.lower().replace(' ', '-')}.png")
    known = native()
    wrong += compared(found, known)
    wrong += edits(browser, known, folder)
    for text, words in (
        ("states q\nq' = q +\nsimulate 1", "line 2, column 9"),
        ("states q\nq' = w\nsimulate 1", 'there is no "w"'),
        ("states q, v\nq' = v\nsimulate 1", '"v" has no derivative'),
        ("states q\nq' = q > 1\nsimulate 1", "a number is needed"),
        ("states q\nq' = 1\noption nonsense = 1\nsimulate 1", "nonsense"),
        ("states q = 1\nq' = q^2\nsimulate 2", "step too small"),
        ("states q\nq' = 1\nq <= 1\nsimulate 1", "line 3, column 1"),
    ):
        shown = browser.run(f"text({json.dumps(text)})")["shown"]
        if words not in shown:
            wrong.append(f"{text!r} shows {shown!r} and not {words!r}")
    browser.picture(folder / "playground-mistake.png")
    cases = operations()
    names = [f"y{k}" for k in range(len(cases))]
    states = [*(f"{name} = {value}" for name, value in zip("abc", OPERANDS)), *names]
    lines = [f"states {', '.join(states)}", *(f"{name}' = 0" for name in "abc"), *(f"{name}' = {e}" for name, e in zip(names, cases)), "simulate 1"]
    answer = browser.run(f"text({json.dumps(chr(10).join(lines))})")
    reached = answer["simulation"]["x_end"][3:] if answer.get("simulation") else []
    # steps that add up to 1 and weights that do, rounded each
    wrong += [f"{e} is {got!r} and not {value!r}" for (e, value), got in zip(cases.items(), reached) if not abs(got - value) <= 1e-13 * max(1.0, abs(value))]
    if len(reached) != len(cases):
        wrong.append(f"the functions of the language: {answer['shown']}")
    cost, switch, mistake = browser.run(CALLS)
    if not (abs(cost - known["Best force on the belt"]) <= 1e-9 * cost and abs(switch - 0.4) <= 1e-12 and mistake == ["SourceError", 2, 7]):
        wrong.append(f"calls give {cost}, {switch}, {mistake}")
    stopped = browser.run(f"""(async () => {{
        part("textarea").value = {json.dumps(LONG)};
        const answer = pressed();
        await new Promise((done) => setTimeout(done, 500));
        const alive = place.dataset.state;
        [...place.querySelectorAll("button")].find((b) => b.textContent === "Stop").click();
        return [alive, (await answer).error];
    }})()""")
    if stopped != ["runs", "stopped"]:
        wrong.append(f"long work does not stop: {stopped}")
    if not browser.run('example("Mass on a belt")').get("simulation"):
        wrong.append("nothing runs after long work was stopped")
    sizes = browser.run(MEMORY)
    print(f"memory of the module after 2 and {len(sizes)} rounds: {sizes[1]}, {sizes[-1]} bytes")
    if sizes[-1] > sizes[1]:
        wrong.append(f"memory is not free after a run: {sizes}")
    for width, scheme in ((1200, "slate"), (420, "default")):
        browser.ask("Emulation.setDeviceMetricsOverride", width=width, height=1700, deviceScaleFactor=1, mobile=False)
        browser.run(f'document.body.dataset.mdColorScheme = "{scheme}"; example("Stick and slip")')
        wide = browser.run("Math.max(place.getBoundingClientRect().right, place.scrollWidth) - window.innerWidth")
        if wide > 0:
            wrong.append(f"in a window of {width} pixels the playground is {wide} pixels too wide")
        browser.picture(folder / f"playground-{width}.png")
    return wrong + browser.errors


def main() -> int:
    site, folder = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    if not (site / "playground" / "switchback.wasm").is_file():
        print("left out: running the playground: the site has none")
        return 0
    if not any(map(shutil.which, NAMES)):
        print("left out: running the playground: there is no Chromium here")
        return 0
    folder.mkdir(parents=True, exist_ok=True)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Silent, directory=site))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(profile)
        try:
            wrong = look(browser, f"http://127.0.0.1:{server.server_port}", folder)
        finally:
            browser.end()
    server.shutdown()
    print("\n".join(f"playground: {what}" for what in wrong) or "the playground runs all examples")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
