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
