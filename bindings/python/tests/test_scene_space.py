"""Contacts in space: slides that begin, friction behind their start, and which impacts are said to be unique."""

import numpy as np

import switchback_control as swb
from switchback_control import cos, exp, sin, sqrt

G = 9.81


def coupled_bodies(n, seed):
    """Inertias that couple all directions, friction from 0 to 1, pushes that grow and turn.

    Returns
    -------
    m : (n, 3, 3) array
        Inertia. A normal force exists at every slide: `D_nn > μ |D_nt|` with `D` its inverse.
    mu : (n,) array
        Coefficients of friction.
    push : (n, 2) array
        Growth of the push, and how fast it turns.
    """
    rng = np.random.default_rng(seed)
    m, mu, push = [], [], []
    while len(m) < n:
        a = rng.normal(size=(3, 3))
        inertia, friction = a @ a.T + rng.uniform(0.3, 3) * np.eye(3), rng.uniform(0, 1)
        d = np.linalg.inv(inertia)
        if d[2, 2] > 1.1 * friction * np.hypot(d[2, 0], d[2, 1]):
            m.append(inertia)
            mu.append(friction)
            push.append([rng.uniform(3, 8), rng.choice([0.0, rng.uniform(-2, 2)])])
    return np.array(m), np.array(mu), np.array(push)


def time_stepping(m, mu, push, t_end, h):
    """Positions at the end by J. J. Moreau's time stepping, all bodies at once, and whether the plane held them.

    A step that does not stick slides in the direction `e` with `e⊥ · v_t = 0`, `e · v_t ≥ 0` behind it: the angle is
    sought among 64 and refined by Newton's method.
    """
    d, n = np.linalg.inv(m), len(m)
    weights = d[:, [2, 0, 1]][:, :, [2, 0, 1]]
    q, v, held = np.zeros((n, 3)), np.zeros((n, 3)), np.ones(n, dtype=bool)
    angles = np.linspace(0, 2 * np.pi, 64, endpoint=False)

    def slide(w, phi):
        """Impulses and velocities behind a slide, normal first."""
        e = np.stack([np.cos(phi), np.sin(phi)], axis=-1)
        one = np.concatenate([np.ones((*phi.shape, 1)), -mu[:, None, None] * e], axis=-1)
        moves = np.einsum("nij,nkj->nki", weights, one)
        r = -w[:, None, 0] / moves[:, :, 0]
        z = w[:, None] + r[:, :, None] * moves
        along = e[..., 0] * z[..., 1] + e[..., 1] * z[..., 2]
        across = e[..., 0] * z[..., 2] - e[..., 1] * z[..., 1]
        return r[..., None] * one, z, along, across

    for k in range(round(t_end / h)):
        t = (k + 0.5) * h
        pushed, turned = push[:, 0] * t, push[:, 1] * t
        f = np.stack([pushed * np.cos(turned), pushed * np.sin(turned), np.full(n, -G)], 1)
        w = (v + h * np.einsum("nij,nj->ni", d, f))[:, [2, 0, 1]]
        r = -np.linalg.solve(weights, w[:, :, None])[:, :, 0]
        sticks = np.hypot(r[:, 1], r[:, 2]) <= mu * r[:, 0]
        _, _, along, across = slide(w, np.tile(angles, (n, 1)))
        best = np.argmin(np.where(along > 0, np.abs(across), np.inf), axis=1)
        phi = angles[best][:, None]
        for _ in range(5):
            value = slide(w, phi)[3]
            slope = (slide(w, phi + 1e-6)[3] - value) / 1e-6
            phi = phi - np.where(slope == 0, 0, value / np.where(slope == 0, 1, slope))
        r, z, _, _ = slide(w, phi)
        held &= sticks | (r[:, 0, 0] >= 0)
        z = np.where(sticks[:, None], 0, z[:, 0])
        v = z[:, [1, 2, 0]]
        q += h * v
    return q, held


def test_slides_begin_where_inertia_couples_directions():
    t_end = 3.0
    m, mu, push = coupled_bodies(45, 1)
    (coarse, _), (fine, held) = (time_stepping(m, mu, push, t_end, h) for h in (4e-3, 2e-3))
    # some are pulled off the floor
    assert held.sum() >= 40
    slid = 0
    for k in np.flatnonzero(held):
        s = swb.Scene("x y z")
        s.inertia(m[k].tolist())
        grows, turns = push[k]
        s.force([grows * s.t * cos(turns * s.t), grows * s.t * sin(turns * s.t), -G])
        s.contact("floor", gap=s.q[2], tangents=[s.q[0], s.q[1]], mu=mu[k])
        run = s.simulate([0, 0, 0], [0, 0, 0], t_end, rtol=1e-8, atol=1e-8)
        assert run.success, (k, run.reason)
        error = 2 * np.abs(coarse[k] - fine[k]).max() + 1e-4
        assert np.abs(run.x_end[:3] - fine[k]).max() < error, (k, run.x_end[:3], fine[k], error)
        slid += np.abs(run.x_end[3:]).max() > 1e-3
    assert slid >= 30


def test_friction_behind_a_break_away_is_opposite_to_the_push():
    rng = np.random.default_rng(2)
    for _ in range(30):
        mu, push, turn = rng.uniform(0.1, 0.35), rng.uniform(4, 8), rng.uniform(-4, 4)
        s = swb.Scene("x y z", name="puck")
        x, y, z = s.q
        grown = push * (1 - exp(-s.t))
        s.force([grown * cos(turn * s.t), grown * sin(turn * s.t), -G])
        table = s.contact("table", gap=z, tangents=[x, y], mu=mu)
        run = s.simulate([0, 0, 0], [0, 0, 0], 3.0, rtol=1e-8, atol=1e-8)
        begins = run.switch_times[0]
        behind = begins + 10.0 ** np.arange(-12, -2.5, 0.5)
        friction = run.force(table, behind)[:, 1:]
        assert np.allclose(np.hypot(*friction.T), mu * G, rtol=1e-6)
        angle = turn * behind
        across = np.cos(angle) * friction[:, 1] - np.sin(angle) * friction[:, 0]
        along = np.cos(angle) * friction[:, 0] + np.sin(angle) * friction[:, 1]
        # the slide turns behind the push, by what this turns in the meantime at most
        assert (along < 0).all()
        assert (np.abs(across) <= mu * G * (np.abs(turn) * (behind - begins) + 1e-4)).all(), (mu, push, turn, across)


def test_derivatives_through_a_break_away():
    rng = np.random.default_rng(5)
    for k in range(6):
        mu, grows, turns = rng.uniform(0.1, 0.3), rng.uniform(4, 8), 0.0 if k < 2 else rng.uniform(-3, 3)
        a = rng.normal(size=(3, 3))
        s = swb.Scene("x y z", p="grows turns")
        s.inertia((a @ a.T + 4 * np.eye(3)).tolist() if k % 2 else np.eye(3).tolist())
        x, y, z = s.q
        grown, turn = s.p[0] * (1 - exp(-s.t)), s.p[1] * s.t
        s.force([grown * cos(turn), grown * sin(turn), -G])
        s.contact("floor", gap=z, tangents=[x, y], mu=mu)
        p = np.array([grows, turns])
        run = s.simulate([0, 0, 0], [0, 0, 0], 3.0, p=p.tolist(), rtol=1e-9, atol=1e-9, sensitivity=True)
        assert run.success and len(run.switches) == 1

        def end(p):
            return s.simulate([0, 0, 0], [0, 0, 0], 3.0, p=p.tolist(), rtol=1e-11, atol=1e-11).x_end

        for j, h in enumerate(1e-4 * np.eye(2)):
            difference = (end(p + h) - end(p - h)) / 2e-4
            assert np.allclose(run.dx_dp[:, j], difference, atol=2e-4 * (1 + np.abs(difference).max())), (k, j)


def quaternion_box(mu, e=0.0):
    """A box with eight corners over a floor."""
    half = [0.2, 0.15, 0.1]
    s = swb.Scene("x y z qw qx qy qz", "vx vy vz wx wy wz")
    _, _, z, qw, qx, qy, qz = s.q
    v, w = s.v[:3], s.v[3:]
    turns = [-qx * w[0] - qy * w[1] - qz * w[2], qw * w[0] + qy * w[2] - qz * w[1]]
    turns += [qw * w[1] + qz * w[0] - qx * w[2], qw * w[2] + qx * w[1] - qy * w[0]]
    s.rates([*v, *(0.5 * r for r in turns)])
    moments = [(half[1] ** 2 + half[2] ** 2) / 3, (half[0] ** 2 + half[2] ** 2) / 3, (half[0] ** 2 + half[1] ** 2) / 3]
    s.inertia([1, 1, 1, *moments])

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    s.force([0, 0, -G, *(-g for g in cross(w, [i * r for i, r in zip(moments, w)]))])
    rows = [[1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qw * qz), 2 * (qx * qz + qw * qy)]]
    rows += [[2 * (qx * qy + qw * qz), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qw * qx)]]
    rows += [[2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx), 1 - 2 * (qx * qx + qy * qy)]]

    def turned(p):
        return [sum(r * c for r, c in zip(row, p)) for row in rows]

    for k in range(8):
        p = [h if k >> i & 1 else -h for i, h in enumerate(half)]
        moved = turned(cross(w, p))
        s.contact(f"c{k}", gap=z + turned(p)[2], tangents=[v[0] + moved[0], v[1] + moved[1]], mu=mu, e=e)
    return s


def test_an_impact_is_unique_where_that_is_proven():
    rng = np.random.default_rng(3)
    rough, smooth = quaternion_box(0.4), quaternion_box(0.0)
    for _ in range(3):
        velocity = [*rng.uniform(-1, 1, 2), -rng.uniform(0.5, 2), 0, 0, 0]
        for s in (rough, smooth):
            run = s.simulate([0, 0, 0.1 + rng.uniform(0.01, 0.1), 1, 0, 0, 0], velocity, 0.2, rtol=1e-6, atol=1e-6)
            corners = [i for i in run.impacts if i.simultaneous]
            # four corners at once, with friction: one solution of many equations was found, not all
            assert corners and not any(i.unique for i in corners)
    for _ in range(30):
        # one corner: all directions of the slide are found
        s = swb.Scene("x y z")
        a = rng.normal(size=(3, 3))
        m = a @ a.T + 4 * np.eye(3)
        s.inertia(m.tolist())
        s.force([0, 0, -G])
        s.contact("floor", gap=s.q[2], tangents=[s.q[0], s.q[1]], mu=rng.uniform(0, 0.8), e=0.3)
        run = s.simulate([0, 0, 0.1], [*rng.uniform(-3, 3, 2), -1], 0.2, rtol=1e-7, atol=1e-7)
        assert run.impacts[0].unique


def test_bodies_that_just_touch():
    rng = np.random.default_rng(4)
    for k in range(30):
        radius, speed, turned = rng.uniform(0.5, 4), rng.uniform(1, 5), rng.uniform(0, 2 * np.pi)
        inside = rng.choice([0.0, 1e-12, 1e-9, -1e-12, -1e-9, 1e-6, -1e-6]) * radius
        side, along = np.array([np.cos(turned), np.sin(turned)]), np.array([-np.sin(turned), np.cos(turned)])
        start = (radius - inside) * side - 0.1 * speed * along
        s = swb.Scene("x y")
        s.force([0, 0])
        gap = sqrt(s.q[0] ** 2 + s.q[1] ** 2) - radius if k % 2 else s.q[0] ** 2 + s.q[1] ** 2 - radius**2
        s.contact("disc", gap=gap)
        run = s.simulate(start.tolist(), (speed * along).tolist(), 0.25)
        assert run.success, run.reason
        # what is taken from a depth δ is a velocity of `v √(2 δ/R)`
        error = 0.25 * speed * np.sqrt(2 * max(abs(inside), 1e-9) / radius) + 1e-6
        assert np.abs(run.x_end[:2] - start - 0.25 * speed * along).max() < error


def test_boxes_dropped_in_space_come_to_rest_on_a_face():
    s = quaternion_box(0.4, e=0.3)
    # with friction and restitution corners stop sliding one after the other: none of them may crawl
    for seed in range(103, 111):
        rng = np.random.default_rng(seed)
        q = rng.normal(size=4)
        v = rng.uniform(-1, 1, 6) * [0.5, 0.5, 0.5, 5, 5, 5]
        run = s.simulate([0, 0, 0.6, *(q / np.linalg.norm(q))], v.tolist(), 2.0, rtol=1e-9, atol=1e-9)
        assert run.success, (seed, run.reason)
        assert run.stats.steps < 3000
        assert np.abs(np.array([0.2, 0.15, 0.1]) - run.x_end[2]).min() < 1e-6, (seed, run.x_end)
        assert np.abs(run.x_end[7:]).max() < 1e-6
