"""Controllers as units for co-simulation: they are valid, and their controls are those of the library."""

import shutil
import subprocess

import numpy as np
import pytest

import switchback_control as swb

needs_tools = pytest.mark.skipif(not all(map(shutil.which, ("make", "cc", "zip"))), reason="no compiler")


def arm():
    m = swb.Model(states="angle speed", controls="torque", parameters="load", name="arm")
    m.derivatives = [m.speed, m.torque - m.load * swb.sin(m.angle) - 0.1 * m.speed]
    ocp = swb.Ocp(m, 2.0, 20, rk_family="explicit", n_s=4, n_fe=1, params=[1.0], control_bounds=(-1.5, 1.5))
    ocp.add_least_squares(m.function([m.angle, m.speed, m.torque]), [1, 0.1, 0.05], [1.0, 0, 0])
    ocp.add_least_squares(m.function([m.angle, m.speed]), [10, 1], [1.0, 0], at="terminal")
    ocp.set_state_bounds([-2, -0.8], [2, 0.8])
    c = swb.Nmpc(ocp, "rti", shift=True, qp_solver="stagewise")
    c.initialise([0.0, 0.0])
    return m, c


class Two:
    """A unit of FMI 2.0 as its importer sees it."""

    def __init__(self, description, folder, name):
        from fmpy.fmi2 import FMU2Slave

        self._unit = FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier="arm", instanceName=name)
        self._unit.instantiate()
        self.source = 0

    def begin(self, start):
        self._unit.setupExperiment(startTime=start)
        self._unit.enterInitializationMode()
        self._unit.exitInitializationMode()

    def set(self, numbers, values):
        self._unit.setReal(numbers, values)

    def get(self, number):
        return self._unit.getReal([number])[0]

    def get_source(self):
        return self._unit.getInteger([self.source])[0]

    def step(self, t, h):
        self._unit.doStep(t, h)

    def reset(self):
        self._unit.reset()

    def end(self):
        self._unit.terminate()
        self._unit.freeInstance()


class Three(Two):
    """A unit of FMI 3.0."""

    def __init__(self, description, folder, name):
        from fmpy.fmi3 import FMU3Slave

        self._unit = FMU3Slave(guid=description.instantiationToken, unzipDirectory=folder, modelIdentifier="arm", instanceName=name)
        self._unit.instantiate()
        self.source = next(v.valueReference for v in description.modelVariables if v.name == "source")

    def begin(self, start):
        self._unit.enterInitializationMode(startTime=start)
        self._unit.exitInitializationMode()

    def set(self, numbers, values):
        self._unit.setFloat64(numbers, values)

    def get(self, number):
        return self._unit.getFloat64([number])[0]

    def get_source(self):
        return self._unit.getInt32([self.source])[0]


@needs_tools
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("precision, tol", [("double", 1e-9), ("float", 2e-3)])
def test_a_controller_is_a_unit(tmp_path, precision, tol, version):
    fmpy = pytest.importorskip("fmpy")
    from fmpy.validation import validate_fmu

    m, c = arm()
    c.write_c(tmp_path, "arm", precision)
    target, name, kind = ("fmu", "arm.fmu", Two) if version == 2 else ("fmu3", "arm_fmi3.fmu", Three)
    subprocess.run(["make", "-s", target], cwd=tmp_path, check=True)
    path = str(tmp_path / name)
    assert validate_fmu(path) == []
    description = fmpy.read_model_description(path)
    numbers = {v.name: v.valueReference for v in description.modelVariables}
    time = [] if version == 2 else ["time"]
    assert list(numbers) == ["x[1]", "x[2]", "u[1]", *(f"reference_1[{i}]" for i in (1, 2, 3)), "reference_2[1]", "reference_2[2]", "p[1]", "source", *time]
    assert float(description.defaultExperiment.stepSize) == pytest.approx(0.1)
    folder = fmpy.extract(path, str(tmp_path / "unit"))
    unit = kind(description, folder, "arm")
    with pytest.raises(Exception):  # there is one in a process
        kind(description, folder, "two")
    unit.begin(1.0)
    c.set_iterate(c.plan.x, c.plan.u)
    x, plant = np.zeros(2), swb.Integrator(m, rtol=1e-10, atol=1e-12)
    plant.set_params([1.3])
    for k in range(40):
        t = 1.0 + 0.1 * k
        if k == 20:  # another goal, and what is known of the load
            goal = [0.5, 0.0, 0.0]
            c.set_references(0, goal)
            c.set_references(1, goal[:2])
            c.set_params([1.3])
            unit.set([numbers[f"reference_1[{i}]"] for i in (1, 2, 3)] + [numbers["reference_2[1]"], numbers["reference_2[2]"], numbers["p[1]"]], [*goal, *goal[:2], 1.3])
        c.prepare()
        u, info = c.feedback(x)
        unit.set([numbers["x[1]"], numbers["x[2]"]], list(x))
        # two steps of half a sample: there is one sample in them
        unit.step(t, 0.05)
        first = unit.get(numbers["u[1]"])
        unit.step(t + 0.05, 0.05)
        assert unit.get(numbers["u[1]"]) == first == pytest.approx(u[0], abs=tol), k
        assert unit.get_source() == int(info.source)
        plant.set_controls(u)
        plant.reinit(x, 0.0)
        plant.advance(0.1)
        x = plant.state
    # the torque that holds the load has a price
    assert abs(x[0] - 0.5) < 0.1
    unit.reset()
    assert unit.get_source() == int(swb.NmpcSource.PLAN)
    unit.end()


@needs_tools
def test_the_library_of_a_unit_has_the_functions_of_the_standard(tmp_path):
    _, c = arm()
    written = c.write_c(tmp_path, "arm")
    assert all(p.is_file() for p in written) and len(written) == 9
    subprocess.run(["make", "-s", "fmu"], cwd=tmp_path, check=True)
    names = subprocess.run(["unzip", "-Z1", "arm.fmu"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout.split()
    assert {"modelDescription.xml", "binaries/linux64/arm.so", "sources/arm_fmu.c"} <= set(names)
    symbols = subprocess.run(["nm", "-D", "--defined-only", "fmu_parts/binaries/linux64/arm.so"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    found = {s for s in symbols.split() if s.startswith("fmi2")}
    assert len(found) == 34 and {"fmi2Instantiate", "fmi2DoStep", "fmi2GetReal", "fmi2SetReal", "fmi2GetStatus"} <= found
