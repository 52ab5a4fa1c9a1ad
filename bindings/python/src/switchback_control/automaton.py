"""Automata: discrete states with names, and the edges between them.

m = Model(states="v T")
gear = Automaton(m, states="first second third")
gear.edge("first", "second", when=m.x[0] > 15)
gear.edge("second", "first", when=m.x[0] < 10)
m.derivative(m.x[0], gear.choose({"first": 3.0, "second": 1.5, "third": 0.8}) - 0.1 * m.x[0])
"""

from __future__ import annotations

import itertools
from typing import Any, Iterable, NamedTuple, Sequence

import numpy

from ._arrays import index, number
from ._names import nearest
from .errors import ArgumentError, DimensionError, StateError
from .expr import Expr, Model, table

__all__ = ["Automaton", "Interval"]


class Interval(NamedTuple):
    """How long a discrete state had a value: between which times, and which."""

    start: float
    end: float
    value: Any


class _Indicator:
    """Of an expression that is 1 in some states of an automaton."""

    def __init__(self, automaton: Automaton, states: Sequence[int]):
        self.automaton, self.states = automaton, tuple(states)


class Automaton:
    """A discrete state of a model with named values, and edges between them, for event-driven simulation.

    `states` are the names, "idle heat" or a list, or their number; then they are called 0, 1, ... It begins in `initial`,
    else in the first one. `name` is that of the discrete state, which is the last state of the model and counts from 0.

    Attributes: `model`, `states` (the names), `state` (the discrete state as an expression), `edges`: for every edge its
    source, its target and the number of its transition, as in `Run.jumps`.
    """

    def __init__(self, model: Model, states: int | str | Iterable[str], initial: Any = None, name: str = ""):
        if not isinstance(model, Model):
            raise ArgumentError(f"an automaton belongs to a Model, not to {type(model).__name__}")
        if isinstance(states, str):
            names: list[Any] = states.replace(",", " ").split()
        elif isinstance(states, (list, tuple)):
            names = list(states)
        else:
            names = list(range(max(index(states, "states"), 0)))
        if len(names) < 2:
            raise DimensionError(f"an automaton has two states at least, not {len(names)}")
        if not isinstance(names[0], int) and not all(isinstance(n, str) and n for n in names):
            raise ArgumentError(f"the states of an automaton are names, or their number, not {states!r:.60}")
        if len(set(names)) < len(names):
            raise ArgumentError(f"two states of the automaton have one name: {', '.join(map(str, names))}")
        self.model, self.states = model, tuple(names)
        self.initial = 0 if initial is None else self._place(initial, "initial")
        self.state = model.discrete(name, self.initial)
        if isinstance(names[0], str):
            model._value_names[model.nx - 1] = self.states
        self.name = name or repr(self.state)
        self.edges: list[tuple[Any, Any, int]] = []
        self._known: dict[Any, str] = {}

    @classmethod
    def of(cls, model: Model, state: Any) -> Automaton:
        """The automaton of a discrete state of a model, given by its name or as an expression: of a model that came from a
        document. Its edges are the transitions of the model that lead from one of its states to another."""
        place = model._state(state, "the discrete state")
        if place not in model._value_names:
            named = [model.names[0][i] or repr(model.x[i]) for i in model._value_names]
            raise ArgumentError(f"{state!r} has no named values: the model has automata of {', '.join(named) or 'no states'}")
        made = cls.__new__(cls)
        made.model, made.states, made.state = model, model._value_names[place], model.x[place]
        made.initial = int(model._discrete[place - model.nx])
        made.name = model.names[0][place] or repr(made.state)
        made.edges, made._known = [], {}
        for k, t in enumerate(model._transitions):
            if place in t.when and place in t.to:
                source, target = (made.states[int(d[place])] for d in (t.when, t.to))
                made.edges.append((source, target, k))
                others = sorted((i, v) for i, v in t.when.items() if i != place)
                made._known[(int(t.when[place]), tuple(t.guard._ids.ravel()), tuple(others))] = target
        return made

    def _place(self, state: Any, what: str) -> int:
        if isinstance(state, (str, int, numpy.integer)) and not isinstance(state, bool) and state in self.states:
            return self.states.index(state)
        known = ", ".join(str(s) for s in self.states)
        raise ArgumentError(f"{what}: the automaton has no state {state!r}, its states are {known}")

    def _places(self, states: Any, what: str) -> list[int]:
        many = states if isinstance(states, (list, tuple, set, frozenset)) else [states]
        if not many:
            raise ArgumentError(f"{what} is an empty list: name a state")
        return sorted({self._place(s, what) for s in many})

    def edge(
        self, source: Any, target: Any, when: Any = None, *, given: Any = None, reset: Any = None, to: Any = None
    ) -> list[int]:
        """Add an edge from `source`, a state, a list of states, or None for all but the target, to `target`; return the
        numbers of its transitions.

        It is passed where `when`, a comparison such as `v > 15`, becomes true, or at once where it is true when a source
        begins. `given` asks for states of others: a dictionary from automata, or discrete states of the model, to a state
        or a list of them. Without `when` the edge is passed as soon as they are so; `when=other.is_in("on")` says the same.
        `reset` are states and what they become, `to` further discrete states and their values, as in
        `Model.transition`.

        Of several edges whose conditions hold at one time the one that was added first is passed, and from its target
        others at the same time, if their conditions hold.
        """
        goal = self._place(target, "target")
        if source is None:
            sources = [k for k in range(len(self.states)) if k != goal]
        else:
            sources = self._places(source, "source")
        asked = self._asked(given)
        indicator = getattr(when, "_indicator", None)
        if indicator is not None:
            other = indicator.automaton
            place = self.model._state(other.state, "when")
            asked[place] = [float(s) for s in indicator.states if place not in asked or s in asked[place]]
            if not asked[place]:
                raise ArgumentError(f"when and given ask for different states of {other.name}")
            when = None
        place = self.model._state(self.state, "the automaton")
        if place in asked:
            raise ArgumentError(f"{self.name}: given asks for a state of the automaton itself, which is what source does")
        if when is None:
            if not asked:
                raise ArgumentError(
                    f"the edge to {target} has no condition: say where it is passed with when, a comparison, or with given"
                )
            when = self.model.graph.constant(1.0)
        elif not isinstance(when, Expr):
            raise ArgumentError(f"when is {when!r:.60}: it must be a comparison of expressions, such as v > 15")
        after = dict(reset.items()) if hasattr(reset, "items") else reset
        goals = dict(to.items()) if hasattr(to, "items") else to
        if goals is not None and not isinstance(goals, dict):
            raise ArgumentError(f"to must be a dictionary from discrete states to values, not {type(to).__name__}")
        changed = [*(after if isinstance(after, dict) else ()), *(goals or ())]
        if place in (self.model._state(s, "reset or to") for s in changed):
            raise ArgumentError(f"reset and to are for other states: the target of the edge is {target} already")
        if goal in sources and not after and not goals:
            raise ArgumentError(f"an edge from {target} to itself changes nothing: give a reset")
        combined = [dict(zip(asked, values)) for values in itertools.product(*asked.values())]
        guard = when if when._margin is None else when._margin
        key = tuple(guard._ids.ravel())
        for k, others in itertools.product(sources, combined):
            same = self._known.get((k, key, tuple(sorted(others.items()))))
            if same is not None:
                raise ArgumentError(
                    f"there is an edge with this condition from {self.states[k]} to {same} already: only that would be passed"
                )
        numbers = []
        for k, others in itertools.product(sources, combined):
            before = {self.model.x[i]: v for i, v in others.items()} | {self.state: k}
            numbers.append(self.model.transition(when, when=before, reset=after, to={**(goals or {}), self.state: goal}))
            self._known[(k, key, tuple(sorted(others.items())))] = str(target)
            self.edges.append((self.states[k], self.states[goal], numbers[-1]))
        return numbers

    def _asked(self, given: Any) -> dict[int, list[float]]:
        """Places of discrete states, and the values they may have."""
        if given is None:
            return {}
        if not hasattr(given, "items"):
            raise ArgumentError(f"given must be a dictionary from automata or discrete states, not {type(given).__name__}")
        asked: dict[int, list[float]] = {}
        for state, wanted in given.items():
            if isinstance(state, Automaton):
                if state.model is not self.model:
                    raise ArgumentError(f"given: {state.name} is an automaton of another model")
                place, values = self.model._state(state.state, "given"), [float(k) for k in state._places(wanted, "given")]
            else:
                many = wanted if isinstance(wanted, (list, tuple, set, frozenset)) else [wanted]
                place, values = self.model._state(state, "given"), [number(v, "given") for v in many]
            if place in asked or not values:
                what = "is there twice" if place in asked else "may have no value"
                raise ArgumentError(f"given: {self.model.names[0][place] or self.model.x[place]!r} {what}")
            asked[place] = sorted(set(values))
        return asked

    def is_in(self, *states: Any) -> Expr:
        """An expression that is exactly 1 in these states and 0 in all others, for derivatives, resets and guards.

        It is a table of steps between the states: nothing that switches for the engine, and its derivative is zero.
        """
        wanted = self._places(states, "is_in")
        e = self.choose([1.0 if k in wanted else 0.0 for k in range(len(self.states))])
        e._indicator = _Indicator(self, wanted)  # type: ignore[attr-defined]
        return e

    def choose(self, values: Any, otherwise: Any = None) -> Expr:
        """An expression with a value for each state: a list in their order, or a dictionary from states to values, numbers
        or expressions; `otherwise` is for states the dictionary leaves out.

        Expressions are all evaluated and multiplied by 1 or 0, so each must be defined in all states.
        """
        graph, n = self.model.graph, len(self.states)
        if hasattr(values, "items"):
            named = {self._place(s, "choose"): v for s, v in values.items()}
            missing = [str(self.states[k]) for k in range(n) if k not in named]
            if missing and otherwise is None:
                raise ArgumentError(f"choose has no value for {', '.join(missing)}: give it, or otherwise")
            all = [named.get(k, otherwise) for k in range(n)]
        else:
            if otherwise is not None:
                raise ArgumentError("choose: otherwise is for a dictionary, a list has a value for every state")
            all = list(values)
            if len(all) != n:
                raise DimensionError(f"choose has {len(all)} values for {n} states")
        if not any(isinstance(v, Expr) for v in all):
            numbers = [number(v, "a value of choose") for v in all]
            steps = [k for k in range(1, n) if numbers[k] != numbers[k - 1]]
            if not steps:
                return graph.constant(numbers[0])
            return table(self.state, [k - 0.5 for k in steps], [numbers[0]] + [numbers[k] for k in steps], "steps")
        total: Any = 0.0
        for k, v in enumerate(all):
            total = total + graph.of(v) * self.is_in(self.states[k])
        return total

    def sequence(self, run: Any) -> list[Interval]:
        """The states of a run in their order, with their times: `Interval(start, end, state)`. States that are left at
        the time they are entered are not in it; `run.jumps` has them."""
        place = self.model._state(self.state, "the automaton")
        found = run._intervals(place) if hasattr(run, "_intervals") else intervals(run, place)
        whole = [int(round(i.value)) for i in found]
        if any(not 0 <= k < len(self.states) for k in whole):
            raise ArgumentError(f"{self.name} has values that are none of its states: does the run belong to another model?")
        return [i._replace(value=self.states[k]) for i, k in zip(found, whole)]

    def __repr__(self) -> str:
        return f"<Automaton {self.name}: {', '.join(map(str, self.states))}; {len(self.edges)} edges>"


def intervals(run: Any, place: int) -> list[Interval]:
    """Values of a discrete state of a run, by its place, with their times."""
    if run.stats.jumps > len(run.jumps):
        raise StateError(f"the run made {run.stats.jumps} transitions and noted {len(run.jumps)}: raise max_switches")
    return intervals_of(run.jumps, place, run.t_start, run.t_end, run._last)


def intervals_of(jumps: Sequence[Any], place: int, start: float, end: float, x_end: Any) -> list[Interval]:
    """Values of a discrete state between two times, by its place, from the transitions in between."""
    value = jumps[0].before[place] if jumps else x_end[place]
    found = []
    for j in jumps:
        if j.after[place] != value:
            found.append(Interval(start, j.t, float(value)))
            start, value = j.t, j.after[place]
    found.append(Interval(start, end, float(value)))
    # a run that ends where it jumps has been in its last state for no time, and is in it
    kept = [i for i in found[:-1] if i.end > i.start] + found[-1:]
    merged: list[Interval] = []
    for i in kept:
        if merged and merged[-1].value == i.value:
            merged[-1] = merged[-1]._replace(end=i.end)
        else:
            merged.append(i)
    return merged


def place_of(system: Any, state: Any) -> int:
    """The place of a discrete state that is given by its place, its name, or as an expression of the model."""
    if isinstance(state, (int, numpy.integer)) and not isinstance(state, bool):
        if not 0 <= state < system.nx:
            raise DimensionError(f"there is no state {state}, the system has {system.nx}")
        return int(state)
    graph, ids, names = getattr(system, "_origin", None) or (None, numpy.empty(0), ())
    places: Any = []
    if isinstance(state, Expr) and state.ndim == 0 and state._graph is graph:
        places = numpy.flatnonzero(ids == state._ids)
    elif isinstance(state, str) and state:
        places = [i for i, name in enumerate(names) if name == state]
    if len(places) != 1:
        meant = nearest(state, names) if isinstance(state, str) else ""
        raise ArgumentError(
            f"{state!r} is no state of the system of the run{meant or ': give its name, its place, or the expression'}"
        )
    return int(places[0])
