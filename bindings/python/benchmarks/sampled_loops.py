"""usage: sampled_loops.py    optimal references for a controller that samples: CPU time against the number of ticks

A mass on a spring is driven by a force that a clock sets anew: 20 (reference - position) - 6 velocity. The reference is constant on every
stage and is to be found. Ticks and ends of stages are different times.
"""

import time

import switchback_control as swb


def loop(period, horizon, stages):
    """The problem with this time between two ticks."""
    m = swb.Model(states="pos v force", controls="reference")
    m.every(period, offset=0.3 * period, reset={m.force: 20 * (m.reference - m.pos) - 6 * m.v})
    m.derivatives = [m.v, m.force - 0.3 * swb.sin(3 * m.pos), 0.0 * m.force]
    ocp = swb.Ocp(m, horizon, stages)
    ocp.set_initial_state(m.system()._start([0.0, 0.0, 0.0], "x0"))
    ocp.set_lagrange((m.pos - 1) ** 2 + 0.01 * m.reference**2)
    ocp.set_control_bounds([-2], [2])
    return ocp


def main():
    print("| ticks | stages | cost | verdict | iterations | CPU s |")
    print("|---|---|---|---|---|---|")
    for period, horizon, stages in ((0.1, 1.0, 10), (0.05, 1.0, 10), (0.02, 1.0, 10), (0.01, 1.0, 10), (0.01, 2.0, 20)):
        ocp = loop(period, horizon, stages)
        begin = time.process_time()
        r = ocp.solve()
        spent = time.process_time() - begin
        print(f"| {len(r.jumps)} | {stages} | {r.cost:.6f} | {r.optimality.verdict} | {r.stats.iterations} | {spent:.2f} |")


if __name__ == "__main__":
    main()
