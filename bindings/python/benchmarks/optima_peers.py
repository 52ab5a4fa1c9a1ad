"""Lowest costs of the problems of `optima_problems.py` by other ways than our own transcription.

`smoothed` replaces signs by hyperbolic tangents, collocates on the control grid (Radau, IPOPT through CasADi), and
sharpens them step by step; `Descent` minimises over the controls themselves (and free lengths, parameters, initial
states) with SciPy's SLSQP, where states, cost and all derivatives come from simulations by events. Both read the document
of a problem, and need casadi and scipy.
"""

from __future__ import annotations

import json
import math
import time
from typing import Any, Callable

import casadi as ca
import numpy as np
from scipy.optimize import linprog, minimize

import switchback_control as swb
from switchback_control import expr

Array = np.ndarray
INF = np.inf


def _numbers(values: list[Any]) -> Array:
    return np.array([float(v) for v in values])


def _interval(data: dict[str, Any]) -> tuple[Array, Array]:
    return _numbers(data["lower"]), _numbers(data["upper"])


def evaluate(f: dict[str, Any], x: Any, u: Any, p: Any, t: Any, space: Any, linear: Callable[..., Any]) -> list[Any]:
    """Outputs of a function of a document, computed with what `space` calls sin, exp, ...; `linear` solves systems."""
    graph = f["expressions"]
    groups: dict[int, Any] = {}
    values: list[Any] = []

    def group(k: int) -> Any:
        if k not in groups:
            g = graph["groups"][k]["solve"]
            n = len(g["rhs"])
            a = [[values[g["matrix"][i * n + j]] for j in range(n)] for i in range(n)]
            a = [list(row) for row in zip(*a)] if g["transposed"] else a
            groups[k] = linear(a, [values[i] for i in g["rhs"]])
        return groups[k]

    for op, *a in graph["nodes"]:
        if op == "const":
            v: Any = a[0]
        elif op in "xupt":
            v = t if op == "t" else {"x": x, "u": u, "p": p}[op][a[0]]
        elif op == "component":
            v = group(a[0])[a[1]]
        elif op == "powi":
            v = values[a[0]] ** a[1]
        elif op == "neg":
            v = -values[a[0]]
        elif op in ("+", "-", "*", "/"):
            b, c = values[a[0]], values[a[1]]
            v = b + c if op == "+" else b - c if op == "-" else b * c if op == "*" else b / c
        elif op == "pow":
            v = values[a[0]] ** values[a[1]]
        else:
            v = getattr(space, op)(values[a[0]])
        values.append(v)
    return [values[i] for i in graph["roots"]]


def _casadi(f: dict[str, Any], x: Any, u: Any, p: Any, t: Any) -> list[Any]:
    def linear(a: Any, b: Any) -> Any:
        y = ca.solve(ca.vertcat(*[ca.horzcat(*row) for row in a]), ca.vertcat(*b))
        return [y[i] for i in range(len(b))]

    return evaluate(f, x, u, p, t, ca, linear)


def _split(v: Any) -> list[Any]:
    return [v[i] for i in range(v.shape[0])]


class Statement:
    """An optimal control problem as data, and its smooth functions in CasADi."""

    def __init__(self, ocp: swb.Ocp):
        d = json.loads(ocp.to_json())["ocp"]
        self.data, s = d, d["system"]
        if any(s.get(k) for k in ("inclusions", "algebraic", "transitions")) or d.get("complementarity"):
            raise NotImplementedError("inclusions, algebraic equations, transitions, complementarities")
        if d.get("stage_params") or any(c.get("relaxed") for c in d.get("constraints", [])):
            raise NotImplementedError("parameters of stages, relaxed constraints")
        self.nx, self.nu, self.np, self.n = s["states"], s["controls"], s["parameters"], d["n_stages"]
        self.linear = any(d.get("linear_controls", []))
        timing = d.get("time") or {}
        self.durations = _numbers(timing.get("durations", [d["horizon"] / self.n] * self.n))
        self.free = timing.get("free")
        self.time_bounds = tuple(float(v[0]) for v in timing["bounds"].values()) if self.free else (0.0, 0.0)
        self.x0_bounds = _interval(d["initial_bounds"])
        self.x_bounds = _interval(d["state_bounds"])
        self.u_bounds = _interval(d["control_bounds"])
        self.params = _numbers(d["params"])
        self.p_bounds = _interval(d["param_bounds"]) if d.get("param_bounds") else (self.params, self.params)
        self.squares = d.get("least_squares", [])
        running = [q for q in self.squares if q["place"] == "running"]
        self.refs = np.hstack([self._references(q) for q in running]) if running else np.zeros((self.n, 0))
        self.running = running
        x, u, p, t = ca.SX.sym("x", self.nx), ca.SX.sym("u", self.nu), ca.SX.sym("p", self.np), ca.SX.sym("t")
        r, x0 = ca.SX.sym("r", self.refs.shape[1]), ca.SX.sym("x0", self.nx)
        self.at = (x, u, p, t)
        inputs = tuple(_split(v) for v in (x, u, p)) + (t,)
        of = lambda f: _casadi(f, *inputs)
        rate = of(d["lagrange"])[0] if d.get("lagrange") else ca.SX(0)
        offset = 0
        for q in running:
            y = of(q["f"])
            rate += self._weighted(y, _split(r[offset : offset + len(y)]), q)
            offset += len(y)
        self.rate = ca.Function("rate", [x, u, p, t, r], [rate])
        end = of(d["mayer"])[0] if d.get("mayer") else ca.SX(0)
        for q in self.squares:
            if q["place"] == "terminal":
                end += self._weighted(of(q["f"]), list(self._references(q)[-1]), q)
        self.end = ca.Function("end", [x, u, p, t], [end])
        g = ca.SX.sym("g", sum(self._references(q).shape[1] for q in self._grid()))
        cost, offset = ca.SX(0), 0
        for q in self._grid():
            y = of(q["f"])
            cost += self._weighted(y, _split(g[offset : offset + len(y)]), q)
            offset += len(y)
        self.grid_refs = (
            np.hstack([self._references(q) for q in self._grid()]) if self._grid() else np.zeros((self.n, 0))
        )
        self.grid = ca.Function("grid", [x, u, p, t, g], [cost])
        self.path, self.path_bounds = self._rows(("control_grid", "elements", "stage_points"), of, [x, u, p, t])
        self.terminal, self.terminal_bounds = self._rows(("terminal",), of, [x, u, p, t])
        both = (_split(x0) + _split(x), inputs[1], inputs[2], t)
        self.boundary, self.boundary_bounds = self._rows(("both_ends",), lambda f: _casadi(f, *both), [x0, x, u, p, t])

    def _grid(self) -> list[dict[str, Any]]:
        return [q for q in self.squares if q["place"] == "control_grid"]

    def _references(self, q: dict[str, Any]) -> Array:
        y = _numbers(q["references"])
        m = q["f"]["signature"]["outputs"]
        return np.broadcast_to(y.reshape(-1, m), (self.n, m))

    @staticmethod
    def _weighted(y: list[Any], r: list[Any], q: dict[str, Any]) -> Any:
        w, m = q["weights"], len(y)
        e = [a - b for a, b in zip(y, r)]
        if len(w) == m:
            return sum((k * d * d for k, d in zip(w, e)), ca.SX(0))
        return sum((w[i * m + j] * e[i] * e[j] for i in range(m) for j in range(m)), ca.SX(0))

    def _rows(
        self, places: tuple[str, ...], of: Callable[..., Any], inputs: list[Any]
    ) -> tuple[Any, tuple[Array, Array]]:
        chosen = [c for c in self.data.get("constraints", []) if c["at"] in places]
        outputs = [y for c in chosen for y in of(c["f"])]
        low = np.concatenate([_interval(c["bounds"])[0] for c in chosen]) if chosen else np.zeros(0)
        high = np.concatenate([_interval(c["bounds"])[1] for c in chosen]) if chosen else np.zeros(0)
        return ca.Function("rows", inputs, [ca.vertcat(*outputs) if outputs else ca.SX(0, 1)]), (low, high)

    def middle(self) -> Array:
        low, high = self.u_bounds
        low, high = (
            np.where(np.isfinite(low), low, np.minimum(high, 0)),
            np.where(np.isfinite(high), high, np.maximum(low, 0)),
        )
        both = (np.where(np.isfinite(low), low, 0) + np.where(np.isfinite(high), high, 0)) / 2
        return np.tile(both, (self.n + 1 if self.linear else self.n, 1))

    def start(self) -> Array:
        low, high = self.x0_bounds
        return np.clip(np.zeros(self.nx), low, high) if not np.all(np.isfinite(low + high)) else (low + high) / 2


# --- smoothing ------------------------------------------------------------------------------------


def _right_hand_side(s: Statement, scales: list[Array]) -> Any:
    """f(x, u, p, t, eps): modes weighted by products of steps that have the width eps."""
    system = s.data["system"]
    x, u, p, t = s.at
    eps = ca.SX.sym("eps")
    inputs = (_split(x), _split(u), _split(p), t)
    rhs = _casadi(system["f0"], *inputs) if system.get("f0") else [ca.SX(0)] * s.nx
    for sub, scale in zip(system.get("subsystems", []), scales):
        psi = _casadi(sub["regions"]["signs"]["psi"], *inputs)
        signs = np.array(sub["regions"]["signs"]["signs"]).reshape(sub["n_modes"], len(psi))
        modes = _casadi(sub["modes"], *inputs)
        step = [ca.tanh(v / (eps * c)) for v, c in zip(psi, scale)]
        weights = []
        for row in signs:
            w = ca.SX(1)
            for k, v in zip(row, step):
                w = w * ((1 + int(k) * v) / 2 if k else 1)
            weights.append(w)
        total = sum(weights[1:], weights[0]) + 1e-12
        for j, row_index in enumerate(sub["rows"]):
            for i, w in enumerate(weights):
                rhs[row_index] = rhs[row_index] + w / total * modes[i * len(sub["rows"]) + j]
    return ca.Function("f", [x, u, p, t, eps], [ca.vertcat(*rhs)])


def _scales(s: Statement, u: Array) -> list[Array]:
    """Sizes of the switching functions along a simulation."""
    d = Descent(s)
    states = d.states(d.pack(u, s.durations, s.params, s.start()))
    x, uu, p, t = s.at
    found = []
    for sub in s.data["system"].get("subsystems", []):
        psi = ca.Function(
            "psi",
            [x, uu, p, t],
            [ca.vertcat(*_casadi(sub["regions"]["signs"]["psi"], _split(x), _split(uu), _split(p), t))],
        )
        values = np.array([np.array(psi(v, u[0], s.params, 0.0)).ravel() for v in states])
        size = np.nanmax(np.abs(values), axis=0)
        found.append(np.where(size > 1e-6, size, 1.0))
    return found


def smoothed(
    s: Statement, controls: Array | None = None, budget: float = 20.0, widths: Any = (0.3, 0.1, 0.03, 0.01, 0.003)
):
    """Controls, lengths, parameters, initial state of the smoothed problem; None where IPOPT finds no solution at all."""
    guess = s.middle() if controls is None else controls
    try:
        scales = _scales(s, guess)
    except (swb.SwitchbackError, FloatingPointError):
        scales = [
            np.ones(len(q["regions"]["signs"]["psi"]["expressions"]["roots"]))
            for q in s.data["system"].get("subsystems", [])
        ]
    f = _right_hand_side(s, scales)
    degree, steps = 3, 3
    tau = [0.0, *ca.collocation_points(degree, "radau")]
    basis = [np.poly1d([1.0]) for _ in tau]
    for j, tj in enumerate(tau):
        for k, tk in enumerate(tau):
            if k != j:
                basis[j] *= np.poly1d([1.0, -tk]) / (tj - tk)
    slope = np.array([[np.polyder(b)(t) for t in tau] for b in basis])
    weight = np.array([np.polyint(b)(1.0) for b in basis])

    w, w0, low, high, rows, row_low, row_high = [], [], [], [], [], [], []

    def variable(n: int, start: Any, lower: Any, upper: Any) -> Any:
        v = ca.MX.sym(f"v{len(w)}", n)
        w.append(v)
        w0.extend(np.broadcast_to(start, n))
        low.extend(np.broadcast_to(lower, n))
        high.extend(np.broadcast_to(upper, n))
        return v

    def rule(value: Any, lower: Any, upper: Any) -> None:
        if value.shape[0]:
            rows.append(value)
            row_low.extend(np.broadcast_to(lower, value.shape[0]))
            row_high.extend(np.broadcast_to(upper, value.shape[0]))

    eps = ca.MX.sym("eps")
    p = variable(s.np, s.params, *s.p_bounds) if s.np else ca.MX(0, 1)
    x_start = s.start()
    x = first = variable(s.nx, x_start, *s.x0_bounds)
    factor = variable(1, 1.0, *(b / s.durations.sum() for b in s.time_bounds)) if s.free == "horizon" else ca.MX(1)
    node = variable(s.nu, guess[0], *s.u_bounds) if s.linear else None
    cost, t = ca.MX(0), ca.MX(s.data["t0"])
    controls_of, lengths = [node] if s.linear else [], []
    for k in range(s.n):
        h = variable(1, s.durations[k], *s.time_bounds) if s.free == "stages" else factor * s.durations[k]
        lengths.append(h)
        u = variable(s.nu, guess[k + 1 if s.linear else k], *s.u_bounds) if s.nu else ca.MX(0, 1)
        controls_of.append(u)
        for i in range(steps):
            points = [x, *(variable(s.nx, x_start, *s.x_bounds) for _ in range(degree))]
            for j in range(1, degree + 1):
                at = t + h * (i + tau[j]) / steps
                uj = controls_of[-2] + (u - controls_of[-2]) * (i + tau[j]) / steps if s.linear else u
                change = sum((slope[r, j] * points[r] for r in range(degree + 1)), ca.MX(0))
                rule(change - h / steps * f(points[j], uj, p, at, eps), 0, 0)
                cost += h / steps * weight[j] * s.rate(points[j], uj, p, at, s.refs[k])
            x = points[-1]
        t = t + h
        cost += s.grid(x, u, p, t, s.grid_refs[k])
        rule(s.path(x, u, p, t), *s.path_bounds)
    cost += s.end(x, u, p, t)
    rule(s.terminal(x, u, p, t), *s.terminal_bounds)
    rule(s.boundary(first, x, u, p, t), *s.boundary_bounds)
    v = ca.vertcat(*w)
    answer = ca.Function("answer", [v], [ca.horzcat(*controls_of), ca.vertcat(*lengths), p, first])
    nlp = {"x": v, "f": cost, "g": ca.vertcat(*rows), "p": eps}
    value, found, clock = np.array(w0, dtype=float), None, time.perf_counter()
    for width in widths:
        left = budget - (time.perf_counter() - clock)
        if left <= 0.5:
            break
        options = {"print_time": False, "ipopt": {"print_level": 0, "max_cpu_time": left, "max_iter": 500, "sb": "yes"}}
        if found is not None:
            options["ipopt"] |= {"mu_init": 1e-3}
        solver = ca.nlpsol("solver", "ipopt", nlp, options)
        r = solver(x0=value, lbx=low, ubx=high, lbg=row_low, ubg=row_high, p=width)
        if not solver.stats()["success"]:
            break
        value = np.array(r["x"]).ravel()
        found = [np.array(a).T if i == 0 else np.array(a).ravel() for i, a in enumerate(answer(value))]
        found[0] = found[0].reshape(guess.shape)
    return found


# --- descent on simulations -----------------------------------------------------------------------


class Descent:
    """The problem in its controls: states, cost and derivatives by event-driven simulation."""

    def __init__(self, s: Statement):
        self.s = s
        self.lift = s.nu if s.linear else 0
        n, nref = s.nx + self.lift + 1, s.refs.shape[1]
        self.na = n
        m = expr.Model(states=n, controls=s.nu, parameters=s.np + nref)
        x, p = list(m.x[: s.nx]), list(m.p[: s.np])
        u = list(m.x[s.nx : s.nx + s.nu]) if self.lift else list(m.u)
        zero = 0 * m.x[0]
        one = lambda v: v if isinstance(v, expr.Expr) else v + zero
        of = lambda f: [
            one(v)
            for v in evaluate(
                f, x, u, p, m.t, expr, lambda a, b: expr.solve([[one(c) for c in r] for r in a], [one(c) for c in b])
            )
        ]
        d = s.data
        system = d["system"]
        rhs = of(system["f0"]) if system.get("f0") else [zero] * s.nx
        rate, offset = of(d["lagrange"])[0] if d.get("lagrange") else zero, s.np
        for q in s.running:
            y = of(q["f"])
            w, k = q["weights"], len(y)
            e = [a - m.p[offset + i] for i, a in enumerate(y)]
            for i in range(k):
                for j in range(k):
                    c = (w[i] if i == j else 0.0) if len(w) == k else w[i * k + j]
                    rate = rate + c * e[i] * e[j] if c else rate
            offset += k
        full = rhs + (list(m.u) if self.lift else []) + [rate]
        self.system = swb.System(n, s.nu, s.np + nref, f0=m.function([one(v) for v in full]))
        for sub in system.get("subsystems", []):
            psi = of(sub["regions"]["signs"]["psi"])
            signs = np.array(sub["regions"]["signs"]["signs"]).reshape(sub["n_modes"], len(psi))
            self.system.add_subsystem(m.function(of(sub["modes"])), m.function(psi), signs, rows=sub["rows"])
        self.engine = swb.Integrator(self.system, rtol=1e-9, atol=1e-11, sensitivity=1, max_steps=20000)
        #: Pieces of a stage at whose ends the bounds of the states are looked at.
        bounded = np.isfinite(s.x_bounds[0]) | np.isfinite(s.x_bounds[1])
        self.bounded = np.flatnonzero(bounded)
        self.pieces = 3 if len(self.bounded) else 1
        self.n_nodes = s.n + 1 if s.linear else s.n
        self.free_p = np.flatnonzero(s.p_bounds[0] < s.p_bounds[1])
        self.free_x = np.flatnonzero(s.x0_bounds[0] < s.x0_bounds[1])
        self.n_h = {"horizon": 1, "stages": s.n}.get(s.free, 0)
        parts = np.cumsum([self.n_nodes * s.nu, self.n_h, len(self.free_p), len(self.free_x)])
        self.cut = [slice(a, b) for a, b in zip([0, *parts[:-1]], parts)]
        self.nz = int(parts[-1])
        tile = lambda b: np.tile(b, self.n_nodes)
        lower = [
            tile(s.u_bounds[0]),
            np.full(self.n_h, s.time_bounds[0]),
            s.p_bounds[0][self.free_p],
            s.x0_bounds[0][self.free_x],
        ]
        upper = [
            tile(s.u_bounds[1]),
            np.full(self.n_h, s.time_bounds[1]),
            s.p_bounds[1][self.free_p],
            s.x0_bounds[1][self.free_x],
        ]
        self.lower, self.upper = np.concatenate(lower), np.concatenate(upper)
        self._jacobians()

    def _jacobians(self) -> None:
        s = self.s
        x, u, p, t = s.at
        x0 = ca.SX.sym("x0", s.nx)
        g = ca.SX.sym("g", s.grid_refs.shape[1])

        def with_jacobian(f: Any, inputs: list[Any], by: list[Any]) -> Any:
            y = f(*inputs)
            return ca.Function("both", inputs, [y, *[ca.jacobian(y, v) for v in by]])

        at = [x, u, p, t]
        self.f_end = with_jacobian(s.end, at, at)
        self.f_grid = with_jacobian(s.grid, [*at, g], at)
        self.f_path = with_jacobian(s.path, at, at)
        self.f_terminal = with_jacobian(s.terminal, at, at)
        self.f_boundary = with_jacobian(s.boundary, [x0, *at], [x0, *at])

    def pack(self, u: Array, h: Array, p: Array, x0: Array) -> Array:
        lengths = {0: np.zeros(0), 1: np.array([np.sum(h)])}.get(self.n_h, np.asarray(h))
        if self.n_h == self.s.n and self.s.free == "stages":
            lengths = np.asarray(h)
        z = np.concatenate([np.ravel(u), lengths, np.asarray(p)[self.free_p], np.asarray(x0)[self.free_x]])
        return np.clip(z, self.lower, self.upper)

    def unpack(self, z: Array) -> tuple[Array, Array, Array, Array, Array]:
        s = self.s
        u = z[self.cut[0]].reshape(self.n_nodes, s.nu)
        h, dh = s.durations.copy(), np.zeros((s.n, self.nz))
        if s.free == "horizon":
            h = h / h.sum() * z[self.cut[1]][0]
            dh[:, self.cut[1].start] = s.durations / s.durations.sum()
        elif s.free == "stages":
            h = z[self.cut[1]].copy()
            dh[np.arange(s.n), np.arange(self.cut[1].start, self.cut[1].stop)] = 1
        p, x0 = s.params.copy(), s.start().astype(float)
        x0 = np.where(s.x0_bounds[0] == s.x0_bounds[1], s.x0_bounds[0], x0)
        p[self.free_p], x0[self.free_x] = z[self.cut[2]], z[self.cut[3]]
        return u, h, dh, p, x0

    def states(self, z: Array) -> Array:
        """States at the ends of the stages and in between."""
        found: list[Array] = []
        self.run(z, found)
        return np.array(found)

    def run(self, z: Array, seen: list[Array] | None = None):
        """Cost and its gradient; rows with bounds and their Jacobian."""
        s, e, nz = self.s, self.engine, self.nz
        u, h, dh, p, x0 = self.unpack(z)
        a = np.zeros(self.na)
        a[: s.nx] = x0
        da = np.zeros((self.na, nz))
        da[self.free_x, np.arange(self.cut[3].start, self.cut[3].stop)] = 1
        da0 = da[: s.nx].copy()
        dp = np.zeros((s.np, nz))
        dp[self.free_p, np.arange(self.cut[2].start, self.cut[2].stop)] = 1
        t, dt = s.data["t0"], np.zeros(nz)
        total, gradient = 0.0, np.zeros(nz)
        rows, jac, low, high = [], [], [], []

        def add(f: Any, arguments: Any, derivatives: Any, bounds: Any) -> None:
            y, *js = f(*arguments)
            if y.shape[0]:
                rows.append(np.array(y).ravel())
                jac.append(sum(np.array(j) @ d for j, d in zip(js, derivatives)))
                low.append(bounds[0])
                high.append(bounds[1])

        for k in range(s.n):
            du = np.zeros((s.nu, nz))
            columns = np.arange(k * s.nu, (k + 1) * s.nu)
            if self.lift:
                control, dcontrol = (u[k + 1] - u[k]) / h[k], np.zeros((s.nu, nz))
                dcontrol[np.arange(s.nu), columns + s.nu] = 1 / h[k]
                dcontrol[np.arange(s.nu), columns] = -1 / h[k]
                dcontrol -= np.outer((u[k + 1] - u[k]) / h[k] ** 2, dh[k])
                a[s.nx : s.nx + s.nu] = u[k]
                da[s.nx : s.nx + s.nu] = 0
                da[np.arange(s.nx, s.nx + s.nu), columns] = 1
                du[np.arange(s.nu), columns + s.nu] = 1
                u_end = u[k + 1]
            else:
                control = u_end = u[k]
                du[np.arange(s.nu), columns] = 1
                dcontrol = du
            if s.np + s.refs.shape[1]:
                e.set_params(np.concatenate([p, s.refs[k]]))
            if s.nu:
                e.set_controls(control)
            for i in range(self.pieces):
                e.reinit(a, t)
                t_next = t + h[k] / self.pieces
                if e.advance(t_next) != swb.RunOutcome.REACHED:
                    raise FloatingPointError(e.reason)
                r = e.run
                slope = np.array(e.derivative)
                da = r.dx_dx0 @ da + r.dx_du @ dcontrol + np.outer(slope, dh[k] / self.pieces)
                if s.np:
                    da = da + r.dx_dp[:, : s.np] @ dp
                a, t, dt = np.array(r.x_end), t_next, dt + dh[k] / self.pieces
                if seen is not None:
                    seen.append(a[: s.nx].copy())
                if len(self.bounded):
                    rows.append(a[self.bounded])
                    jac.append(da[self.bounded])
                    low.append(s.x_bounds[0][self.bounded])
                    high.append(s.x_bounds[1][self.bounded])
            at = (a[: s.nx], u_end, p, t)
            changes = (da[: s.nx], du, dp, dt[None, :])
            if self.f_path.size1_out(0):
                add(self.f_path, at, changes, s.path_bounds)
            if s.grid_refs.shape[1]:
                y, *js = self.f_grid(*at, s.grid_refs[k])
                total += float(y)
                gradient = gradient + sum((np.array(j) @ d).ravel() for j, d in zip(js, changes))
        y, *js = self.f_end(*at)
        total += float(y) + a[-1]
        gradient = gradient + da[-1] + sum((np.array(j) @ d).ravel() for j, d in zip(js, changes))
        add(self.f_terminal, at, changes, s.terminal_bounds)
        add(self.f_boundary, (x0, *at), (da0, *changes), s.boundary_bounds)
        if not rows:
            return total, gradient, np.zeros(0), np.zeros((0, nz)), np.zeros(0), np.zeros(0)
        return total, gradient, *(np.concatenate(v) for v in (rows, jac, low, high))

    @staticmethod
    def violation(c: Array, low: Array, high: Array) -> float:
        return float(np.max(np.maximum(np.maximum(low - c, c - high), 0), initial=0.0))

    def minimise(self, z: Array, budget: float = 15.0) -> tuple[float, float, Array] | None:
        """Cost, violation and variables of a descent from z; None where the start cannot be simulated."""
        size = np.where(np.isfinite(self.upper - self.lower), (self.upper - self.lower) / 2, np.maximum(np.abs(z), 1.0))
        size = np.where(size > 0, size, 1.0)
        clock, best = time.perf_counter(), None
        memory: dict[bytes, Any] = {}
        last: list[Any] = []

        def at(y: Array) -> Any:
            key = y.tobytes()
            if key not in memory:
                if time.perf_counter() - clock > budget:
                    raise TimeoutError
                try:
                    memory[key] = self.run(np.clip(y * size, self.lower, self.upper))
                    last[:] = [memory[key]]
                except (FloatingPointError, swb.SwitchbackError):
                    if not last:
                        raise FloatingPointError("the start cannot be simulated") from None
                    f, g, c, j, low, high = last[0]
                    memory[key] = (f + 10 * (1 + abs(f)), g, c, j, low, high)
                note(y, memory[key])
            return memory[key]

        def note(y: Array, r: Any) -> None:
            nonlocal best
            v = self.violation(r[2], r[4], r[5])
            met = v < 1e-6
            if best is None or (met and (best[1] >= 1e-6 or r[0] < best[0])) or (best[1] >= 1e-6 and v < best[1]):
                best = (r[0], v, y * size)

        try:
            y = z / size
            f, _, _, _, low, high = at(y)
            unit = max(abs(f), 1e-3)
            fixed = np.flatnonzero(low == high)
            below, above = (
                np.flatnonzero((low < high) & np.isfinite(low)),
                np.flatnonzero((low < high) & np.isfinite(high)),
            )
            constraints = []
            if len(fixed):
                equal = {
                    "type": "eq",
                    "fun": lambda y: (at(y)[2] - low)[fixed],
                    "jac": lambda y: at(y)[3][fixed] * size,
                }
                constraints.append(equal)
            if len(below) + len(above):
                inside = lambda y: np.concatenate([(at(y)[2] - low)[below], (high - at(y)[2])[above]])
                slope = lambda y: np.concatenate([at(y)[3][below], -at(y)[3][above]]) * size
                constraints.append({"type": "ineq", "fun": inside, "jac": slope})
            bounds = list(zip(self.lower / size, self.upper / size))
            limits = np.array(bounds).T
            rng = np.random.default_rng(1)
            before = math.inf
            for attempt in range(12):
                if attempt % 2:
                    y = self._linear_steps(at, np.clip(y, *limits), size, limits, unit)
                else:
                    y = minimize(
                        lambda y: at(y)[0] / unit,
                        np.clip(y, *limits),
                        jac=lambda y: at(y)[1] * size / unit,
                        method="SLSQP",
                        bounds=bounds,
                        constraints=constraints,
                        options={"maxiter": 150, "ftol": 1e-11},
                    ).x
                memory.clear()
                met = best is not None and best[1] < 1e-6
                y, now = (best[2] / size, best[0]) if met else (y, math.inf)
                if met and attempt >= 3 and before - now <= 1e-6 * (1 + abs(now)):
                    break
                before = min(before, now)
                if attempt % 4 == 3:
                    y = y + 1e-4 * rng.standard_normal(len(y))
        except (TimeoutError, FloatingPointError, swb.SwitchbackError):
            pass
        return best

    def _linear_steps(self, at: Callable[..., Any], y: Array, size: Array, limits: Array, unit: float) -> Array:
        """Linear programs within a trust region, where steps and kinks are too much for quadratic models."""
        n, radius, price = len(y), 0.1, 10.0

        def merit(r: Any) -> float:
            _, _, c, _, low, high = r
            return r[0] / unit + price * float(np.sum(np.maximum(low - c, 0) + np.maximum(c - high, 0)))

        here = at(y)
        for _ in range(80):
            f, g, c, j, low, high = here
            j, m = j * size, len(c)
            has_low, has_high = np.isfinite(low), np.isfinite(high)
            a = np.vstack([np.hstack([-j, -np.eye(m)])[has_low], np.hstack([j, -np.eye(m)])[has_high]])
            b = np.concatenate([(c - low)[has_low], (high - c)[has_high]])
            box = [*zip(np.maximum(limits[0] - y, -radius), np.minimum(limits[1] - y, radius)), *[(0, None)] * m]
            cost = np.concatenate([g * size / unit, np.full(m, price)])
            r = linprog(cost, a if m else None, b if m else None, bounds=box, method="highs")
            if r.x is None:
                break
            d, slack = r.x[:n], float(np.sum(r.x[n:]))
            predicted = merit(here) - (f + float(g * size @ d)) / unit - price * slack
            if slack > 1e-9 and price < 1e6 and radius > 1e-3:
                price *= 3
                continue
            if predicted < 1e-12:
                break
            y_new = np.clip(y + d, *limits)
            there = at(y_new)
            ratio = (merit(here) - merit(there)) / predicted
            radius = min(2 * radius, 1.0) if ratio > 0.75 else radius if ratio > 0.25 else radius / 4
            if ratio > 1e-4:
                y, here = y_new, there
            if radius < 1e-9:
                break
        return y

    def of_result(self, r: Any) -> Array:
        """Variables of an answer of ours."""
        u = np.vstack([r.controls, r.control_ends[-1:]]) if self.lift else r.controls
        return self.pack(u, r.durations, r.params, np.array(r.trajectory.states)[0])
