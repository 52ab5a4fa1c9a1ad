"""usage: overhead.py [REPETITIONS]    what Python adds to the library: a table for docs/benchmarks/python.md

Of many calls the fastest counts, which other work on the machine disturbs least. "library" is the time that the result itself says it took
(stats.time_total), or for calls without one nothing.
"""

import sys
import time
import warnings

import numpy as np
import switchback_control as swb

REPETITIONS = int(sys.argv[1]) if len(sys.argv) > 1 else 200


def best(call, inside=lambda result: float("nan"), repetitions=REPETITIONS):
    """Fastest call, and the time the library said this one took, in microseconds."""
    found = (float("inf"), float("nan"))
    for _ in range(repetitions):
        start = time.perf_counter()
        result = call()
        found = min(found, (time.perf_counter() - start, inside(result)))
    return 1e6 * found[0], 1e6 * found[1]


def model():
    m = swb.Model(states="q v", controls="F", parameters="k")
    m.derivatives = [m.v, m.F - m.k * m.q - 0.4 * swb.sign(m.v)]
    return m


def main():
    m = model()
    rows = []

    def row(what, call, inside=lambda result: float("nan"), of=1, repetitions=REPETITIONS):
        whole, own = best(call, inside, repetitions)
        rows.append((what, whole / of, own / of))

    total = lambda result: result.stats.time_total  # noqa: E731
    row("`simulate`, model of expressions, 1 switch", lambda: swb.simulate(m, [1, 0], 6.0, u=[0], p=[1]), total)
    with warnings.catch_warnings(), swb.tracing(False):
        warnings.simplefilter("ignore")
        system = swb.System(2)
        system.add_subsystem(
            [lambda x: [x[1], -x[0] - 0.4], lambda x: [x[1], -x[0] + 0.4]], lambda x: x[1], signs=[1, -1]
        )
        row("the same, callables that are not traced", lambda: swb.simulate(system, [1, 0], 6.0), total, repetitions=20)
    built = m.system()
    row("`simulate`, the system made before", lambda: swb.simulate(built, [1, 0], 6.0, u=[0], p=[1]), total)
    starts = np.tile([1.0, 0.0], (1000, 1))
    row("`simulate_batch`, a run of 1000, one thread", lambda: swb.simulate_batch(built, starts, 6.0, u=[0], p=[1], threads=1), of=1000, repetitions=5)
    run = swb.simulate(m, [1, 0], 6.0, u=[0], p=[1])
    times = np.linspace(0, 6, 1000)
    row("`run(times)`, a time of 1000", lambda: run(times), of=1000)
    integrator = swb.Integrator(built)

    def steps():
        integrator.set_params([1])
        integrator.set_controls([0])
        integrator.reinit([1.0, 0.0], 0.0)
        for _ in range(10):
            integrator.step(100.0)

    row("`Integrator.step`, a step of 10", steps, of=10)
    f = m.function(m.F**2)
    row("a `Function` at a point", lambda: f([1, 0], [0.5], [1]))
    ocp = swb.Ocp(m, 2.0, 8, lagrange=m.F**2, initial_state=[0, 0], params=[1], control_bounds=(-5, 5))
    ocp.add_terminal([m.q, m.v], [1, 0], [1, 0])
    ocp.solve()
    row("`Ocp.solve`, warm, 8 stages", ocp.solve, total, repetitions=20)
    program = swb.Mpcc(2, lambda x: (x[0] - 1) ** 2 + (x[1] - 2) ** 2, pairs=[(0, 1)], start=[0.1, 0.2])
    row("`Mpcc.solve`, 2 variables", program.solve, total)
    print("| call | whole (µs) | library (µs) | Python (µs) |\n|---|---|---|---|")
    for what, whole, own in rows:
        print(f"| {what} | {whole:.1f} | {'' if np.isnan(own) else f'{own:.1f}'} | {'' if np.isnan(own) else f'{whole - own:.1f}'} |")


if __name__ == "__main__":
    main()
