"""Closed loops under model predictive control: costs beside another implementation, and times, as a page of docs/benchmarks.

usage: nmpc_loops.py [--out FOLDER] [--only REGEX] [--repeat N] [--quick]

The problems are those of tests/data/nmpc (pendulum, chains), of examples/python/diesel.py and of examples/python/stick_slip.py. Costs
of the smooth problems are functions of the scheme alone, so they must be met to all digits that are known. The other implementation
is acados with code generated for every problem and DAQP on the condensed program. Only its costs stand beside ours: times that were not
measured in the same run say nothing about each other. For every sample the shortest time of some loops counts.

Ours are the seconds that `prepare` and `feedback` measure themselves.
"""

from __future__ import annotations

import argparse
import datetime
import json
import re
import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "examples" / "python"))

import diesel  # noqa: E402
import nmpc as pendulum_example  # noqa: E402

DATA = json.loads((ROOT / "tests/data/nmpc/problems.json").read_text())

# schemes by other names: whether the state of the next sample is known, the controller's scheme, its options. "adaptive": as many inner
# iterations as the steps ask for
SCHEMES = {"ideal": (True, "asc", {}), "adaptive": (False, "as_rti", {"tol": 1e-2})}

# scheme, level, inner iterations, cost that is known
NONE = float("nan")
ROWS = {
    "pendulum": [
        ("RTI", "rti", "d", 0, 50.527637),
        ("AS-RTI-D-1", "as_rti", "d", 1, 42.949317),
        ("AS-RTI-D-2", "as_rti", "d", 2, 42.9678),
        ("adaptive", "adaptive", "c", 4, NONE),
        ("AS-RTI-A", "as_rti", "a", 1, 43.0446),
        ("AS-RTI-B-1", "as_rti", "b", 1, 43.0461),
        ("AS-RTI-B-3", "as_rti", "b", 3, 42.9431),
        ("AS-RTI-C-1", "as_rti", "c", 1, 42.9791),
        ("AS-RTI-C-3", "as_rti", "c", 3, 42.9606),
        ("MLI-B", "mli", "b", 0, NONE),
        ("MLI-C", "mli", "c", 0, NONE),
        ("ideal", "ideal", "d", 100, 42.968375),
    ],
    "chain3": [
        ("RTI", "rti", "d", 0, 28.066576),
        ("AS-RTI-D-1", "as_rti", "d", 1, 28.056979),
        ("AS-RTI-D-2", "as_rti", "d", 2, 28.0570),
        ("adaptive", "adaptive", "c", 4, NONE),
        ("MLI-B", "mli", "b", 0, NONE),
        ("MLI-C", "mli", "c", 0, NONE),
        ("ideal", "ideal", "d", 100, 28.057042),
    ],
    "chain6": [
        ("RTI", "rti", "d", 0, 53.058806),
        ("AS-RTI-D-1", "as_rti", "d", 1, 52.870885),
        ("AS-RTI-D-2", "as_rti", "d", 2, 52.8673),
        ("adaptive", "adaptive", "c", 4, NONE),
        ("AS-RTI-A", "as_rti", "a", 1, 52.8708),
        ("AS-RTI-B-3", "as_rti", "b", 3, 52.8680),
        ("AS-RTI-C-3", "as_rti", "c", 3, 52.8673),
        ("MLI-B", "mli", "b", 0, NONE),
        ("MLI-C", "mli", "c", 0, NONE),
        ("ideal", "ideal", "d", 100, 52.867116),
    ],
    "diesel 50 ode": [
        ("RTI", "rti", "d", 0, 0.00553285),
        ("AS-RTI-D-1", "as_rti", "d", 1, 0.00304997),
        ("AS-RTI-D-2", "as_rti", "d", 2, 0.0030377),
        ("adaptive", "adaptive", "c", 4, NONE),
        ("MLI-C", "mli", "c", 0, NONE),
        ("ideal", "ideal", "d", 60, 0.00301974),
    ],
    "diesel 50 dae": [
        ("RTI", "rti", "d", 0, 0.00553285),
        ("AS-RTI-D-1", "as_rti", "d", 1, 0.00304997),
        ("AS-RTI-D-2", "as_rti", "d", 2, 0.0030377),
    ],
    "diesel 40 dae": [
        ("RTI", "rti", "d", 0, 0.0070286),
        ("AS-RTI-D-1", "as_rti", "d", 1, 0.0042589),
        ("AS-RTI-D-2", "as_rti", "d", 2, 0.0042557),
        ("ideal", "ideal", "d", 60, 0.00413859),
    ],
}


def pendulum_rates(x, u, m=np):
    th, v, om = x[1], x[2], x[3]
    mc, mp, length, g = 1.0, 0.1, 0.5, 9.81
    d = mc + mp * m.sin(th) ** 2
    t = u[0] + mp * length * om * om * m.sin(th)
    dv = (t - mp * g * m.sin(th) * m.cos(th)) / d
    return [v, om, dv, ((mc + mp) * g * m.sin(th) - t * m.cos(th)) / (length * d)]


def chain_rates(masses):
    mass, stiffness, rest = 0.03, 1.0, 0.033

    def rates(x, u, m=np):
        at = lambda i: [0.0] * 3 if i == 0 else [x[3 * (i - 1) + c] for c in range(3)]  # noqa: E731
        forces = []
        for i in range(masses + 1):
            d = [b - a for a, b in zip(at(i), at(i + 1))]
            pull = stiffness * (1 - rest / m.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]))
            forces.append([pull * v for v in d])
        out = [x[3 * (masses + 1) + i] for i in range(3 * masses)] + [u[0], u[1], u[2]]
        for i in range(masses):
            out += [(forces[i + 1][c] - forces[i][c]) / mass - (9.81 if c == 2 else 0.0) for c in range(3)]
        return out

    return rates


class Tracking:
    """One of the problems of tests/data/nmpc."""

    def __init__(self, name):
        self.name, d = name, DATA[name]
        self.rates = pendulum_rates if name == "pendulum" else chain_rates(int(name[-1]))
        get = lambda key: np.array(d[key], dtype=float)  # noqa: E731
        self.n, self.ts, self.model_steps, self.plant_steps = d["N"], d["Ts"], d["rk4_substeps_model"], d["rk4_substeps_plant"]
        self.nx, self.nu, self.samples = d["nx"], d["nu"], d["n_sim"]
        self.q, self.r, self.qn, self.ref, self.x0 = get("Q_diag"), get("R_diag"), get("QN_diag"), get("xref"), get("x0")
        self.lower, self.upper = get("lbu"), get("ubu")
        s, self.noise = int(d["noise_seed"]), np.zeros((self.samples, self.nx))
        for k in range(self.samples):
            for j in range(self.nx):
                s = (6364136223846793005 * s + 1442695040888963407) % 2**64
                self.noise[k, j] = d["noise_amp"][j] * (2 * ((s >> 11) * 2.0**-53) - 1)
        for k, kick in d["kicks"].items():
            self.noise[int(k)] += kick

    def ocp(self):
        m = swb.Model(self.nx, self.nu, name=self.name)
        x, u = list(m.x), list(m.u)
        m.derivatives = self.rates(x, u, swb)
        ocp = swb.Ocp(m, self.n * self.ts, self.n, rk_family="explicit", n_s=4, n_fe=self.model_steps)
        ocp.set_control_bounds(self.lower, self.upper)
        ocp.add_least_squares(m.function(x + u), np.concatenate([self.q, self.r]) / 2, np.concatenate([self.ref, np.zeros(self.nu)]))
        ocp.add_least_squares(m.function(x), self.qn / 2, self.ref, at="terminal")
        ocp.set_state_guess([0, self.n * self.ts], [self.x0, self.ref])
        return ocp

    def step(self, x, u, steps):
        h = self.ts / steps
        f = lambda y: np.array(self.rates(y, u), dtype=float)  # noqa: E731
        for _ in range(steps):
            a = f(x)
            b = f(x + h / 2 * a)
            c = f(x + h / 2 * b)
            d = f(x + h * c)
            x = x + h / 6 * (a + 2 * b + 2 * c + d)
        return x

    def loop(self, scheme, level, inner):
        times, cost, x = [], 0.0, self.x0
        ideal, scheme, options = SCHEMES.get(scheme, (False, scheme, {}))
        with swb.Nmpc(self.ocp(), scheme, level, inner, **options) as c:
            c.initialise(self.x0, 200)
            for k in range(self.samples):
                prepared = c.prepare(x if ideal else None)
                u, info = c.feedback(x)
                assert info.source is swb.NmpcSource.QP, (k, info)
                times.append((prepared.time, info.time))
                cost += self.ts * 0.5 * (self.q @ (x - self.ref) ** 2 + self.r @ u**2)
                x = self.step(x, u, self.plant_steps) + self.noise[k]
        return cost, np.array(times)


def diesel_loop(name, scheme, level, inner):
    _, n, form = name.split()
    ideal, scheme, options = SCHEMES.get(scheme, (False, scheme, {}))
    cost, _, times, _ = diesel.run(int(n), form, scheme, level, inner, ideal=ideal, **options)
    return cost, times


def shortest(loop, repeat):
    """The cost, and of every sample the shortest times of several loops."""
    cost, best = loop()
    for _ in range(repeat - 1):
        best = np.minimum(best, loop()[1])
    return cost, best


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs/benchmarks")
    parser.add_argument("--only", default="")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="RTI and AS-RTI-D-1 alone, nothing is written")
    args = parser.parse_args()
    records = []
    head = f"{'problem':14} {'scheme':11} {'cost':>13} {'known':>11} {'prepare':>9} {'feedback':>9} {'worst':>7}"
    table = [head]
    print(head, flush=True)
    for problem, rows in ROWS.items():
        for scheme_name, scheme, level, inner, known in rows:
            if not re.search(args.only, problem) or (args.quick and scheme_name not in ("RTI", "AS-RTI-D-1")):
                continue
            if problem.startswith("diesel"):
                run = lambda: diesel_loop(problem, scheme, level, inner)  # noqa: B023, E731
            else:
                run = lambda: Tracking(problem).loop(scheme, level, inner)  # noqa: B023, E731
            # loops of the generator take seconds: its plant is written in Python
            repeat = 1 if scheme == "ideal" else (min(args.repeat, 3) if problem.startswith("diesel") else args.repeat)
            cost, times = shortest(run, repeat)
            own, worst = 1e6 * times.mean(0), 1e6 * times[:, 1].max()
            records.append(
                {"problem": problem, "scheme": scheme_name, "cost": cost, "known": known, "prepare_us": own[0], "feedback_us": own[1],
                 "worst_feedback_us": worst}
            )  # fmt: skip
            known_text = f"{known:>11}" if np.isfinite(known) else f"{'-':>11}"
            table.append(
                f"{problem:14} {scheme_name:11} {cost:13.9g} {known_text} {own[0]:9.1f} {own[1]:9.2f} {worst:7.1f}"
            )
            print(table[-1], flush=True)
    if args.quick or args.only:
        return
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "data").mkdir(exist_ok=True)
    clean = [{k: (None if isinstance(v, float) and not np.isfinite(v) else v) for k, v in r.items()} for r in records]
    (args.out / "data" / "nmpc.json").write_text(json.dumps({"loops": clean}, indent=1) + "\n")
    text = PAGE.format(date=datetime.date.today().isoformat(), table="\n".join(table))
    (args.out / "nmpc.md").write_text(text)


PAGE = """# Model predictive control in closed loop

| date | machine | command |
|---|---|---|
| {date} | one core of a shared machine | `bindings/python/benchmarks/nmpc_loops.py` |

Two implementations of a scheme have the same cost of the closed loop; `known` is the cost of acados (code generated for every problem, DAQP
on the condensed program). Times are microseconds, good to some ten per cent; the data is in [data/nmpc.json](data/nmpc.json).

- `prepare`, `feedback`: for every sample the shortest of some loops, then the mean over the samples; `worst`: the longest feedback among them.
- `adaptive`: at most four inner iterations, until the estimated contraction leaves less than a hundredth of states and controls.
- `ideal`: every problem is solved with the state that will be measured.

```
{table}
```

The pendulum has 4 states, the chains have 21 and 39, and the diesel generator has 17 with 18 algebraic ones as `dae`. Horizons have 40 stages, and
those of the generator as many as its name says. The matrices of plain MLI controllers are those of the first linearisation, and the swing-up
of the pendulum goes far beyond where they are valid.
"""


if __name__ == "__main__":
    main()
