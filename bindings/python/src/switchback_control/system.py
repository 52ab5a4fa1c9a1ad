"""Piecewise smooth systems."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy

from . import _ffi
from ._arrays import address, choice, index, number, real, seen, vector
from ._call import Handle, encode
from ._ffi import Direction, Effect, Trigger
from ._names import filled, named_vector, split
from .errors import ArgumentError, DimensionError, RangeError
from .function import Function

__all__ = ["System"]


class System(Handle):
    """x' = f0(x, u, p, t) plus, for each subsystem, a convex combination of its modes.

    The numbers of states, controls and parameters may be names, "q v": then values can be given by them, x0={"q": 1, "v": 0}.
    Functions are given as `Function`, as callables (see there), as lists of callables, one for each mode, or as
    arrays of constants.
    """

    _kind = "system"
    _contacts: tuple[tuple[str, int], ...] = ()  # of a scene: names of contacts and their numbers of tangents
    _scene: Any = None  # the scene it was made of
    _events: Sequence[str] = ()  # names of the transitions
    _algebraic: Sequence[int] = ()  # states that equations determine
    _names: tuple[tuple[str, ...], ...]  # of states, controls and parameters: "" where one has none, () where none has

    def __init__(self, nx: int | str, nu: int | str = 0, np: int | str = 0, f0: Any = None):
        given: Any = ((nx, "nx"), (nu, "nu"), (np, "np"))
        self._names = tuple(() if hasattr(n, "__index__") else tuple(split(n, what)) for n, what in given)
        every = [name for names in self._names for name in names]
        if len(set(every)) < len(every):
            raise ArgumentError(f"two variables are called '{max(every, key=every.count)}'")
        self.nx, self.nu, self.np = (len(names) or index(n, what) for names, (n, what) in zip(self._names, given))
        self._functions: list[Function] = []  # their callbacks are called as long as a model is there
        self.n_subsystems = 0
        self._discrete: list[float] = []  # initial values of the last states
        self._origin: Any = None  # of a model: its graph, its states as expressions, and their names
        self._create(self.nx, self.nu, self.np)
        if f0 is not None:
            self.set_f0(f0)

    def function(self, value: Callable[..., Any], n_out: int | tuple[int, ...] = 1, **keywords: Any) -> Function:
        """A function with the sizes of this system; keywords as those of `Function`."""
        return Function(value, self.nx, self.nu, self.np, n_out, **keywords)

    def _start(self, x: Any, what: str) -> numpy.ndarray:
        """An initial state; the discrete states of a model may be left out."""
        smooth = self.nx - len(self._discrete)
        if isinstance(x, Mapping):
            return filled(x, self._names[0], what, [numpy.nan] * smooth + list(self._discrete))
        if x is None:
            return named_vector(x, self._names[0], self.nx, what)
        if self._discrete and numpy.ndim(x) <= 1 and numpy.size(x) == smooth:
            return numpy.concatenate([vector(x, smooth, what), self._discrete])
        return vector(x, self.nx, what)

    def _controls(self, u: Any) -> numpy.ndarray:
        """Controls, given as an array or by names."""
        return named_vector(u, self._names[1], self.nu, "u")

    def _params(self, p: Any) -> numpy.ndarray:
        """Parameters, given as an array or by names."""
        return named_vector(p, self._names[2], self.np, "p")

    def _function(self, f: Any, n_out: int | tuple[int, ...], name: str) -> Function:
        return Function._of(f, (self.nx, self.nu, self.np), n_out, name)

    def _switching(self, f: Any, n_out: int, name: str) -> Function:
        """Functions whose signs decide; constants have none that changes."""
        made = self._function(f, n_out, name)
        if not isinstance(f, Function):
            made._require_rows(name, "modes change where it passes zero; give a function of the states, as lambda x: x[0] - 1")
        return made

    def set_f0(self, f0: Any) -> None:
        """Set the part of the right-hand side that does not switch: nx outputs."""
        f = self._function(f0, self.nx, "f0")
        self._do("set_f0", f)
        self._functions.append(f)

    def _rows(self, rows: Any) -> numpy.ndarray:
        if rows is None:
            return numpy.arange(self.nx, dtype=numpy.int64)
        array = numpy.atleast_1d(seen(rows, "rows"))
        if array.size > self.nx:
            raise DimensionError(f"rows has {array.size} entries, there are {self.nx} states")
        if array.size and (array.ndim != 1 or array.dtype.kind not in "iu"):
            raise RangeError(f"rows must be indices of states, not {rows!r:.60}")
        return numpy.ascontiguousarray(array, dtype=numpy.int64)

    def add_subsystem(self, modes: Any, psi: Any, signs: Any, rows: Sequence[int] | None = None) -> int:
        """Add a subsystem whose regions are given by switching functions psi and a sign matrix: mode i is valid
        where signs[i, j] psi_j(x) > 0 for every j with signs[i, j] != 0.

        `signs` has a row for each mode and a column for each switching function; with one of these, a list. The
        modes return an array (n_modes, n_rows), a vector field for each mode, or the same numbers flat; they drive
        the states `rows`, all of them if it is None. Returns the number of the subsystem.
        """
        try:
            matrix = numpy.asarray(signs)
        except ValueError:
            raise DimensionError("signs is no regular array") from None
        matrix = matrix.reshape(-1, 1) if matrix.ndim == 1 else matrix
        if matrix.ndim != 2:
            raise DimensionError(f"signs has shape {matrix.shape}, expected (n_modes, n_psi)")
        if matrix.dtype.kind not in "fiub" or not numpy.isin(matrix, (-1, 0, 1)).all():
            raise RangeError("signs must be -1, 0 or 1")
        n_modes, n_psi = matrix.shape
        packed = numpy.ascontiguousarray(matrix, dtype=numpy.int8)
        chosen = self._rows(rows)
        f = self._function(modes, (n_modes, len(chosen)), "modes")
        g = self._switching(psi, n_psi, "psi")
        number = ctypes.c_int64()
        self._do(
            "add_subsystem",
            address(chosen),
            len(chosen),
            f,
            n_modes,
            g,
            address(packed),
            packed.size,
            ctypes.byref(number),
        )
        return self._added(number, f, g)

    def add_subsystem_indicators(
        self, modes: Any, indicators: Any, rows: Sequence[int] | None = None, n_modes: int | None = None
    ) -> int:
        """Add a subsystem whose regions are given by Stewart's indicator functions: mode i is valid where g_i(x) is
        the smallest. `n_modes` is needed if neither modes nor indicators tell it. Returns its number."""
        chosen = self._rows(rows)
        if n_modes is None:
            if isinstance(indicators, Function):
                n_modes = indicators.n_out
            elif isinstance(indicators, (list, tuple)):
                n_modes = len(indicators)
            elif isinstance(modes, Function) and len(chosen):
                n_modes = modes.n_out // len(chosen)
            elif isinstance(modes, (list, tuple)):
                n_modes = len(modes)
            else:
                raise ArgumentError("n_modes: the number of modes must be given")
        count = index(n_modes, "n_modes")
        f = self._function(modes, (count, len(chosen)), "modes")
        g = self._function(indicators, count, "indicators")
        if not g.jacobian_pattern[0].size and not isinstance(indicators, Function):
            raise ArgumentError("indicators are constants: the smallest one tells the mode; give functions of the states")
        number = ctypes.c_int64()
        self._do("add_subsystem_indicators", address(chosen), len(chosen), f, count, g, ctypes.byref(number))
        return self._added(number, f, g)

    def add_inclusion(self, f: Any, psi: Any, n_psi: int = 1, rows: Sequence[int] | None = None) -> int:
        """Add f(x, alpha, u, p, t) to the derivatives of the states `rows`, where alpha is the set-valued step of the
        `n_psi` switching functions psi.

        The function sees x and alpha as one array of nx + n_psi states. Returns the number of the inclusion.

        `simulate` keeps psi_j at zero by an alpha_j between 0 and 1 at which it has no rate, where neither side goes on; f need not be
        linear in it. A switch from which several ways go on is not `unique`. In a scene the row of a velocity is a force, and no
        coordinate is driven. Where forces of contacts push what psi depends on, only f that is linear in every alpha_j slides.
        """
        chosen, count = self._rows(rows), index(n_psi, "n_psi")
        c = self._switching(psi, count, "psi")
        g = Function._of(f, (self.nx + count, self.nu, self.np), len(chosen), "f")
        number = ctypes.c_int64()
        self._do("add_inclusion", address(chosen), len(chosen), g, c, ctypes.byref(number))
        self._functions += (g, c)
        return number.value

    def set_algebraic(self, n_z: int, g: Any = None) -> None:
        """Make the last `n_z` states algebraic: what f0 and modes add to their rows, and g, adds up to zero.

        Their initial values are guesses where the smooth equations determine them. `simulate` takes equations of index 1: they are
        solved where a run begins, behind every event, and at every point of a result. Modes may switch inside of them; where neither of two goes on
        beyond the surface between them, a weight of both holds it, as with a relay in its own loop. States that transitions alone change, and that
        stand behind all others as those of a `Model` do, are not counted. In a scene they are the last of its `states`; forces and friction may
        depend on them, gaps and constraints may not."""
        count = index(n_z, "n_z")
        f = None if g is None else self._function(g, count, "g")
        self._do("set_algebraic", count, f)
        last = self.nx - len(self._discrete)
        self._algebraic = range(last - count, last)
        if f is not None:
            self._functions.append(f)

    def add_complementarity(self, b: Any, *, rows: Sequence[int] | None = None, a: Any = None) -> int:
        """Add 0 ≤ a ⊥ b ≥ 0 to the equations of the algebraic states `rows`, all of them if it is left out: of every pair one is zero, and the
        other one is not negative, as current and voltage of an ideal diode.

        Without `a` it is the states themselves. Each pair is a subsystem with the modes a = 0 and b = 0; the number of the first one is returned.
        Call `set_algebraic` before. For matrices see `linear_complementarity`."""
        if rows is None:
            rows = self._algebraic or [0]  # which is none
        chosen = self._rows(rows)
        g = self._function(b, len(chosen), "b")
        f = None if a is None else self._function(a, len(chosen), "a")
        number = ctypes.c_int64()
        self._do("add_complementarity", address(chosen), len(chosen), f, g, ctypes.byref(number))
        first = self._added(number, *(h for h in (g, f) if h is not None))
        self.n_subsystems = first + len(chosen)
        return first

    @classmethod
    def linear_complementarity(cls, A: Any, B: Any, C: Any, D: Any, E: Any = None, F: Any = None) -> System:
        """The linear complementarity system x' = A x + B λ + E (u, 1), 0 ≤ λ ⊥ C x + D λ + F (u, 1) ≥ 0.

        `E` and `F` have a column for every control and a last one for constants; without them there are no controls. The states are x, then λ, whose
        initial values are guesses. Simulation by events wants the parts of `D` that belong to pairs with λ > 0 to be regular; if all principal
        minors of `D` are positive, λ is unique."""
        a, b = real(A, "A"), real(B, "B")
        c, d = real(C, "C"), real(D, "D")
        if a.ndim != 2 or d.ndim != 2 or a.shape[0] != a.shape[1] or d.shape[0] != d.shape[1]:
            raise DimensionError(f"A of shape {a.shape} and D of shape {d.shape} must be square matrices")
        n, k = len(a), len(d)
        if not (n and k) or b.shape != (n, k) or c.shape != (k, n):
            raise DimensionError(f"B has shape {b.shape} and C has shape {c.shape}, expected {(n, k)} and {(k, n)}, neither of them empty")
        e = numpy.zeros((n, 1)) if E is None else real(E, "E")
        f = numpy.zeros((k, e.shape[-1])) if F is None else real(F, "F")
        if E is None and f.ndim == 2:
            e = numpy.zeros((n, f.shape[1]))
        if e.ndim != 2 or not e.shape[1] or e.shape[0] != n or f.shape != (k, e.shape[1]):
            raise DimensionError(
                f"E has shape {e.shape} and F has shape {f.shape}: give {n} and {k} rows, and a column for every control and one for constants"
            )
        nu = e.shape[1] - 1
        rate = numpy.hstack([numpy.vstack([a, numpy.zeros((k, n))]), numpy.vstack([b, numpy.zeros((k, k))]), numpy.vstack([e[:, :nu], numpy.zeros((k, nu))])])
        constant = numpy.concatenate([e[:, nu], numpy.zeros(k)])
        self = cls(n + k, nu, f0=Function.affine(constant, rate, nx=n + k, nu=nu, name="f0"))
        self.set_algebraic(k)
        self.add_complementarity(Function.affine(f[:, nu], numpy.hstack([c, d, f[:, :nu]]), nx=n + k, nu=nu, name="b"))
        return self

    def add_transition(
        self,
        guard: Any,
        direction: Direction | str = "rising",
        *,
        when: Any = None,
        reset: Any = None,
        to: Any = None,
        name: str = "",
        edge: bool = False,
    ) -> int:
        """Add a jump of the state, for event-driven simulation, and return its number.

        It happens where the function `guard` passes zero in its direction, "rising" or "falling", while the states in
        `when`, a dictionary from indices to values, have these values. Then the state becomes `reset`, a function with nx
        outputs, and the states in `to` get their values. States in `when` and `to` are discrete: their derivative is zero.
        The rules, `name` and `edge` are those of `Model.transition`.
        """
        return self._add_event(guard, direction, when, reset, to, name, Effect.JUMP, Trigger.EDGE if edge else Trigger.LEVEL)

    def stop_at(self, guard: Any, direction: Direction | str = "rising", *, when: Any = None, name: str = "") -> int:
        """End runs where the function `guard` passes zero in its direction, see `Model.stop_at`."""
        return self._add_event(guard, direction, when, None, None, name, Effect.STOP, Trigger.EDGE)

    def note(self, guard: Any, direction: Direction | str = "rising", *, when: Any = None, name: str = "") -> int:
        """Note where the function `guard` passes zero in its direction, see `Model.note`."""
        return self._add_event(guard, direction, when, None, None, name, Effect.NOTE, Trigger.EDGE)

    def _add_event(
        self, guard: Any, direction: Any, when: Any, reset: Any, to: Any, name: str, effect: Effect, trigger: Trigger
    ) -> int:
        g = self._switching(guard, 1, "guard")
        after = None if reset is None else self._function(reset, self.nx, "reset")
        lists = []
        for what, given in (("when", when), ("to", to)):
            if given is None:
                given = {}
            if not hasattr(given, "items"):
                raise ArgumentError(f"{what} must be a dictionary from states to values, not {type(given).__name__}")
            states = numpy.array([index(i, what) for i in given], dtype=numpy.int64)
            values = numpy.array([number(v, what) for v in given.values()], dtype=numpy.float64)
            lists.append((states, values))
        (a, va), (b, vb) = lists
        count = ctypes.c_int64()
        self._do(
            "add_event",
            encode(name, "name"),
            effect,
            trigger,
            g,
            choice(Direction, direction, "direction"),
            address(a),
            a.size,
            address(va),
            va.size,
            after,
            address(b),
            b.size,
            address(vb),
            vb.size,
            ctypes.byref(count),
        )
        self._functions += [f for f in (g, after) if f is not None]
        self._events = [*self._events, name]
        return count.value

    def add_choice(self, control: Any, values: Any, dwell: float = 0.0) -> int:
        """Say that a control, given by its number or name, chooses among values, and return the number of the choice; see `Model.choice`."""
        at = index(self._names[1].index(control), "control") if control in self._names[1] else index(control, "control")
        given = numpy.array(numpy.atleast_1d(values), dtype=numpy.float64).ravel()
        count = ctypes.c_int64()
        self._do("add_choice", at, address(given), given.size, number(dwell, "dwell"), ctypes.byref(count))
        return count.value

    def add_known_times(self, t: Any, jumps: Any = False) -> None:
        """Add times at which functions of the system are not smooth: steps of event-driven simulation end there, and begin anew where `jumps`, one
        value or one for each, says that the right-hand side jumps. Tables of time in models say these times themselves."""
        times = numpy.atleast_1d(real(t, "t"))
        flags = numpy.ascontiguousarray(numpy.broadcast_to(numpy.asarray(jumps, dtype=bool), times.shape), dtype=numpy.int32)
        self._do("add_known_times", address(times), times.size, address(flags), flags.size)

    def surfaces(self, x: Any, u: Any = None, p: Any = None, t: float = 0.0, *, subsystem: int = 0) -> numpy.ndarray:
        """Values whose zeros are the switching surfaces of a subsystem: its switching functions, or the differences
        g_i - g_j, i < j, of its indicators, NaN where both are not the smallest two."""
        arrays = [
            numpy.zeros(n) if v is None and name != "x" else vector(v, n, name)
            for v, n, name in ((x, self.nx, "x"), (u, self.nu, "u"), (p, self.np, "p"))
        ]
        point = _ffi.swb_point(number(t, "t"), *(address(a) for a in arrays))
        k, needed = index(subsystem, "subsystem"), ctypes.c_int64()
        self._do("surfaces", k, ctypes.byref(point), None, 0, ctypes.byref(needed))
        out = numpy.empty(needed.value)
        self._do("surfaces", k, ctypes.byref(point), address(out), out.size, None)
        return out

    def _added(self, number: ctypes.c_int64, *functions: Function) -> int:
        self._functions += functions
        self.n_subsystems += 1
        return number.value

    def __repr__(self) -> str:
        return f"<System nx={self.nx} nu={self.nu} np={self.np}, {self.n_subsystems} subsystems>"
