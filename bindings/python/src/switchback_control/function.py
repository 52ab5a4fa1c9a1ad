"""Functions of a model: Python callables or pointers to compiled code, with derivatives."""

from __future__ import annotations

import ctypes
import inspect
from dataclasses import dataclass
from typing import Any, Callable, Sequence, Union

import numpy

from . import _ffi
from ._arrays import Array, address, index, number, real, seen, vector
from ._call import Handle, encode, failed
from .errors import ArgumentError, DimensionError, NullError, RangeError, SwitchbackError

__all__ = ["DerivativeCheck", "Function"]

_NAMES = ("x", "u", "p", "t")
_FLAGS = {"x": _ffi.Input.X, "u": _ffi.Input.U, "p": _ffi.Input.P, "t": _ffi.Input.T}
_CACHE = 4096  # views of memory that are kept
_MOST_EXPRESSIONS = 100_000  # numbers of an affine function above which NumPy is faster than expressions

Pattern = Any  # (rows, columns), or a matrix whose entries count if they are not zero


@dataclass(frozen=True)
class DerivativeCheck:
    """Result of a comparison of derivatives with finite differences; true if nothing disagrees."""

    passed: bool
    max_error: float
    report: str

    def __bool__(self) -> bool:
        return self.passed

    def __str__(self) -> str:
        return self.report


# --- arguments of a callable --------------------------------------------------------------------------


def _arguments(f: Callable[..., Any], allowed: Sequence[str], what: str) -> list[str]:
    """Which of the inputs a callable takes, by the names of its arguments."""
    hint = f"{what} must take arguments named {', '.join(allowed)}, those that it needs"
    if not callable(f):
        raise ArgumentError(f"{what} must be a function, not {type(f).__name__}")
    try:
        parameters = list(inspect.signature(f).parameters.values())
    except (TypeError, ValueError):
        raise ArgumentError(f"{hint}; {f!r} does not say its own: write lambda x: ...") from None
    names: list[str] = []
    for p in parameters:
        name = "x" if p.name == "w" else p.name
        if p.kind is p.VAR_POSITIONAL:
            if names:
                raise ArgumentError(f"{hint}; it mixes them with *{p.name}")
            return list(allowed)
        if p.kind is p.VAR_KEYWORD:
            continue
        if p.kind is p.KEYWORD_ONLY:
            if p.default is p.empty:
                raise ArgumentError(f"{hint}; '{p.name}' can only be given by keyword")
            continue
        if name in allowed and name not in names:
            names.append(name)
        elif p.default is p.empty:
            states = ": states are x, as in lambda t, x: ..." if p.name in ("y", "z", "q", "state", "states") else ""
            raise ArgumentError(f"{hint}; there is no input '{p.name}'{states}")
        else:
            break  # a default, and what follows has one too
    return names


def _view(cache: dict[int, Array], where: int, n: int) -> Array:
    """The numbers at an address, by a view that is kept: a new one costs more than the rest of a call."""
    array = cache.get(where)
    if array is None:
        if len(cache) >= _CACHE:
            cache.clear()
        array = numpy.ctypeslib.as_array((ctypes.c_double * n).from_address(where))
        cache[where] = array
    return array


def _reader(names: Sequence[str], sizes: dict[str, int]) -> Callable[[int], list[Any]]:
    """A function that makes the arguments of a callable from the address of a point. The arrays are copies:
    what the callable does with them, also later, is its own affair."""
    points: dict[int, _ffi.swb_point] = {}
    plan: list[tuple[str, int, dict[int, Array]]] = [(name, sizes.get(name, 0), {}) for name in names]
    empty = numpy.empty(0)
    empty.flags.writeable = False

    def read(at: int) -> list[Any]:
        point = points.get(at)
        if point is None:
            if len(points) >= _CACHE:
                points.clear()
            point = points[at] = _ffi.swb_point.from_address(at)
        values: list[Any] = []
        for name, n, cache in plan:
            if name == "t":
                values.append(point.t)
            elif n == 0:
                values.append(empty)
            else:
                values.append(_view(cache, getattr(point, name), n).copy())
        return values

    return read


def sparse_entries(matrix: Any, rows: Array, columns: Array, pointers: Array) -> Array:
    """Entries of a sparse matrix at places that are sorted by columns; as they are where the matrix has just these."""
    if getattr(matrix, "format", "") == "csc" and len(matrix.data) == len(rows):
        if numpy.array_equal(matrix.indptr, pointers[: len(matrix.indptr)]) and numpy.array_equal(matrix.indices, rows):
            return numpy.asarray(matrix.data, dtype=numpy.float64)
    return numpy.asarray(matrix.tocsr()[rows, columns], dtype=numpy.float64).ravel()


def _numbers(result: Any, what: str) -> Array:
    """What a callable returned, as an array of numbers of any type: who assigns it converts it."""
    if result is None:
        raise TypeError(f"{what} returned None: is a return missing?")
    array = numpy.asarray(result)
    if array.dtype.kind not in "fiub":
        shown = f"{result!r:.80}" if array.size <= 100 else f"an array of shape {array.shape} and type {array.dtype}"
        raise TypeError(f"{what} must return real numbers, not {shown}")
    return array


def _constant(value: Any, what: str) -> Callable[..., Any]:
    """Numbers as a callable without arguments."""
    numbers = real(value, what)
    return lambda: numbers


def _value_callback(
    f: Callable[..., Any], names: Sequence[str], sizes: dict[str, int], shape: tuple[int, ...], what: str
):
    read = _reader(names, sizes)
    n_out = int(numpy.prod(shape))
    outputs: dict[int, Array] = {}
    shapes = {shape, (n_out,)} | ({()} if n_out == 1 else set())

    def value(at: int, out: int, _: Any) -> int:
        try:
            result = _numbers(f(*read(at)), what)
            if result.shape not in shapes:
                raise DimensionError(f"{what} returned an array of shape {result.shape}, expected {shape}")
            if n_out:
                _view(outputs, out, n_out)[:] = result.ravel()
            return 0
        except BaseException as error:
            return failed(error)

    return value


class _Entries:
    """A pattern, and how the values of its entries are taken out of what a callable returned."""

    def __init__(self, pattern: Pattern, n_rows: int, n_columns: int, upper: bool, what: str):
        self.listed = isinstance(pattern, tuple)
        if self.listed:
            if len(pattern) != 2:
                raise DimensionError(f"pattern of {what}: expected (rows, columns), got {len(pattern)} items")
            rows, columns = (self._indices(v, n_rows * n_columns, what) for v in pattern)
            if len(rows) != len(columns):
                raise DimensionError(f"pattern of {what}: {len(rows)} rows and {len(columns)} columns")
        else:
            rows, columns = self._of_matrix(pattern, n_rows, n_columns, what)
            if upper:
                keep = rows <= columns
                rows, columns = rows[keep], columns[keep]
        if rows.size:
            for name, indices, n in (("row", rows, n_rows), ("column", columns, n_columns)):
                if indices.min() < 0 or indices.max() >= n:
                    worst = indices.min() if indices.min() < 0 else indices.max()
                    raise RangeError(f"pattern of {what}: there is no {name} {worst}, only 0 to {n - 1}")
        if upper and numpy.any(rows > columns):
            raise RangeError(f"pattern of {what}: entries belong into the upper triangle, row <= column")
        self.order = numpy.lexsort((rows, columns))
        self.rows, self.columns = rows[self.order], columns[self.order]
        same = (numpy.diff(self.rows) == 0) & (numpy.diff(self.columns) == 0)
        if same.any():
            k = int(numpy.argmax(same))
            raise RangeError(f"pattern of {what}: entry ({self.rows[k]}, {self.columns[k]}) is there twice")
        self.pointers = numpy.zeros(n_columns + 1, dtype=numpy.int64)
        numpy.cumsum(numpy.bincount(self.columns, minlength=n_columns), out=self.pointers[1:])
        self.n_rows = n_rows

    @staticmethod
    def _indices(values: Any, most: int, what: str) -> Array:
        array = numpy.atleast_1d(seen(values, f"pattern of {what}"))
        if array.size == 0:
            return numpy.empty(0, dtype=numpy.int64)
        if array.size > most:
            raise DimensionError(f"pattern of {what}: {array.size} entries, the matrix has {most}")
        if array.ndim != 1 or array.dtype.kind not in "iu":
            raise RangeError(f"pattern of {what}: rows and columns are lists of integers")
        return array.astype(numpy.int64)

    @staticmethod
    def _of_matrix(pattern: Any, n_rows: int, n_columns: int, what: str) -> tuple[Array, Array]:
        shape = numpy.shape(pattern)
        if len(shape) == 2 and (shape[0] > n_rows or shape[1] > n_columns):
            raise RangeError(f"pattern of {what}: a matrix of shape {shape}, expected {(n_rows, n_columns)} at most")
        if hasattr(pattern, "tocoo"):
            coo = pattern.tocoo()
            return coo.row.astype(numpy.int64), coo.col.astype(numpy.int64)
        array = numpy.asarray(pattern)
        if array.ndim != 2 or array.dtype.kind not in "fiub":
            raise DimensionError(f"pattern of {what}: expected (rows, columns) as a tuple, or a matrix")
        rows, columns = numpy.nonzero(array)
        return rows.astype(numpy.int64), columns.astype(numpy.int64)

    @staticmethod
    def dense(pointers: Array, rows: Array, n_rows: int, what: str) -> _Entries:
        """The pattern that the library derived."""
        columns = numpy.repeat(numpy.arange(len(pointers) - 1), numpy.diff(pointers))
        entries = _Entries((rows, columns), n_rows, len(pointers) - 1, False, what)
        entries.listed = False
        return entries

    def callback(
        self, f: Callable[..., Any], names: Sequence[str], sizes: dict[str, int], weights: int | None, what: str
    ):
        """The callback of a Jacobian, or of a Hessian if there are weights."""
        read = _reader([n for n in names if n != "weights"], sizes)
        place = list(names).index("weights") if "weights" in names else None
        rows, columns, order, listed, n_rows = self.rows, self.columns, self.order, self.listed, self.n_rows
        nnz, pointers = len(rows), self.pointers
        x, u, p = sizes["x"], sizes["u"], sizes["p"]
        widths = {x, x + u, x + u + p, x + u + p + 1}
        needed = int(columns.max()) + 1 if nnz else 0
        outputs: dict[int, Array] = {}
        inputs: dict[int, Array] = {}

        def take(result: Any) -> Array:
            if hasattr(result, "tocsr"):  # a sparse matrix
                shape, sparse = result.shape, True
            else:
                result = _numbers(result, what)
                shape, sparse = result.shape, False
                if listed and shape == (nnz,):
                    return result[order]
                if len(shape) == 0 and n_rows == 1:
                    result, shape = result.reshape(1, 1), (1, 1)
                elif len(shape) == 1 and n_rows == 1 and weights is None:
                    result, shape = result.reshape(1, -1), (1, shape[0])
            square = weights is None or shape[:1] == shape[1:]
            if len(shape) != 2 or shape[1] not in widths or not square or (weights is None and shape[0] != n_rows):
                height = "the same number of" if weights is not None else n_rows
                raise DimensionError(
                    f"{what} returned an array of shape {shape}, expected {height} rows and "
                    f"{' or '.join(map(str, sorted(widths)))} columns" + (f", or {nnz} values" if listed else "")
                )
            if shape[1] < needed:
                raise DimensionError(
                    f"{what} returned {shape[1]} columns, but its pattern has entries in column {needed - 1}"
                )
            if sparse:
                return sparse_entries(result, rows, columns, pointers)
            return result[rows, columns]

        def fill(at: int, w: int | None, out: int) -> int:
            try:
                values = read(at)
                if place is not None:
                    w_array = _view(inputs, w, weights).copy() if w and weights else numpy.empty(0)
                    values.insert(place, w_array)
                taken = take(f(*values))
                if nnz:
                    _view(outputs, out, nnz)[:] = taken
                return 0
            except BaseException as error:
                return failed(error)

        if weights is None:
            return _ffi.swb_jacobian_fn(lambda at, out, _: fill(at, None, out))
        return _ffi.swb_hessian_fn(lambda at, w, out, _: fill(at, w, out))


Pointer = Union[int, Any]


def _pointer(kind: Any, value: Any, what: str) -> Any:
    """A pointer to compiled code, from a number or a ctypes function."""
    if value is None:
        return kind(0)
    if isinstance(value, ctypes._CFuncPtr):  # type: ignore[attr-defined]
        value = ctypes.cast(value, ctypes.c_void_p).value
    where = index(value, what)
    if where <= 0:
        raise NullError(f"{what}: the address is zero")
    return kind(where)


class Function(Handle):
    """A function of states x, controls u, parameters p and time t, with first and second derivatives.

    `value` is a callable whose arguments are named after the inputs it needs: `lambda x: ...`,
    `def f(x, u, t): ...`. It depends on nothing else. The inputs are arrays of lengths `nx`, `nu`, `np`, and a
    number. It returns `n_out` numbers; if `n_out` is a shape, such as `(n_modes, n_rows)`, an array of this
    shape. For the variables of a program, `w` is another name of x. It may raise `Undefined`.

    Without `jacobian` and `hessian` the derivatives are finite differences. `jacobian` has the same kind of
    arguments and returns a matrix, dense or of scipy.sparse, with a row for each output and a column for each of
    x, or of x and u, or of x, u and p, or of x, u, p and t. `hessian` takes `weights` too and returns the
    symmetric matrix of second derivatives of the sum of the outputs times the weights. A pattern is a tuple
    (rows, columns), then the values may be returned in this order; or a matrix that is zero where the derivative
    always is. Patterns without a callable help the finite differences. Patterns of Hessians are those of the upper
    triangle. `linear` says that all second derivatives are zero.

    A callable without derivatives is traced: it is called once with expressions, and these are used where they agree with
    it at random points; `traced` tells. Their derivatives are exact, and no Python runs while they are evaluated. A callable that
    branches on a value, or calls what knows numbers only, cannot be traced: a `TraceWarning` names the line. Numbers from
    around the callable keep the values they have when the function is made. `trace=False`: call it every time.
    """

    _kind = "function"
    _in_python = False
    #: Was it a callable, and is it expressions now?
    traced = False
    _captured: Sequence[Any] = ()

    def __init__(
        self,
        value: Callable[..., Any],
        nx: int,
        nu: int = 0,
        np: int = 0,
        n_out: int | tuple[int, ...] = 1,
        *,
        jacobian: Callable[..., Any] | None = None,
        jacobian_pattern: Pattern | None = None,
        hessian: Callable[..., Any] | None = None,
        hessian_pattern: Pattern | None = None,
        linear: bool = False,
        name: str | None = None,
        trace: bool = True,
    ):
        derivatives = (jacobian, jacobian_pattern, hessian, hessian_pattern)
        parts = [value] if trace and not linear and all(d is None for d in derivatives) else None
        self._begin(value, nx, nu, np, n_out, name, None, parts)
        if not self.traced:
            self._derivatives(*derivatives, linear)

    def _begin(
        self,
        value: Any,
        nx: int,
        nu: int,
        np: int,
        n_out: Any,
        name: str | None,
        inputs: list[str] | None,
        parts: list[Any] | None = None,
    ) -> None:
        """Make it of a callable `value`; of expressions where the callables `parts`, each with its share of the outputs, can
        be traced."""
        if name is None:
            name = getattr(value, "__name__", None) or "f"
            name = "f" if name == "<lambda>" else name
        self.name = name
        self.shape = (
            tuple(index(n, "n_out") for n in n_out) if isinstance(n_out, (tuple, list)) else (index(n_out, "n_out"),)
        )
        self.sizes = {"x": index(nx, "nx"), "u": index(nu, "nu"), "p": index(np, "np")}
        for key, size in [*self.sizes.items(), *(("_out", n) for n in self.shape)]:
            if size < 0:
                raise DimensionError(f"function '{name}': n{key} is negative: {size}")
        what = f"function '{name}'"
        names = _arguments(value, _NAMES, what) if inputs is None else inputs
        self.inputs = tuple(names)
        if parts is not None and self._trace(parts, what):
            return
        callback = _ffi.swb_value_fn(_value_callback(value, names, self.sizes, self.shape, what))
        self._callbacks: list[Any] = [callback]
        self._in_python = True
        self._create_function(callback)
        # One thread only: exceptions come out with their traceback, and Python would not run faster on several.
        self._do("set_flags", _ffi.FunctionFlag.SERIAL)
        flags = sum(_FLAGS[n] for n in names if n in _FLAGS)
        self._do("set_inputs", flags)
        if flags == 0:
            self._do("set_linear")

    def _trace(self, callables: list[Any], what: str) -> bool:
        """Make it of expressions, if the callables can be traced; else say why not."""
        from . import _trace

        if not _trace.is_on():
            return False
        parts = [_trace.Part(f, _arguments(f, _NAMES, what), what) for f in callables]
        outcome = _trace.trace(parts, self.sizes, self.shape)
        if outcome.ids is not None:
            try:
                outcome.graph._fill(self, outcome.ids, encode(self.name, "name"))
                reason = _trace.disagreement(self, parts, self.sizes)
                if reason is None:
                    self.traced, self._captured = True, outcome.captured
                    return True
                self.close()
            except SwitchbackError as error:
                reason = str(error)
            outcome = outcome._replace(reason=reason)
        if outcome.reason:
            _trace.warn(what, outcome)
        return False

    def _create_function(self, callback: Any) -> None:
        s = self.sizes
        name = encode(self.name, "name")
        self._create(name, s["x"], s["u"], s["p"], self.n_out, callback, None, _ffi.swb_destroy_fn(0))

    def _derivatives(
        self, jacobian: Any, jacobian_pattern: Any, hessian: Any, hessian_pattern: Any, linear: bool
    ) -> None:
        if linear and (hessian is not None or hessian_pattern is not None):
            raise ArgumentError(f"function '{self.name}': linear and a Hessian contradict each other")
        if jacobian is not None or jacobian_pattern is not None:
            what = f"jacobian of '{self.name}'"
            if jacobian_pattern is None:
                entries = _Entries.dense(*self._pattern("jacobian"), self.n_out, what)
            else:
                entries = _Entries(jacobian_pattern, self.n_out, self.n_in, False, what)
            callback = _ffi.swb_jacobian_fn(0)
            if jacobian is not None:
                callback = entries.callback(jacobian, _arguments(jacobian, _NAMES, what), self.sizes, None, what)
            self._set("jacobian", entries, callback)
        if hessian is not None or hessian_pattern is not None:
            what = f"hessian of '{self.name}'"
            if hessian_pattern is None:
                entries = _Entries.dense(*self._pattern("hessian"), self.n_in, what)
            else:
                entries = _Entries(hessian_pattern, self.n_in, self.n_in, True, what)
            callback = _ffi.swb_hessian_fn(0)
            if hessian is not None:
                names = _arguments(hessian, (*_NAMES, "weights"), what)
                callback = entries.callback(hessian, names, self.sizes, self.n_out, what)
            self._set("hessian", entries, callback)
        if linear:
            self._do("set_linear")

    def _set(self, which: str, entries: _Entries, callback: Any) -> None:
        pointers, rows = entries.pointers, numpy.ascontiguousarray(entries.rows)
        self._callbacks.append(callback)
        self._do(f"set_{which}", address(pointers), len(pointers), address(rows), len(rows), callback)

    @classmethod
    def from_pointers(
        cls,
        value: Pointer,
        nx: int,
        nu: int = 0,
        np: int = 0,
        n_out: int | tuple[int, ...] = 1,
        *,
        jacobian: Pointer | None = None,
        jacobian_pattern: Pattern | None = None,
        hessian: Pointer | None = None,
        hessian_pattern: Pattern | None = None,
        linear: bool = False,
        inputs: str = "xupt",
        user_data: int | None = None,
        name: str = "f",
        keep: Any = None,
        serial: bool = True,
    ) -> Function:
        """A function in compiled code: pointers to a swb_value_fn, swb_jacobian_fn and swb_hessian_fn, as numbers
        or ctypes functions. Derivatives write the entries of their patterns column by column. `inputs` are the
        letters of those that the function depends on, `keep` is kept alive with it. `serial=False` says that several
        threads may call the code at once."""
        self = cls.__new__(cls)
        self.name = name
        self.shape = tuple(n_out) if isinstance(n_out, (tuple, list)) else (index(n_out, "n_out"),)
        self.sizes = {"x": index(nx, "nx"), "u": index(nu, "nu"), "p": index(np, "np")}
        self.inputs = tuple(inputs)
        unknown = set(inputs) - set(_NAMES)
        if unknown:
            raise ArgumentError(f"function '{name}': there is no input '{unknown.pop()}', only x, u, p, t")
        pointer = _pointer(_ffi.swb_value_fn, value, f"value of '{name}'")
        if value is None:
            raise NullError(f"function '{name}': value is None")
        self._callbacks = [pointer, keep]
        s = self.sizes
        self._create(
            encode(name, "name"), s["x"], s["u"], s["p"], self.n_out, pointer, user_data, _ffi.swb_destroy_fn(0)
        )
        self._do("set_flags", _ffi.FunctionFlag.SERIAL if serial else 0)
        self._do("set_inputs", sum(_FLAGS[n] for n in inputs if n in _FLAGS))
        if linear and (hessian is not None or hessian_pattern is not None):
            raise ArgumentError(f"function '{name}': linear and a Hessian contradict each other")
        for which, pattern, code, upper, kind in (
            ("jacobian", jacobian_pattern, jacobian, False, _ffi.swb_jacobian_fn),
            ("hessian", hessian_pattern, hessian, True, _ffi.swb_hessian_fn),
        ):
            what = f"{which} of '{name}'"
            rows = self.n_in if upper else self.n_out
            if pattern is not None:
                self._set(which, _Entries(pattern, rows, self.n_in, upper, what), _pointer(kind, code, what))
            elif code is not None:
                entries = _Entries.dense(*self._pattern(which), rows, what)
                self._set(which, entries, _pointer(kind, code, what))
        if linear:
            self._do("set_linear")
        return self

    @classmethod
    def affine(
        cls, constant: Any, matrix: Any = None, *, nx: int, nu: int = 0, np: int = 0, name: str = "affine"
    ) -> Function:
        """constant + matrix z, with a column of the matrix for each of z = x, or (x, u), or (x, u, p), or
        (x, u, p, t). A constant with several dimensions is the shape of the outputs, one after the other."""
        b = real(constant, f"constant of '{name}'")
        b = b.reshape(1) if b.ndim == 0 else b
        widths = [nx, nx + nu, nx + nu + np, nx + nu + np + 1]
        a = numpy.zeros((b.size, nx)) if matrix is None else seen(matrix, f"matrix of '{name}'")
        a = a.reshape(1, -1) if a.ndim == 1 and b.size == 1 else a
        if a.ndim != 2 or a.shape[0] != b.size or a.shape[1] not in widths:
            raise DimensionError(
                f"matrix of '{name}' has shape {a.shape}, expected {b.size} rows and "
                f"{' or '.join(map(str, sorted(set(widths))))} columns"
            )
        a = real(a, f"matrix of '{name}'")
        if not (numpy.isfinite(a).all() and numpy.isfinite(b).all()):
            raise RangeError(f"constant and matrix of '{name}' must be finite")
        width = a.shape[1]
        needed = [n for n, end in zip(_NAMES, widths) if width >= end and (n == "t" or {"x": nx, "u": nu, "p": np}[n])]
        if b.size + a.size <= _MOST_EXPRESSIONS:
            return cls._affine_expressions(b, a, (nx, nu, np), needed, name)
        flat, a = b.ravel().copy(), a.copy()
        rows, columns = numpy.nonzero(a)
        entries = a[rows, columns]

        def value(*inputs: Any) -> Array:
            z = numpy.hstack(inputs) if inputs else numpy.empty(0)
            return flat + a @ z if width else flat

        self = cls.__new__(cls)
        self._begin(value, nx, nu, np, b.shape, name, needed)
        self._derivatives(lambda *_: entries, (rows, columns), None, None, True)
        return self

    @classmethod
    def _affine_expressions(cls, b: Array, a: Array, sizes: tuple[int, int, int], needed: list[str], name: str) -> Function:
        """b + a z as expressions: no Python runs while they are evaluated."""
        from .expr import Graph

        graph = Graph()
        outputs = graph.constant(b.ravel())
        if a.any():
            blocks = [graph.inputs(block, n)._ids for block, n in zip(_NAMES, (*sizes, 1))]
            outputs = outputs + a @ graph._expr(numpy.concatenate(blocks)[: a.shape[1]])
        f = graph.function(outputs, *sizes, name)
        f.shape, f.inputs = b.shape, tuple(needed) if a.any() else ()
        return f

    @classmethod
    def _of(cls, f: Any, sizes: tuple[int, int, int], n_out: int | tuple[int, ...], name: str) -> Function:
        """What the models take as a function: one, a callable, several callables, of CasADi too, expressions, or constants."""
        if isinstance(f, Function):
            return f
        if f is None:
            raise NullError(f"{name} must be a function, not None")
        if isinstance(f, (bool, numpy.bool_)):
            raise ArgumentError(f"{name} is {f}: comparisons are no functions; give the expression and its bounds, as in add_terminal(m.q, 1, 1)")
        if isinstance(f, str):
            raise ArgumentError(f"{name} is the text {f!r:.40}: give the expression, model.q or model['q'], or a function")
        from . import casadi
        from .expr import _graph_among

        graph = _graph_among((f,))
        if graph is not None:
            return cls._of_expressions(graph, f, sizes, n_out, name)
        several = isinstance(f, (list, tuple)) and len(f) > 0 and all(map(casadi.is_function, f))
        if several or casadi.is_function(f):
            return casadi.function(f, *sizes, n_out)
        if callable(f):
            return cls(f, *sizes, n_out, name=name)
        if isinstance(f, (list, tuple)) and any(callable(g) and not isinstance(g, Function) for g in f):
            return cls._stack([g if callable(g) else _constant(g, f"{name}[{k}]") for k, g in enumerate(f)], sizes, n_out, name)
        nx, nu, np = sizes
        constant = cls.affine(f, nx=nx, nu=nu, np=np, name=name)
        shape = n_out if isinstance(n_out, tuple) else (n_out,)
        if constant.shape not in (shape, (int(numpy.prod(shape)),)):
            raise DimensionError(f"{name} has shape {constant.shape}, expected {shape}")
        return constant

    def _require_rows(self, what: str, instead: str) -> None:
        """Raises ArgumentError where an output is a constant though a function of the model is meant."""
        still = sorted(set(range(self.n_out)) - set(self.jacobian_pattern[0].tolist()))
        if still:
            place = f"{what}[{still[0]}]" if self.n_out > 1 else what
            raise ArgumentError(f"{place} is a constant: {instead}")

    @classmethod
    def _of_expressions(cls, graph: Any, f: Any, sizes: tuple[int, int, int], n_out: Any, name: str) -> Function:
        """Expressions, among which there may be numbers, as a function of the shape that is expected."""
        outputs = graph.of(f)
        if outputs._condition:
            raise ArgumentError(f"{name} is a condition: give the expression that it compares, or choose values by where")
        shape = n_out if isinstance(n_out, tuple) else (n_out,)
        if outputs.size != int(numpy.prod(shape)) or outputs.shape not in (shape, (outputs.size,), ()):
            raise DimensionError(f"{name} has shape {outputs.shape}, expected {shape}")
        made: Function = graph.function(outputs.ravel(), *sizes, name)
        made.shape = shape
        return made

    @classmethod
    def _stack(cls, parts: list[Callable[..., Any]], sizes: tuple[int, int, int], n_out: Any, name: str) -> Function:
        """Several callables as one, their outputs one after the other."""
        names = [_arguments(g, _NAMES, f"{name}[{k}]") for k, g in enumerate(parts)]
        union = [n for n in _NAMES if any(n in some for some in names)]
        places = [[union.index(n) for n in some] for some in names]
        shape = n_out if isinstance(n_out, tuple) else (n_out,)
        total = int(numpy.prod(shape))
        if shape[0] != len(parts) if len(shape) > 1 else total % len(parts):
            raise DimensionError(f"{name}: {len(parts)} functions, expected {shape[0]}")
        each = total // len(parts)

        def value(*inputs: Any) -> Array:
            out = numpy.empty((len(parts), each))
            for k, (g, place) in enumerate(zip(parts, places)):
                row = _numbers(g(*[inputs[i] for i in place]), f"{name}[{k}]")
                if row.size != each:
                    raise DimensionError(f"{name}[{k}] returned an array of shape {row.shape}, expected ({each},)")
                out[k] = row.ravel()
            return out.ravel()

        self = cls.__new__(cls)
        self._begin(value, *sizes, shape, name, union, parts)
        return self

    # --- what it is -----------------------------------------------------------------------------------

    @property
    def n_out(self) -> int:
        """Number of outputs."""
        return int(numpy.prod(self.shape))

    @property
    def n_in(self) -> int:
        """Number of inputs, time included."""
        return sum(self.sizes.values()) + 1

    def _pattern(self, which: str) -> tuple[Array, Array]:
        jacobian, hessian = ctypes.c_int64(), ctypes.c_int64()
        self._do("sizes", None, None, None, None, ctypes.byref(jacobian), ctypes.byref(hessian))
        nnz = (jacobian if which == "jacobian" else hessian).value
        pointers, rows = numpy.empty(self.n_in + 1, dtype=numpy.int64), numpy.empty(nnz, dtype=numpy.int64)
        self._do(f"{which}_pattern", address(pointers), len(pointers), address(rows), nnz)
        return pointers, rows

    @property
    def jacobian_pattern(self) -> tuple[Array, Array]:
        """Rows and columns of the entries, declared or derived."""
        return self._lists("jacobian")

    @property
    def hessian_pattern(self) -> tuple[Array, Array]:
        """Rows and columns of the entries of the upper triangle, declared or derived."""
        return self._lists("hessian")

    def _lists(self, which: str) -> tuple[Array, Array]:
        pointers, rows = self._pattern(which)
        return rows, numpy.repeat(numpy.arange(self.n_in), numpy.diff(pointers))

    # --- evaluation -----------------------------------------------------------------------------------

    def _point(self, x: Any, u: Any, p: Any, t: Any) -> tuple[Any, list[Array]]:
        arrays = [
            vector([] if v is None and n == 0 else v, n, f"{name} of '{self.name}'")
            for (name, n), v in zip(self.sizes.items(), (x, u, p))
        ]
        point = _ffi.swb_point(number(t, "t"), *(address(a) for a in arrays))
        return point, arrays

    def __call__(self, x: Any = None, u: Any = None, p: Any = None, t: float = 0.0) -> Array:
        """The value, by the way the library takes."""
        point, _keep = self._point(x, u, p, t)
        out = numpy.empty(self.shape)
        self._do("eval", ctypes.byref(point), address(out), out.size)
        return out

    def jacobian(self, x: Any = None, u: Any = None, p: Any = None, t: float = 0.0) -> Array:
        """The Jacobian, dense, with a column for each of x, u, p, t."""
        point, _keep = self._point(x, u, p, t)
        rows, columns = self._lists("jacobian")
        values = numpy.empty(len(rows))
        self._do("eval_jacobian", ctypes.byref(point), address(values), len(values))
        out = numpy.zeros((self.n_out, self.n_in))
        out[rows, columns] = values
        return out

    def hessian(self, x: Any = None, u: Any = None, p: Any = None, t: float = 0.0, *, weights: Any = None) -> Array:
        """The Hessian of the weighted sum of the outputs, dense and symmetric."""
        point, _keep = self._point(x, u, p, t)
        w = numpy.ones(self.n_out) if weights is None else vector(weights, self.n_out, "weights")
        rows, columns = self._lists("hessian")
        values = numpy.empty(len(rows))
        self._do("eval_hessian", ctypes.byref(point), address(w), len(w), address(values), len(values))
        out = numpy.zeros((self.n_in, self.n_in))
        out[rows, columns] = values
        out[columns, rows] = values
        return out

    def check_derivatives(self, x: Any = None, u: Any = None, p: Any = None, t: float = 0.0) -> DerivativeCheck:
        """Compare the derivatives at a point with finite differences, inside and outside the patterns."""
        point, _keep = self._point(x, u, p, t)
        passed, error, needed = ctypes.c_int32(), ctypes.c_double(), ctypes.c_int64(1 << 14)
        for attempt in (True, False):
            buffer = ctypes.create_string_buffer(needed.value)
            try:
                self._do(
                    "check_derivatives",
                    ctypes.byref(point),
                    ctypes.byref(passed),
                    ctypes.byref(error),
                    buffer,
                    len(buffer),
                    ctypes.byref(needed),
                )
                break
            except DimensionError:
                if not attempt or needed.value <= len(buffer):
                    raise
        return DerivativeCheck(bool(passed.value), error.value, buffer.value.decode("utf-8", "replace"))

    def __repr__(self) -> str:
        s = self.sizes
        return f"<Function '{self.name}' nx={s['x']} nu={s['u']} np={s['p']} n_out={self.n_out}>"
