"""Arrays: shapes are looked at before anything is copied or converted."""

import tracemalloc

import models
import numpy as np
import pytest
import switchback_control as swb

HUGE = np.broadcast_to(1.0, (10**8,))  # 8 bytes
HUGE_INTEGERS = np.broadcast_to(1, (10**8,))
HUGE_TABLE = np.broadcast_to(1.0, (10**8, 2))
WIDE = np.broadcast_to(1.0, (3, 10**8))


def function():
    return swb.Function(lambda x, p: x * p, 2, 0, 1, n_out=2)


def ocp():
    system = swb.System(2, 1, 1, f0=lambda x, u: [x[1], u[0]])
    return swb.Ocp(system, 1.0, 4)


def refusals():
    yield "value", lambda: function()(HUGE, p=1.0)
    yield "integers", lambda: function()(HUGE_INTEGERS, p=1.0)
    yield "complex", lambda: function()(np.broadcast_to(1j, (10**8,)), p=1.0)
    yield "table as vector", lambda: function().jacobian(HUGE_TABLE, p=1.0)
    yield "weights", lambda: function().hessian([1, 1], p=1.0, weights=HUGE)
    yield "affine matrix", lambda: swb.Function.affine([1.0], WIDE, nx=2)
    yield "jacobian pattern", lambda: swb.Function(
        lambda x: x, 2, n_out=2, jacobian_pattern=(HUGE_INTEGERS, HUGE_INTEGERS)
    )
    yield "pattern by matrix", lambda: swb.Function(lambda x: x, 2, n_out=2, jacobian_pattern=WIDE)
    yield "returned", lambda: swb.Function(lambda x: HUGE_INTEGERS, 2, n_out=2)([1, 1])
    yield "returned jacobian", lambda: swb.Function(lambda x: x, 2, n_out=2, jacobian=lambda x: WIDE).jacobian([1, 1])
    yield "rows", lambda: models.oscillator()._rows(HUGE_INTEGERS)
    yield "simulate", lambda: swb.simulate(models.oscillator(), HUGE, 1.0)
    yield "time span", lambda: swb.simulate(models.oscillator(), [1.0, 0.0], HUGE)
    yield "tolerances", lambda: swb.simulate(models.oscillator(), [1.0, 0.0], 1.0, rtol=HUGE)
    yield "batch", lambda: swb.simulate_batch(models.oscillator(), WIDE, 1.0)
    yield "fesd", lambda: swb.simulate_fesd(models.oscillator(), HUGE, 1.0, 10)
    yield "bounds", lambda: ocp().set_control_bounds(HUGE, 1.0)
    yield "initial state", lambda: ocp().set_initial_state(HUGE)
    yield "state guess", lambda: ocp().set_state_guess([0.0, 1.0], WIDE)
    yield "control guess", lambda: ocp().set_control_guess(WIDE)
    yield "parameters", lambda: ocp().set_params(HUGE)
    yield "starts", lambda: ocp().solve_starts(HUGE_TABLE)
    yield "least squares", lambda: ocp().add_least_squares(function(), HUGE)
    yield "references", lambda: ocp().add_least_squares(lambda x: x, [1.0, 1.0], HUGE)
    yield "linear controls", lambda: ocp().set_linear_controls(HUGE_INTEGERS)
    yield "program", lambda: swb.Mpcc(2, lambda w: w[0], bounds=(HUGE, None))


@pytest.mark.parametrize("refused", [r for _, r in refusals()], ids=[name for name, _ in refusals()])
def test_huge_arrays_are_refused_unread(refused):
    tracemalloc.start()
    try:
        with pytest.raises((swb.DimensionError, swb.RangeError)):
            refused()
        assert tracemalloc.get_traced_memory()[1] < 50e6
    finally:
        tracemalloc.stop()


def test_shapes_that_fit_are_taken_as_before():
    f = function()
    for x in ([1, 2], (1.0, 2.0), np.array([[1], [2]]), np.array([[1, 2]], dtype=np.int8), np.array([1, 2], dtype=object)):
        assert np.array_equal(f(x, p=3), [3.0, 6.0]), x
    assert np.array_equal(f(np.broadcast_to(1.0, (2,)), p=np.array(2.0)), [2.0, 2.0])
    for wrong in ([1, 2, 3], 1.0, [[1, 2], [3, 4]], []):
        with pytest.raises(swb.DimensionError, match=r"expected \(2,\)"):
            f(wrong, p=1)
    with pytest.raises(swb.RangeError, match="real numbers"):
        f(["a", "b"], p=1)
    with pytest.raises(swb.RangeError, match="masked"):
        f(np.ma.masked_array([1.0, 2.0], mask=[True, False]), p=1)
