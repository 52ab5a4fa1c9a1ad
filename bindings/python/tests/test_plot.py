"""Plots: files come out, and wrong arguments are refused."""

import numpy as np
import pytest

import switchback_control as swb
from models import OSCILLATOR_T, OSCILLATOR_X0, oscillator, tutorial
from test_ocp import constrained

plt = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(scope="module")
def result():
    return swb.simulate_fesd(oscillator(), OSCILLATOR_X0, OSCILLATOR_T, 10)


@pytest.mark.parametrize("suffix", ["svg", "png", "pdf"])
def test_files(result, tmp_path, suffix):
    path = tmp_path / f"oscillator.{suffix}"
    result.plot(path, names=["x", "y"], title="Oscillator")
    assert path.stat().st_size > 1000 and not plt.get_fignums()


def test_what_is_in_it(result, tmp_path):
    figure = result.plot()
    assert [a.get_ylabel() for a in figure.axes] == ["states", "step sizes", "modes"]
    plt.close(figure)
    figure = swb.plot(constrained().solve(), states=[0], names=["q"], control_names=["force"])
    assert [a.get_ylabel() for a in figure.axes] == ["states", "control force", "step sizes", "modes"]
    plt.close(figure)
    tutorial().solve().trajectory.plot(str(tmp_path / "tutorial.svg"))
    smooth = swb.simulate_fesd(swb.System(1, 1, f0=lambda x, u: u - x), [0.0], 2.0, 4, u=np.ones((4, 1)))
    figure = smooth.plot(tmp_path / "smooth.svg")
    assert [a.get_ylabel() for a in figure.axes] == ["states", "control $u_{1}$", "step sizes"]


def test_refusals(result):
    for call in (
        lambda: swb.plot(3),
        lambda: swb.plot(result, names=["a"]),
        lambda: swb.plot(result, names=["a", "b", "c"]),
    ):
        with pytest.raises(swb.ArgumentError):
            call()
    plt.close("all")


def test_modes_that_are_not_known_have_no_bands():
    m = swb.Model(states="y v")
    m.derivatives = [m.v, -9.81 - 0.1 * m.v * abs(m.v)]
    landed = m.discrete("landed")
    m.transition(m.y < 0, when={landed: 0}, to={landed: 1})
    falls = swb.simulate(m, {"y": 10, "v": 0}, 1.0)
    lands = swb.simulate(m, {"y": 10, "v": 0}, 100.0, on_step=lambda step: step.x[2] == 1)
    assert falls.active() and not lands.active()
    assert [ax.get_ylabel() for ax in falls.plot().axes] == ["states", "modes"]
    assert [ax.get_ylabel() for ax in lands.plot().axes] == ["states"]
