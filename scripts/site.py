"""usage: site.py FOLDER    write the documentation as web pages into FOLDER/site, with MkDocs, without a network

Pages are those of docs but the log, the READMEs, a gallery of the examples with pictures and code, and references of the interfaces:
site_references.py, Doxygen for C++, `cargo doc` for Rust. Links to files that are no pages become plain text. What the pages look like is in site.yml
and site_files. Exits with 1 where a link of a page leads nowhere, or where a page needs the network.
"""

import html.parser
import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path
from urllib.parse import unquote, urldefrag

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from site_references import c_reference, julia_reference, python_reference  # noqa: E402

# Sources of pages, and where they are in the site.
PAGES = {
    "README.md": "index.md",
    "bindings/python/README.md": "python.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "fuzz/README.md": "fuzz.md",
    **{f"docs/{p.name}": p.name for p in sorted((ROOT / "docs").glob("*.md"))},
    "docs/README.md": "overview.md",
    **{
        f"docs/{folder}/{p.name}": f"{folder}/{p.name}"
        for folder in ("benchmarks", "dev", "dev/algorithms", "howto")
        for p in sorted((ROOT / "docs" / folder).glob("*.md"))
    },
}

NAVIGATION = """
  - Start:
      - Switchback: index.md
      - Overview: overview.md
      - First hour: tutorial.md
      - Playground: playground.md
      - What to expect: expect.md
      - Limits: limits.md
  - Gallery: gallery/index.md
  - How to:
      - State a model: models.md
      - Simulate: simulation.md
      - Model mechanics with contacts: scenes.md
      - Solve optimal control problems: ocp.md
      - Control in real time: nmpc.md
      - Solve programs with complementarity constraints: mpcc.md
      - Solve problems of AMPL, Pyomo and JuMP: ampl.md
      - Use time-freezing: freezing.md
      - Come from other packages: coming_from.md
      - Recipes:
          - On/off controls: howto/choices.md
          - Pulse width modulation: howto/pwm.md
          - Sampled controllers: howto/sampled.md
          - Controllers on microcontrollers: howto/microcontroller.md
          - Models in other simulators: howto/fmu.md
          - Moving horizon estimation: howto/moving_horizon.md
          - Terminal events: howto/events.md
          - Circuits with algebraic equations: howto/algebraic.md
          - Data as inputs: howto/data.md
          - Estimation of parameters: howto/estimation.md
          - A leg that hops: howto/leg.md
          - An arm that touches: howto/arm.md
          - Bodies in space: howto/space.md
          - Bodies that touch each other: howto/shapes.md
  - Reference:
      - Solutions of optimal control: ocp_results.md
      - Options: options.md
      - Errors: errors.md
      - Platforms: platforms.md
      - Python: python.md
      - Reference of Python: api_python/index.md
      - C: c.md
      - Reference of C: api_c/index.md
      - C++: cpp.md
      - Reference of C++: api_cpp/annotated.md
      - Julia: julia.md
      - Reference of Julia: api_julia/index.md
      - Rust: rust.md
      - Glossary: glossary.md
  - Explanation:
      - Which model class is my system: model_classes.md
      - Event-driven simulation: simulation_method.md
      - Finite elements with switch detection: fesd.md
      - Search for optimal controls: ocp_search.md
      - Contacts in optimal control: contact_search.md
      - Methods for complementarity constraints: mpcc_method.md
      - Real-time iterations: nmpc_method.md
  - Benchmarks:
      - Overview: benchmarks/README.md
      - Simulation: benchmarks/simulation.md
      - Programs: benchmarks/mpcc.md
      - Scenes in optimal control: benchmarks/jumps.md
      - Paired comparisons: benchmarks/paired.md
      - Ingredients by tasks: benchmarks/matrix.md
      - A control problem of every pair: benchmarks/pairs.md
      - Model predictive control: benchmarks/nmpc.md
      - Contraction of real-time iterations: benchmarks/nmpc_contraction.md
      - Quadratic programs of control: benchmarks/nmpc_qp.md
      - Quadratic programs of long horizons: benchmarks/nmpc_horizon.md
      - Bounds that cannot be met: benchmarks/nmpc_infeasible.md
      - Bounds on the changes of a feedback: benchmarks/nmpc_bounded.md
      - Controllers and estimators as C files: benchmarks/nmpc_c.md
      - Feedback for systems that switch: benchmarks/nmpc_switching.md
      - Feedback through contacts: benchmarks/nmpc_contacts.md
      - Linear algebra: benchmarks/linalg.md
      - Evaluation of models: benchmarks/model-eval.md
      - Robots in optimal control: benchmarks/robots.md
      - Bodies in space: benchmarks/space.md
      - Calls from Python: benchmarks/python.md
  - For maintainers:
      - Overview: dev/README.md
      - Architecture: dev/architecture.md
      - Modes from expressions: dev/algorithms/models.md
      - Inner problems: dev/algorithms/inner.md
      - Event-driven simulation: dev/algorithms/events.md
      - Events of single units: dev/algorithms/calendar.md
      - Derivatives: dev/algorithms/derivatives.md
      - Accumulating switches: dev/algorithms/accumulation.md
      - Contacts: dev/algorithms/contacts.md
      - Time stepping: dev/algorithms/time_stepping.md
      - Time-freezing: dev/algorithms/time_freezing.md
      - Finite elements: dev/algorithms/fesd.md
      - Interior point: dev/algorithms/interior_point.md
      - Complementarity constraints: dev/algorithms/mpcc.md
      - The search for a sequence: dev/algorithms/search.md
      - Controls that choose: dev/algorithms/choices.md
      - Mode sequences: dev/algorithms/mode_search.md
      - Descents on simulations: dev/algorithms/descents.md
      - Contacts in optimal control: dev/algorithms/contact_search.md
      - Verdict and descent: dev/algorithms/verdict.md
      - Real-time control: dev/algorithms/nmpc.md
      - Memory: dev/algorithms/memory.md
      - Collections of programs: dev/collections.md
      - Contributing: contributing.md
      - Changes: changelog.md
      - Fuzzing: fuzz.md
"""

#: Made by site_references.py, pages by name.
REFERENCES = {"c": c_reference, "julia": julia_reference, "python": python_reference}

LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")


def rewritten(text: str, source: Path, target: str) -> str:
    """A page with links between files of the repository turned into links between pages."""

    def link(match: re.Match[str]) -> str:
        picture, label, address = match.groups()
        path, anchor = urldefrag(address)
        if "://" in address or not path:
            return match[0]
        found = os.path.normpath(source.parent / unquote(path))
        try:
            name = str(Path(found).relative_to(ROOT))
        except ValueError:
            return label
        if name in PAGES:
            place = os.path.relpath(PAGES[name], os.path.dirname(target) or ".")
            return f"{picture}[{label}]({place}{'#' + anchor if anchor else ''})"
        if picture and name.startswith("docs/") and Path(found).is_file():
            place = os.path.relpath(name[len("docs/") :], os.path.dirname(target) or ".")
            return f"![{label}]({place})"
        return label

    return LINK.sub(link, text)


def start(text: str) -> str:
    """The README with its title first, then its pictures, then the command that installs."""
    pictures = re.search(r"\n(\|[^\n]*\n\|[-|]+\n\|[^\n]*!\[[^\n]*\n)", text)
    drawn = pictures[1] if pictures else ""
    text = text.replace(drawn, "", 1)
    return re.sub(r"\A(```\n.*?\n```\n)\n(# [^\n]*\n)", lambda m: f"{m[2]}\n{drawn}\n{m[1]}", text, flags=re.S)


#: What a page needs that has a playground, and what stands in its place where the module was not built (see playground.py).
PLAYGROUND = '\n\n<link rel="stylesheet" href="playground/playground.css">\n<script type="module" src="playground/playground.mjs"></script>\n'
LEFT_OUT = "The playground was left out when these pages were made: there was no compiler for WebAssembly."
PLACE = re.compile(r'<div class="swb-playground">.*?</div>\n', re.S)


def with_playground(texts: dict[str, str], built: bool) -> dict[str, str]:
    """The pages with the playground: its own, and the first one in front of the first program."""
    page = texts["playground.md"]
    place = PLACE.search(page)[0]
    first = re.sub(r"^(?=## A first program$)", lambda _: f"## Try it\n\n{place}\n[What can be written](playground.md)\n\n", texts["index.md"], count=1, flags=re.M)
    if built:
        return texts | {"playground.md": page + PLAYGROUND, "index.md": first + PLAYGROUND}
    return texts | {"playground.md": page.replace(place, f"{LEFT_OUT}\n")}


def gallery() -> dict[str, str]:
    """A page for every example: pictures, and code in Python, C and Julia. The first page has a picture of each."""
    kept = ROOT / "docs" / "pictures" / "gallery"
    pages, tiles = {}, []
    for script in sorted((ROOT / "examples" / "python").glob("*.py")):
        code, name = script.read_text(encoding="utf-8"), script.stem.replace("_", " ")
        first, _, rest = code.split('"""')[1].partition("\n\n")
        about, pictures = rest.split("usage:")[0].strip(), sorted(kept.glob(f"{script.stem}-*.png"))
        parts = [f"---\nsearch:\n  boost: 0.3\n---\n\n# {name.capitalize()}\n\n{' '.join(first.split())}\n\n" + (f"```text\n{about}\n```\n" if about else "")]
        parts += [f"![{name}](../pictures/gallery/{picture.name})\n" for picture in pictures]
        parts.append(f"`python examples/python/{script.name} FOLDER` draws this.\n\n```python\n{code}\n```\n")
        for language, other in (("C", ROOT / "examples" / "c" / f"{script.stem}.c"), ("Julia", ROOT / "bindings" / "julia" / "examples" / f"{script.stem}.jl")):
            if other.is_file():
                parts.append(f'??? example "{language}"\n\n{indented(language.lower(), other.read_text(encoding="utf-8"))}')
        pages[script.stem] = "\n".join(parts)
        picture = f"![{name}](../pictures/gallery/{pictures[0].name})" if pictures else ""
        tiles.append(f"-   [{picture}<br>**{name}**]({script.stem}.md)<br>{' '.join(first.split())}\n")
    head = "---\nhide: [toc]\n---\n\n# Gallery\n\nEvery example is a program that runs. `make examples` runs all of them, and those in C.\n\n"
    return {"index": f"{head}<div class=\"grid cards\" markdown>\n\n" + "\n".join(tiles) + "\n</div>\n", **pages}


def indented(language: str, code: str) -> str:
    return textwrap.indent(f"```{language}\n{code}\n```\n", "    ")


class Links(html.parser.HTMLParser):
    """Addresses that a page mentions, and the names it has for others."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.anchors: set[str] = set()
        #: What is loaded with the page from elsewhere.
        self.fetched: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        loads = tag in ("script", "img", "iframe") or (tag == "link" and dict(attributes).get("rel") in ("stylesheet", "preconnect", "icon"))
        for key, value in attributes:
            if loads and key in ("href", "src") and value and re.match(r"https?:|//", value):
                self.fetched.append(value)
            if key in ("href", "src") and value:
                self.addresses.append(value)
            if key in ("id", "name") and value:
                self.anchors.add(value)


def broken(site: Path) -> list[str]:
    """Links within the site that lead nowhere."""
    pages = {}
    for page in site.rglob("*.html"):
        pages[page] = Links()
        pages[page].feed(page.read_text(encoding="utf-8"))
    found = []
    for page, links in pages.items():
        # cargo doc looks at its own links
        if page.name == "404.html" or page.is_relative_to(site / "rust_api"):
            continue
        found += [f"{page.relative_to(site)} needs the network: {address}" for address in links.fetched]
        for address in links.addresses:
            path, anchor = urldefrag(address)
            if re.match(r"[a-z]+:", address) or address.startswith("//"):
                continue
            place = page if not path else (page.parent / unquote(path.split("?")[0])).resolve()
            place = place / "index.html" if place.is_dir() else place
            if not place.exists() or (anchor and place in pages and anchor not in pages[place].anchors):
                found.append(f"{page.relative_to(site)}: {address}")
    return sorted(set(found))


def rust_reference(site: Path) -> None:
    """The pages of cargo doc, where there is a cargo; without them the page about Rust says so."""
    cargo = shutil.which(os.environ.get("CARGO", "cargo"))
    page = site / "rust.html"
    text = page.read_text(encoding="utf-8")
    if cargo:
        target = Path(os.environ.get("CARGO_TARGET_DIR") or ROOT / "target")
        subprocess.run([cargo, "doc", "--quiet", "--no-deps"], cwd=ROOT, check=True)
        shutil.copytree(target / "doc", site / "rust_api")
        text = text.replace("RUST_API", "rust_api/switchback/index.html")
    else:
        print("left out: reference of Rust: there is no cargo here")
        text = re.sub(r'<a href="RUST_API">.*?</a>', "left out", text)
    page.write_text(text, encoding="utf-8")


def navigation(pages: dict[str, list[str]]) -> str:
    """NAVIGATION with all pages of a folder that is made here below the first one."""

    def expand(match: re.Match[str]) -> str:
        space, title, folder = match.groups()
        return f"{space}- {title}:\n" + "\n".join(f"{space}    - {folder}/{page}.md" for page in ["index", *(p for p in pages[folder] if p != "index")])

    return re.sub(r"^( *)- ([^:]+): (api_\w+|gallery)/index\.md$", expand, NAVIGATION, flags=re.M)


def main() -> int:
    folder = Path(sys.argv[1]).resolve()
    source, site = folder / "site_source", folder / "site"
    for old in (source, site):
        shutil.rmtree(old, ignore_errors=True)
    shutil.copytree(ROOT / "scripts" / "site_files", source)
    shutil.copytree(folder / "katex", source / "katex")
    for picture in [p for p in (ROOT / "docs").rglob("*") if p.suffix in (".svg", ".png")]:
        place = source / picture.relative_to(ROOT / "docs")
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(picture, place)
    texts = {target: rewritten((ROOT / name).read_text(encoding="utf-8"), ROOT / name, target) for name, target in PAGES.items()}
    texts["index.md"] = start(texts["index.md"])
    module = folder / "playground"
    built = (module / "switchback.wasm").is_file()
    if built:
        shutil.copytree(module, source / "playground")
    texts = with_playground(texts, built)
    made = {"gallery": gallery(), **{f"api_{language}": reference() for language, reference in REFERENCES.items()}}
    texts |= {f"{place}/{name}.md": text for place, pages in made.items() for name, text in pages.items()}
    for target, text in texts.items():
        (source / target).parent.mkdir(parents=True, exist_ok=True)
        (source / target).write_text(text, encoding="utf-8")
    settings = folder / "mkdocs.yml"
    order = navigation({place: list(pages) for place, pages in made.items()})
    settings.write_text(f"INHERIT: {ROOT / 'scripts' / 'site.yml'}\ndocs_dir: {source}\nsite_dir: {site}\nnav:{order}", encoding="utf-8")
    places = {
        "SITE_PYTHON": ROOT / "bindings" / "python" / "src",
        "SITE_DOCSTRINGS": ROOT / "scripts" / "site_docstrings.py",
        "SITE_INCLUDE": ROOT / "include",
    }
    environment = {**os.environ, **{name: str(place) for name, place in places.items()}, "NO_MKDOCS_2_WARNING": "1"}
    subprocess.run([sys.executable, "-m", "mkdocs", "build", "--quiet", "--config-file", str(settings)], check=True, env=environment)
    rust_reference(site)
    lost = broken(site)
    print("\n".join(f"broken link: {b}" for b in lost))
    size = sum(f.stat().st_size for f in site.rglob("*") if f.is_file())
    print(f"{len(list(site.rglob('*.html')))} pages, {size / 1e6:.1f} MB: {site / 'index.html'}")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
