"""Write functions of CasADi to the file given: f of two states and a control, with its Jacobian."""

import sys

import casadi

x, u = casadi.SX.sym("x", 2), casadi.SX.sym("u")
f = casadi.Function("f", [x, u], [casadi.vertcat(x[0] + u, x[0] * x[1], x[1] - u**2)], ["x", "u"], ["f"])
file = casadi.FileSerializer(sys.argv[1])
file.pack([f, f.jacobian()])
