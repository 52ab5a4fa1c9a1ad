"""What the contacts of a scene do in the answer of an optimal control problem."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy

from ._arrays import Array, address, index, real
from ._call import text
from ._ffi import ContactMode, ImpactKind, swb_impact
from ._library import lib
from .errors import ArgumentError, DimensionError, RangeError
from .scene import Impact, SceneContact
from .trajectory import Trajectory

__all__ = ["OcpContacts"]

_WORDS = {0: "open", 1: "closed", 2: "slides", 3: "slides back"}


class OcpContacts:
    """Impacts, modes and forces of an answer, in physical time.

    names    of the contacts, those that were left out not counted
    impacts  in the order of time, a list of `Impact`, one for every contact with an impulse; their depth is NaN
    phases   parts of the horizon in which no contact changes: a list of (start, end, modes), integers of `ContactMode`
    freezing what stood for the contacts in numerical time, as text: strengths a_n and k, the recommended ones, how long a jump takes, warnings;
             empty unless the search was by time-freezing
    """

    def __init__(self, ocp: Any, trajectory: Trajectory):
        self.names = [name for name, _ in ocp._contacts]
        self._n_tangents = [n for _, n in ocp._contacts]
        number, count = ctypes.c_int64(), ctypes.c_int64()
        ocp._do("get_contacts", ctypes.byref(number), ctypes.byref(count))
        found = (swb_impact * max(count.value, 1))()
        ocp._do("impacts", found if count.value else None, count.value, ctypes.sizeof(swb_impact))
        self.impacts = [self._impact(i) for i in list(found[: count.value])]
        n = len(self.names)
        self._times, self._stage_times = trajectory.times, trajectory.stage_times
        middle = numpy.ascontiguousarray(0.5 * (self._times[1:] + self._times[:-1]))
        self._modes = numpy.empty((middle.size, n), dtype=numpy.int64)
        ocp._do("contact_modes", address(middle), middle.size, address(self._modes), self._modes.size)
        flat = numpy.ascontiguousarray(self._stage_times.reshape(-1))
        self._forces = numpy.empty((*self._stage_times.shape, n, 3))
        ocp._do("contact_forces", address(flat), flat.size, address(self._forces), self._forces.size)
        self.phases = self._make_phases()
        self.freezing = text(lib.swb_ocp_freezing_report, ocp)

    def _impact(self, i: Any) -> Impact:
        tangential = (i.tangential, i.tangential2)[: self._n_tangents[i.contact]]
        return Impact(
            i.t,
            i.contact,
            self.names[i.contact],
            ImpactKind(i.kind),
            i.rate_before,
            i.rate_after,
            i.normal,
            tangential,
            i.depth,
            bool(i.simultaneous),
            bool(i.unique),
        )

    def _make_phases(self) -> list[tuple[float, float, tuple[int, ...]]]:
        struck = {i.t for i in self.impacts}
        phases: list[tuple[float, float, tuple[int, ...]]] = []
        for a, b, row in zip(self._times, self._times[1:], self._modes):
            modes = tuple(int(m) for m in row)
            if phases and phases[-1][2] == modes and float(a) not in struck:
                phases[-1] = (phases[-1][0], float(b), modes)
            else:
                phases.append((float(a), float(b), modes))
        return phases

    def _contact(self, contact: Any) -> int:
        name = contact.name if isinstance(contact, SceneContact) else contact
        if isinstance(name, str):
            if name not in self.names:
                raise ArgumentError(f"there is no contact '{name}', only {', '.join(self.names) or 'none'}")
            return self.names.index(name)
        k = index(contact, "contact")
        if not 0 <= k < len(self.names):
            raise DimensionError(f"there is no contact {k}, their number is {len(self.names)}")
        return k

    def _elements(self, t: Array) -> Array:
        first, last = self._times[0], self._times[-1]
        slack = 1e-12 * max(abs(first), abs(last), last - first)
        if not numpy.all((t >= first - slack) & (t <= last + slack)):
            raise RangeError(f"times must be between {first:g} and {last:g}")
        found = numpy.searchsorted(self._times, t, side="left") - 1
        return numpy.clip(found, 0, len(self._modes) - 1)

    def mode(self, contact: Any, t: Any) -> Array:
        """Modes of a contact, a `SceneContact`, its name or its number, at times: integers of `ContactMode`. At the time of an
        event they are those before it."""
        k = self._contact(contact)
        return self._modes[self._elements(numpy.asarray(real(t, "t"))), k]

    def force(self, contact: Any, t: Any) -> Array:
        """Forces of a contact at times, [..., 1 + number of tangents]: the normal force, then those along the tangents. Forces,
        not impulses, which are in `impacts`."""
        k = self._contact(contact)
        times = numpy.asarray(real(t, "t"))
        e = self._elements(times)
        nodes = self._stage_times[e]
        # the polynomial through the values at the stage points
        out = numpy.zeros((*times.shape, 3))
        n_s = nodes.shape[-1]
        for j in range(n_s):
            weight = numpy.ones(times.shape)
            for i in range(n_s):
                if i != j:
                    weight = weight * (times - nodes[..., i]) / (nodes[..., j] - nodes[..., i])
            out += weight[..., None] * self._forces[e, j, k]
        return out[..., : 1 + self._n_tangents[k]]

    def table(self) -> str:
        """Phases and impacts as text."""
        lines = [f"{'from':>14} {'to':>14}  contacts"]
        impacts = {i.t: [j for j in self.impacts if j.t == i.t] for i in self.impacts}
        for a, b, modes in self.phases:
            for i in impacts.get(a, []):
                lines.append(f"{a:14.8g} {'':>14}  impact of {i.name}: rate {i.rate_before:.6g} -> {i.rate_after:.6g}, impulse {i.normal:.6g}")
            closed = [f"{name} {_WORDS[m]}" for name, m in zip(self.names, modes) if m != ContactMode.OPEN]
            lines.append(f"{a:14.8g} {b:14.8g}  {', '.join(closed) or 'free'}")
        return "\n".join(lines)
