"""The pages of documentation: links between them, links that lead nowhere, references that are complete."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]



def script(name):
    spec = importlib.util.spec_from_file_location(f"{name}_script", ROOT / "scripts" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


site, demo = script("site"), script("demo")


def test_every_page_is_in_the_navigation():
    mentioned = set(re.findall(r"[\w/-]+\.md", site.NAVIGATION))
    assert mentioned == {*site.PAGES.values(), "gallery.md", *(f"api_{language}.md" for language in ("c", "cpp", "julia", "python"))}
    assert all((ROOT / name).is_file() for name in site.PAGES)


def test_links_of_all_documents_lead_to_files():
    for name in site.PAGES:
        source = ROOT / name
        for _, label, address in site.LINK.findall(source.read_text(encoding="utf-8")):
            path = address.split("#")[0]
            if path and "://" not in path:
                assert (source.parent / path).exists(), f"{name}: [{label}]({address})"


def test_links_are_rewritten():
    source = ROOT / "bindings" / "python" / "README.md"
    text = "[a](../../docs/simulation.md#tolerances) [b](../../src/lib.rs) [c](https://x.org) [d](#own)"
    assert site.rewritten(text, source, "python.md") == "[a](simulation.md#tolerances) b [c](https://x.org) [d](#own)"
    picture = "![p](benchmarks/sliding-ocp-steps-fesd.svg)"
    assert site.rewritten(picture, ROOT / "docs" / "fesd.md", "fesd.md") == picture


def test_broken_links_are_found(tmp_path):
    (tmp_path / "a.html").write_text('<a href="b.html#here">b</a><img src="c.svg"><a href="b.html#lost">b</a><a href="http://x.org">x</a>')
    (tmp_path / "b.html").write_text('<h2 id="here"></h2><a href="a.html">a</a>')
    assert site.broken(tmp_path) == ["a.html: b.html#lost", "a.html: c.svg"]


def test_references_are_complete():
    reference = site.c_reference()
    symbols = (ROOT / "capi_tests" / "abi" / "symbols.txt").read_text().split()
    missing = [s for s in symbols if f"### {s}\n" not in reference]
    assert not missing
    import switchback_control as swb

    python = site.python_reference()
    named = [n for n in swb.__all__ if not inspect_module(getattr(swb, n))]
    assert [n for n in named if f"## {n}\n" not in python] == []
    assert "Ocp.set_lagrange" in python and "```" in python


def test_the_demo_names_the_pictures_of_each_program(tmp_path, capsys):
    (tmp_path / "old.svg").write_text("of another program")
    show = demo.Demo(tmp_path, 120.0)
    show.run([sys.executable, "-c", "open('new.svg', 'w').write('<svg/>')"], "first", "1/2", tmp_path)
    out = capsys.readouterr().out
    assert show.fine and f"{tmp_path / 'new.svg'}\n" in out and "old.svg" not in out
    show.run([sys.executable, "-c", "1 / 0"], "wrong", "2/2", tmp_path)
    assert not show.fine and "ZeroDivisionError" in capsys.readouterr().out
    assert all(demo.title(demo.EXAMPLES / f"{name}.py") for name in demo.ORDER)


def inspect_module(thing):
    return type(thing).__name__ == "module"


@pytest.mark.parametrize("name", ["CITATION.cff", "CONTRIBUTING.md"])
def test_what_a_stranger_looks_for(name):
    assert (ROOT / name).stat().st_size > 300
