"""Exceptions out of callbacks, Ctrl-C, interrupts, threads, lifetimes."""

import gc
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import weakref

import numpy as np
import pytest

import switchback_control as swb
from models import A_IN, A_OUT, OSCILLATOR_T, OSCILLATOR_X0, OSCILLATOR_XT, oscillator, tutorial


@pytest.fixture(autouse=True)
def in_python():
    """Callables stay callables: what they do when they are called is what is tested here."""
    with swb.tracing(False):
        yield


class Failing:
    """The modes of the oscillator, which do something else from a call on."""

    def __init__(self, action, start):
        self.action, self.start, self.calls = action, start, 0

    def __call__(self, x):
        self.calls += 1
        if self.calls >= self.start:
            return self.action(self)
        return [A_IN @ x, A_OUT @ x]


def throw(error):
    def action(_):
        raise error

    return action


class Mine(Exception):
    pass


@pytest.mark.parametrize(
    "error", [Mine("mine"), SystemExit(3), GeneratorExit(), MemoryError(), ZeroDivisionError(), KeyboardInterrupt()]
)
def test_exceptions_come_out(error):
    modes = Failing(throw(error), 10**9)
    with swb.Simulator(oscillator(modes), n_s=2) as sim:
        sim.set_state(OSCILLATOR_X0)
        sim.run(0.4, 8)
        modes.start, modes.calls = modes.calls // 2, 0
        sim.set_state(OSCILLATOR_X0)
        with pytest.raises(type(error)) as caught:
            sim.run(0.4, 8)
        assert caught.value is error and modes.calls == modes.start  # no call after the one that failed
        assert sim.outcome == swb.Outcome.FAILED and 0.0 < sim.time < 0.4
        modes.start = 10**9
        assert sim.run(0.4 - sim.time, 8) == swb.Outcome.SOLVED
        assert np.hypot(*sim.state) == pytest.approx(np.exp(sim.time - 1), abs=1e-4)
    assert "test_callbacks.py" in "".join(str(t.path) for t in caught.traceback)


@pytest.mark.parametrize("where", ["value", "jacobian", "hessian", "iteration", "log", "eval"])
def test_exceptions_from_everywhere(where):
    def throws(*_):
        raise Mine(where)

    if where == "eval":
        with pytest.raises(Mine):
            swb.Function(throws, 2)([1.0, 2.0])
        return
    keywords, monitors = {}, {}
    if where in ("jacobian", "hessian"):
        keywords[where] = throws
    if where in ("iteration", "log"):
        monitors["on_" + where] = throws
    f = swb.Function(throws if where == "value" else (lambda x: x @ x), 2, **keywords)
    program = swb.Nlp(2, f, start=[1.0, 2.0], log_level="trace", **monitors)
    with pytest.raises(Mine, match=where):
        program.solve()
    assert program.outcome != swb.Outcome.SOLVED


def test_nan_from_callbacks():
    for bad in (np.nan, np.inf):
        modes = Failing(lambda _: np.full((2, 2), bad), 30)
        with swb.Simulator(oscillator(modes)) as sim:
            sim.set_state(OSCILLATOR_X0)
            with pytest.raises(swb.NonfiniteError, match="modes") as caught:
                sim.run(0.4, 8)
            assert caught.value.status == swb.Status.NONFINITE and isinstance(caught.value, swb.UserError)
            modes.start = 10**9
            assert sim.run(0.1, 1) == swb.Outcome.SOLVED


def test_error_codes_of_compiled_code():
    from switchback_control import _ffi

    code = _ffi.swb_value_fn(lambda at, out, data: -42)
    f = swb.Function.from_pointers(code, 1, keep=code)
    with pytest.raises(swb.UserError) as caught:
        f([1.0])
    assert caught.value.code == -42


def quadratic(x):
    return x @ x + 0.1 * (x[0] * x[1]) ** 2


def test_calls_into_the_same_object():
    errors = []

    def f(x):
        for call in (program.solve, program.close, lambda: program.set_start([0.0, 0.0]), lambda: program.objective_):
            try:
                call()
            except (swb.StateError, AttributeError) as error:
                errors.append(type(error))
        return quadratic(x) + other.solve().objective  # another object is fine

    other = swb.Nlp(2, quadratic, start=[1, 2])
    program = swb.Nlp(2, f, start=[1, 2])
    assert program.solve().success
    assert errors.count(swb.StateError) == 3 * errors.count(AttributeError) > 0


def test_exception_of_an_inner_solve():
    def inner(x):
        raise Mine("inner")

    def f(x):
        with pytest.raises(Mine):
            swb.Nlp(2, inner).solve()
        return quadratic(x)

    assert swb.Nlp(2, f, start=[1, 2]).solve().success


# --- Ctrl-C -------------------------------------------------------------------------------------------


@pytest.fixture
def default_handler():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    signal.signal(signal.SIGINT, before)


def test_interrupted_in_a_callback(default_handler):
    calls = []

    def f(x):
        calls.append(1)
        if len(calls) == 8:
            signal.raise_signal(signal.SIGINT)
        return 100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2

    program = swb.Nlp(2, f, start=[-1.2, 1.0])
    with pytest.raises(KeyboardInterrupt):
        program.solve()
    assert program.outcome == swb.Outcome.STOPPED and program.result.x.shape == (2,)
    n = len(calls)
    assert program.solve().success and len(calls) > n  # no interrupt is left over


def test_interrupted_from_a_thread(default_handler):
    def wait():
        time.sleep(0.2)
        os.kill(os.getpid(), signal.SIGINT)

    sim = swb.Simulator(oscillator())
    sim.set_state(OSCILLATOR_X0)
    thread = threading.Thread(target=wait)
    start = time.monotonic()
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        sim.run(1e-3 * 10**6, 10**8)
    thread.join()
    assert time.monotonic() - start < 5.0
    assert sim.outcome == swb.Outcome.STOPPED and sim.time > 0 and sim.trajectory.n_elements > 0
    assert sim.step(1e-3) == swb.Outcome.SOLVED


def test_second_interrupt_leaves_a_callback_that_hangs(default_handler):
    def f(x):
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        while True:
            time.sleep(0.01)

    with pytest.raises(KeyboardInterrupt):
        swb.Nlp(2, f, start=[1, 2]).solve()


def test_handler_of_the_user():
    seen = []
    before = signal.signal(signal.SIGINT, lambda number, where: seen.append(number))
    try:
        r = swb.Nlp(
            2, lambda x: (signal.raise_signal(signal.SIGINT) if not seen else None, quadratic(x))[1], start=[1, 2]
        ).solve()
        assert r.outcome == swb.Outcome.STOPPED and len(seen) >= 1
    finally:
        signal.signal(signal.SIGINT, before)


def test_interrupt_of_a_process():
    """Compiled code only: Python runs nowhere but in the iterations."""
    code = (
        "import signal, switchback_control as swb\n"
        # shells start what runs in the background with interrupts switched off
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "s = swb.System(1, f0=lambda x: -x)\n"
        "sim = swb.Simulator(s); sim.set_state([1.0])\n"
        "print('go', flush=True)\n"
        "try:\n    sim.run(1e6, 10**9)\n"
        "except KeyboardInterrupt:\n    print('stopped', sim.outcome, flush=True)\n"
    )
    p = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert p.stdout.readline() == "go\n"
    time.sleep(0.3)
    p.send_signal(signal.SIGINT)
    try:
        out, err = p.communicate(timeout=20)
    finally:
        p.kill()
    assert out == "stopped stopped\n" and err == "" and p.returncode == 0


def test_interrupt_method():
    sim = swb.Simulator(oscillator())
    sim.set_state(OSCILLATOR_X0)
    threading.Timer(0.2, sim.interrupt).start()
    assert sim.run(1e3, 10**8) == swb.Outcome.STOPPED
    assert sim.step(1e-3) == swb.Outcome.SOLVED


# --- threads and lifetimes ----------------------------------------------------------------------------


def test_two_threads():
    results, errors = {}, []

    def simulate(k):
        try:
            for _ in range(3):
                results[k] = swb.simulate_fesd(oscillator(), OSCILLATOR_X0, OSCILLATOR_T, 10, n_s=4).state
                results[k, "cost"] = tutorial().solve().cost
                with pytest.raises(Mine, match=str(k)):
                    swb.Nlp(1, throw(Mine(str(k))) and (lambda x: throw(Mine(str(k)))(x))).solve()
                with pytest.raises(swb.OptionError, match=f"no_such_{k}"):
                    swb.Settings(**{f"no_such_{k}": 1})
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=simulate, args=(k,)) for k in range(2)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert not errors
    assert np.array_equal(results[0], results[1]) and np.allclose(results[0], OSCILLATOR_XT, atol=1e-7)
    assert results[0, "cost"] == results[1, "cost"]


def test_one_object_two_threads():
    inside, go_on = threading.Event(), threading.Event()

    def f(x):
        inside.set()
        go_on.wait(10)
        return quadratic(x)

    program = swb.Nlp(2, f, start=[1, 2])
    thread = threading.Thread(target=program.solve)
    thread.start()
    inside.wait(10)
    for call in (program.solve, program.close, lambda: program.set_start([1, 2]), lambda: program.outcome):
        with pytest.raises(swb.StateError):
            call()
    go_on.set()
    thread.join()
    assert program.result.success
    program.close()


def test_everything_is_freed(live):
    gc.collect()
    before = live()
    trajectory = swb.simulate_fesd(oscillator(), OSCILLATOR_X0, OSCILLATOR_T, 10).trajectory
    ocp = tutorial()
    r = ocp.solve()
    ocp.myself = ocp  # a cycle
    with pytest.raises(swb.ArgumentError):
        swb.Simulator(oscillator(), n_s=-1)
    with pytest.raises(swb.ArgumentError):
        swb.Ocp(oscillator(), 1.0, 1, initial_state=[1.0])
    assert live() != before
    watch = weakref.ref(ocp)
    del trajectory, ocp, r
    assert live() == before and watch() is None


def test_functions_are_freed_with_their_models():
    class Modes:
        def __call__(self, x):
            return [A_IN @ x, A_OUT @ x]

    modes = Modes()
    watch = weakref.ref(modes)
    system = oscillator(modes)
    del modes
    sim = swb.Simulator(system)
    system.close()
    gc.collect()
    sim.set_state(OSCILLATOR_X0)
    assert watch() is not None and sim.run(0.3, 3) == swb.Outcome.SOLVED
    sim.close()
    del sim, system
    gc.collect()
    assert watch() is None


def test_memory_does_not_grow():
    def once():
        swb.simulate_fesd(oscillator(), OSCILLATOR_X0, 0.2, 2)
        swb.Mpcc(2, quadratic, pairs=[(0, 1)], start=[1, 2]).solve()

    def pages():
        with open("/proc/self/statm") as f:
            return int(f.read().split()[1])

    if not os.path.exists("/proc/self/statm"):
        pytest.skip("no /proc here")
    for _ in range(100):
        once()
    gc.collect()
    start = pages()
    for _ in range(300):
        once()
    gc.collect()
    assert pages() - start < 1000  # 4 MB


def test_closed_objects_and_copies():
    system = oscillator()
    system.close()
    system.close()
    with pytest.raises(swb.StateError, match="closed"):
        swb.Simulator(system)
    f = swb.Function(lambda x: x, 1)
    f.close()
    with pytest.raises(swb.StateError, match="closed"):
        f([1.0])
    for thing in (system, f, swb.Nlp(1, lambda x: x @ x)):
        with pytest.raises(TypeError, match="pickled"):
            pickle.dumps(thing)
    with pytest.raises(TypeError):
        swb.Trajectory()
    failed = swb.System.__new__(swb.System)
    with pytest.raises(swb.StateError):
        failed.set_f0(lambda x: x) if hasattr(failed, "nx") else failed._do("sizes")


def test_functions_in_python_are_called_by_the_thread_of_the_call():
    """However many threads are asked for: exceptions come out with their traceback, run times do not see foreign threads."""
    threads = set()

    def f0(x, u):
        threads.add(threading.get_ident())
        if x[0] > 10.0:
            raise KeyError("thrown in f0")
        return u

    system = swb.System(1, 1, 0, f0=f0)
    starts = [[float(k)] for k in range(9)]
    assert np.allclose(swb.simulate_batch(system, starts, 1.0, u=[1.0], threads=8).x[:, 0], np.arange(9) + 1.0)
    with pytest.raises(KeyError, match="thrown in f0") as caught:
        swb.simulate_batch(system, [*starts, [11.0], [12.0]], 1.0, u=[1.0], threads=8)
    assert any(entry.name == "f0" for entry in caught.traceback)
    with swb.Ocp(system, 1.0, 2) as ocp:
        ocp.set_initial_state([0.0])
        ocp.set_lagrange(lambda u: u[0] ** 2)
        ocp.solve_starts([[[0.1], [0.2]], [[0.3], [0.4]]], threads=8)
        with pytest.raises(KeyError, match="thrown in f0"):
            ocp.set_initial_state([20.0])
            ocp.solve_starts([[[0.1], [0.2]], [[0.3], [0.4]]], threads=8)
    assert threads == {threading.get_ident()}
