"""The pages of documentation: links between them, links that lead nowhere, references that are complete."""

import importlib.util
import re
import shutil
import subprocess
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
    made = {"gallery/index.md", "api_cpp/annotated.md", *(f"api_{language}/index.md" for language in site.REFERENCES)}
    assert mentioned == {*site.PAGES.values(), *made}
    assert all((ROOT / name).is_file() for name in site.PAGES)
    pages = {f"api_{language}": ["index", "first"] for language in site.REFERENCES} | {"gallery": ["index", "oscillator"]}
    order = site.navigation(pages)
    assert "\n  - Gallery:\n      - gallery/index.md\n      - gallery/oscillator.md\n" in order
    assert "\n      - Reference of C:\n          - api_c/index.md\n          - api_c/first.md\n" in order


def test_the_first_page_begins_with_title_pictures_and_installation():
    text = site.start((ROOT / "README.md").read_text(encoding="utf-8"))
    title, picture, install, program = (text.index(part) for part in ("# Switchback\n", "![", "pip install", "## A first program"))
    assert title == 0 and title < picture < install < program
    assert text.count("![") == (ROOT / "README.md").read_text(encoding="utf-8").count("![")


def test_the_playground_is_on_its_page_and_on_the_first():
    texts = {name: (ROOT / path).read_text(encoding="utf-8") for name, path in (("index.md", "README.md"), ("playground.md", "docs/playground.md"))}
    pages = site.with_playground(texts, True)
    for page in pages.values():
        assert page.count('<div class="swb-playground">') == page.count('src="playground/playground.mjs"') == 1
    assert pages["index.md"].index("swb-playground") < pages["index.md"].index("## A first program")
    without = site.with_playground(texts, False)
    assert "left out" in without["playground.md"] and not any("playground.mjs\"" in page for page in without.values())
    assert without["index.md"] == texts["index.md"]


def test_the_playground_knows_the_functions_it_calls():
    text, functions = script("playground").interface()
    assert "swb_integrator_advance" in functions and "swb_ocp_solve" in functions
    # a field begins at a multiple of its size, and the record ends at one of its largest
    record = {"fields": [{"name": n, "type": {"base": b, "stars": s}} for n, b, s in (("a", "int32_t", 0), ("b", "double", 0), ("c", "double", 1))]}
    assert script("playground").layout(record) == {"size": 24, "fields": {"a": [0, "i32"], "b": [8, "f64"], "c": [16, "i32"]}}
    assert '"REACHED": 0' in text


@pytest.mark.skipif(not shutil.which("node"), reason="there is no node here")
def test_the_language_of_the_playground():
    subprocess.run(["node", "web/test_language.mjs"], cwd=ROOT, check=True)


def test_every_example_has_a_small_picture():
    pages = site.gallery()
    examples = {p.stem for p in (ROOT / "examples" / "python").glob("*.py")}
    assert set(pages) == {"index", *examples}
    assert [e for e in sorted(examples) if f"../pictures/gallery/{e}-" not in pages[e]] == []
    pictures = [*(ROOT / "docs" / "pictures").rglob("*.png")]
    assert [p.name for p in pictures if p.stat().st_size > 60_000] == []
    known = re.compile("|".join(f"{re.escape(e)}-" for e in examples))
    assert [p.name for p in pictures if p.parent.name == "gallery" and not known.match(p.name)] == []


def test_pages_that_teach_have_pictures():
    pages = ("tutorial", "models", "simulation", "scenes", "freezing", "ocp", "nmpc", "mpcc", "model_classes", "fesd", "julia", "rust", "c", "cpp", "limits", "expect")
    named = [ROOT / "docs" / f"{p}.md" for p in pages] + [*(ROOT / "docs" / "howto").glob("*.md")]
    assert [p.name for p in named if "![" not in p.read_text(encoding="utf-8")] == []


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
    (tmp_path / "b.html").write_text('<h2 id="here"></h2><a href="a.html">a</a><script src="https://x.org/y.js"></script>')
    assert site.broken(tmp_path) == ["a.html: b.html#lost", "a.html: c.svg", "b.html needs the network: https://x.org/y.js"]


def test_references_are_complete():
    reference = site.c_reference()
    symbols = (ROOT / "capi_tests" / "abi" / "symbols.txt").read_text().split()
    headings = {h for text in reference.values() for h in re.findall(r"^## (\w+)$", text, re.M)}
    assert sorted({*symbols} - headings) == []
    for page, text in reference.items():
        for target, anchor in re.findall(r"\]\((\w+)\.md#(\w+)\)", text):
            assert target in reference and (anchor in headings or anchor == target), f"{page}: {target}#{anchor}"
    import switchback_control as swb

    python = site.python_reference()
    members = {m for text in python.values() for m in re.findall(r"^        - (\w+)$", text, re.M)}
    named = {n: getattr(swb, n) for n in swb.__all__}
    assert [n for n, thing in named.items() if hasattr(thing, "__qualname__") and thing.__qualname__ not in members] == []
    assert "# Ocp" in python["ocp"] and "- solve" in python["expr"]
    assert "## solve!\n" in site.julia_reference()["ocp"]
    # a page is a page
    assert max(len(t) for pages in (reference, python, site.julia_reference()) for t in pages.values()) < 100_000


def test_the_demo_names_the_pictures_of_each_program(tmp_path, capsys):
    (tmp_path / "old.svg").write_text("of another program")
    show = demo.Demo(tmp_path, 120.0)
    show.run([sys.executable, "-c", "open('new.svg', 'w').write('<svg/>')"], "first", "1/2", tmp_path)
    out = capsys.readouterr().out
    assert show.fine and f"{tmp_path / 'new.svg'}\n" in out and "old.svg" not in out
    show.run([sys.executable, "-c", "1 / 0"], "wrong", "2/2", tmp_path)
    assert not show.fine and "ZeroDivisionError" in capsys.readouterr().out
    assert all(demo.title(demo.EXAMPLES / f"{name}.py") for name in demo.ORDER)


@pytest.mark.parametrize("name", ["CITATION.cff", "CONTRIBUTING.md"])
def test_what_a_stranger_looks_for(name):
    assert (ROOT / name).stat().st_size > 300


def test_docstrings_keep_tables_and_tell_attributes(tmp_path):
    griffe = pytest.importorskip("griffe")
    (tmp_path / "thing.py").write_text(
        'class Thing:\n    """About it.\n\n    t     times\n    long  another\n    """\n\n    #: How many\n    #: there are.\n    n: int\n    t: float | None = None\n    _own: int\n'
    )
    tables = script("site_docstrings").Tables()
    package = griffe.load("thing", search_paths=[str(tmp_path)], extensions=griffe.Extensions(tables))
    told = package["Thing"].docstring.value
    assert "```text\nt     times" in told
    assert "| `n` | `int` | How many there are. |\n| `t` | `float | None` |  |" in told and "_own" not in told
    assert "n" not in package["Thing"].members and "_own" in package["Thing"].members
