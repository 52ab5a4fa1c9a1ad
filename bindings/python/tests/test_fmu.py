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


@needs_tools
@pytest.mark.parametrize("precision, tol", [("double", 1e-9), ("float", 2e-3)])
def test_a_controller_is_a_unit(tmp_path, precision, tol):
    pytest.importorskip("fmpy.fmi2")
    import fmpy
    from fmpy.fmi2 import FMU2Slave
    from fmpy.validation import validate_fmu

    m, c = arm()
    c.write_c(tmp_path, "arm", precision)
    subprocess.run(["make", "-s", "fmu"], cwd=tmp_path, check=True)
    path = str(tmp_path / "arm.fmu")
    assert validate_fmu(path) == []
    description = fmpy.read_model_description(path)
    numbers = {v.name: v.valueReference for v in description.modelVariables}
    assert list(numbers) == ["x[1]", "x[2]", "u[1]", *(f"reference_1[{i}]" for i in (1, 2, 3)), "reference_2[1]", "reference_2[2]", "p[1]", "source"]
    assert float(description.defaultExperiment.stepSize) == pytest.approx(0.1)
    unit = FMU2Slave(guid=description.guid, unzipDirectory=fmpy.extract(path, str(tmp_path / "unit")), modelIdentifier="arm", instanceName="arm")
    unit.instantiate()
    with pytest.raises(Exception):  # there is one in a process
        FMU2Slave(guid=description.guid, unzipDirectory=str(tmp_path / "unit"), modelIdentifier="arm", instanceName="two").instantiate()
    unit.setupExperiment(startTime=1.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
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
            unit.setReal([numbers[f"reference_1[{i}]"] for i in (1, 2, 3)] + [numbers["reference_2[1]"], numbers["reference_2[2]"], numbers["p[1]"]], [*goal, *goal[:2], 1.3])
        c.prepare()
        u, info = c.feedback(x)
        unit.setReal([numbers["x[1]"], numbers["x[2]"]], list(x))
        # two steps of half a sample: there is one sample in them
        unit.doStep(t, 0.05)
        first = unit.getReal([numbers["u[1]"]])[0]
        unit.doStep(t + 0.05, 0.05)
        assert unit.getReal([numbers["u[1]"]])[0] == first == pytest.approx(u[0], abs=tol), k
        assert unit.getInteger([0])[0] == int(info.source)
        plant.set_controls(u)
        plant.reinit(x, 0.0)
        plant.advance(0.1)
        x = plant.state
    # the torque that holds the load has a price
    assert abs(x[0] - 0.5) < 0.1
    unit.reset()
    assert unit.getInteger([0])[0] == int(swb.NmpcSource.PLAN)
    unit.terminate()
    unit.freeInstance()


@needs_tools
def test_the_library_of_a_unit_has_the_functions_of_the_standard(tmp_path):
    _, c = arm()
    written = c.write_c(tmp_path, "arm")
    assert all(p.is_file() for p in written) and len(written) == 7
    subprocess.run(["make", "-s", "fmu"], cwd=tmp_path, check=True)
    names = subprocess.run(["unzip", "-Z1", "arm.fmu"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout.split()
    assert {"modelDescription.xml", "binaries/linux64/arm.so", "sources/arm_fmu.c"} <= set(names)
    symbols = subprocess.run(["nm", "-D", "--defined-only", "fmu_parts/binaries/linux64/arm.so"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    found = {s for s in symbols.split() if s.startswith("fmi2")}
    assert len(found) == 34 and {"fmi2Instantiate", "fmi2DoStep", "fmi2GetReal", "fmi2SetReal", "fmi2GetStatus"} <= found
