"""Answers of projected systems: known descents are followed, and one without contact is not the last word."""

import numpy as np
import pytest

import switchback_control as swb
from switchback_control import sqrt


class Discs:
    """A disc that is driven pushes another one, which moves in no other way, to a place."""

    def __init__(self, place, start, price, n):
        self.place, self.start, self.n, self.T = place, [*start, 0, 0, 0], n, 4.0
        m = self.model = swb.Projected("x1 y1 x2 y2 c", u="u v")
        x, u = m.x, m.u
        self.off = lambda x: (x[2] - place[0]) ** 2 + (x[3] - place[1]) ** 2
        m.f([u[0], u[1], 0, 0, 1e-4 * (u[0] ** 2 + u[1] ** 2) + price * self.off(x)])
        m.constraint("touch", sqrt((x[0] - x[2]) ** 2 + (x[1] - x[3]) ** 2) - 3)

    def mayer(self, x):
        return x[4] + 1e-5 * ((x[0] - self.start[0]) ** 2 + (x[1] - self.start[1]) ** 2) + 10 * self.off(x)

    def solve(self, **options):
        ocp = swb.Ocp(self.model, self.T, self.n, initial_state=self.start, control_bounds=(-3, 3), **options)
        ocp.set_mayer(self.model.function(self.mayer(self.model.x)))
        return ocp.solve()

    def cost(self, controls):
        z = np.array(self.start, dtype=float)
        for u in controls:
            z = swb.simulate(self.model, z, self.T / self.n, u=u).x_end
        return self.mayer(z)


@pytest.mark.parametrize("seed", range(8))
def test_a_known_descent_is_followed(seed):
    g = np.random.default_rng(seed)
    place = g.uniform(-1.5, 1.5), g.uniform(2.5, 4.5)
    price = g.uniform(0.05, 0.2)
    discs = Discs(place, (-5 + g.uniform(-0.7, 0.7), 5 + g.uniform(-0.7, 0.7)), price, 12)
    r = discs.solve()
    assert r.success and r.cost == pytest.approx(discs.cost(r.controls), rel=1e-4)
    if r.certificate == "not_optimal":
        moved = np.clip(np.asarray(r.controls) + r.optimality.descent, -3, 3)
        assert discs.cost(moved) > (1 - 1e-3) * r.cost, r.optimality
    # nothing that is drawn next to it is much cheaper
    if r.certificate == "local_optimum":
        near = [np.clip(r.controls + 0.01 * g.normal(size=r.controls.shape), -3, 3) for _ in range(10)]
        assert min(discs.cost(u) for u in near) > (1 - 1e-4) * r.cost


def test_an_answer_without_contact_is_not_the_last_word():
    discs = Discs((0, 4), (-5, 5), 0.1, 30)
    r = discs.solve(n_s=1, n_fe=2)
    still = discs.cost(np.zeros((30, 2)))
    assert still == pytest.approx(166.4) and r.success and r.cost < 0.5 * still
