"""usage: demo.py FOLDER [SECONDS]    the first pictures: the README's program, then examples, as many as SECONDS (150) allow

Names every picture when it is there, and writes FOLDER/index.html with all of them. Exits with 1 where an example fails. `make examples`
runs all examples, `make benchmarks` the reports on accuracy and speed.
"""

import html
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples" / "python"
KINDS = (".svg", ".png", ".gif")

# Simulation, optimal control and feedback in turns, the quick ones first.
ORDER = (
    "bouncing_ball hysteresis_car expressions blocks nmpc impact_oscillator cradle transitions rocking_block puck gallery thermostats"
).split()

PAGE = """<!doctype html>
<meta charset="utf-8">
<title>Switchback: first pictures</title>
<style>body { font-family: sans-serif; max-width: 60rem; margin: 2rem auto } img { max-width: 100% }</style>
<h1>First pictures</h1>
"""


def title(script: Path) -> str:
    """The first sentence of an example."""
    text = script.read_text(encoding="utf-8").split('"""')[1]
    return re.split(r"(?<=[.:])\s", " ".join(text.split("\n\n")[0].split()))[0].rstrip(".:")


def written(folder: Path) -> dict[str, int]:
    """Pictures in a folder, and when they were written."""
    return {p.name: p.stat().st_mtime_ns for p in sorted(folder.glob("*")) if p.suffix in KINDS}


class Demo:
    """Programs that draw into a folder, one after the other."""

    def __init__(self, folder: Path, budget: float) -> None:
        self.folder, self.budget = folder, budget
        self.start = time.monotonic()
        self.page = [PAGE]
        self.fine = True

    def left(self) -> float:
        """Seconds that are left."""
        return self.budget - (time.monotonic() - self.start)

    def run(self, command: list[str], what: str, count: str, cwd: Path) -> None:
        """Runs a program for at most the time that is left. One that is cut off has not failed."""
        print(f"[{count}] {what}", flush=True)
        before, start = written(self.folder), time.monotonic()
        try:
            done = subprocess.run(
                command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=max(self.left(), 5.0)
            )
        except subprocess.TimeoutExpired:
            print("      not ready in the time that was left; make examples runs it", flush=True)
            return
        took = time.monotonic() - start
        if done.returncode != 0:
            self.fine = False
            print(f"{done.stdout}\n      failed after {took:.1f} s", flush=True)
            return
        print(f"      {took:.1f} s", flush=True)
        new = [name for name, at in written(self.folder).items() if before.get(name) != at]
        self.page.append(f"<h2>{html.escape(what)}</h2>\n")
        for name in new:
            print(f"      {self.folder / name}", flush=True)
            self.page.append(f'<p><img src="{html.escape(name)}" alt="{html.escape(name)}"></p>\n')


def readme_program() -> str:
    """The first Python program of the README."""
    return re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.S)[0]


def main() -> int:
    folder, budget = Path(sys.argv[1]).resolve(), float(sys.argv[2]) if len(sys.argv) > 2 else 150.0
    folder.mkdir(parents=True, exist_ok=True)
    demo = Demo(folder, budget)
    total, done = 1 + len(ORDER), 1
    with tempfile.TemporaryDirectory() as work:
        script = Path(work) / "readme.py"
        script.write_text(readme_program(), encoding="utf-8")
        demo.run([sys.executable, str(script)], "README: a mass on a belt, simulated and controlled", f"1/{total}", folder)
    for k, name in enumerate(ORDER, 2):
        if demo.left() < 5.0:
            break
        script = EXAMPLES / f"{name}.py"
        demo.run([sys.executable, str(script), str(folder)], f"{script.name}: {title(script)}", f"{k}/{total}", ROOT)
        done += 1
    page = folder / "index.html"
    page.write_text("".join(demo.page), encoding="utf-8")
    print(f"{done} of {total} programs in {time.monotonic() - demo.start:.0f} s; all pictures on one page: {page}")
    print("all examples, also in C: make examples; accuracy and speed: make benchmarks")
    return 0 if demo.fine else 1


if __name__ == "__main__":
    sys.exit(main())
