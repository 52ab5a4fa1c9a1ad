"""usage: site.py FOLDER    write the documentation as web pages into FOLDER/site, with MkDocs, without a network

Pages are those of docs but the log, the READMEs, a gallery of the examples with pictures and code, and references of the interfaces (site_references.py; that of
Rust is what `cargo doc` writes). Links to files that are no pages become plain text. Exits with 1 where a link of a page leads nowhere.
"""

import html.parser
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urldefrag

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from site_references import c_reference, cpp_reference, julia_reference, python_reference  # noqa: E402

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
        for folder in ("benchmarks", "dev", "dev/algorithms")
        for p in sorted((ROOT / "docs" / folder).glob("*.md"))
    },
}

NAVIGATION = """
  - Start: index.md
  - Overview: overview.md
  - Tutorial:
      - First hour: tutorial.md
      - Gallery: gallery.md
  - How to:
      - State a model: models.md
      - Simulate: simulation.md
      - Model mechanics with contacts: scenes.md
      - Solve optimal control problems: ocp.md
      - Control in real time: nmpc.md
      - Solve programs with complementarity constraints: mpcc.md
      - Use time-freezing: freezing.md
      - Come from other packages: coming_from.md
  - Reference:
      - Solutions of optimal control: ocp_results.md
      - Options: options.md
      - Errors: errors.md
      - Python: python.md
      - Reference of Python: api_python.md
      - Reference of C: api_c.md
      - Reference of C++: api_cpp.md
      - Julia: julia.md
      - Reference of Julia: api_julia.md
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
      - Model predictive control: benchmarks/nmpc.md
      - Contraction of real-time iterations: benchmarks/nmpc_contraction.md
      - Quadratic programs of control: benchmarks/nmpc_qp.md
      - Linear algebra: benchmarks/linalg.md
      - Evaluation of models: benchmarks/model-eval.md
      - Calls from Python: benchmarks/python.md
  - For maintainers:
      - Overview: dev/README.md
      - Architecture: dev/architecture.md
      - Modes from expressions: dev/algorithms/models.md
      - Event-driven simulation: dev/algorithms/events.md
      - Derivatives: dev/algorithms/derivatives.md
      - Accumulating switches: dev/algorithms/accumulation.md
      - Contacts: dev/algorithms/contacts.md
      - Time stepping: dev/algorithms/time_stepping.md
      - Time-freezing: dev/algorithms/time_freezing.md
      - Finite elements: dev/algorithms/fesd.md
      - Interior point: dev/algorithms/interior_point.md
      - Complementarity constraints: dev/algorithms/mpcc.md
      - Mode sequences: dev/algorithms/mode_search.md
      - Transitions: dev/algorithms/transitions.md
      - Contacts in optimal control: dev/algorithms/contact_search.md
      - Verdict and descent: dev/algorithms/verdict.md
      - Real-time control: dev/algorithms/nmpc.md
      - Memory: dev/algorithms/memory.md
      - Contributing: contributing.md
      - Changes: changelog.md
      - Fuzzing: fuzz.md
"""

#: Nothing is cut off at the right.
STYLE = """
.wy-nav-content { max-width: 1100px; }
.rst-content pre code, .rst-content pre { white-space: pre-wrap; }
.wy-table-responsive table td, .wy-table-responsive table th, .rst-content table td { white-space: normal !important; }
.rst-content img { max-height: 640px; width: auto; }
"""

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


def gallery(target: Path) -> str:
    """The examples: pictures, and code in Python, C and Julia."""
    parts = [
        "# Gallery\n\nRun them with `python examples/python/NAME.py FOLDER`; `make examples` runs all of them and those in C. Pictures that "
        "are missing here are drawn there.\n"
    ]
    pictures = [*(ROOT / "out").glob("*.svg"), *(ROOT / "docs").rglob("*.svg")]
    (target / "gallery").mkdir()
    for script in sorted((ROOT / "examples" / "python").glob("*.py")):
        code = script.read_text(encoding="utf-8")
        first, _, rest = code.split('"""')[1].partition("\n\n")
        about = rest.split("usage:")[0].strip()
        parts.append(f"## {script.stem.replace('_', ' ')}\n\n{' '.join(first.split())}\n\n```text\n{about}\n```\n")
        stems = (f"python_{script.stem}", script.stem, f"{script.stem}-", f"gallery-{script.stem.replace('_', '-')}")
        for picture in [p for p in pictures if p.stem.startswith(stems)][:2]:
            shutil.copyfile(picture, target / "gallery" / picture.name)
            parts.append(f"![{script.stem}](gallery/{picture.name})\n")
        parts.append(f"<details markdown><summary>Python</summary>\n\n```python\n{code}\n```\n\n</details>\n")
        for language, other in (("C", ROOT / "examples" / "c" / f"{script.stem}.c"), ("Julia", ROOT / "bindings" / "julia" / "examples" / f"{script.stem}.jl")):
            if other.is_file():
                own = other.read_text(encoding="utf-8")
                parts.append(f"<details markdown><summary>{language}</summary>\n\n```{language.lower()}\n{own}\n```\n\n</details>\n")
    return "\n".join(parts)


class Links(html.parser.HTMLParser):
    """Addresses that a page mentions, and the names it has for others."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        for key, value in attributes:
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
        for address in links.addresses:
            path, anchor = urldefrag(address)
            if re.match(r"[a-z]+:", address) or address.startswith("//"):
                continue
            place = page if not path else (page.parent / unquote(path.split("?")[0])).resolve()
            place = place / "index.html" if place.is_dir() else place
            if not place.exists() or (anchor and place in pages and anchor not in pages[place].anchors):
                found.append(f"{page.relative_to(site)}: {address}")
    return sorted(set(found))


def rust_reference(folder: Path, site: Path) -> None:
    """The pages of cargo doc, where there is a cargo; without them the page about Rust says how to make them."""
    cargo = shutil.which(os.environ.get("CARGO", "cargo"))
    if not cargo:
        print("left out: reference of Rust: there is no cargo here")
        return
    target = Path(os.environ.get("CARGO_TARGET_DIR") or ROOT / "target")
    subprocess.run([cargo, "doc", "--quiet", "--no-deps", "--lib"], cwd=ROOT, check=True)
    shutil.copytree(target / "doc", site / "rust_api")
    page = site / "rust.html"
    page.write_text(page.read_text(encoding="utf-8").replace("RUST_API", "rust_api/switchback/index.html"), encoding="utf-8")


def main() -> int:
    folder = Path(sys.argv[1]).resolve()
    source, site = folder / "site_source", folder / "site"
    for old in (source, site):
        shutil.rmtree(old, ignore_errors=True)
    source.mkdir(parents=True)
    for picture in (ROOT / "docs").rglob("*.svg"):
        place = source / picture.relative_to(ROOT / "docs")
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(picture, place)
    for name, target in PAGES.items():
        place = source / target
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(rewritten((ROOT / name).read_text(encoding="utf-8"), ROOT / name, target), encoding="utf-8")
    references = {"c": c_reference, "cpp": cpp_reference, "julia": julia_reference, "python": python_reference}
    for language, reference in references.items():
        (source / f"api_{language}.md").write_text(reference(), encoding="utf-8")
    (source / "gallery.md").write_text(gallery(source), encoding="utf-8")
    (source / "wide.css").write_text(STYLE, encoding="utf-8")
    settings = folder / "mkdocs.yml"
    settings.write_text(
        f"site_name: switchback\ndocs_dir: {source}\nsite_dir: {site}\nuse_directory_urls: false\n"
        "theme:\n  name: readthedocs\n  highlightjs: false\n  include_homepage_in_sidebar: false\n"
        "extra_css: [wide.css]\n"
        "markdown_extensions: [md_in_html, tables, fenced_code, toc]\nplugins: [search]\n"
        f"nav:{NAVIGATION}",
        encoding="utf-8",
    )
    subprocess.run([sys.executable, "-m", "mkdocs", "build", "--quiet", "--config-file", str(settings)], check=True)
    rust_reference(folder, site)
    lost = broken(site)
    print("\n".join(f"broken link: {b}" for b in lost))
    print(f"{len(list(site.rglob('*.html')))} pages: {site / 'index.html'}")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
