"""Functions: inputs by name, shapes, derivatives, patterns, refusals."""

import numpy as np
import pytest

import switchback_control as swb
from models import oscillator

X, U, P, T = [0.7, -1.3, 2.1], [0.9], [1.7], 0.4
SIZES = dict(nx=3, nu=1, np=1)


def value(x, u, p, t):
    return [x[0] ** 2 * u[0] + np.sin(x[1] * t), np.exp(x[2]) * p[0]]


def jacobian(x, u, p, t):
    c = np.cos(x[1] * t)
    return np.array(
        [[2 * x[0] * u[0], c * t, 0, x[0] ** 2, 0, c * x[1]], [0, 0, np.exp(x[2]) * p[0], 0, np.exp(x[2]), 0]]
    )


def hessian(x, u, p, t, weights):
    h = np.zeros((6, 6))
    phase = x[1] * t
    h[0, 0], h[0, 3] = 2 * u[0], 2 * x[0]
    h[1, 1], h[1, 5] = -np.sin(phase) * t * t, np.cos(phase) - np.sin(phase) * phase
    h[5, 5] = -np.sin(phase) * x[1] ** 2
    h *= weights[0]
    h[2, 2], h[2, 4] = weights[1] * np.exp(x[2]) * p[0], weights[1] * np.exp(x[2])
    return h + np.triu(h, 1).T


JACOBIAN_PATTERN = jacobian(np.ones(3), [1.0], [1.0], 0.5) != 0
HESSIAN_PATTERN = hessian(np.ones(3), [1.0], [1.0], 0.5, [1.0, 1.0]) != 0


def exact(**keywords):
    given = dict(jacobian=jacobian, jacobian_pattern=JACOBIAN_PATTERN, hessian=hessian, hessian_pattern=HESSIAN_PATTERN)
    return swb.Function(value, **SIZES, n_out=2, **{**given, **keywords})


def at():
    return [np.array(v) for v in (X, U, P)] + [T]


def test_values_and_derivatives():
    f = exact()
    w = [0.8, -1.1]
    assert np.allclose(f(X, U, P, T), value(*at()), rtol=1e-15)
    assert np.allclose(f.jacobian(X, U, P, T), jacobian(*at()), rtol=1e-15)
    assert np.allclose(f.hessian(X, U, P, T, weights=w), hessian(*at(), w), rtol=1e-15)
    check = f.check_derivatives(X, U, P, T)
    assert check and check.max_error < 1e-6, str(check)
    assert len(f.jacobian_pattern[0]) == 6 and len(f.hessian_pattern[0]) == 7
    assert "value" in repr(f)


def test_finite_differences():
    f = swb.Function(value, **SIZES, n_out=2)
    assert np.allclose(f.jacobian(X, U, P, T), jacobian(*at()), atol=1e-7)
    patterns = exact(jacobian=None, hessian=None)
    assert np.allclose(patterns.jacobian(X, U, P, T), jacobian(*at()), atol=1e-7)
    assert np.allclose(patterns.hessian(X, U, P, T, weights=[0.8, -1.1]), hessian(*at(), [0.8, -1.1]), atol=1e-5)


def test_forms_of_derivatives():
    rows, columns = np.nonzero(JACOBIAN_PATTERN)  # by rows, not by columns as the library has it
    f = exact(jacobian=lambda x, u, p, t: jacobian(x, u, p, t)[rows, columns], jacobian_pattern=(rows, columns))
    assert np.allclose(f.jacobian(X, U, P, T), jacobian(*at()), rtol=1e-15)
    r, c = np.nonzero(np.triu(HESSIAN_PATTERN))
    f = exact(
        hessian=lambda weights, x, t, u, p: hessian(x, u, p, t, weights)[r, c], hessian_pattern=(list(r), list(c))
    )
    assert np.allclose(f.hessian(X, U, P, T), hessian(*at(), [1, 1]), rtol=1e-15)
    # gradients, and matrices of the first inputs only
    g = swb.Function(lambda x: x @ x, 3, jacobian=lambda x: 2 * x, hessian=lambda weights: 2 * weights[0] * np.eye(3))
    assert np.allclose(g.jacobian(X)[0, :3], 2 * np.array(X)) and np.allclose(g.hessian(X)[:3, :3], 2 * np.eye(3))
    assert g.check_derivatives(X)
    h = swb.Function(lambda x, u: x * u, 1, 1, jacobian=lambda x, u: [[u[0], x[0]]])
    assert np.allclose(h.jacobian([2.0], [3.0]), [[3.0, 2.0, 0.0]])
    one = swb.Function(lambda x: x[0] ** 2, 1, jacobian=lambda x: 2 * x[0])
    assert one.jacobian([3.0])[0, 0] == 6.0


def test_scipy_matrices():
    sparse = pytest.importorskip("scipy.sparse")
    f = exact(
        jacobian=lambda x, u, p, t: sparse.csc_matrix(jacobian(x, u, p, t)),
        jacobian_pattern=sparse.coo_matrix(JACOBIAN_PATTERN),
        hessian=lambda x, u, p, t, weights: sparse.csr_array(hessian(x, u, p, t, weights)),
        hessian_pattern=sparse.csr_matrix(HESSIAN_PATTERN),
    )
    assert np.allclose(f.jacobian(X, U, P, T), jacobian(*at())) and f.check_derivatives(X, U, P, T)
    assert np.allclose(f.hessian(X, U, P, T), hessian(*at(), [1, 1]))


def test_wrong_derivatives_are_found():
    def wrong(x, u, p, t):
        j = jacobian(x, u, p, t)
        j[1, 2] *= 1.01
        return j

    check = exact(jacobian=wrong).check_derivatives(X, U, P, T)
    assert not check and check.max_error > 5e-3 and "out[1]" in check.report
    narrow = JACOBIAN_PATTERN.copy()
    narrow[0, 5] = False
    check = exact(jacobian=None, jacobian_pattern=narrow).check_derivatives(X, U, P, T)
    assert not check and "missing in Jacobian pattern" in str(check)


@pytest.mark.parametrize(
    "f, inputs",
    [
        (lambda x: x[:2], ("x",)),
        (lambda t, x: x[:2] * t, ("t", "x")),
        (lambda w: w[:2], ("x",)),
        (lambda *a: a[0][:2], ("x", "u", "p", "t")),
        (lambda x, scale=2.0: scale * x[:2], ("x",)),
        (lambda x, **_: x[:2], ("x",)),
        (lambda: [1.0, 2.0], ()),
    ],
)
def test_inputs_by_name(f, inputs):
    g = swb.Function(f, **SIZES, n_out=2)
    assert g.inputs == inputs
    args = {"x": np.array(X), "u": np.array(U), "p": np.array(P), "t": T}
    assert np.allclose(g(X, U, P, T), f(*[args[n] for n in inputs]))


@pytest.mark.parametrize("f", [lambda y: y, lambda x, z: x, lambda x, *, t: x, lambda x, *a: x, "text", 3.0, max, None])
def test_inputs_refused(f):
    with pytest.raises(swb.ArgumentError, match="must"):
        swb.Function(f, **SIZES)


def test_arrays_belong_to_the_callable():
    kept = []

    def f(x):
        kept.append(x)
        y = x.copy()
        x[:] = -1.0
        return y

    g = swb.Function(f, 3, n_out=3, trace=False)
    assert np.allclose(g(X), X) and np.allclose(g([1, 2, 3]), [1, 2, 3])
    assert np.allclose(kept[0], -1.0) and kept[0] is not kept[1]


def test_shapes_of_outputs():
    modes = swb.Function(lambda x: [[x[0], 1.0, 2.0], [3.0, 4.0, x[1]]], 2, n_out=(2, 3))
    assert modes([5.0, 6.0]).tolist() == [[5, 1, 2], [3, 4, 6]]
    for f in (lambda x: np.zeros((3, 2)), lambda x: np.zeros(5), lambda x: 0.0, lambda x: np.zeros((1, 2, 3))):
        with pytest.raises(swb.DimensionError, match=r"returned an array of shape .* expected \(2, 3\)"):
            swb.Function(f, 2, n_out=(2, 3))([1.0, 2.0])


@pytest.mark.parametrize(
    "result, message",
    [
        (None, "is a return missing"),
        ("abc", "real numbers"),
        (1j, "real numbers"),
        ([1, None], "real numbers"),
        ({}, "real"),
    ],
)
def test_nonsense_from_a_callable(result, message):
    with pytest.raises(TypeError, match=message):
        swb.Function(lambda x: result, 1)([0.0])


def test_ragged_result():
    with pytest.raises(ValueError):
        swb.Function(lambda x: [1.0, [2.0, 3.0]], 1, n_out=3)([0.0])


@pytest.mark.parametrize(
    "bad", [lambda x: np.zeros(3), lambda x: np.zeros((2, 2)), lambda x: np.zeros((1, 4)), lambda x: None]
)
def test_wrong_jacobians(bad):
    f = swb.Function(lambda x: x[:2], 3, n_out=2, jacobian=bad)
    with pytest.raises((swb.DimensionError, TypeError)):
        f.jacobian(X)


def test_jacobian_too_narrow_for_its_pattern():
    f = swb.Function(lambda x, t: x * t, 1, jacobian=lambda x, t: [[t]], jacobian_pattern=([0, 0], [0, 1]))
    with pytest.raises(swb.DimensionError, match="column 1"):
        f.jacobian([1.0], t=2.0)


@pytest.mark.parametrize(
    "pattern, message",
    [
        (([0, 0], [0, 0]), "twice"),
        (([0], [0, 1]), "1 rows and 2 columns"),
        (([5], [0]), "no row 5"),
        (([0], [9]), "no column 9"),
        (([-1], [0]), "no row -1"),
        (([0.5], [0]), "integers"),
        ((1, 2, 3), "got 3"),
        ([0, 1], "expected"),
        ("xx", "expected"),
    ],
)
def test_wrong_patterns(pattern, message):
    with pytest.raises(swb.ArgumentError, match=message):
        swb.Function(lambda x: x[:2], 3, n_out=2, jacobian_pattern=pattern)


def test_pattern_of_the_wrong_triangle():
    with pytest.raises(swb.RangeError, match="upper triangle"):
        swb.Function(lambda x: x @ x, 3, hessian_pattern=([1], [0]))


def test_wrong_points():
    f = exact()
    for arguments in (
        ([1.0], U, P, T),
        (X, None, P, T),
        (X, U, "a", T),
        (X, U, P, None),
        (X, U, P, "now"),
        ([X], [U, U], P, T),
    ):
        with pytest.raises(swb.ArgumentError):
            f(*arguments)
    with pytest.raises(swb.ArgumentError):
        f.hessian(X, U, P, T, weights=[1.0])
    with pytest.raises(swb.RangeError):
        f.check_derivatives([np.nan, 0, 0], U, P, T)


@pytest.mark.parametrize(
    "sizes",
    [
        (-1, 0, 0, 1),
        (1, -1, 0, 1),
        (1, 0, 0, -1),
        (2**70, 0, 0, 1),
        (1.5, 0, 0, 1),
        ("a", 0, 0, 1),
        (2**62, 2**62, 0, 1),
    ],
)
def test_wrong_sizes(sizes):
    with pytest.raises(swb.ArgumentError):
        swb.Function(lambda x: 0.0, *sizes)


def test_affine():
    f = swb.Function.affine([1.0, 2.0], [[1, 0, 3], [0, 4, 0]], nx=2, nu=1)
    assert np.allclose(f([1.0, 2.0], [3.0]), [11.0, 10.0]) and f.check_derivatives([1, 2], [3])
    assert len(f.jacobian_pattern[0]) == 3 and len(f.hessian_pattern[0]) == 0
    g = swb.Function.affine(1.0, [[0, 2.0]], nx=1)  # of the time
    assert g.inputs == ("x", "t") and g([5.0], t=3.0)[0] == 7.0
    c = swb.Function.affine([[1, 2], [3, 4]], nx=2)
    assert c.shape == (2, 2) and c([0, 0]).tolist() == [[1, 2], [3, 4]]
    for wrong in ((1.0, np.zeros((2, 1))), (1.0, np.zeros((1, 9))), (np.nan, None), (None, None), ([1.0], "x")):
        with pytest.raises(swb.ArgumentError):
            swb.Function.affine(*wrong, nx=1)


def test_compiled_code(tmp_path):
    import ctypes
    import shutil
    import subprocess

    if shutil.which("cc") is None:
        pytest.skip("no C compiler here")
    source = tmp_path / "f.c"
    source.write_text(
        "struct p { double t; const double *x, *u, *p; };\n"
        "int f(const struct p *a, double *out, void *d) { (void)d; out[0] = a->x[0] * a->x[1]; return 0; }\n"
        "int j(const struct p *a, double *out, void *d) { (void)d; out[0] = a->x[1]; out[1] = a->x[0]; return 0; }\n"
        "int h(const struct p *a, const double *w, double *o, void *d) { (void)a; (void)d; o[0] = w[0]; return 0; }\n"
    )
    subprocess.run(["cc", "-shared", "-fPIC", source, "-o", tmp_path / "f.so"], check=True)
    library = ctypes.CDLL(str(tmp_path / "f.so"))
    f = swb.Function.from_pointers(
        library.f,
        2,
        jacobian=library.j,
        hessian=ctypes.cast(library.h, ctypes.c_void_p).value,
        hessian_pattern=([0], [1]),
        inputs="x",
        name="product",
        keep=library,
    )
    assert f([2.0, 3.0])[0] == 6.0 and f.check_derivatives([2.0, 3.0])
    assert f.hessian([2.0, 3.0], weights=[5.0])[0, 1] == 5.0
    with pytest.raises(swb.ArgumentError):
        swb.Function.from_pointers(None, 2)
    with pytest.raises(swb.ArgumentError):
        swb.Function.from_pointers(0, 2)


def test_linear_and_hessian_contradict():
    with pytest.raises(swb.ArgumentError, match="contradict"):
        swb.Function(lambda x: x, 1, linear=True, hessian=lambda x, weights: [[0.0]])


def test_a_function_of_a_model_is_fixed():
    f = swb.Function(lambda x: -x, 2, n_out=2)
    system = swb.System(2, f0=f)
    with pytest.raises(swb.StateError):
        f._do("set_linear")
    assert system._functions == [f]
    with pytest.raises(swb.DimensionError, match="'f'"):
        oscillator().set_f0(swb.Function(lambda x: x, 3, n_out=3, name="f"))
