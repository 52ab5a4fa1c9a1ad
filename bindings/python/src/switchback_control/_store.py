"""Results in files: a tree of plain values in JSON, with arrays beside it (.npz) or in it (.json). No code is in a file."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from enum import IntEnum
from typing import Any

import numpy

from . import _ffi
from ._pieces import Pieces
from .errors import ArgumentError, UnsupportedError

__all__ = ["load", "save"]

_FORMAT, _VERSION = "switchback result", 1


def _classes() -> dict[str, Any]:
    """Classes whose objects may be in a file, by name."""
    from . import _ocp_contacts, _ocp_search, automaton, integrator, mpcc, nmpc, ocp, recorded, results, saved, scene, simulator, trajectory

    own = {}
    modules = (_ocp_contacts, _ocp_search, automaton, integrator, mpcc, nmpc, ocp, recorded, results, saved, scene, simulator, trajectory)
    for module in modules:
        for name, kind in vars(module).items():
            plain = isinstance(kind, type) and (dataclasses.is_dataclass(kind) or hasattr(kind, "_fields"))
            if plain or name in ("SavedRun", "SavedTrajectory", "OcpContacts"):
                own[name] = kind
    return {**own, "Pieces": Pieces}


def _pack(value: Any, arrays: list[numpy.ndarray]) -> Any:
    """A value as a tree for JSON; its arrays go into the list."""
    from .runs import Run
    from .recorded import OverElements
    from .saved import SavedRun, SavedTrajectory
    from .trajectory import Trajectory

    if isinstance(value, IntEnum):
        return {"$enum": type(value).__name__, "value": int(value)}
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, (float, numpy.floating)):
        number = float(value)
        return number if math.isfinite(number) else {"$float": repr(number)}
    if isinstance(value, (numpy.integer, numpy.bool_)):
        return value.item()
    if isinstance(value, numpy.ndarray):
        arrays.append(value)
        return {"$array": len(arrays) - 1}
    if isinstance(value, list):
        return [_pack(v, arrays) for v in value]
    if isinstance(value, tuple):
        name = type(value).__name__ if hasattr(value, "_fields") else ""
        return {"$tuple": name, "values": [_pack(v, arrays) for v in value]}
    if isinstance(value, dict):
        return {"$dict": [[_pack(k, arrays), _pack(v, arrays)] for k, v in value.items()]}
    if isinstance(value, Run) and not isinstance(value, SavedRun):
        value = SavedRun._of(value)
    elif isinstance(value, Trajectory) and not isinstance(value, SavedTrajectory):
        value = SavedTrajectory._of(value)
    kind = type(value)
    if _classes().get(kind.__name__) is not kind:
        raise UnsupportedError(f"a {kind.__name__} cannot be written to a file")
    state = value.__getstate__() if isinstance(value, OverElements) else value.__dict__
    return {"$object": kind.__name__, "state": {k: _pack(v, arrays) for k, v in state.items()}}


def _unpack(tree: Any, arrays: list[numpy.ndarray], classes: dict[str, Any]) -> Any:
    if isinstance(tree, list):
        return [_unpack(v, arrays, classes) for v in tree]
    if not isinstance(tree, dict):
        return tree
    if "$float" in tree:
        return float(tree["$float"])
    if "$array" in tree:
        return arrays[tree["$array"]]
    if "$dict" in tree:
        return {_unpack(k, arrays, classes): _unpack(v, arrays, classes) for k, v in tree["$dict"]}
    if "$enum" in tree:
        return getattr(_ffi, tree["$enum"])(tree["value"])
    if "$tuple" in tree:
        values = [_unpack(v, arrays, classes) for v in tree["values"]]
        return classes[tree["$tuple"]](*values) if tree["$tuple"] else tuple(values)
    made = classes[tree["$object"]].__new__(classes[tree["$object"]])
    made.__dict__.update({k: _unpack(v, arrays, classes) for k, v in tree["state"].items()})
    return made


def _numbers(array: numpy.ndarray) -> dict[str, Any]:
    """An array for JSON; numbers that are not finite as texts."""
    flat = array.ravel().tolist()
    if array.dtype.kind == "f":
        flat = [v if math.isfinite(v) else repr(v) for v in flat]
    return {"type": array.dtype.str, "shape": list(array.shape), "values": flat}


def save(result: Any, path: str | os.PathLike) -> None:
    """Write a result to a file, .npz or .json by the end of its name."""
    where = os.fspath(path)
    arrays: list[numpy.ndarray] = []
    document = {"format": _FORMAT, "version": _VERSION, "result": _pack(result, arrays)}
    if where.endswith(".json"):
        document["arrays"] = [_numbers(a) for a in arrays]
        with open(where, "w", encoding="utf-8") as file:
            json.dump(document, file, allow_nan=False)
    elif where.endswith(".npz"):
        with open(where, "wb") as file:
            numpy.savez_compressed(file, document=numpy.array(json.dumps(document)), **{f"a{k}": a for k, a in enumerate(arrays)})
    else:
        raise ArgumentError(f"the name of the file must end in .npz or .json, not '{where}'")


def load(path: str | os.PathLike) -> Any:
    """Read a result that `save` wrote. Nothing in a file is executed.

    Runs and trajectories are `SavedRun` and `SavedTrajectory` then: everything but what the expressions of the model would be
    needed for."""
    where = os.fspath(path)
    try:
        if where.endswith(".json"):
            with open(where, encoding="utf-8") as file:
                document = json.load(file)
            arrays = [
                numpy.array([float(v) for v in a["values"]] if a["type"][1] == "f" else a["values"], dtype=a["type"]).reshape(a["shape"])
                for a in document["arrays"]
            ]
        else:
            with numpy.load(where, allow_pickle=False) as file:
                document = json.loads(str(file["document"]))
                arrays = [file[f"a{k}"] for k in range(len(file.files) - 1)]
        if document["format"] != _FORMAT or document["version"] > _VERSION:
            raise UnsupportedError(f"'{where}' is a {document['format']} of version {document['version']}, not of {_VERSION}")
        return _unpack(document["result"], arrays, _classes())
    except (ValueError, KeyError, TypeError, IndexError, AttributeError, EOFError) as error:
        if isinstance(error, UnsupportedError):
            raise
        raise ArgumentError(f"'{where}' holds no result: {type(error).__name__}: {error}") from None
