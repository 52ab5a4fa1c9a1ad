"""Writes the C files of this folder with the CasADi it runs in: python generate.py

The integers have 64 bits; the option casadi_int of CasADi changes the line that -Dcasadi_int replaces.
"""

import os
import sys

import casadi as ca

VERSION = "".join(ca.__version__.split(".")[:2])


def with_derivatives(generator, f, adjoint=False):
    """f, its Jacobian, and its Hessian in the form of CasADi, or of a function of inputs and weights."""
    generator.add(f)
    generator.add(f.jacobian())
    if adjoint:
        generator.add(f.reverse(1).jacobian())
        return
    inputs = f.sx_in()
    w = ca.SX.sym("w", f.numel_out(0))
    gradient = ca.dot(w, ca.vec(ca.densify(f(*inputs))))
    hessian = ca.hessian(gradient, ca.vertcat(*[ca.vec(v) for v in inputs]))[0]
    names = [f.name_in(k) for k in range(f.n_in())]
    generator.add(ca.Function("hess_" + f.name(), [*inputs, w], [hessian], [*names, "weights"], ["hessian"]))


def models():
    """The oscillator, and the problem with two sliding modes."""
    generator = ca.CodeGenerator(f"models_{VERSION}")
    x = ca.SX.sym("x", 2)
    omega = 2 * ca.pi
    inside, outside = ca.SX([[1, omega], [-omega, 1]]), ca.SX([[1, -omega], [omega, 1]])
    with_derivatives(generator, ca.Function("osc_F", [x], [ca.horzcat(outside @ x, inside @ x)], ["x"], ["F"]))
    with_derivatives(generator, ca.Function("osc_c", [x], [ca.sumsqr(x) - 1], ["x"], ["c"]))

    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    with_derivatives(generator, ca.Function("f0", [x, u], [ca.vertcat(x[2:], u)], ["x", "u"], ["f"]))
    with_derivatives(generator, ca.Function("sides", [x], [ca.DM([[-1, 1]])], ["x"], ["F"]))
    c1, c2 = x[0] + 0.15 * x[1] ** 2, x[1] - 0.05 * x[0] ** 3
    with_derivatives(generator, ca.Function("c1", [x], [c1], ["x"], ["c"]), True)
    with_derivatives(generator, ca.Function("c2", [x], [c2], ["x"], ["c"]), True)
    with_derivatives(generator, ca.Function("L", [x, u], [ca.sumsqr(x[2:]) + ca.sumsqr(u)], ["x", "u"], ["L"]))
    with_derivatives(generator, ca.Function("e", [x], [x[:2]], ["x"], ["e"]))
    generator.generate()


def forms():
    """One function (x0 u + sin(x1 t), x1^2, 0) in the forms in which functions come, and one with a solver inside."""
    generator = ca.CodeGenerator(f"forms_{VERSION}")
    x, u, t = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("t")
    z = ca.vertcat(t, x, u)
    value = ca.vertcat(x[0] * u + ca.sin(x[1] * t), x[1] ** 2, ca.SX(1, 1))
    inputs, names = [t, x, u], ["t", "x", "u"]

    # Derivatives of all outputs in one matrix, the lower triangle, one vector of weights.
    w = ca.SX.sym("w", 3)
    jacobian = ca.jacobian(value, z)
    hessian = ca.hessian(ca.dot(w, value), z)[0]
    outputs = [value[0], value[1:]]
    generator.add(ca.Function("one", inputs, outputs, names, ["y0", "y1"]))
    generator.add(ca.Function("one_jac", inputs, [jacobian], names, ["jac"]))
    generator.add(ca.Function("one_hess", [*inputs, w], [ca.tril(hessian)], [*names, "w"], ["hess"]))

    # Weights for each output.
    two = ca.Function("two", inputs, outputs, names, ["y0", "y1"])
    generator.add(two)
    generator.add(two.jacobian())
    split = [w[0], w[1:]]
    generator.add(ca.Function("two_hess", [*inputs, *split], [hessian], [*names, "w0", "w1"], ["hess"]))

    # The pattern of the Jacobian alone; nothing at all; no names.
    generator.add(ca.Function("pattern", inputs, [value], names, ["y"]), True)
    generator.add(ca.Function("bare", inputs, [value], names, ["y"]))
    generator.add(ca.Function("unnamed", inputs, [value]))

    # A Jacobian that wants the value.
    a, y = ca.SX.sym("x", 2), ca.SX.sym("y", 2)
    generator.add(ca.Function("wants", [a], [ca.exp(a)], ["x"], ["y"]))
    generator.add(ca.Function("jac_wants", [a, y], [ca.diag(y)], ["x", "out_y"], ["jac_y_x"]))

    # A nested solver: y with y^3 + y = x.
    y, a = ca.MX.sym("y"), ca.MX.sym("a")
    solve = ca.rootfinder("solve", "fast_newton", {"x": y, "p": a, "g": y**3 + y - a})
    a = ca.MX.sym("x")
    root = ca.Function("root", [a], [solve(0, a)], ["x"], ["y"])
    generator.add(root)
    generator.add(root.jacobian())
    generator.generate()


os.chdir(sys.argv[1] if len(sys.argv) > 1 else os.path.dirname(os.path.abspath(__file__)))
models()
forms()
