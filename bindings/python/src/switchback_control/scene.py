"""Scenes: mechanical systems with contacts, written as expressions."""

from __future__ import annotations

import ctypes
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy

from ._arrays import address, choice, index, number, vector
from ._call import Handle, encode, text
from ._document import Reader
from ._ffi import ContactMode, ImpactKind, ImpactLaw
from ._library import lib
from .errors import ArgumentError, DimensionError, RangeError
from ._names import Named, split
from .expr import Expr, Graph, Jumping, _packed, _Transition
from .function import Function
from .system import System

if TYPE_CHECKING:
    from typing_extensions import Self

    from .freezing import FrozenModel
    from .runs import Run
    from .stepper import Steps

__all__ = ["ContactMode", "Impact", "ImpactKind", "ImpactLaw", "Projected", "Scene", "SceneContact"]


@dataclass(frozen=True)
class Impact:
    """The part of one contact in an impact.

    t                  time
    contact            number of the contact
    name               its name
    kind               ImpactKind: a collision, the last of accumulating ones, an impact without collision (Painlevé)
    rate_before, rate_after   rate of the gap around it
    normal, tangential        impulses; the tangential ones in the order of the tangents
    depth              how far the bodies would overlap without it: small where the contact is grazing
    simultaneous       other contacts had impulses at the same time
    unique             velocities behind it and impulses are unique
    """

    t: float
    contact: int
    name: str
    kind: ImpactKind
    rate_before: float
    rate_after: float
    normal: float
    tangential: tuple[float, ...]
    depth: float
    simultaneous: bool
    unique: bool


@dataclass(frozen=True)
class SceneContact:
    """A contact of a scene, as `Scene.contact` returns it: for `Run.force` and `Run.mode`. Of friction the gap is zero."""

    name: str
    gap: Expr
    tangents: tuple[Expr, ...]


class _Scene(Handle):
    _kind = "scene"


def _known_by(contact: Any) -> int:
    """Expressions that something among the contacts of a document is known by."""
    ((kind, one),) = contact.items()
    return 1 + len(one.get("tangents", ())) if kind == "contact" else 1


class _ContactSystem(Jumping, Named):
    """What scenes and projected systems share: a graph, contacts, and the system they become."""

    name: str
    names: list[list[str]]
    graph: Graph
    x: Expr
    q: Expr
    v: Expr
    contacts: list[SceneContact]
    n_q: int = -1  # number of coordinates; the states of a projected system are in the place of velocities: 0
    states: Expr
    nx: int
    nu: int
    np: int
    _made: _Scene
    _transitions: list[Any]
    _discrete: list[float]  # initial values of the last states
    _n_groups: int  # groups of names of the states that are not beside others
    _layout: Any = None  # of a World: where its bodies are

    def _begin(self, create: Any, sizes: Sequence[int], states: int, controls: list[str], parameters: list[str]) -> None:
        self._refuse_twice()
        self._transitions, self._discrete = [], []
        names = encode("\n".join(n for group in self.names for n in group), "names")
        made = _Scene.__new__(_Scene)
        made._make(create, encode(self.name, "name"), *sizes, names)
        self._adopt(Graph(), made, states, controls, parameters)

    def _adopt(self, graph: Graph, made: _Scene, states: int, controls: list[str], parameters: list[str]) -> None:
        self.graph = graph
        self.x = self.graph.inputs("x", states)
        self.nx, self.nu, self.np = states, len(controls), len(parameters)
        self.u, self.p = self.graph.inputs("u", self.nu), self.graph.inputs("p", self.np)
        self.t = self.graph.inputs("t", 1)[0]
        self.contacts = []
        self._made = made
        self._current = False
        self._complete = True

    def discrete(self, name: str = "", initial: float = 0.0) -> Expr:
        """Add a discrete state: only transitions change it. It is the last state, and where an initial state is given
        without the discrete ones they begin with `initial`."""
        start = number(initial, "initial")
        if not isinstance(name, str):
            raise ArgumentError(f"the name of a discrete state must be a text, not {type(name).__name__}")
        if name and any(name in names for names in self.names):
            raise ArgumentError(f"there is a variable '{name}' already: give the discrete state another name")
        self._made._do("add_discrete", encode(name, "name"), start, None)
        if len(self.names) == self._n_groups + 2:
            self.names.insert(self._n_groups, [])
        self.names[self._n_groups].append(name)
        self._discrete.append(start)
        self.nx += 1
        self.x = self.graph.inputs("x", self.nx)
        self._current = False
        return self.x[self.nx - 1]

    def _state_names(self) -> list[str]:
        return [n for group in self.names[:-2] for n in group]

    def _take(self, transition: Any) -> None:
        transition.add_to(self._made, self.graph)
        self._current = False

    def _blocks(self) -> tuple[Expr, ...]:
        states, start = [], 0
        for names in self.names[:-2]:
            states.append(self.x[start : start + len(names)])
            start += len(names)
        return *states, self.u, self.p

    def _ids(self, values: Any, shape: tuple[int, ...], what: str) -> numpy.ndarray:
        given = self.graph.of(values)
        if given.shape != shape:
            raise DimensionError(f"{what} has shape {given.shape}, expected {shape}")
        self._current = False
        return numpy.ascontiguousarray(given._ids.ravel(), dtype=numpy.int64)

    def _set(self, function: str, values: Any, shape: tuple[int, ...], what: str) -> None:
        ids = self._ids(values, shape, what)
        self._made._do(function, self.graph, address(ids), ids.size)

    def _add(self, name: str, gap: Expr, tangents: Sequence[Expr], mu: int, e: int) -> SceneContact:
        """Add a contact whose parts are checked; `mu` and `e` are numbers of expressions, -1 for zero."""
        ids = numpy.array([int(t._ids) for t in tangents], dtype=numpy.int64)
        place = ctypes.c_int64()
        self._current = False  # a call that is refused takes the built scene back, too
        self._made._do(
            "add_contact",
            self.graph,
            encode(name, "name"),
            int(gap._ids),
            address(ids) if ids.size else None,
            ids.size,
            mu,
            e,
            ctypes.byref(place),
        )
        made = SceneContact(name, gap, tuple(tangents))
        self.contacts.append(made)
        return made

    def _build(self) -> _Scene:
        if not self._current:
            self._made._do("build", self.graph)
            self._current = True
        return self._made

    def report(self) -> str:
        """What it consists of, what each contact costs, which were left out and why."""
        return text(lib.swb_scene_report, self._build(), 0)

    def report_data(self) -> dict[str, Any]:
        """The report as data."""
        return json.loads(text(lib.swb_scene_report, self._build(), 1))

    def system(self) -> System:
        """The system, for event-driven simulation."""
        s = System.__new__(System)
        s.nx, s.nu, s.np = self.nx, self.nu, self.np
        s._functions = list(self.graph._functions)
        s._make(lib.swb_scene_system, self._build())
        s.n_subsystems = 0
        s._discrete = []
        states = tuple(n for group in self.names[:-2] for n in group)
        s._names = states, *(tuple(names) for names in self.names[-2:])
        s._origin = self.graph, self.x._ids, states
        s._contacts = tuple((c["name"], c["tangents"]) for c in self.report_data()["contacts"])
        s._scene = self
        s._discrete = list(self._discrete)
        s._events = [t.name for t in self._transitions]
        return s

    def to_json(self) -> str:
        """It as a document in JSON: for bug reports, and to pass it on; with its discrete states and transitions. Functions that its
        expressions call are named only."""
        return text(lib.swb_scene_to_json, self._made, self.graph)

    @classmethod
    def from_json(cls, document: str, functions: Iterable[Function] = ()) -> Self:
        """From a document of `to_json`. Functions that it calls are not in it: they are supplied, and found by name."""
        reader = Reader(document, functions)
        saved: Any = reader.data().get("scene")
        graph = Graph()
        graph._functions.extend(reader.functions)
        try:
            projected = bool(saved.get("projected", False))
            n_roots = sum(_known_by(c) for c in saved.get("contacts", ()))
            n_roots += sum(1 + len(t.get("reset", ())) for t in saved.get("transitions", ()))
        except (AttributeError, KeyError, TypeError, ValueError):
            projected, n_roots = False, 0  # the library says what is wrong
        roots = numpy.empty(n_roots, dtype=numpy.int64)
        made = _Scene.__new__(_Scene)
        made._make(lib.swb_scene_from_json, graph, *reader.arguments, address(roots), roots.size)
        if projected != (cls.n_q == 0):
            raise ArgumentError(f"the document holds a {'projected system: read it with Projected' if projected else 'scene: read it with Scene'}")
        found = cls.__new__(cls)
        found._read(saved, graph, made, iter([graph._expr(numpy.array(k)) for k in roots]))
        return found

    def _read(self, saved: Any, graph: Graph, made: _Scene, roots: Iterator[Expr]) -> None:
        """Take over a scene of the library, with what a document says of it."""
        names, discrete = saved.get("names") or {}, saved.get("discrete", [])
        blocks = (("q", saved.get("coordinates", 0)), ("v", saved["velocities"]), ("z", len(saved.get("states", ())) + len(discrete)))
        rest = list(names.get("states", ()))
        groups = []
        for _, n in blocks:
            groups.append((rest[:n] + [""] * n)[:n])
            rest = rest[n:]
        first = self.n_q == 0
        inputs = [(list(names.get(what, ())) + [""] * n)[:n] for what, n in (("controls", saved["controls"]), ("parameters", saved["parameters"]))]
        self.name = saved["name"]
        self.names = [*(groups[first : 3 if groups[2] else 2]), *inputs]
        self._discrete = discrete
        self._enter(saved)
        self._adopt(graph, made, sum(n for _, n in blocks), *inputs)
        for c in saved.get("contacts", ()):
            ((kind, one),) = c.items()
            gap = next(roots) if kind != "friction" else graph.of(0.0)
            self.contacts.append(SceneContact(one["name"], gap, tuple(next(roots) for _ in range(_known_by(c) - (kind != "friction")))))
        self._transitions = [_Transition.saved(t, roots) for t in saved.get("transitions", ())]

    def _enter(self, saved: Any) -> None:
        """Sizes that not all of them have."""

    def function(self, outputs: Any, name: str = "f") -> Function:
        """A function of the states, controls, parameters and time."""
        return self.graph.function(outputs, self.nx, self.nu, self.np, name)


class Scene(_ContactSystem):
    """A mechanical system with contacts:

    q' = N(q) v,   M(q) v' = force(q, v, u, p, t) + contact forces,   gap >= 0, friction

    `q`, `v`, `u`, `p` are arrays of expressions and `t` is the time. Coordinates, controls and parameters are given by names,
    "x y", or by their number; velocities too, and without them there is one for each coordinate, its rate. `states` are states
    beside these, such as currents of motors and temperatures; `state_rates` gives their rates. Transitions, discrete states and clocks
    are those of a `Model`: `transition`, `discrete`, `hysteresis`, `every`, `hold`, `pwm`, `stop_at`, `note`.

        s = swb.Scene("y", name="ball")
        s.force([-9.81])
        s.contact("floor", gap=s.q[0], e=0.8)
        run = s.simulate([1.0], [0.0], 3.0)
    """

    def __init__(
        self,
        q: int | str | Sequence[str],
        v: int | str | Sequence[str] | None = None,
        u: int | str | Sequence[str] = 0,
        p: int | str | Sequence[str] = 0,
        name: str = "scene",
        states: int | str | Sequence[str] = 0,
    ):
        self.name = name
        qs = split(q, "q")
        vs = [f"v_{n}" if n else "" for n in qs] if v is None else split(v, "v")
        zs, us, ps = split(states, "states"), split(u, "u"), split(p, "p")
        self.names = [qs, vs, *([zs] if zs else []), us, ps]
        self.n_q, self.n_v, self.n_states = len(qs), len(vs), len(zs)
        if not self.n_q or not self.n_v:
            raise DimensionError("a scene needs at least one coordinate and one velocity")
        sizes = self.n_q, self.n_v, self.n_states
        self._begin(lib.swb_scene_create_with_states, (*sizes, len(us), len(ps)), sum(sizes), us, ps)
        self._warn_hidden(besides=("x",))  # coordinates are written s.q; a state array in the place of x has the wrong shape

    _what = "scene"
    _n_groups = 2

    def _adopt(self, *given: Any) -> None:
        super()._adopt(*given)
        behind = self.n_q + self.n_v
        self.q, self.v, self.states = self.x[: self.n_q], self.x[self.n_q : behind], self.x[behind : behind + self.n_states]

    def _enter(self, saved: Any) -> None:
        self.n_q, self.n_v, self.n_states = saved["coordinates"], saved["velocities"], len(saved.get("states", ()))

    def rates(self, values: Any) -> None:
        """Set the rates of the coordinates, one for each, linear in the velocities; by default they are the velocities."""
        self._set("set_rates", values, (self.n_q,), "rates")

    def inertia(self, values: Any) -> None:
        """Set the inertia: a number for every velocity (a diagonal), or a symmetric matrix; by default the unit matrix.

        Where it depends on coordinates, the terms that Lagrange's equations put beside M v' belong to `force`: `lagrange` finds them."""
        given = self.graph.of(values)
        if given.ndim == 1 and self.n_v >= 1 and given.shape == (self.n_v,):
            rows = [[given[i] if i == j else 0.0 for j in range(self.n_v)] for i in range(self.n_v)]
            given = self.graph.of(rows)
        elif given.shape != (self.n_v, self.n_v):
            n = self.n_v
            raise DimensionError(f"inertia has shape {given.shape}, expected ({n},), a diagonal, or ({n}, {n})")
        self._set("set_inertia", given, (self.n_v, self.n_v), "inertia")

    def force(self, values: Any) -> None:
        """Set the forces, one for every velocity: all that stands beside M v' but contact forces. They may switch (`sign`,
        `where`, tables); switches stand behind the contacts in `report_data()["contacts"]`, and their weights in `run.force`."""
        self._set("set_force", values, (self.n_v,), "force")

    def lagrange(self, inertia: Any, potential: Any = 0.0, force: Any = 0.0) -> None:
        """Set inertia and forces by Lagrange's equations of the energies T = v' M v / 2 and V, where the rates of the coordinates are
        the velocities: forces of the potential, centrifugal and Coriolis forces, and what else acts, `force`.

            s.lagrange([[2 + 2 * c, 1 + c], [1 + c, 1]], potential=9.81 * height, force=[s.u[0], 0.0])

        inertia     as `inertia` takes it, an expression of coordinates, parameters and time
        potential   an expression of the same
        force       one expression for each velocity, or 0
        """
        if self.n_q != self.n_v:
            raise DimensionError(f"{self.n_q} coordinates and {self.n_v} velocities: Lagrange's equations are for q' = v")
        n = self.n_v
        given = self.graph.of(inertia)
        matrix = self.graph.of([[given[i] if i == j else 0.0 for j in range(n)] for i in range(n)]) if given.shape == (n,) else given
        self.inertia(matrix)
        m, q, v = (_packed(e._ids.ravel()) for e in (matrix, self.q, self.v))
        out = numpy.empty(n, dtype=numpy.int64)
        energy = int(self.graph.of(potential)._ids)
        self.graph._do("lagrangian_forces", address(m), m.size, energy, address(q), address(v), address(out), n)
        other = self.graph.of(force)
        self.force(self.graph._expr(out) + other)

    def backlash(self, name: str, play: Any, width: Any, e: Any = 0.0) -> tuple[SceneContact, SceneContact]:
        """Add backlash: `play`, an expression of coordinates, parameters and time, moves freely over `width` about zero, and is held on
        both sides by contacts, "NAME lower" and "NAME upper", with restitution `e`. Returns the two.

            s.backlash("teeth", s.q[0] - s.q[1], 0.01, e=0.3)
        """
        if not isinstance(name, str) or not name:
            raise ArgumentError(f"the name of a backlash must be a text, not {name!r:.40}")
        if not isinstance(width, Expr) and not number(width, "width") > 0.0:
            raise RangeError(f"the width of backlash {name} is {width}: it must be positive")
        half = 0.5 * self.graph.of(width)
        lower = self.contact(f"{name} lower", self.graph.of(play) + half, e=e)
        return lower, self.contact(f"{name} upper", half - self.graph.of(play), e=e)

    def contact(
        self, name: str, gap: Any, tangents: Any = (), mu: Any = 0.0, e: Any = 0.0, mu_s: Any = None, separation: Any = None
    ) -> SceneContact:
        """Add a contact.

        `gap` is an expression of coordinates, parameters and time, positive where the bodies are apart. `tangents` are none
        (no friction), one (in the plane) or two (in space): expressions whose rates are the sliding velocity, or which are
        its components, linear in the velocities. `mu` and `e` are friction and restitution, numbers or expressions; `mu_s` is
        the coefficient by which it sticks, where that is larger than `mu`. With friction, gap and tangents are lengths.

        `separation` is an expression that the gap is never less than, as the distance of spheres around two bodies. Contacts with the
        same one are not looked at while it is positive: for scenes with very many contacts. Nothing checks that it is right.
        """
        if not isinstance(name, str) or not name:
            raise ArgumentError(f"the name of a contact must be a text, not {name!r:.40}")
        listed = list(tangents) if isinstance(tangents, (list, tuple)) else [tangents]
        all = [self.graph.of(t) for t in listed]
        numbers = [self._one(value, f"{what} of contact {name}") for what, value in (("gap", gap), ("mu", mu), ("e", e))]
        sticks = None if mu_s is None else self._one(mu_s, f"mu_s of contact {name}")
        far = None if separation is None else self._one(separation, f"separation of contact {name}")
        # friction that nothing slides along would be ignored
        if not all and (isinstance(mu, Expr) or number(mu, "mu") > 0.0):
            raise ArgumentError(f"contact {name} has friction and no tangents: give one in the plane, two in space")
        if any(t.ndim for t in all):
            raise DimensionError(f"tangents of contact {name}: give a list of single expressions")
        if sticks is not None and not all:
            raise ArgumentError(f"contact {name} has no tangents: it cannot stick by mu_s; give one in the plane, two in space")
        made = self._add(name, self.graph.of(gap), all, numbers[1], numbers[2])
        if sticks is not None:
            self._made._do("set_stiction", self.graph, len(self.contacts) - 1, sticks)
        if far is not None:
            self._made._do("set_separation", self.graph, len(self.contacts) - 1, far)
        return made

    def _one(self, value: Any, what: str) -> int:
        """The number of one expression."""
        if isinstance(value, str) or value is None:
            raise ArgumentError(f"{what} must be an expression or a number, not {value!r:.40}")
        given = self.graph.of(value)
        if given.ndim:
            raise DimensionError(f"{what} is an array of shape {given.shape}")
        return int(given._ids)

    def _joined(self, function: str, name: str, ids: Sequence[int], gap: Expr, tangents: tuple[Expr, ...]) -> SceneContact:
        self._current = False
        self._made._do(function, self.graph, encode(name, "name"), *ids, None)
        made = SceneContact(name, gap, tangents)
        self.contacts.append(made)
        return made

    def state_rates(self, values: Any) -> None:
        """Set the rates of the states beside coordinates and velocities, one for each, expressions of states, controls, parameters
        and time, which may switch.

            s = swb.Scene("angle", u="U", states="current")
            s.force([0.1 * s.current])
            s.state_rates([(s.U - 2.0 * s.current - 0.1 * s.v[0]) / 0.01])
        """
        self._set("set_state_rates", values, (self.n_states,), "state_rates")

    def friction(self, name: str, sliding: Any, bound: Any, stiction: Any = None) -> SceneContact:
        """Add dry friction at a joint: a force opposite to a sliding velocity, with a bound that is given.

        `sliding` is an expression of coordinates, parameters and time whose rate is the sliding velocity, or which is that
        velocity, linear in the velocities. `bound` is an expression of states, controls, parameters and time, not negative: the
        force where it slides; where it sticks the force is at most `stiction`, which is not less, or `bound` itself. In
        results it is a contact: `run.mode(friction)` is 1 where it sticks, 2 and 3 where it slides along or against
        `sliding`, and the force is the second of `run.force(friction)`.

            s.friction("hinge", s.q[0], 0.3, stiction=0.4)
        """
        if not isinstance(name, str) or not name:
            raise ArgumentError(f"the name of friction must be a text, not {name!r:.40}")
        ids = [self._one(sliding, f"what slides at {name}"), self._one(bound, f"the bound of {name}")]
        ids.append(-1 if stiction is None else self._one(stiction, f"the stiction of {name}"))
        return self._joined("add_friction", name, ids, self.graph.of(0.0), (self.graph.of(sliding),))

    def constraint(self, name: str, zero: Any) -> SceneContact:
        """Add a constraint: a contact that never opens, with a force of either sign.

        `zero` is an expression of coordinates, parameters and time, or one that contains velocities, linear in them. The state
        at the start must satisfy it, and velocities its rate. In results it is a contact that is always closed.

            s.constraint("rod", swb.sqrt(s.q[0] ** 2 + s.q[1] ** 2) - 1.0)
        """
        if not isinstance(name, str) or not name:
            raise ArgumentError(f"the name of a constraint must be a text, not {name!r:.40}")
        return self._joined("add_constraint", name, [self._one(zero, f"constraint {name}")], self.graph.of(zero), ())

    def bounds(self, coordinate: Any, low: float, high: float) -> None:
        """State that a coordinate stays between bounds: contacts that cannot close there are left out (see `report`). A
        simulation that leaves the bounds ends with an error then. -inf and inf say nothing about their side."""
        place, low, high = self._place(coordinate), number(low, "low"), number(high, "high")
        self._current = False
        self._made._do("set_bounds", place, low, high)

    def _place(self, coordinate: Any) -> int:
        if isinstance(coordinate, Expr) and coordinate.ndim == 0:
            found = numpy.flatnonzero(self.q._ids == coordinate._ids)
        elif isinstance(coordinate, str):
            found = numpy.array([i for i, n in enumerate(self.names[0]) if n and n == coordinate])
        else:
            return index(coordinate, "coordinate")
        if len(found) != 1:
            raise ArgumentError(f"{coordinate!r} is no coordinate of the scene")
        return int(found[0])

    def impact_law(self, law: str | ImpactLaw) -> None:
        """Law for several contacts that close at once: "newton" (all in one problem) or "sequential" (one after the
        other, the fastest first)."""
        chosen = int(choice(ImpactLaw, law, "law"))
        self._current = False
        self._made._do("set_impact_law", chosen)

    def simulate(self, q0: Any, v0: Any, t_span: Any, *, states: Any = (), **keywords: Any) -> Run:
        """Simulate from coordinates, velocities and the `states` beside them; see `switchback_control.simulate` for the rest."""
        from .integrator import simulate

        return simulate(self.system(), self._start(q0, v0, states), t_span, **keywords)

    def _start(self, q0: Any, v0: Any, states: Any) -> numpy.ndarray:
        sizes = (q0, self.n_q, "q0"), (v0, self.n_v, "v0"), (states, self.n_states, "states")
        return numpy.concatenate([*(vector(value, n, what) for value, n, what in sizes), self._discrete])

    def freeze(
        self,
        step: float = 0.1,
        speed: float = 1.0,
        a_n: float = 0.0,
        stiffness: float = 0.0,
        creep: float = 0.0,
        speed_of_time: bool = False,
        costs: Sequence[Any] = (),
        at: Any = None,
    ) -> FrozenModel:
        """The scene as a piecewise smooth model in numerical time (time-freezing): for simulation by finite elements and
        optimal control.

        `step` is the numerical time a jump should take, that of a step or a finite element; `speed` the rate at which gaps
        usually close. The strength `a_n` of contacts without restitution and the `stiffness` of those with follow from them at
        the state `at` (zeros), unless they are given. In space, what slides slower than `creep` sticks. `costs` are expressions
        whose integrals over physical time become states; with `speed_of_time` a control multiplies all rates.
        """
        from .freezing import freeze

        return freeze(self, step, speed, a_n, stiffness, creep, speed_of_time, costs, at)

    def simulate_steps(self, q0: Any, v0: Any, t_span: Any, h: float = 1e-3, **keywords: Any) -> Steps:
        """Simulate by time stepping, for many contacts; see `switchback_control.simulate_steps`."""
        from .stepper import simulate_steps

        return simulate_steps(self, q0, v0, t_span, h, **keywords)

    def __repr__(self) -> str:
        return f"<Scene '{self.name}': {self.n_q} coordinates, {self.n_v} velocities, {len(self.contacts)} contacts>"


class Projected(_ContactSystem):
    """A projected system, or first-order sweeping process:

    x' = f(x, u, p, t) + sum of gradient(c_i) * multiplier_i,   multiplier_i >= 0, c_i(x, p, t) >= 0, one of them zero

    A state is held inside of a set, that may move, by the least push; play between two parts is one. `run.force(constraint)`
    are multipliers, `run.mode(constraint)` is 0 where a constraint is not active and 1 where it is.

        m = swb.Projected("y", name="play")
        y, input = m.x[0], swb.sin(m.t)
        m.f([0])
        m.constraint("upper", input - y + 0.2)
        m.constraint("lower", y - input + 0.2)
        run = swb.simulate(m, [0.0], 10.0)

    Transitions, discrete states and clocks are those of a `Model`, for simulation by events: `transition`, `discrete`, `hysteresis`, `every`,
    `hold`, `pwm`, `stop_at`, `note`. A reset must stay in the set: it ends the run elsewhere, and says so.

    `swb.simulate_fesd` and `swb.Ocp` take it too; there every constraint is a subsystem with one mode, whose weight is the multiplier.
    """

    _what = "projected system"
    _n_groups = 1

    def __init__(
        self,
        x: int | str | Sequence[str],
        u: int | str | Sequence[str] = 0,
        p: int | str | Sequence[str] = 0,
        name: str = "projected",
    ):
        self.name = name
        self.names = [split(x, "x"), split(u, "u"), split(p, "p")]
        self._n_moving = len(self.names[0])
        self._begin(lib.swb_scene_create_projected, [len(n) for n in self.names], self._n_moving, *self.names[1:])

    def _enter(self, saved: Any) -> None:
        self._n_moving = saved["velocities"]

    def f(self, values: Any) -> None:
        """Set the derivatives of the states without constraints, one for each that is not discrete. They may switch, for simulation by events."""
        self._set("set_force", values, (self._n_moving,), "f")

    def constraint(self, name: str, c: Any) -> SceneContact:
        """Add a constraint c >= 0, an expression of states, parameters and time."""
        if not isinstance(name, str) or not name:
            raise ArgumentError(f"the name of a constraint must be a text, not {name!r:.40}")
        given = self.graph.of(c)
        if given.ndim:
            raise DimensionError(f"constraint {name} is an array of shape {given.shape}")
        return self._add(name, given, (), -1, -1)

    n_q = 0

    @property
    def constraints(self) -> list[SceneContact]:
        """The constraints, in the order they were added."""
        return self.contacts

    def __repr__(self) -> str:
        return f"<Projected '{self.name}': {self.nx} states, {len(self.constraints)} constraints>"
