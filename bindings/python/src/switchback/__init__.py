"""Simulation and optimal control of systems that switch.

import switchback as swb

system = swb.System(nx=1)
system.add_subsystem(modes=[[3.0], [1.0]], psi=lambda x: x[0], signs=[-1, 1])
result = swb.simulate(system, x0=[-1.0], duration=2.0, n_steps=10)
print(result.trajectory.switches)
"""

from . import casadi, expr
from ._ffi import Item, LogLevel, Member, Outcome, PathAt, Polished, Status, SwitchKind
from ._library import path as library_path
from ._library import version as library_version
from .errors import (
    ArgumentError,
    DimensionError,
    InternalError,
    InterruptedSolve,
    LibraryError,
    NonfiniteError,
    NullError,
    NumericError,
    OptionError,
    RangeError,
    StateError,
    SwitchbackError,
    Undefined,
    UnsupportedError,
    UserError,
)
from .expr import (
    Model,
    acos,
    asin,
    atan,
    atan2,
    clip,
    cos,
    cosh,
    dead_zone,
    erf,
    exp,
    log,
    maximum,
    minimum,
    relay,
    sign,
    sin,
    sinh,
    sqrt,
    tan,
    tanh,
    where,
)
from .function import DerivativeCheck, Function
from .mpcc import (
    Certificate,
    Conflict,
    Mpcc,
    MpccResult,
    Multipliers,
    Nlp,
    PairMember,
    ProgramItem,
    constraint,
    minimize_mpcc,
    variable,
)
from .ocp import Ocp, OcpResult, OcpSensitivity
from .plot import plot
from .results import Accuracy, Iteration, LinearStats, Residuals, Stats, print_iteration
from .settings import Option, Settings, options
from .simulator import SimulationResult, Simulator, simulate
from .system import System
from .trajectory import Switch, Trajectory

__version__ = "0.1.0"

__all__ = [
    "Accuracy",
    "ArgumentError",
    "Certificate",
    "Conflict",
    "DerivativeCheck",
    "DimensionError",
    "Function",
    "InternalError",
    "InterruptedSolve",
    "Item",
    "Iteration",
    "LibraryError",
    "LinearStats",
    "LogLevel",
    "Member",
    "Model",
    "Mpcc",
    "MpccResult",
    "Multipliers",
    "Nlp",
    "NonfiniteError",
    "NullError",
    "NumericError",
    "Ocp",
    "OcpResult",
    "OcpSensitivity",
    "Option",
    "OptionError",
    "Outcome",
    "PairMember",
    "PathAt",
    "Polished",
    "ProgramItem",
    "RangeError",
    "Residuals",
    "Settings",
    "SimulationResult",
    "Simulator",
    "StateError",
    "Stats",
    "Status",
    "Switch",
    "SwitchKind",
    "SwitchbackError",
    "System",
    "Trajectory",
    "Undefined",
    "UnsupportedError",
    "UserError",
    "acos",
    "asin",
    "atan",
    "atan2",
    "clip",
    "constraint",
    "cos",
    "cosh",
    "dead_zone",
    "erf",
    "exp",
    "expr",
    "library_path",
    "library_version",
    "log",
    "maximum",
    "minimize_mpcc",
    "minimum",
    "options",
    "plot",
    "print_iteration",
    "relay",
    "sign",
    "simulate",
    "sin",
    "sinh",
    "sqrt",
    "tan",
    "tanh",
    "variable",
    "where",
]
