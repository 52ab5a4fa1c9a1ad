"""Transitions: what jumps. A ball that bounces until it rests, and a room that a thermostat heats.

    ball:  q' = v, v' = -g while it flies; where q < 0: v becomes -e v, or, when it is slow, the ball rests
    room:  x' = -k x + P w, w = 1 from x < 18 until x > 20

Jumps are located to rounding, and the derivatives of states and times of jumps go through them.

usage: transitions.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb
from switchback_control.expr import Model

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

# discrete states: does the ball fly, and has it just bounced? Then it rests if it is slower than 0.05, or flies on
ball = Model(states="q v", parameters="e")
q, v = ball.x
flies, bounced = ball.discrete("flies", initial=1), ball.discrete("bounced")
ball.derivatives = [v, -9.81 * flies]
ball.transition(q < 0, when={flies: 1}, reset={v: -ball.p[0] * v}, to={bounced: 1})
ball.transition(v > 0.05, when={bounced: 1}, to={bounced: 0})
ball.transition(v < 0.05, when={bounced: 1}, reset={q: 0.0, v: 0.0}, to={bounced: 0, flies: 0})
run = swb.simulate(ball, [1.0, 0.0], 6.0, p=[0.8], rtol=1e-10, atol=1e-10, sensitivity=True)
impacts = [i for i, j in enumerate(run.jumps) if j.transition == 0]
print(f"{len(impacts)} impacts, the last at t = {run.jumps[-1].t:.6f}; {run.stats.steps} steps, "
      f"{1e6 * run.stats.time_total:.0f} microseconds")
print("derivatives of the third impact's time with respect to q0, v0 and e:", run.jump_derivatives[impacts[2]][[0, 1, 4]])
run.plot(folder / "python_transitions_ball.svg", states=[0, 1, 2], names=["height", "speed", "flies"], title="A ball that bounces, and rests")
print("python_transitions_ball.svg: the speed jumps at every impact; at the end the ball rests.")

room = Model(states="x", parameters="k P")
x = room.x[0]
heat = room.hysteresis(-x, on=-18.0, off=-20.0, name="heat")
room.derivative(x, -room.p[0] * x + room.p[1] * heat)
run = swb.simulate(room, [15.0], 12.0, p=[0.2, 5.0], rtol=1e-10, atol=1e-10)
period = np.diff([j.t for j in run.jumps if j.transition == 0])[1:]
print(f"\n{len(run.jumps)} switches of the heater, with the period {period.mean():.10f} (exact: 2.2091637614)")
run.plot(folder / "python_transitions_room.svg", names=["temperature", "heater"], title="A thermostat")
print("python_transitions_room.svg: the heater goes on below 18 and off above 20 degrees.")
