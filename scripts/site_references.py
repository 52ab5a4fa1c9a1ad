"""The references of the site, a page for each object or module, made of what is in the sources: api.json for C, docstrings for Python and Julia.

That of C++ is made by Doxygen. The reference of C is not: api.json knows shapes, directions, ownership and threads, which comments have in words only.
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tools" / "api"))

from api import Function, Type, load  # noqa: E402

WHOSE = {"new": "yours, free it", "shared": "shared", "exclusive": "exclusive", "freed": "freed"}
#: Where a name of the interface in C is described.
Places = dict[str, str]


def c_reference() -> dict[str, str]:
    """Pages by name: objects with their functions, functions of no object, structs, callbacks, enumerations."""
    api = load((ROOT / "include" / "api.json").read_text(encoding="utf-8"))
    by_length = sorted(api.objects, key=len, reverse=True)
    groups: dict[str, list[Function]] = {name: [] for name in sorted(api.objects)}
    groups["functions"] = []
    for f in api.functions.values():
        groups[next((o for o in by_length if f.name.startswith(o + "_")), "functions")].append(f)
    places: Places = {o: o for o in api.objects}
    places |= {f.name: group for group, functions in groups.items() for f in functions}
    for page, names in (("structs", api.records), ("callbacks", api.callbacks), ("enumerations", api.enums)):
        places |= dict.fromkeys(names, page)
    pages = {}
    for group, functions in groups.items():
        about = linked(places, api.objects[group]) if group in api.objects else "Functions that belong to no object."
        parts = [f"# {group}\n\n{about}\n\n" + table("function", [(f.name, first_sentence(linked(places, f.doc))) for f in functions])]
        pages[group] = "\n".join(parts + [c_function(places, f) for f in functions])
    parts = ["# Structs\n\n" + table("struct", [(r.name, first_sentence(linked(places, r.doc))) for r in api.records.values()])]
    for record in api.records.values():
        rows = [f"| `{declared(f.type)}{f.name}` | {cell(linked(places, f.doc))} |" for f in record.fields]
        parts.append(f"## {record.name}\n\n{linked(places, record.doc)}\n\n| field | |\n|---|---|\n" + "\n".join(rows) + "\n")
    pages["structs"] = "\n".join(parts)
    pages["callbacks"] = "\n".join(["# Callbacks\n"] + [c_function(places, f, callback=True) for f in api.callbacks.values()])
    parts = ["# Enumerations\n\n" + table("enumeration", [(e.name, first_sentence(linked(places, e.doc))) for e in api.enums.values()])]
    for enum in api.enums.values():
        rows = [f"| `{name}` | {value} | {cell(linked(places, doc))} |" for name, value, doc in enum.values]
        parts.append(f"## {enum.name}\n\n{linked(places, enum.doc)}\n\n| name | number | |\n|---|---|---|\n" + "\n".join(rows) + "\n")
    pages["enumerations"] = "\n".join(parts)
    objects = [f"| [{o}]({o}.md) | {cell(first_sentence(linked(places, api.objects[o])))} | {len(groups[o])} |" for o in sorted(api.objects)]
    pages["index"] = (
        "# Reference of C\n\nMade from `include/api.json`. The conventions (status codes, ownership, threads, callbacks) are those at the top of "
        "`switchback.h`. An object that is *shared* may be used by several threads at once. One that is *exclusive* may be used by one.\n\n"
        "| object | | functions |\n|---|---|---|\n" + "\n".join(objects) + "\n\n[Functions that belong to no object](functions.md) · "
        "[structs](structs.md) · [callbacks](callbacks.md) · [enumerations](enumerations.md)\n"
    )
    return pages


def table(what: str, rows: list[tuple[str, str]]) -> str:
    """Names of a page with what they are, in short."""
    return f"| {what} | |\n|---|---|\n" + "\n".join(f"| [{name}](#{name}) | {cell(about)} |" for name, about in rows) + "\n"


def first_sentence(text: str) -> str:
    return re.split(r"(?<=[.:])\s|\n\n|@", text.strip())[0].rstrip(":")


def declared(of: Type) -> str:
    """A type in front of a name, as C has it."""
    const = "const " if of.const else ""
    return f"{const}{of.base} {'*' * of.stars}"


def c_function(places: Places, f: Function, callback: bool = False) -> str:
    arguments = [f"{declared(p.type)}{p.name}" for p in f.parameters]
    head = f"{declared(f.result)}{'(*' + f.name + ')' if callback else f.name}("
    line = head + ", ".join(arguments or ["void"]) + ");"
    if len(line) > 80:
        line = head + "\n    " + ",\n    ".join(arguments) + ");"
    about, _, rest = f.doc.partition("@param")
    rest = rest.partition("@return")[2]
    about, _, early = about.partition("@return")
    returns = " ".join((rest or early).split("@thread")[0].split())
    rows = []
    lengths = {p.length for p in f.parameters}
    for p in f.parameters:
        if p.name in lengths and not p.doc:
            continue  # the shape of its array says it
        notes = [p.direction or "", f"`[{p.shape}]`" if p.shape else "", WHOSE.get(p.object or "", ""), "NULL allowed" if p.nullable else ""]
        rows.append(f"| `{p.name}` | {', '.join(n for n in notes if n)} | {cell(linked(places, p.doc))} |")
    arguments_table = "| argument | | |\n|---|---|---|\n" + "\n".join(rows) + "\n" if any(p.doc or p.shape or p.object for p in f.parameters) else ""
    end = f"\nReturns {linked(places, returns)}\n" if returns else ""
    return f"## {f.name}\n\n```c\n{line}\n```\n\n{linked(places, about.strip())}\n\n{arguments_table}{end}"


def cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def linked(places: Places, text: str) -> str:
    """Names of the interface as links to where they are described; stars and angles as they are."""
    text = re.sub(r"([*<>])", r"\\\1", text)
    return re.sub(r"\bswb_\w+\b", lambda m: f"[{m[0]}]({places[m[0]]}.md#{m[0]})" if m[0] in places else f"`{m[0]}`", text)


def julia_reference() -> dict[str, str]:
    """Docstrings of the package, a page for each file."""
    pages = {}
    for file in sorted((ROOT / "bindings" / "julia" / "src").glob("*.jl")):
        if file.name in ("Lib.jl", "Switchback.jl"):
            continue
        found = []
        text = file.read_text(encoding="utf-8")
        for doc, behind in re.findall(r'^"""\n(.*?)\n"""\n([^\n]*)', text, flags=re.S | re.M):
            head = doc.split("\n\n")[0] if doc.startswith("    ") else ""
            name = re.match(r"(?:mutable struct|struct|abstract type|function|macro|const)?\s*([\w.]+!?)", behind)
            if not name or name[1].startswith("_"):
                continue
            rest = doc[len(head) :].strip().replace("\\\\", "\\").replace('\\"', '"').replace("\\$", "$")
            code = "\n".join(line.removeprefix("    ") for line in head.splitlines())
            found.append((name[1].split(".")[-1], (f"```julia\n{code}\n```\n\n" if code else "") + rest + "\n"))
        if found:
            title = file.stem.replace("_", " ").capitalize()
            pages[file.stem.lower()] = f"# {title}\n\n" + "\n".join(f"## {name}\n\n{about}" for name, about in found)
    titles = [f"| [{text.splitlines()[0][2:]}]({page}.md) | {', '.join(re.findall('^## (.*)', text, flags=re.M))} |" for page, text in pages.items()]
    pages["index"] = (
        "# Reference of Julia\n\nMade from the docstrings of the package. `?` shows them as well.\n\n| page | |\n|---|---|\n" + "\n".join(titles) + "\n"
    )
    return pages


def python_reference() -> dict[str, str]:
    """Pages that mkdocstrings fills: one for each module, with the names of it that the package exports."""
    package = importlib.import_module("switchback_control")
    groups: dict[str, dict[str, list[str]]] = {}
    for name in sorted({*package.__all__} - {"casadi", "expr"}, key=str.lower):
        thing = getattr(package, name)
        if not hasattr(thing, "__qualname__"):
            continue  # a version, a path
        module = thing.__module__.split(".")[-1]
        page = {"_ffi": "enumerations"}.get(module, "other" if module.startswith("_") else module)
        groups.setdefault(page, {}).setdefault(module, []).append(thing.__qualname__)
    for module in ("expr", "casadi", "jax", "torch"):
        source = (ROOT / "bindings" / "python" / "src" / "switchback_control" / f"{module}.py").read_text(encoding="utf-8")
        listed = re.search(r"__all__ = \[(.*?)\]", source, flags=re.S)
        groups[module] = {module: re.findall(r'"(\w+)"', listed[1]) if listed else []}
    pages, rows = {}, []
    for page, modules in sorted(groups.items()):
        parts, links = [f"# {page.capitalize()}\n"], []
        for module, names in modules.items():
            path = f"switchback_control.{module}"
            parts.append(f"::: {path}\n    options:\n      members:" + "".join(f"\n        - {name}" for name in names) + "\n")
            links += [f"[{name}]({page}.md#{path}.{name})" for name in names]
        pages[page] = "\n".join(parts)
        rows.append(f"| [{page}]({page}.md) | {', '.join(links)} |")
    pages["index"] = (
        "# Reference of Python\n\nMade from the docstrings of the package. Names are those of `import switchback_control as swb`. Those of the "
        "modules `casadi`, `jax` and `torch`, and some of `expr`, have the name of their module in front.\n\n| page | names |\n|---|---|\n"
        + "\n".join(rows)
        + "\n"
    )
    return pages
