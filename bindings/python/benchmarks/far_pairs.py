"""What pairs of bodies cost that are far apart: boxes in space that fall on a floor, each away from all others, by time stepping.

With the lower bounds that the contacts of a pair share (spheres around both), and without them.

usage: far_pairs.py [COUNT ...]
"""

import sys
import time

import numpy as np

import switchback_control as swb
from switchback_control import _world_scene


def fallen(count: int) -> tuple[int, float, swb.Steps, float]:
    """Contacts, seconds to build, the steps, and seconds for one."""
    rng = np.random.default_rng(0)
    w = swb.World(space=True, mu=0.5)
    w.floor()
    side = int(np.ceil(np.sqrt(count)))
    for k in range(count):
        box = w.box(0.5, 0.3, mass=1.0, depth=0.4, rounding=0.02)
        w.place(box, 3.0 * (k % side), 3.0 * (k // side), z=0.4 + 0.6 * rng.uniform(), turn=rng.normal(size=4) * 0.2 + [1, 0, 0, 0])
    began = time.perf_counter()
    w.scene.system()
    built = time.perf_counter()
    steps = w.scene.simulate_steps(*w.start(), 1.0, 2e-3)
    return len(w.scene.contacts), built - began, steps, (time.perf_counter() - built) / steps.stats.steps


def main() -> None:
    counts = [int(a) for a in sys.argv[1:]] or [2, 4, 6]
    print(f"{'boxes':>5} {'contacts':>8} {'bounds shared':>13} {'built':>7} {'step':>8} {'gaps':>6} {'bounds':>6}")
    separation = _world_scene.separation_of
    for count in counts:
        for shared in (False, True):
            _world_scene.separation_of = separation if shared else lambda *_: None
            contacts, built, steps, step = fallen(count)
            s = steps.stats
            row = f"{count:5} {contacts:8} {'yes' if shared else 'no':>13} {built:6.1f}s {1e6 * step:6.0f}us"
            print(f"{row} {s.gaps / s.steps:6.1f} {s.bounds / s.steps:6.1f}", flush=True)


if __name__ == "__main__":
    main()
