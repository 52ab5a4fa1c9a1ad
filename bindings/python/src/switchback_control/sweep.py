"""Sweeps: simulations, optimal control problems and functions over many values, on any executor, resumable.

    job = swb.Simulation(model, {"q": 1, "v": 0}, 10.0, p={"k": 1, "mu": 0.3})
    found = swb.sweep(job, {"k": numpy.linspace(1, 2, 100), "mu": [0.1, 0.2]}, executor=4, store="sweep.sqlite")
    found.to_pandas()
"""

from __future__ import annotations

import concurrent.futures
import hashlib
import itertools
import multiprocessing
import pickle
import queue
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy

from ._arrays import Array, index
from ._names import named_vector, nearest
from ._progress import Progress
from ._sweep_store import Point, SweepStore, key_of
from .errors import ArgumentError, StateError
from .expr import Model, system_of
from .integrator import simulate
from .ocp import Ocp, OcpResult
from .recorded import labels
from .runs import Run

__all__ = ["Simulation", "Sweep", "sweep"]

Result = dict[str, Any]


# --- problems -----------------------------------------------------------------------------------------


class Simulation:
    """A simulation to be repeated with other values: model, initial state, time span, controls `u`, parameters `p` and options as
    those of `simulate`. A point gives values to states (their initial ones), controls and parameters by name; without names they
    are x0, x1, ..., u0, ..., p0, ....

    `outputs` is a function of the `Run` that returns a dictionary of numbers and texts; by default the states at the end, the
    number of switches, and whether the end was reached. The model travels to other processes as a document."""

    def __init__(
        self,
        model: Model,
        x0: Any,
        t_span: Any,
        *,
        u: Any = None,
        p: Any = None,
        outputs: Callable[[Run], Mapping[str, Any]] | None = None,
        **options: Any,
    ):
        if not isinstance(model, Model):
            raise ArgumentError(f"a simulation to be repeated takes a Model, which travels as a document, not {type(model).__name__}")
        self._system: Any
        self.model, self.t_span, self.outputs, self.options = model, t_span, outputs, options
        self._system = system = system_of(model)
        names, sizes = model.names, (model.nx, model.nu, model.np)
        self.names = [labels(own, letter, n) for own, letter, n in zip(names, "xup", sizes)]
        self.base = [
            system._start(x0, "x0"),
            named_vector(u if u is not None or model.nu else [], names[1], model.nu, "u"),
            named_vector(p if p is not None or model.np else [], names[2], model.np, "p"),
        ]

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_system": None}

    def check(self, names: Iterable[str]) -> None:
        """Raise ArgumentError for a name that is none of the model."""
        known = [n for group in self.names for n in group]
        for name in names:
            if name not in known:
                raise ArgumentError(f"the model has no '{name}'{nearest(name, known)}")

    def __call__(self, point: Point) -> Result:
        """The outputs at a point."""
        x0, u, p = (_replaced(base, names, point) for base, names in zip(self.base, self.names))
        options = {"dense": self.outputs is not None, **self.options}
        if self._system is None:
            self._system = system_of(self.model)
        run = simulate(self._system, x0, self.t_span, u=u if u.size else None, p=p if p.size else None, **options)
        if self.outputs is not None:
            return dict(self.outputs(run))
        ends = {f"{name}_end": float(v) for name, v in zip(self.names[0], run._last)}
        return {**ends, "t_end": run.t_end, "switches": len(run.switches), "success": run.success}


class _OptimalControl:
    """An optimal control problem to be solved with other initial states and parameters; it travels as a document."""

    def __init__(self, ocp: Ocp, outputs: Callable[[OcpResult], Mapping[str, Any]] | None):
        if any(f._in_python for f in ocp._functions):
            name = next(f.name for f in ocp._functions if f._in_python)
            raise ArgumentError(f"function '{name}' is Python and cannot travel with the problem: write it so that it can be traced")
        self.document, self.outputs = ocp.to_json(), outputs
        self.names = [labels(ocp._named(0), "x", ocp.nx), labels(ocp._named(2), "p", ocp.np)]
        self.base = [ocp._x0, ocp._p]

    def check(self, names: Iterable[str]) -> None:
        known = [n for group in self.names for n in group]
        for name in names:
            if name not in known:
                raise ArgumentError(f"the problem has no '{name}'{nearest(name, known)}")
        for own, base, what in zip(self.names, self.base, ("set_initial_state", "set_params")):
            if base is None and any(n in own for n in names) and not all(n in names for n in own):
                raise ArgumentError(f"call {what} before the sweep: the points give only some of {', '.join(own)}")

    def __call__(self, point: Point) -> Result:
        with Ocp.from_json(self.document) as ocp:
            for own, base, use in zip(self.names, self.base, (ocp.set_initial_state, ocp.set_params)):
                if any(n in point for n in own):
                    use(_replaced(numpy.zeros(len(own)) if base is None else base, own, point))
            result = ocp.solve()
        if self.outputs is not None:
            return dict(self.outputs(result))
        return {
            "cost": float(result.cost),
            "success": result.success,
            "certificate": result.certificate,
            "switches": len(result.trajectory.switches),
            "iterations": result.stats.iterations,
        }


class _Call:
    """A function of a point's values by keyword."""

    def __init__(self, f: Callable[..., Any]):
        self.f = f

    def check(self, names: Iterable[str]) -> None:
        pass

    def __call__(self, point: Point) -> Result:
        found = self.f(**point)
        return dict(found) if isinstance(found, Mapping) else {"value": found}


def _replaced(base: Array, names: Sequence[str], point: Point) -> Array:
    out = base.copy()
    for i, name in enumerate(names):
        if name in point:
            out[i] = point[name]
    return out


# --- work ---------------------------------------------------------------------------------------------

_loaded: dict[str, Any] = {}  # the problem of this worker, by its fingerprint


def _plain(value: Any) -> Any:
    """A value of a result as JSON has it."""
    if isinstance(value, numpy.ndarray):
        return value.tolist()
    return value.item() if isinstance(value, numpy.generic) else value


def _work(fingerprint: str, problem: bytes, points: list[Point]) -> list[Result]:
    """Results of some points, in a worker. What a point raises is its result."""
    job = _loaded.get(fingerprint)
    if job is None:
        _loaded.clear()
        job = _loaded[fingerprint] = pickle.loads(problem)
    found = []
    for point in points:
        try:
            found.append({k: _plain(v) for k, v in job(point).items()})
        except Exception as error:
            found.append({"error": f"{type(error).__name__}: {error}"})
    return found


class _Ray:
    """Ray with the interface of an executor."""

    def __init__(self, ray: Any):
        self._work = ray.remote(_work)

    def submit(self, _: Any, *arguments: Any) -> Any:
        return self._work.remote(*arguments).future()


@dataclass
class _Workers:
    """Where the work is done. Processes of our own are started again when one dies."""

    executor: Any
    own: int | None = None

    @classmethod
    def of(cls, executor: Any) -> _Workers:
        if executor is None:
            return cls(None)
        if isinstance(executor, int) and not isinstance(executor, bool):
            return cls(None, max(index(executor, "executor"), 1)).renew()
        if getattr(executor, "__name__", "") == "ray":
            return cls(_Ray(executor))
        if not hasattr(executor, "submit"):
            raise ArgumentError(
                f"executor must be a number of processes, an executor of concurrent.futures, a client of Dask or ray, not "
                f"{type(executor).__name__}"
            )
        return cls(executor)

    def renew(self) -> _Workers:
        """Processes that know nothing of this one: threads and locks do not survive a fork."""
        self.close()
        context = multiprocessing.get_context("spawn")
        self.executor = concurrent.futures.ProcessPoolExecutor(self.own, mp_context=context)
        return self

    def close(self) -> None:
        if self.own is not None and self.executor is not None:
            self.executor.shutdown(wait=False, cancel_futures=True)


# --- results ------------------------------------------------------------------------------------------


@dataclass
class Sweep:
    """Results of a sweep, in the order of its points: `found["cost"]` is a column, of points or of results.

    points    the points
    results   what was found there; what a point raised is its "error"
    """

    points: list[Point] = field(repr=False)
    results: list[Result] = field(repr=False)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def columns(self) -> list[str]:
        """Names of the columns: those of the points, then those of the results."""
        return list(dict.fromkeys(k for rows in (self.points, self.results) for row in rows for k in row))

    def __getitem__(self, name: str) -> Array:
        if name not in self.columns:
            raise KeyError(f"there is no column '{name}'{nearest(name, self.columns)}")
        rows = [{**point, **result} for point, result in zip(self.points, self.results)]
        column = [row.get(name) for row in rows]
        if any(isinstance(v, float) for v in column):
            column = [numpy.nan if v is None else v for v in column]
        return numpy.array(column)

    @property
    def errors(self) -> list[tuple[Point, str]]:
        """Points that raised, and what."""
        return [(p, r["error"]) for p, r in zip(self.points, self.results) if "error" in r]

    def to_dict(self) -> dict[str, Array]:
        """All columns."""
        return {name: self[name] for name in self.columns}

    def to_pandas(self) -> Any:
        """A DataFrame with a row for each point. Needs pandas."""
        try:
            import pandas
        except ImportError as error:
            raise ImportError("to_pandas needs pandas: pip install pandas; to_dict has the same columns as arrays") from error
        return pandas.DataFrame([{**p, **r} for p, r in zip(self.points, self.results)], columns=self.columns)

    def __repr__(self) -> str:
        return f"<Sweep of {len(self)} points, {len(self.errors)} errors>"


# --- the sweep ----------------------------------------------------------------------------------------


def _points(grid: Any) -> list[Point]:
    if hasattr(grid, "to_dict") and hasattr(grid, "columns"):  # a DataFrame
        grid = grid.to_dict("records")
    if isinstance(grid, Mapping):
        columns = [[_plain(v) for v in numpy.atleast_1d(numpy.asarray(values))] for values in grid.values()]
        return [dict(zip(grid, values)) for values in itertools.product(*columns)]
    if isinstance(grid, (str, bytes)) or not isinstance(grid, Iterable):
        raise ArgumentError("grid must be a dictionary from names to values, a list of dictionaries or a DataFrame")
    points = list(grid)
    if not all(isinstance(p, Mapping) for p in points):
        raise ArgumentError("grid must be a dictionary from names to values, a list of dictionaries or a DataFrame")
    return [{str(k): _plain(v) for k, v in p.items()} for p in points]


def _job(problem: Any, outputs: Any) -> Any:
    if isinstance(problem, Ocp):
        return _OptimalControl(problem, outputs)
    if outputs is not None:
        raise ArgumentError("outputs belongs to a problem of optimal control here, or to Simulation(..., outputs=...)")
    if isinstance(problem, Simulation):
        return problem
    if callable(problem):
        return _Call(problem)
    raise ArgumentError(f"a sweep takes a Simulation, an Ocp or a function, not {type(problem).__name__}")


def sweep(
    problem: Simulation | Ocp | Callable[..., Any],
    grid: Any,
    *,
    executor: Any = None,
    store: Any = None,
    chunk: int | None = None,
    retries: int = 2,
    progress: Any = False,
    outputs: Callable[[OcpResult], Mapping[str, Any]] | None = None,
) -> Sweep:
    """Work through all points of a grid, and return what was found, in the order of the points.

    problem   a `Simulation`, an `Ocp` (points give initial states and parameters by name; every point is solved from the
              problem's own start), or a function of the values by keyword that returns a dictionary or a number: a closed loop, say
    grid      a dictionary from names to values, whose product is taken; a list of dictionaries; or a DataFrame
    executor  None: here, one after the other; a number of processes; an executor of concurrent.futures; a client of Dask; `ray`
    store     a file (SQLite) for what was found: a sweep that was cut off goes on from there, with the same results
    chunk     points that travel together; by default such that every worker gets several
    retries   how often points are tried again whose process died; then that is their error
    progress  True: tqdm where it is installed, else lines; or a function of (done, total)
    outputs   of an `Ocp`: a function of the `OcpResult` that returns a dictionary of numbers and texts

    What a point raises is its result, `errors` lists it. With processes, functions and the problem must be importable there: as
    for `multiprocessing`, a script needs `if __name__ == "__main__":`."""
    job, points = _job(problem, outputs), _points(grid)
    job.check(dict.fromkeys(k for p in points for k in p))
    try:
        document = pickle.dumps(job)
    except Exception as error:
        if executor is not None or store is not None:
            raise ArgumentError(f"the problem cannot travel to other processes: {error}") from None
        document = b""
    fingerprint = hashlib.sha256(document).hexdigest()
    if not document:
        _loaded.clear()
        _loaded[fingerprint] = job
    kept = SweepStore(store, fingerprint)
    try:
        known = kept.known()
        missing = list({key_of(p): p for p in points if key_of(p) not in known}.values())
        report = Progress(progress, len(points) - len(missing), len(points), "points")
        try:
            workers = _Workers.of(executor)
            try:
                _run(workers, fingerprint, document, missing, kept, report, chunk, index(retries, "retries"))
            finally:
                workers.close()
        finally:
            report.close()
        known = kept.known()
    finally:
        kept.close()
    return Sweep(points, [known[key_of(p)] for p in points])


def _run(
    workers: _Workers,
    fingerprint: str,
    document: bytes,
    missing: list[Point],
    kept: SweepStore,
    report: Progress,
    chunk: int | None,
    retries: int,
) -> None:
    """Work through points, at most a few chunks for each worker under way."""
    at_once = workers.own or 4
    size = max(1, min(100, len(missing) // (8 * at_once))) if chunk is None else max(index(chunk, "chunk"), 1)
    waiting = deque((missing[i : i + size], 0) for i in range(0, len(missing), size))
    suspects: deque[tuple[list[Point], int]] = deque()  # one of these killed a process: they go alone, so that it shows which

    def keep(points: list[Point], results: list[Result]) -> None:
        kept.add(zip(points, results))
        report.add(len(points))

    if workers.executor is None:
        while waiting:
            points, _ = waiting.popleft()
            keep(points, _work(fingerprint, document, points))
        return
    done: queue.Queue[Any] = queue.Queue()
    running: dict[Any, tuple[list[Point], int]] = {}

    def again(points: list[Point], tries: int, error: BaseException) -> None:
        """Try points whose process died once more: alone, in halves where they were alone, until a single point has died often
        enough."""
        if retries == 0 or (len(points) == 1 and tries >= retries):
            keep(points, [{"error": f"the worker died: {type(error).__name__}"}] * len(points))
        elif tries == 0 or len(points) == 1:
            suspects.append((points, tries + 1))
        else:
            half = len(points) // 2
            suspects.extend([(points[:half], 1), (points[half:], 1)])

    while waiting or suspects or running:
        broken: BaseException | None = None
        while (suspects and not running) or (waiting and not suspects and len(running) < 4 * at_once):
            points, tries = (suspects or waiting).popleft()
            try:
                future = workers.executor.submit(_work, fingerprint, document, points)
            except Exception as error:
                (suspects if tries else waiting).appendleft((points, tries))
                broken = error
                break
            running[future] = points, tries
            future.add_done_callback(done.put)
        if broken is None:
            future = done.get()
            points, tries = running.pop(future)
            try:
                keep(points, future.result())
                continue
            except concurrent.futures.BrokenExecutor as error:
                broken = error
                again(points, tries, error)
            except Exception as error:
                again(points, tries, error)
                continue
        if workers.own is None:
            raise StateError(
                f"the executor does not work any more ({type(broken).__name__}: {broken}): call sweep again with another one"
                + ("" if kept.path is None else ", which goes on from what is stored")
            ) from broken
        for _ in range(len(running)):  # all that was under way is lost with a broken pool
            future = done.get()
            points, tries = running.pop(future)
            try:
                keep(points, future.result())
            except Exception as error:
                again(points, tries, error)
        workers.renew()
