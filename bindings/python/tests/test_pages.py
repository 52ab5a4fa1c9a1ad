"""The pages of documentation that are recipes run, with the numbers in their comments; what the page of limits says is refused is refused."""

import re
from pathlib import Path

import pytest
import switchback_control as swb

DOCS = Path(__file__).resolve().parents[3] / "docs"
RECIPES = sorted(DOCS.glob("howto/*.md"))
pytestmark = pytest.mark.skipif(not RECIPES, reason="no pages here")


def numbers(text):
    """Numbers of a text; three dots after one leave the rest of it open."""
    return re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?(?:\.\.\.)?", text)


def claims(block):
    """What the comments behind `print` say, in their order."""
    return [m[1] for m in re.finditer(r"print\(.*\)  # (.*)", block)]


@pytest.mark.parametrize("page", RECIPES, ids=lambda p: p.stem)
def test_recipes_run(page, tmp_path, monkeypatch, capsys):
    plt = pytest.importorskip("matplotlib.pyplot")
    pytest.importorskip("scipy")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": page.stem}
    said = 0
    for block in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.S):
        exec(compile(block, str(page), "exec"), names)
        out = capsys.readouterr().out
        printed = numbers(out)
        for claim in claims(block):
            said += 1
            for number in numbers(claim):
                whole = number.removesuffix("...")
                found = any(p.startswith(whole) for p in printed) if number.endswith("...") else whole in printed
                assert found, f"'{claim}' is said, printed is '{out}'"
            for word in ("True", "False", "local_optimum"):
                assert word not in claim or word in out
    plt.close("all")
    assert said >= 3
    assert (tmp_path / f"{page.stem}.png").is_file()


def refused(make, *errors):
    with pytest.raises(errors or swb.UnsupportedError):
        make()


def test_limits_of_models():
    m = swb.Model(states="q v")
    m.derivatives = [m.v, 0]
    m.transition(abs(m.q) > 1, reset={m.v: swb.clip(m.v, -1, 1)})
    refused(m.system)
    t = swb.Model(states="q")
    t.derivatives = [1]
    t.transition(t.q > 1, reset={t.q: 0})
    assert swb.simulate_fesd(t, [0], 2, 10).success
    ocp = swb.Ocp(swb.Model.from_json(t.to_json()), horizon=1, n_stages=2, initial_state=[0])
    refused(lambda: swb.Nmpc(ocp, "rti"), swb.SwitchbackError)  # it has no controls
    t.stop_at(t.q > 0.9)
    refused(lambda: swb.simulate_fesd(t, [0], 2, 10))


def test_limits_of_contacts():
    s = swb.Scene("y")
    s.force([-9.81])
    s.contact("floor", gap=s.q[0] + swb.sign(s.q[0]))
    refused(s.system, swb.SwitchbackError)
    s = swb.Scene("y")
    s.force([-9.81])
    s.contact("floor", gap=s.q[0], e=0.5)
    refused(lambda: s.simulate([-1.0], [0.0], 1.0), swb.SwitchbackError)
    refused(lambda: swb.simulate_fesd(s.system(), [1.0, 0.0], 1.0, 10), swb.SwitchbackError)
    f = swb.Scene("x y", u="u")
    f.force([f.u[0], -9.81])
    f.contact("floor", gap=f.q[1], tangents=[f.q[0]], mu=0.5, e=0.5)
    refused(lambda: f.freeze(step=0.1, speed=4.0), swb.SwitchbackError)


@pytest.mark.parametrize("language", ["c", "cpp"])
def test_the_program_in_a_page_is_the_one_that_is_compiled(language):
    page = (DOCS / f"{language}.md").read_text(encoding="utf-8")
    program = (DOCS.parent / "capi_tests" / f"test_{language}_page.{language}").read_text(encoding="utf-8")
    assert f"```{language}\n{program}```" in page
