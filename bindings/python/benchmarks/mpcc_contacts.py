"""Random problems of contact, discretised here: pushing, and carts before a wall.

usage: mpcc_contacts.py FOLDER [--pushers N] [--carts N] [--seed K]

Writes a folder that mpcc_train.py and mpcc_judge.py take as any other: `--problems FOLDER --set-of pushers`, or `carts`. Each
problem is a program with complementarity pairs in CasADi's symbols, whose functions are compiled (a C compiler and CasADi are
needed). Parameters are drawn from the seed; nothing else says what the problem is, so other seeds are other problems of the same
kinds:

pushers  `disc`: a finger with a bounded force pushes a disc to a place on the other side of an obstacle or beside it; the normal
         force and the gap are a pair, with dry friction at the contact two more and the sliding velocity. Implicit Euler.
         `slider`: a point pushes a box on a table (quasi-static, ellipsoidal limit surface), sticking, sliding up or down the
         face; force and distance are a pair, so contact can be made and broken.
         `blocks`: a pusher and blocks in a row on a floor with dry friction, each to its own place; pairs of gaps with forces,
         and of slip with friction.
         `discs`: a disc pushes another one without restitution, time-frozen, by FESD.
carts    `frozen`: carts that bounce off a wall and off each other, time-frozen: restitution by a spring and a damper behind
         the contact, in which physical time stands still; by FESD with the speed of time a control, Heaviside's or Stewart's form,
         implicit Euler or Radau IIA, pairs for each stage or for the element, as drawn.
         `impulses`: the same without restitution, one impulse for each element and contact (implicit Euler).
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

from mpcc_problems import HERE

# The folder's mpcc_vm.c: a problem is a shared library that has it.
LOADER = """#include "mpcc_problem.h"

#include <dlfcn.h>
#include <stddef.h>

const mpcc_problem *mpcc_open(const char *path)
{
    void *code = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    const mpcc_problem *(*get)(void) = NULL;
    if (code)
        *(void **)&get = dlsym(code, "mpcc_get");
    return get ? get() : NULL;
}

void mpcc_close(const mpcc_problem *p) { (void)p; }
"""

RADAU = np.array([[5 / 12, -1 / 12], [3 / 4, 1 / 4]])  # Radau IIA, two stages


def vertical(*parts):
    """The parts one below the other."""
    import casadi

    return casadi.vertcat(*(casadi.SX(part) for part in parts))


def sum1(v):
    """The sum of the entries."""
    import casadi

    return casadi.sum1(v)


class Program:
    """Variables, rows, pairs and cost, put together in the order of time."""

    def __init__(self, casadi) -> None:
        self.ca = casadi
        self.x, self.x0, self.lbx, self.ubx = [], [], [], []
        self.g, self.lbg, self.ubg = [], [], []
        self.pairs = []
        self.cost = casadi.SX(0)

    def variables(self, n: int, lower=-np.inf, upper=np.inf, start=0.0):
        new = self.ca.SX.sym(f"v{len(self.x)}", n)
        self.x.append(new)
        for to, value in ((self.lbx, lower), (self.ubx, upper), (self.x0, start)):
            to += np.broadcast_to(value, n).tolist()
        return new

    def rows(self, of, lower=0.0, upper=0.0) -> None:
        of = self.ca.vertcat(of)
        self.g.append(of)
        self.lbg += np.broadcast_to(lower, of.numel()).tolist()
        self.ubg += np.broadcast_to(upper, of.numel()).tolist()

    def pair(self, a, b) -> None:
        """0 <= a _|_ b >= 0, entry by entry."""
        self.pairs += zip(self.ca.vertsplit(self.ca.vertcat(a)), self.ca.vertsplit(self.ca.vertcat(b)))

    def compile(self, name: str, folder: Path) -> Path:
        """A shared library with this problem."""
        ca = self.ca
        x, g = ca.vertcat(*self.x), ca.vertcat(*self.g)
        members = [ca.vertcat(*(p[i] for p in self.pairs)) for i in range(2)]
        con = ca.vertcat(g, *members)
        m, c, n = g.numel(), len(self.pairs), x.numel()
        y = ca.SX.sym("y", 1 + con.numel())
        jac = ca.jacobian(con, x)
        lagrangian = y[0] * self.cost + ca.dot(y[1:], con)
        hess = ca.triu(ca.hessian(lagrangian, x)[0])
        outputs = {
            "f": self.cost, "grad": ca.densify(ca.gradient(self.cost, x)), "con": ca.densify(con),
            "jac": jac.nz[:], "hess": hess.nz[:],
        }  # fmt: skip
        code = ca.CodeGenerator(f"{name}.c", {"with_header": False})
        functions = [ca.Function(f"of_{k}", [x, y], [v]) for k, v in outputs.items()]
        for f in functions:
            code.add(f)
        where = folder / f"{name}.c"
        where.write_text(code.dump() + self._tables(name, functions, (n, m, c), jac.sparsity(), hess.sparsity(), members, x))
        target = folder / f"{name}.so"
        compiler = os.environ.get("CC") or shutil.which("cc")
        subprocess.run([compiler, "-O1", "-fPIC", "-shared", f"-I{folder}", where, "-o", target, "-lm"], check=True)
        where.unlink()
        return target

    def _tables(self, name, functions, sizes, jac, hess, members, x) -> str:
        n, m, c = sizes
        index = {e.__hash__(): j for j, e in enumerate(self.ca.vertsplit(x))}
        which = [[index.get(e.__hash__(), -1) for e in self.ca.vertsplit(v)] for v in members]

        def number(v: float) -> str:
            return ("-" if v < 0 else "") + "INFINITY" if np.isinf(v) else repr(float(v))

        out = ['#include "mpcc_problem.h"', "#include <math.h>"]
        for f in functions:
            size = max(f.sz_w(), 1), max(f.sz_iw(), 1), max(f.sz_arg(), 2), max(f.sz_res(), 1), f.nnz_out(0)
            out.append(
                "static int call_{0}(const double *x, const double *y, double *out, void *user)\n{{\n"
                "    static double w[{1}];\n    static casadi_int iw[{2}];\n    const double *arg[{3}] = {{x, y}};\n"
                "    double *res[{4}] = {{out}};\n    int i;\n    (void)user;\n    {0}(arg, res, iw, w, 0);\n"
                "    for (i = 0; i < {5}; i++)\n        if (!isfinite(out[i]))\n            return 1;\n    return 0;\n}}".format(
                    f.name(), *size
                )
            )
        for key in ("x0", "lbx", "ubx", "lbg", "ubg"):
            values = ", ".join(map(number, getattr(self, key))) or "0"
            out.append(f"static const double t_{key}[] = {{{values}}};")
        rows_cols = {"jac": jac, "hess": hess}
        for key, s in rows_cols.items():
            parts = {"colptr": s.colind(), "row": s.row(), "col": s.get_col()}
            for part, values in parts.items():
                out.append(f"static const int32_t {key}_{part}[] = {{{', '.join(map(str, values)) or '0'}}};")
        for k, v in zip("GH", which):
            out.append(f"static const int32_t {k}_var[] = {{{', '.join(map(str, v)) or '0'}}};")
        fields = [
            "MPCC_ABI", n, m, c, jac.nnz(), hess.nnz(), f'"{name}"', *(f"t_{k}" for k in ("x0", "lbx", "ubx", "lbg", "ubg")),
            *(f"{k}_{p}" for k in ("jac", "hess") for p in ("colptr", "row", "col")), "G_var", "H_var",
            *(f"call_{f.name()}" for f in functions), "0",
        ]  # fmt: skip
        out.append(f"static const mpcc_problem problem = {{{', '.join(map(str, fields))}}};")
        out.append("const mpcc_problem *mpcc_get(void) { return &problem; }\n")
        return "\n".join(out)


def disc(p: Program, rng: np.random.Generator) -> None:
    """A finger pushes a disc."""
    ca = p.ca
    n, horizon = int(rng.integers(8, 21)), rng.uniform(2.0, 5.0)
    h = horizon / n
    mass = rng.uniform(0.5, 2.0, 2)
    radius = rng.uniform(0.1, 0.4, 2)
    drag = rng.uniform(0.5, 3.0)
    friction = rng.uniform(0.2, 0.8) if rng.random() < 0.5 else 0.0
    start = np.concatenate([rng.uniform(-2.0, -1.0, 1), rng.uniform(-0.3, 0.3, 1), rng.uniform(-0.3, 0.3, 2)])
    goal = np.array([rng.uniform(1.0, 2.0), rng.uniform(-1.0, 1.0)])
    obstacle = (np.array([rng.uniform(0.4, 0.9), rng.uniform(-0.3, 0.3)]), rng.uniform(0.1, 0.3)) if rng.random() < 0.5 else None
    force = rng.uniform(10.0, 30.0)
    exact = rng.random() < 0.5
    q, v = ca.DM(start), ca.DM.zeros(4)
    for k in range(n):
        u = p.variables(2, -force, force)
        qn = p.variables(4, -5.0, 5.0, start)
        vn = p.variables(4, -10.0, 10.0)
        normal = p.variables(1, 0.0, np.inf, 1.0)
        apart = qn[2:] - qn[:2]
        distance = ca.sqrt(ca.sumsqr(apart) + 1e-12)
        along = apart / distance
        push = normal * along
        gap = distance - radius.sum()
        if friction:
            across = ca.vertcat(-along[1], along[0])
            slide = p.variables(2, 0.0, np.inf, 0.1)  # friction either way
            speed = p.variables(1, 0.0, np.inf, 0.1)
            rate = ca.dot(across, vn[2:] - vn[:2])
            p.pair(slide, ca.vertcat(speed + rate, speed - rate))
            p.pair(speed, friction * normal - slide[0] - slide[1])
            push = push + across * (slide[0] - slide[1])
        p.pair(normal, gap)
        p.rows(qn - q - h * vn)
        p.rows(mass[0] * (vn[:2] - v[:2]) - h * (u - push))
        p.rows(mass[1] * (vn[2:] - v[2:]) - h * (push - drag * vn[2:]))
        if obstacle:
            p.rows(ca.sumsqr(qn[2:] - obstacle[0]), (radius[1] + obstacle[1]) ** 2, np.inf)
        p.cost += h * (0.01 * ca.sumsqr(u) + ca.sumsqr(qn[2:] - goal) + 0.01 * ca.sumsqr(vn))
        q, v = qn, vn
    if exact:
        p.rows(q[2:] - goal)
    else:
        p.cost += 100.0 * ca.sumsqr(q[2:] - goal) + ca.sumsqr(v)


def slider(p: Program, rng: np.random.Generator) -> None:
    """A point pushes a box on a table; the pusher moves, the box follows quasi-statically."""
    ca = p.ca
    n, horizon = int(rng.integers(10, 26)), rng.uniform(2.0, 5.0)
    h = horizon / n
    half = rng.uniform(0.3, 0.6)
    mu = rng.uniform(0.2, 0.6)
    moment = rng.uniform(0.3, 0.8) * half  # largest moment of the limit surface over its largest force
    goal = np.array([rng.uniform(0.5, 1.5), rng.uniform(-0.6, 0.6), rng.uniform(-0.6, 0.6)])
    begin = rng.uniform(0.0, 0.4)
    exact = rng.random() < 0.5
    pose = ca.DM([0.0, 0.0, 0.0])
    at = ca.DM([-half - begin, rng.uniform(-0.5, 0.5) * half])  # the pusher in the frame of the box
    for k in range(n):
        u = p.variables(2, -1.0, 1.0)  # its velocity in that frame, over that of the box
        posen = p.variables(3, -4.0, 4.0)
        atn = p.variables(2, [-2.0, -0.95 * half], [-half + 1e-3, 0.95 * half], [-half - 0.1, 0.0])
        normal = p.variables(1, 0.0, 5.0, 0.5)
        tangential = p.variables(1, -5.0, 5.0)
        up = p.variables(1, 0.0, np.inf, 0.1)
        down = p.variables(1, 0.0, np.inf, 0.1)
        torque = -atn[1] * normal - half * tangential
        spin = torque / moment**2
        turn = posen[2]
        p.rows(posen[0] - pose[0] - h * (ca.cos(turn) * normal - ca.sin(turn) * tangential))
        p.rows(posen[1] - pose[1] - h * (ca.sin(turn) * normal + ca.cos(turn) * tangential))
        p.rows(posen[2] - pose[2] - h * spin)
        p.rows(atn[0] - at[0] - h * u[0])
        p.rows(atn[1] - at[1] - h * (up - down))
        p.rows(up - down - u[1])
        gap = -half - atn[0]
        p.pair(normal, gap)
        # friction at its limit while the pusher slides along the face, and none apart
        p.pair(up, mu * normal - tangential)
        p.pair(down, mu * normal + tangential)
        p.cost += h * (ca.sumsqr(posen - goal) + 0.05 * (normal**2 + tangential**2) + 0.01 * ca.sumsqr(u))
        pose, at = posen, atn
    if exact:
        p.rows(pose - goal)
    else:
        p.cost += 50.0 * ca.sumsqr(pose - goal)


def blocks(p: Program, rng: np.random.Generator) -> None:
    """A pusher and blocks in a row on a floor with dry friction."""
    ca = p.ca
    n, horizon, count = int(rng.integers(15, 31)), rng.uniform(2.0, 4.0), int(rng.integers(1, 4))
    h = horizon / n
    mass = rng.uniform(0.5, 2.0, count + 1)
    limit = 9.81 * rng.uniform(0.1, 0.4) * mass
    limit[0] = 0.0
    place = np.cumsum(np.concatenate([[0.0], rng.uniform(0.2, 0.8, count)]))
    goal = place + np.concatenate([[0.0], np.sort(rng.uniform(0.3, 1.5, count))])
    goal[0] = 0.0
    exact = rng.random() < 0.5
    force = 2.0 * (limit.sum() + mass.sum())
    q, v = ca.DM(place), ca.DM.zeros(count + 1)
    for k in range(n):
        u = p.variables(1, -force, force)
        qn = p.variables(count + 1, -5.0, 5.0, place)
        vn = p.variables(count + 1, -20.0, 20.0)
        contact = p.variables(count, 0.0, np.inf, 0.1)
        right = p.variables(count, 0.0, np.inf, 0.1)
        left = p.variables(count, 0.0, np.inf, 0.1)
        share = p.variables(count, -1.0, 1.0)
        p.pair(contact, qn[1:] - qn[:-1])
        p.rows(vn[1:] - right + left)
        p.pair(right, 1.0 - share)
        p.pair(left, 1.0 + share)
        net = ca.vertcat(u, -limit[1:] * share) + ca.vertcat(0, contact) - ca.vertcat(contact, 0)
        p.rows(qn - q - h * vn)
        p.rows(mass * (vn - v) - h * net)
        p.cost += h * (0.01 * u**2 + 0.1 * ca.sumsqr(qn - goal))
        q, v = qn, vn
    if exact:
        p.rows(q[1:] - goal[1:])
        p.rows(v)
    else:
        p.cost += 100.0 * ca.sumsqr(q - goal) + ca.sumsqr(v)


def impulses(p: Program, rng: np.random.Generator) -> None:
    """Carts in a row before a wall, without restitution; a force on the last one."""
    ca = p.ca
    n, horizon, count = int(rng.integers(15, 36)), rng.uniform(2.0, 4.0), int(rng.integers(1, 4))
    h = horizon / n
    mass = rng.uniform(0.5, 2.0, count)
    drag = rng.uniform(0.0, 0.3, count)
    place = np.cumsum(rng.uniform(0.3, 1.0, count))
    goal = np.cumsum(rng.uniform(0.1, 1.0, count))
    speed = rng.uniform(-1.0, 1.0, count)
    spring = rng.uniform(0.0, 2.0)
    exact = rng.random() < 0.5
    force = rng.uniform(5.0, 20.0)
    q, v = ca.DM(place), ca.DM(speed)
    for k in range(n):
        u = p.variables(1, -force, force)
        qn = p.variables(count, -5.0, 5.0, place)
        vn = p.variables(count, -20.0, 20.0)
        impulse = p.variables(count, 0.0, np.inf, 0.1)
        p.pair(impulse, qn - ca.vertcat(0, qn[:-1]))
        p.rows(qn - q - h * vn)
        net = -drag * vn - spring * (qn - place)
        net[count - 1] += u
        p.rows(mass * (vn - v) - h * net - impulse + ca.vertcat(impulse[1:], 0))
        p.cost += h * (0.01 * u**2 + ca.sumsqr(qn - goal))
        q, v = qn, vn
    if exact:
        p.rows(q - goal)
    else:
        p.cost += 100.0 * ca.sumsqr(q - goal) + ca.sumsqr(v)


class Switched:
    """A system with modes by the signs of its switching functions `functions(x)`, or, where it has `indicators(x)`, the one whose
    indicator is least (Stewart's form)."""

    indicators = None
    clock: int | None = None  # the state that is physical time; without one the speed of time is one unknown
    ends = True  # is the end of physical time given?
    pace = (0.5, 20.0, 1.0)  # bounds and start of the speed of time
    reach = 20.0  # bound of all states


def switched(p: Program, rng: np.random.Generator, sizes: tuple[int, int, float], start, model: Switched) -> tuple:
    """A system discretised by FESD with implicit Euler or Radau IIA in Heaviside's or Stewart's form; the speed of time is a
    control of each stage where physical time is a state. The last state, and the integral of `model.running`."""
    ca = p.ca
    n, elements, horizon = sizes
    stages = int(rng.integers(1, 3))
    tableau = RADAU if stages == 2 else np.array([[1.0]])
    heaviside, each = rng.random() < 0.5, rng.random() < 0.5  # a pair for each stage and function, or one for the element
    mean = horizon / (n * elements)
    if model.indicators:
        heaviside, count = False, 0
        patterns = range(model.indicators(ca.SX(start)).numel())
    else:
        count = model.functions(ca.SX(start)).numel()
        patterns = list(itertools.product((True, False), repeat=count))
        signs = np.where(patterns, 1.0, -1.0)
    weights = count if heaviside else len(patterns)

    def indicators(x):
        return model.indicators(x) if model.indicators else -signs @ model.functions(x)

    def field(x, u, w):
        """All modes with their weights: products of steps, or Stewart's multipliers."""
        total = 0
        for i, pattern in enumerate(patterns):
            weight = 1.0 if heaviside else w[i]
            for k in range(count if heaviside else 0):
                weight = weight * (w[k] if pattern[k] else 1.0 - w[k])
            total = total + weight * model.field(pattern, x, u)
        return total

    def split(x):
        """Parts of the switching functions that are positive and negative, or how far the modes are from active."""
        if heaviside:
            c = model.functions(x)
            return [ca.fmax(-c, 0.0), ca.fmax(c, 0.0)]
        g = indicators(x)
        return [g - ca.mmin(g)]

    x, total = ca.DM(start), 0
    last = [ca.DM(ca.evalf(v)) for v in split(ca.SX(start))]
    for k in range(n):
        u = p.variables(model.controls, -model.force, model.force)
        if k == 0 or model.clock is not None:
            pace = p.variables(1, *model.pace)
        length = 0
        for _ in range(elements):
            step = p.variables(1, 0.0, 2.0 * mean, mean)
            length += step
            p.cost += 1e-2 * (step / mean - 1.0) ** 2
            xs = [p.variables(len(start), -model.reach, model.reach, start) for _ in range(stages)]
            ws, multipliers = [], [last]
            for at in xs:
                ws.append(p.variables(weights, 0.0, 1.0, 0.5 if heaviside else 1.0 / weights))
                if heaviside:
                    c = model.functions(at)
                    below, above = (p.variables(count, 0.0, np.inf, 0.5) for _ in range(2))
                    p.rows(c - above + below)
                    multipliers.append([below, above])
                else:
                    away, level = p.variables(weights, 0.0, np.inf, 0.5), p.variables(1)
                    p.rows(indicators(at) - away - level)
                    p.rows(ca.sum1(ws[-1]) - 1.0)
                    multipliers.append([away])
            rates = [pace * field(at, u, w) for at, w in zip(xs, ws)]
            for j in range(stages):
                p.rows(xs[j] - x - step * sum(tableau[j, i] * rates[i] for i in range(stages)))
            total += step * sum(tableau[-1, i] * pace * model.running(xs[i], u) for i in range(stages))
            sums = [sum(m[i] for m in multipliers) for i in range(len(last))]
            groups = ws if each else [sum(ws)]
            for w in groups:
                p.pair(w, sums[0])
                if heaviside:
                    p.pair((1.0 if each else stages) - w, sums[1])
            x, last = xs[-1], multipliers[-1]
        p.rows(length - horizon / n)
        if model.clock is not None and model.ends:
            p.rows(x[model.clock] - (k + 1) * horizon / n)
    return x, total


class Carts(Switched):
    """Carts in a row before a wall at zero, which bounce off it and off each other: behind a contact a spring and a damper act
    while physical time stands still."""

    def __init__(self, rng: np.random.Generator, count: int):
        self.count, self.controls, self.clock = count, 1, 2 * count
        self.mass = rng.uniform(0.5, 2.0, count)
        self.force = rng.uniform(5.0, 20.0)
        self.stiffness = 10.0
        decay = -np.log(rng.uniform(0.3, 1.0)) / np.pi  # the restitution is drawn
        self.damping = 2.0 * np.sqrt(self.stiffness) * decay / np.sqrt(1.0 + decay**2)
        self.goal = np.cumsum(rng.uniform(0.2, 1.0, count))

    def functions(self, x):
        return x[: self.count] - (0 if self.count == 1 else vertical(0, x[: self.count - 1]))

    def field(self, apart, x, u):
        q, v = x[: self.count], x[self.count : 2 * self.count]
        if all(apart):
            return vertical(v, vertical(np.zeros(self.count - 1), u) / self.mass, 1.0)
        i = apart.index(False)  # the first closed one acts
        direction = np.zeros(self.count)
        direction[i] = 1.0
        direction[i - 1 if i else i] -= float(i > 0)
        share = direction / self.mass
        gap, rate = sum1(direction * q), sum1(direction * v)
        pull = -(self.stiffness * gap + self.damping * rate) / (direction * share).sum()
        return vertical(v * np.abs(direction), pull * share, 0.0)

    def running(self, x, u):
        return 0.1 * u**2 + sum1((x[: self.count] - self.goal) ** 2)


class Discs(Switched):
    """A driven disc pushes another one, without restitution: between discs that overlap and approach each other an auxiliary
    force acts while physical time stands still."""

    def __init__(self, rng: np.random.Generator):
        self.controls, self.clock = 2, 8
        self.mass = rng.uniform(0.5, 2.0, 2)
        self.radius = rng.uniform(0.1, 0.4, 2)
        self.force = rng.uniform(10.0, 30.0)
        self.drag = rng.uniform(0.5, 2.0)
        self.goal = np.array([rng.uniform(0.5, 1.5), rng.uniform(-0.5, 0.5)])

    def functions(self, x):
        apart, rate = x[2:4] - x[:2], x[6:8] - x[4:6]
        return vertical(sum1(apart**2) - self.radius.sum() ** 2, sum1(apart * rate))

    def field(self, signs, x, u):
        apart, v = x[2:4] - x[:2], x[4:8]
        if any(signs):
            return vertical(v, u / self.mass[0], -self.drag / self.mass[1] * v[2:], 1.0)
        return vertical(np.zeros(4), -10.0 * apart / self.mass[0], 10.0 * apart / self.mass[1], 0.0)

    def running(self, x, u):
        return 0.01 * sum1(u**2) + sum1((x[2:4] - self.goal) ** 2)


def frozen(p: Program, rng: np.random.Generator) -> None:
    """Carts that bounce off a wall and off each other, time-frozen."""
    count = int(rng.integers(1, 3))
    model = Carts(rng, count)
    sizes = int(rng.integers(5, 16)), int(rng.integers(3, 5)), rng.uniform(1.5, 4.0)
    start = np.concatenate([np.cumsum(rng.uniform(0.4, 1.0, count)), rng.uniform(-2.0, 0.0, count), [0.0]])
    x, cost = switched(p, rng, sizes, start, model)
    p.cost += cost
    if count == 1 and rng.random() < 0.5:
        p.rows(x[:count] - model.goal)
    else:
        p.cost += 10.0 * p.ca.sumsqr(x[:count] - model.goal) + p.ca.sumsqr(x[count : 2 * count])


def discs(p: Program, rng: np.random.Generator) -> None:
    """A disc pushes another one to its place, time-frozen."""
    model = Discs(rng)
    sizes = int(rng.integers(5, 16)), int(rng.integers(2, 4)), rng.uniform(2.0, 4.0)
    start = np.concatenate([rng.uniform(-1.5, -1.0, 1), rng.uniform(-0.2, 0.2, 3), np.zeros(5)])
    x, cost = switched(p, rng, sizes, start, model)
    p.cost += cost + 10.0 * p.ca.sumsqr(x[2:4] - model.goal) + 0.1 * p.ca.sumsqr(x[4:8])


FAMILIES = {"pushers": (disc, slider, blocks, discs), "carts": (frozen, impulses)}


def write(folder: Path, families: dict[str, tuple], counts: dict[str, int], seed: int) -> None:
    """A collection: for each family a list of problems, whose kinds take turns."""
    import casadi

    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(HERE.parent / "tests" / "collection" / "mpcc_problem.h", folder)
    (folder / "mpcc_vm.c").write_text(LOADER)
    for number, (family, kinds) in enumerate(families.items()):
        entries = {}
        for i in range(counts[family]):
            kind = kinds[i % len(kinds)]
            name = f"{kind.__name__}_{seed + i}"
            program = Program(casadi)
            kind(program, np.random.default_rng([seed + i, number]))
            entries[f"{family}:{name}"] = {"file": program.compile(name, folder).name}
            print(f"{name}: {len(program.x0)} variables, {len(program.pairs)} pairs", file=sys.stderr)
        (folder / f"{family}.json").write_text(json.dumps(entries, indent=1) + "\n")


def main(families: dict[str, tuple] = FAMILIES, about: str = __doc__) -> int:
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("folder", type=Path)
    for family in families:
        parser.add_argument(f"--{family}", type=int, default=24, metavar="N", help="how many of them")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    write(arguments.folder, families, {f: getattr(arguments, f) for f in families}, arguments.seed)
    return 0


if __name__ == "__main__":
    sys.exit(main())
