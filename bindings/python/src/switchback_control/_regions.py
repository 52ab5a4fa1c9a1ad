"""Modes in words: "q > 0.5" instead of a number."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy

from ._call import text
from ._library import lib

__all__ = ["mode_names"]

_SHIFTED = re.compile(r"^(.*) ([-+]) ([0-9.]+(?:e[-+]?[0-9]+)?)$")


def _side(psi: str, sign: int) -> str:
    """The side of a surface, such as "q > 0.5" for "q - 0.5" and 1."""
    relation = ">" if sign > 0 else "<"
    match = _SHIFTED.match(psi)
    if match is None or match[1].count("(") != match[1].count(")"):
        return f"{psi} {relation} 0"
    return f"{match[1]} {relation} {'' if match[2] == '-' else '-'}{match[3]}"


def of_report(report: dict[str, Any]) -> tuple[tuple[str, ...], ...]:
    """Names of the modes of every subsystem of a model's report; () for a subsystem whose regions are unions."""
    found = []
    for group in report.get("groups", ()):
        psi, signs = group["switching_functions"], numpy.array(group["signs"])
        if signs.size != group["modes"] * len(psi):
            found.append(())
            continue
        table = signs.reshape(group["modes"], len(psi))
        found.append(tuple(" & ".join(_side(f, s) for f, s in zip(psi, row) if s) for row in table))
    return tuple(found)


def mode_names(system: Any, n_modes: tuple[int, ...]) -> list[list[str]]:
    """Names of the modes of the subsystems of a system: sides of surfaces where it was made of a model, else numbers."""
    known = getattr(system, "_mode_names", None)
    built = getattr(system, "_built", None)
    if known is None and built is not None:
        known = system._mode_names = of_report(json.loads(text(lib.swb_model_report, built, 1)))
    names = []
    for k, n in enumerate(n_modes):
        own = known[k] if known and len(known) == len(n_modes) else ()
        names.append(list(own) if len(own) == n else [str(i) for i in range(n)])
    return names
