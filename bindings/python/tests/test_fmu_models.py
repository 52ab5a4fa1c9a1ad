"""Models as functional mock-up units: valid, and with the trajectories of the library, whoever makes the steps."""

import numpy as np
import pytest

import switchback_control as swb

fmpy = pytest.importorskip("fmpy")
from fmpy.validation import validate_fmu  # noqa: E402

KINDS = ["ModelExchange", "CoSimulation"]


def ball():
    m = swb.Model(states="height speed", parameters="bounce", name="bouncing ball")
    m.derivatives = [m.speed, -9.81]
    m.transition(m.height < 0, reset={m.speed: -m.bounce * m.speed, m.height: 0.0})
    return m, [1.0, 0.0], {"params": [0.8]}, 1.9


def stick_slip():
    """A mass on a belt, held by a spring: it sticks and slips."""
    m = swb.Model(states="q v", parameters="belt", name="stick <slip>")
    slip = m.v - m.belt
    m.derivatives = [m.v, -m.q - swb.sign(slip) / (1 + swb.maximum(slip, -slip))]
    return m, [0.0, 0.0], {"params": [0.3]}, 12.0


def thermostat():
    m = swb.Model(states="temperature", controls="outside", name="thermostat")
    heater = m.hysteresis(-m.temperature, on=-19.0, off=-21.0, initial=0, name="heater")
    m.derivatives = [0.2 * (m.outside - m.temperature) + 6.0 * heater, 0]
    return m, [20.0], {"controls": [5.0]}, 9.0


def coupled():
    """Two masses with dry friction on each other and on the ground, pulled: slides on two surfaces."""
    m = swb.Model(states="v w", name="coupled")
    between, ground = 0.6 * swb.sign(m.v - m.w), 0.3 * swb.sign(m.w)
    m.derivatives = [swb.sin(1.3 * m.t) - between, between - ground]
    return m, [0.8, -0.4], {}, 9.0


def clock():
    """A value that is held between the strokes of a clock, and a resonance that it drives."""
    m = swb.Model(states="q v", name="clock")
    held = m.hold(swb.cos(m.t), 0.25, initial=1.0, name="held")
    m.derivatives = [m.v, -m.q + held]
    return m, [0.5, 0.0], {}, 3.1


ALL = [ball, stick_slip, thermostat, coupled, clock]


def write(make, path, version):
    m, x0, data, end = make()
    m.write_fmu(path, x0, version=version, duration=end, rtol=1e-10, atol=1e-12, **data)
    return m, x0, data, end


def reference(m, x0, data, times):
    data = {{"params": "p", "controls": "u"}.get(k, k): v for k, v in data.items()}
    engine = swb.Integrator(m, rtol=1e-12, atol=1e-13)
    if "p" in data:
        engine.set_params(data["p"])
    if "u" in data:
        engine.set_controls(data["u"])
    engine.reinit(x0)
    out = []
    for t in times:
        if t > 0:
            engine.advance(t)
        out.append(np.array(engine.state))
    return np.array(out)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("make", ALL)
def test_units_are_valid(make, version, tmp_path):
    path = tmp_path / "unit.fmu"
    write(make, path, version)
    assert validate_fmu(str(path)) == []


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("make", ALL)
def test_trajectories_are_those_of_the_library(make, kind, version, tmp_path):
    path = tmp_path / "unit.fmu"
    m, x0, data, end = write(make, path, version)
    names = [n or f"x[{i}]" for i, n in enumerate(m.names[0])]
    r = fmpy.simulate_fmu(
        str(path), stop_time=end, output_interval=end / 64, fmi_type=kind, solver="CVode", relative_tolerance=1e-10,
        record_events=False, output=names,
    )
    assert len(r) >= 64 and abs(r["time"][-1] - end) < 1e-9
    expected = reference(m, x0, data, r["time"])
    got = np.column_stack([r[n] for n in names])
    # transitions of the start are made before its values are seen
    got, expected = got[1:], expected[1:]
    assert np.abs(got - expected).max() < (3e-6 if kind == "ModelExchange" else 1e-7)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_inputs_and_start_values(kind, version, tmp_path):
    path = tmp_path / "unit.fmu"
    m, x0, _, end = write(thermostat, path, version)
    signal = np.array([(0.0, 5.0), (4.0, 5.0), (4.0, -5.0), (9.0, -5.0)], dtype=[("time", float), ("outside", float)])
    r = fmpy.simulate_fmu(
        str(path), stop_time=end, output_interval=0.125, fmi_type=kind, solver="CVode", relative_tolerance=1e-10,
        record_events=False, input=signal, start_values={"temperature": 19.5}, output=["temperature", "heater"],
    )
    engine = swb.Integrator(m, rtol=1e-12, atol=1e-13)
    engine.set_controls([5.0])
    engine.reinit([19.5])
    for row in r:
        if row["time"] > 4 >= engine.time:
            engine.advance(4.0)
            engine.set_controls([-5.0])
        if row["time"] > engine.time:
            engine.advance(row["time"])
        assert abs(row["temperature"] - engine.state[0]) < 1e-5, row["time"]


@pytest.mark.parametrize("seed", range(6))
def test_networks_with_friction_slide_as_in_the_library(seed, tmp_path):
    """Masses with dry friction on each other and on the ground, drawn at random: any of the surfaces may slide at a time."""
    draw = np.random.default_rng(seed)
    n = int(draw.integers(2, 4))
    m = swb.Model(states=[f"v{i}" for i in range(n)], name="network")
    force = [draw.uniform(0.5, 2) * swb.sin(draw.uniform(0.5, 2) * m.t + draw.uniform(0, 6)) for _ in range(n)]
    rates = [force[i] - draw.uniform(0.1, 0.5) * swb.sign(m.x[i]) - 0.1 * m.x[i] for i in range(n)]
    for i in range(n - 1):
        f = draw.uniform(0.2, 0.8) * swb.sign(m.x[i] - m.x[i + 1])
        rates[i], rates[i + 1] = rates[i] - f, rates[i + 1] + f
    m.derivatives = rates
    x0 = draw.uniform(-1, 1, n)
    path = m.write_fmu(tmp_path / "network.fmu", x0, version=2 + seed % 2, duration=12.0)
    r = fmpy.simulate_fmu(
        str(path), stop_time=12.0, output_interval=0.2, fmi_type="ModelExchange", solver="CVode", relative_tolerance=1e-10,
        record_events=False, output=[f"v{i}" for i in range(n)],
    )
    expected = reference(m, x0, {}, r["time"])
    assert np.abs(np.column_stack([r[f"v{i}"] for i in range(n)]) - expected).max() < 1e-6


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_an_event_that_stops_ends_the_simulation(kind, version, tmp_path):
    m = swb.Model(states="height speed", name="drop")
    m.derivatives = [m.speed, -9.81]
    m.stop_at(m.height < 0, name="ground")
    path = m.write_fmu(tmp_path / "drop.fmu", [1.0, 0.0], version=version, duration=2.0)
    r = fmpy.simulate_fmu(str(path), stop_time=2.0, output_interval=0.1, fmi_type=kind, solver="CVode", output=["height"])
    assert r["time"][-1] < 0.5 + 1e-9 and abs(np.interp(0.4, r["time"], r["height"]) - (1 - 0.5 * 9.81 * 0.16)) < 0.02


@pytest.mark.parametrize("version", [2, 3])
def test_instances_are_independent_and_begin_anew(version, tmp_path):
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    path = tmp_path / "unit.fmu"
    stick_slip()[0].write_fmu(path, [0.0, 0.3], params=[0.3], version=version)
    d = fmpy.read_model_description(str(path))
    numbers = {v.name: v.valueReference for v in d.modelVariables}
    folder = fmpy.extract(str(path), str(tmp_path / "parts"))
    token = d.guid if version == 2 else d.instantiationToken
    kind = FMU2Slave if version == 2 else FMU3Slave
    units = [kind(guid=token, unzipDirectory=folder, modelIdentifier="unit", instanceName=str(k)) for k in range(2)]

    def begin(unit):
        if version == 2:
            unit.setupExperiment(startTime=0.0)
        unit.enterInitializationMode()
        unit.exitInitializationMode()

    def get(unit, name):
        return (unit.getReal if version == 2 else unit.getFloat64)([numbers[name]])[0]

    def put(unit, name, value):
        (unit.setReal if version == 2 else unit.setFloat64)([numbers[name]], [value])

    for unit in units:
        unit.instantiate()
    put(units[1], "belt", 0.1)
    put(units[1], "q", 0.5)
    put(units[1], "v", 0.1)
    for unit in units:
        begin(unit)
        unit.doStep(0.0, 1.0)
    first = get(units[0], "q")
    assert abs(first - 0.3) < 1e-9 and abs(get(units[1], "q") - 0.6) < 1e-9  # both stick to their belts
    assert abs(get(units[0], "der(q)") - 0.3) < 1e-12 and abs(get(units[0], "der(v)")) < 1e-12
    with pytest.raises(Exception):
        put(units[0], "q", 0.0)
    units[1].reset()
    begin(units[1])
    units[1].doStep(0.0, 1.0)
    assert get(units[1], "q") == first and get(units[1], "belt") == 0.3
    for unit in units:
        unit.terminate()
        unit.freeInstance()
    with pytest.raises(Exception):
        kind(guid="another", unzipDirectory=folder, modelIdentifier="unit", instanceName="other").instantiate()


def test_what_a_unit_cannot_be(tmp_path):
    m, x0, data, _ = ball()
    with pytest.raises(swb.RangeError, match="letters, digits"):
        m.write_fmu(tmp_path / "bouncing ball.fmu", x0, **data)
    with pytest.raises(swb.RangeError, match="version"):
        m.write_fmu(tmp_path / "ball.fmu", x0, version=1, **data)
    with pytest.raises(swb.RangeError, match="duration"):
        m.write_fmu(tmp_path / "ball.fmu", x0, duration=-1.0, **data)
    with pytest.raises(swb.DimensionError):
        m.write_fmu(tmp_path / "ball.fmu", [1.0], **data)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_accumulating_events_end_with_a_message(kind, version, tmp_path):
    path = tmp_path / "ball.fmu"
    write(ball, path, version)
    messages = []

    def note(*given):
        messages.append(given[-1])

    with pytest.raises(Exception):
        fmpy.simulate_fmu(str(path), stop_time=6.0, output_interval=0.1, fmi_type=kind, solver="CVode", relative_tolerance=1e-8, logger=note)
    text = b" ".join(m if isinstance(m, bytes) else str(m).encode() for m in messages)
    assert b"accumulate" in text or b"shorter than rounding" in text
