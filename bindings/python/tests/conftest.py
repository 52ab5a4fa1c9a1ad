import gc
import os
import sys

import pytest

os.environ.setdefault("MPLBACKEND", "Agg")
# tests that call make read what it prints, which a make around the tests would add to
for name in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL"):
    os.environ.pop(name, None)
sys.path.insert(0, os.path.dirname(__file__))


@pytest.fixture
def live():
    """Numbers of objects of the library that are not freed, after the garbage was collected."""
    from switchback_control import _call

    def count():
        gc.collect()
        return {kind: n for kind, n in _call.live.items() if n}

    return count


@pytest.fixture(autouse=True)
def nothing_unraisable(monkeypatch):
    """No exception may get lost inside a callback or a finalizer."""
    lost = []
    monkeypatch.setattr(sys, "unraisablehook", lost.append)
    yield
    gc.collect()
    assert not lost, [f"{u.err_msg}: {u.exc_value!r}" for u in lost]
