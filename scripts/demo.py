"""usage: demo.py FOLDER [SECONDS]    the first pictures: the README's example, then others, as many as SECONDS (150) allow

Says what runs, how far it is and where the pictures are. Exits with 1 where an example fails. `make examples` runs all of them,
`make benchmarks` the reports on accuracy and speed.
"""

import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples" / "python"

FIRST = """
import sys
import numpy as np
import switchback as swb

w = 2 * np.pi
A1, A2 = np.array([[1, w], [-w, 1]]), np.array([[1, -w], [w, 1]])
system = swb.System(nx=2)
system.add_subsystem(modes=[lambda x: A1 @ x, lambda x: A2 @ x], psi=lambda x: x @ x - 1, signs=[-1, 1])
run = swb.simulate(system, x0=[np.exp(-1), 0], t_span=np.pi / 2, rtol=1e-10)
print(run.x_end, run.table(), sep="\\n")
run.plot(sys.argv[1] + "/readme.svg")
run.plot_phase(sys.argv[1] + "/readme_phase.svg")
"""

# The shortest first; the first line of each says what it shows.
ORDER = (
    "bouncing_ball blocks expressions impact_oscillator cradle oscillator simulate transitions rocking_block play puck gallery "
    "nmpc thermostats"
).split()


def title(script: Path) -> str:
    """The first sentence of an example."""
    text = script.read_text(encoding="utf-8").split('"""')[1]
    return " ".join(text.split("\n\n")[0].split())


def pictures(folder: Path, since: float) -> list[str]:
    """Files that were written since a time."""
    kinds = (".svg", ".png", ".gif")
    return sorted(p.name for p in folder.glob("*") if p.suffix in kinds and p.stat().st_mtime >= since)


def run(command: list[str], what: str, folder: Path, count: str, most: float) -> bool:
    """Run an example, for at most some seconds; did it work? One that is cut off has not failed."""
    print(f"[{count}] {what}", flush=True)
    start, stamp = time.monotonic(), time.time() - 1.0
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=most)
    except subprocess.TimeoutExpired:
        print(f"      not ready after {most:.0f} s, left to make examples", flush=True)
        return True
    took = time.monotonic() - start
    if done.returncode != 0:
        print(done.stdout)
        print(f"      failed after {took:.1f} s", flush=True)
        return False
    drawn = ", ".join(pictures(folder, stamp)[:6])
    print(f"      {took:.1f} s{': ' + drawn if drawn else ''}", flush=True)
    return True


def main() -> int:
    folder, budget = Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 150.0
    folder.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    total = 1 + len(ORDER)
    fine = run([sys.executable, "-c", FIRST, str(folder)], "the first example of the README", folder, f"1/{total}", 60.0)
    done = 1
    for k, name in enumerate(ORDER, 2):
        left = budget - (time.monotonic() - start)
        if left < 5.0:
            break
        script = EXAMPLES / f"{name}.py"
        fine &= run([sys.executable, str(script), str(folder)], f"{script.name}: {title(script)}", folder, f"{k}/{total}", left)
        done += 1
    print(f"{done} of {total} examples in {time.monotonic() - start:.0f} s; pictures: {folder}")
    print("all examples, also in C: make examples; accuracy and speed: make benchmarks")
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
