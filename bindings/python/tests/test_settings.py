"""Settings: by keyword, attribute, dictionary and object; what is refused, and what the messages say."""

import copy
import json
import pickle

import numpy as np
import pytest

import switchback_control as swb
from models import sides


def test_reading_and_writing():
    s = swb.Settings(n_s=3, cross="stage", tol=1e-9)
    assert (s.n_s, s.cross, s.tol) == (3, "stage", 1e-9)
    s.n_s = np.int64(4)
    s["tol"] = np.float32(0.5)
    s.update(cross=2, polish=True, max_time=10)
    assert (s.n_s, s.tol, s.cross, s.polish, s.max_time) == (4, 0.5, "full", "on", 10.0)
    s.n_s = "2"
    assert s["n_s"] == 2 and isinstance(s.n_s, int) and isinstance(s.tol, float)
    assert set(s.to_dict()) == set(s) == set(swb.options()) and "n_s" in dir(s)
    assert json.loads(s.to_json())["cross"] == "full"
    assert repr(swb.Settings(n_s=4)) == "Settings(n_s=4)" and repr(swb.Settings()) == "Settings()"
    s.validate()


def test_copies():
    s = swb.Settings(n_s=3)
    for other in (s.copy(), copy.copy(s), copy.deepcopy(s), pickle.loads(pickle.dumps(s))):
        assert other == s
        other.n_s = 4
        assert other != s and s.n_s == 3


def test_options():
    o = swb.options()["n_s"]
    assert o.kind == "int" and o.default == swb.Settings().n_s and o.min >= 1 and o.doc and not o.values
    assert swb.options()["cross"].values == ("element", "stage", "full", "point")
    assert all(o.default == getattr(swb.Settings(), o.name) for o in swb.options().values())


@pytest.mark.parametrize(
    "values, kind, message",
    [
        ({"n_ss": 3}, swb.OptionError, "did you mean 'n_s'"),
        ({"crosss": "full"}, swb.OptionError, "did you mean 'cross'"),
        ({"n_ss": None}, swb.OptionError, "did you mean 'n_s'"),
        ({"n_s": 0}, swb.RangeError, "n_s"),
        ({"n_s": 2**70}, swb.ArgumentError, "n_s"),
        ({"n_s": 2.5}, swb.OptionError, "n_s"),
        ({"n_s": None}, swb.ArgumentError, "n_s"),
        ({"n_s": [3]}, swb.ArgumentError, "n_s"),
        ({"tol": float("nan")}, swb.RangeError, "tol"),
        ({"tol": -1.0}, swb.RangeError, "tol"),
        ({"cross": "ful"}, swb.OptionError, "cross"),
        ({"cross": 17}, swb.RangeError, "cross"),
        ({"cross": "fu\0ll"}, swb.ArgumentError, "NUL"),
        ({"cross": "\ud800"}, swb.ArgumentError, "text"),
        ({"": 1}, swb.OptionError, "option"),
    ],
)
def test_refusals(values, kind, message):
    with pytest.raises(kind, match=message) as caught:
        swb.Settings(**values)
    assert isinstance(caught.value, ValueError) and caught.value.status == kind.status or kind is swb.ArgumentError
    for make in (lambda: swb.Simulator(sides(1.0, 2.0), **values), lambda: swb.Ocp(sides(1.0, 2.0), 1.0, 1, values)):
        with pytest.raises(kind, match=message):
            make()
    with swb.Nlp(1, lambda x: x @ x) as nlp, pytest.raises(kind, match=message):
        nlp.set(**values)


def test_attributes_that_are_not_there():
    with pytest.raises(AttributeError, match="did you mean"):
        swb.Settings().n_ss
    assert not hasattr(swb.Settings(), "no_such_option_at_all") and not hasattr(swb.Settings(), "__len__")
    for wrong in (3, "n_s", [1]):
        with pytest.raises(swb.ArgumentError, match="Settings"):
            swb.Nlp(1, lambda x: x @ x, settings=wrong)


def test_keywords_go_over_settings():
    s = swb.Settings(n_s=3, n_fe=4)
    sim = swb.Simulator(sides(1.0, 2.0), s, n_s=2)
    assert (sim.settings.n_s, sim.settings.n_fe, s.n_s) == (2, 4, 3)
