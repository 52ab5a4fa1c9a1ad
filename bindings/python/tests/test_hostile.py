"""Arguments nobody would give, Ctrl-C at any moment, and loops that must not grow."""

import os
import signal
import subprocess
import sys
import time

import hypothesis
import hypothesis.strategies as st
import numpy as np
import pytest

import switchback_control as swb
from models import OSCILLATOR_X0, oscillator, tutorial

# The same examples each time, without a clock: a slow machine is no failure.
repeatable = hypothesis.settings(
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=int(os.environ.get("SWB_HYPOTHESIS_EXAMPLES", "20")),
    suppress_health_check=list(hypothesis.HealthCheck),
)

numbers = st.one_of(
    st.integers(-3, 6),
    st.sampled_from([2**31, 2**63, -(2**63), 2**64, 10**30]),
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([5e-324, 1e300, -0.0, True, 1j, np.float32(1.5), np.int8(-1)]),
)
arrays = st.builds(
    lambda shape, dtype, order: np.zeros(shape, dtype=dtype, order=order),
    st.lists(st.integers(0, 4), max_size=3),
    st.sampled_from([float, np.float32, np.int64, bool, complex, object, "U3", ">f8"]),
    st.sampled_from("CF"),
)
anything = st.recursive(
    st.one_of(numbers, arrays, st.none(), st.text(max_size=6), st.binary(max_size=3), st.builds(object)),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.tuples(inner, inner), st.dictionaries(st.text(max_size=3), inner, max_size=2)),
    max_leaves=6,
)

#: What may be said about an argument; an internal error, or one of the interpreter, may not.
REFUSALS = (swb.ArgumentError, swb.SwitchbackError, TypeError, ValueError, IndexError, OverflowError, AttributeError)


def refuses_or_does(call, *arguments):
    try:
        return call(*arguments)
    except swb.InternalError:
        raise
    except REFUSALS as error:
        assert str(error), f"{type(error).__name__} without a message"


def methods(kind):
    """Public methods that a user may call with wrong arguments, without those that need long."""
    left_out = {"solve", "solve_starts", "run", "advance", "step", "plot", "plot_phase", "interrupt", "mro"}
    names = [n for n in dir(kind) if not n.startswith("_") and n not in left_out]
    return [n for n in names if callable(getattr(kind, n))]


@pytest.mark.parametrize("name", methods(swb.Ocp))
def test_ocp_with_anything(name):
    @repeatable
    @hypothesis.given(st.lists(anything, max_size=3))
    def run(arguments):
        refuses_or_does(getattr(tutorial(n_fe=2), name), *arguments)

    run()


@pytest.mark.parametrize("name", methods(swb.Integrator))
def test_integrator_with_anything(name):
    @repeatable
    @hypothesis.given(st.lists(anything, max_size=3))
    def run(arguments):
        it = swb.Integrator(oscillator())
        refuses_or_does(getattr(it, name), *arguments)

    run()


@repeatable
@hypothesis.given(st.sampled_from(sorted(swb.options())), anything)
def test_options_with_anything(name, value):
    settings = refuses_or_does(lambda: swb.Settings(**{name: value}))
    if settings is not None:
        assert isinstance(settings, swb.Settings)


@repeatable
@hypothesis.given(anything, anything)
def test_simulate_with_anything(x0, span):
    refuses_or_does(lambda: swb.simulate(oscillator(), x0, span, max_steps=50))
    refuses_or_does(lambda: swb.simulate_batch(oscillator(), x0, span, max_steps=50))


@repeatable
@hypothesis.given(st.text(max_size=200), st.integers(0, 4000), st.sampled_from(["", "9", '"', "{", "null", "-1e999"]))
def test_documents_with_anything(text, place, piece):
    refuses_or_does(swb.Ocp.from_json, text)
    document = DOCUMENT[:place] + piece + DOCUMENT[place + 1 :]
    refuses_or_does(swb.Ocp.from_json, document)


def friction():
    from switchback_control.expr import Model, sign

    m = Model(states="q v", controls="u")
    q, v = m.x
    m.derivatives = [v, m.u[0] - q - 0.2 * sign(v)]
    return m


DOCUMENT = swb.Ocp(friction(), 1.0, 2).to_json()


# --- Ctrl-C: compiled code only, so Python runs nowhere but where the package makes it ---

LONG = {
    "simulate": "swb.simulate(m, [1.0, 0.0], 1e9, u=[0.0], h_max=1e-4, max_steps=10**12)",
    "batch": "swb.simulate_batch(m, [[1.0, 0.0]] * 2, 1e9, u=[0.0], h_max=1e-4, max_steps=10**12)",
    "fesd": "swb.simulate_fesd(m, [1.0, 0.0], 1e6, 10**9, u=[0.0])",
    "solve": "ocp.solve()",
    "multistart": "ocp.solve_starts(64)",
}

CTRL_C = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # programs in the background begin without one
import switchback_control as swb
from switchback_control.expr import Model, sign
m = Model(states="q v", controls="u")
q, v = m.x
m.derivatives = [v, m.u[0] - q - 0.2 * sign(v)]
ocp = swb.Ocp(m, 20.0, 200, n_fe=4, n_s=3, lagrange=m.function(m.u[0] ** 2 + q ** 2), initial_state=[1.0, 0.0])
print("go", flush=True)
try:
    %s
    print("done", flush=True)
except KeyboardInterrupt:
    print("stopped", flush=True)
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("what", sorted(LONG))
def test_ctrl_c(what):
    p = subprocess.Popen([sys.executable, "-c", CTRL_C % LONG[what]], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert p.stdout.readline() == "go\n", p.stderr.read()
        time.sleep(0.5)
        p.send_signal(signal.SIGINT)
        out, err = p.communicate(timeout=120)
    finally:
        p.kill()
    assert (out, p.returncode) == ("stopped\n", 0), err


# --- loops ---


def memory():
    """Bytes this process has."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def fails():
    raise ZeroDivisionError("as it is meant to")


LOOPS = {
    "simulate": lambda: swb.simulate(oscillator(), OSCILLATOR_X0, 0.2, dense=True),
    "batch": lambda: swb.simulate_batch(oscillator(), [OSCILLATOR_X0] * 3, 0.1),
    "solve": lambda: tutorial(n_fe=2, ocp_start="homotopy").solve(),
    "model": lambda: swb.Ocp(friction(), 1.0, 2).to_json(),
    "failing": lambda: swb.simulate(swb.System(1, f0=lambda x: fails()), [1.0], 1.0),
    "refused": lambda: swb.Settings(n_s=-1),
    "documents": lambda: swb.Ocp.from_json(DOCUMENT[:-10]),
}


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="no /proc")
@pytest.mark.parametrize("what", sorted(LOOPS))
def test_loops_do_not_grow(what, live):
    def run(times):
        for _ in range(times):
            try:
                LOOPS[what]()
            except (swb.SwitchbackError, ZeroDivisionError):
                pass

    run(20)
    objects, before = live(), memory()
    run(100)
    assert live() == objects
    # A single object that stays behind each time is some ten kilobytes: 100 of them are more than that.
    assert memory() - before < 3 << 19
