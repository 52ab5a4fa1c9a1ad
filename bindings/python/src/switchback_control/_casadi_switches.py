"""Operators in functions of CasADi that jump or have a kink: the library takes such functions for smooth ones."""

from __future__ import annotations

from typing import Any

from .errors import UnsupportedError

# Operators of CasADi by the end of the name of their constant, as one writes them.
_SWITCHES = {
    "LT": "<",
    "LE": "<=",
    "EQ": "==",
    "NE": "!=",
    "NOT": "logic_not",
    "AND": "logic_and",
    "OR": "logic_or",
    "IF_ELSE_ZERO": "if_else",
    "SIGN": "sign",
    "COPYSIGN": "copysign",
    "FABS": "fabs",
    "FMIN": "fmin",
    "FMAX": "fmax",
    "MMIN": "mmin",
    "MMAX": "mmax",
    "NORM1": "norm_1",
    "NORMINF": "norm_inf",
    "FLOOR": "floor",
    "CEIL": "ceil",
    "FMOD": "fmod",
    "REMAINDER": "remainder",
    "LOW": "low",
    "FIND": "find",
}
_CONDITIONS = {"<", "<=", "==", "!=", "logic_not", "logic_and", "logic_or"}
# Functions of CasADi that choose between others, or between the pieces of a table.
_CLASSES = {"Switch": "a choice between functions", "LinearInterpolant": "a table with linear interpolation"}

_SMOOTH_INPUTS = {"p"}  # constant during a simulation or a solve


def refuse(parts: list[Any], names: list[list[str]]) -> None:
    """Raise UnsupportedError if an output of one of the functions has an operator that switches with a state, a control
    or the time; `names` are the blocks of their inputs."""
    for part, blocks in zip(parts, names):
        for k, found in enumerate(_found(part, [{b} for b in blocks])):
            words = sorted(found - _CONDITIONS) or sorted(found)
            if words:
                raise UnsupportedError(
                    f"output {k} ('{part.name_out(k)}') of function '{part.name()}' has {', '.join(words)} in it, and would be "
                    "taken as smooth: state what it switches between as modes with switching functions (System."
                    "add_subsystem), or write the model in expressions (Model), which turn abs, sign, min, max and where "
                    "into modes; where it is smooth all the same, say so: switchback_control.casadi.function(f, smooth=True)"
                )


def _found(f: Any, inputs: list[set[str]]) -> list[set[str]]:
    """What switches in every output of a function whose inputs depend on these blocks."""
    if all(i <= _SMOOTH_INPUTS for i in inputs):
        return [set() for _ in range(f.n_out())]
    kind = f.class_name()
    if kind in ("SXFunction", "MXFunction"):
        return _in_instructions(f, inputs, kind == "MXFunction")
    # Integrators, root finders, maps ...: their outputs have whatever the functions inside of them have.
    inside = {_CLASSES[kind]} if kind in _CLASSES else set()
    everything = set().union(*inputs)
    for g in f.find_functions(0):
        for found in _found(g, [everything] * g.n_in()):
            inside |= found
    return [set(inside) for _ in range(f.n_out())]


def _in_instructions(f: Any, inputs: list[set[str]], matrices: bool) -> list[set[str]]:
    """Follows the instructions: of every number in the work vector the blocks it depends on, and what switched it."""
    import casadi as ca

    switches = {getattr(ca, f"OP_{end}"): text for end, text in _SWITCHES.items() if hasattr(ca, f"OP_{end}")}
    work: dict[int, tuple[set[str], set[str]]] = {}
    nothing: tuple[set[str], set[str]] = (set(), set())
    outputs: list[set[str]] = [set() for _ in range(f.n_out())]
    for k in range(f.n_instructions()):
        op, source, target = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
        if op == ca.OP_INPUT:
            work[target[0]] = (inputs[source[0]], set())
            continue
        known = [work.get(i, nothing) for i in source]
        blocks = set().union(*(b for b, _ in known))
        found = set().union(*(s for _, s in known))
        if op == ca.OP_OUTPUT:
            outputs[target[0]] |= found
            continue
        if op == ca.OP_CALL and matrices:
            g = f.instruction_MX(k).which_function()
            # Inputs that are not given are zeros.
            given = [work.get(i, nothing)[0] for i in source] + [set()] * max(0, g.n_in() - len(source))
            for i, inside in zip(target, _found(g, given)):
                work[i] = (blocks, found | inside)
            continue
        if op in switches and not blocks <= _SMOOTH_INPUTS:
            found = found | {switches[op]}
        for i in target:
            work[i] = (blocks, found)
    return outputs
