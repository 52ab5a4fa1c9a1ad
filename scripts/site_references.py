"""The references of the site, made of what is in the sources: api.json for C, comments for C++, docstrings for Python and Julia."""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tools" / "api"))

from api import Api, Function, Type, load  # noqa: E402

WHOSE = {"new": "yours, free it", "shared": "shared", "exclusive": "exclusive", "freed": "freed"}


def c_reference() -> str:
    """Objects with their functions, functions of no object, structs, callbacks, enumerations."""
    api = load((ROOT / "include" / "api.json").read_text(encoding="utf-8"))
    by_length = sorted(api.objects, key=len, reverse=True)
    groups: dict[str, list[Function]] = {}
    for f in api.functions.values():
        own = next((o for o in by_length if f.name.startswith(o + "_")), "")
        groups.setdefault(own, []).append(f)
    contents = ", ".join(f"[{o}](#{o})" for o in sorted(groups) if o)
    parts = [
        "# Reference of C\n\nMade from `include/api.json`; the conventions (status codes, ownership, threads, callbacks) are those at the top of "
        "`switchback.h`. An object that is *shared* may be used by several threads at once, one that is *exclusive* by one.\n\n"
        f"Objects: {contents}. [Other functions](#other-functions), [structs](#structs), [callbacks](#callbacks), "
        "[enumerations](#enumerations).\n"
    ]
    for group in sorted(groups, key=lambda g: (not g, g)):
        parts.append(f"## {group or 'Other functions'}\n\n{linked(api, api.objects.get(group, ''))}\n")
        parts += [c_function(api, f) for f in groups[group]]
    parts.append("## Structs\n")
    for record in api.records.values():
        rows = [f"| `{declared(api, f.type)}{f.name}` | {cell(linked(api, f.doc))} |" for f in record.fields]
        parts.append(f"### {record.name}\n\n{linked(api, record.doc)}\n\n| field | |\n|---|---|\n" + "\n".join(rows) + "\n")
    parts.append("## Callbacks\n")
    parts += [c_function(api, f, callback=True) for f in api.callbacks.values()]
    parts.append("## Enumerations\n")
    for enum in api.enums.values():
        rows = [f"| `{name}` | {value} | {cell(linked(api, doc))} |" for name, value, doc in enum.values]
        parts.append(f"### {enum.name}\n\n{linked(api, enum.doc)}\n\n| name | number | |\n|---|---|---|\n" + "\n".join(rows) + "\n")
    return "\n".join(parts)


def declared(api: Api, of: Type) -> str:
    """A type in front of a name, as C has it."""
    const = "const " if of.const else ""
    return f"{const}{of.base} {'*' * of.stars}"


def c_function(api: Api, f: Function, callback: bool = False) -> str:
    arguments = [f"{declared(api, p.type)}{p.name}" for p in f.parameters]
    head = f"{declared(api, f.result)}{'(*' + f.name + ')' if callback else f.name}("
    line = head + ", ".join(arguments or ["void"]) + ");"
    if len(line) > 110:
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
        rows.append(f"| `{p.name}` | {', '.join(n for n in notes if n)} | {cell(linked(api, p.doc))} |")
    table = "| argument | | |\n|---|---|---|\n" + "\n".join(rows) + "\n" if any(p.doc or p.shape or p.object for p in f.parameters) else ""
    end = f"\nReturns {linked(api, returns)}\n" if returns else ""
    return f"### {f.name}\n\n```c\n{line}\n```\n\n{linked(api, about.strip())}\n\n{table}{end}"


def cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def linked(api: Api, text: str) -> str:
    """Names of the interface as links to where they are described; stars and angles as they are."""
    text = re.sub(r"([*<>])", r"\\\1", text)
    known = {*api.functions, *api.records, *api.callbacks, *api.enums, *api.objects}
    return re.sub(r"\bswb_\w+\b", lambda m: f"[{m[0]}](#{m[0]})" if m[0] in known else f"`{m[0]}`", text)


def cpp_reference() -> str:
    """Classes of the headers with the comments of their public members."""
    parts = ["# Reference of C++\n\nMade from the comments of the header-only interface; everything is in the namespace `swb`.\n"]
    for name in ("switchback.hpp", "switchback_expr.hpp"):
        parts.append(f"## {name}\n")
        text = (ROOT / "include" / name).read_text(encoding="utf-8")
        first = re.match(r"/\*(.*?)\*/", text, flags=re.S)
        parts.append(re.sub(r"\n \* ?", "\n", first[1]).strip() + "\n" if first else "")
        text = re.sub(r"namespace detail \{.*?\n\}(?: // namespace detail)?\n", "", text, flags=re.S)
        for about, kind, title, body in re.findall(r"((?:^/// ?[^\n]*\n)+)(class|struct) (\w+)[^\n;]*\{\n(.*?)^\};", text, flags=re.S | re.M):
            parts.append(f"### swb::{title}\n\n{plain(about)}\n")
            parts += [f"```cpp\n{declaration}\n```\n\n{doc}\n" for declaration, doc in members(body, kind == "struct")]
    return "\n".join(parts)


def plain(comment: str) -> str:
    return re.sub(r"^\s*/// ?", "", comment, flags=re.M).strip()


def members(body: str, public: bool) -> list[tuple[str, str]]:
    """Public declarations of a class with their comments; those without one are named as well."""
    found, about, lines = [], [], body.splitlines()
    at = 0
    while at < len(lines):
        line = lines[at]
        at += 1
        if re.match(r"(public|private|protected):", line):
            public, about = line.startswith("public"), []
        elif line.startswith("    ///"):
            about.append(line)
        elif public and re.match(r"    [\w~]", line):
            declaration = [line[4:]]
            while not re.search(r"[{;]\s*$|\}\s*$|[{;]", declaration[-1]) and at < len(lines):
                declaration.append(lines[at][4:])
                at += 1
            whole = "\n".join(declaration)
            whole = re.split(r"\s*\{|\n?\s*:\s+(?=\w+[({])|;", whole)[0].rstrip()
            if "(" in whole and not whole.startswith(("using ", "friend ", "static_assert")):
                found.append((whole + ";", plain("\n".join(about))))
            about = []
        else:
            about = about if line.startswith("     ") else []
    return found


def julia_reference() -> str:
    """Docstrings of the package, file by file."""
    parts = ["# Reference of Julia\n\nMade from the docstrings of the package; they are shown by `?` as well.\n"]
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
            found.append(f"### {name[1].split('.')[-1]}\n\n" + (f"```julia\n{code}\n```\n\n" if code else "") + rest + "\n")
        if found:
            parts.append(f"## {file.stem.replace('_', ' ').capitalize()}\n")
            parts += found
    return "\n".join(parts)


def signature(f: object) -> str:
    try:
        text = str(inspect.signature(f))
    except (TypeError, ValueError):
        return "(...)"
    return re.sub(r"'([^']*)'", r"\1", text)


def python_reference() -> str:
    """Classes and functions of the package from their docstrings."""
    swb = importlib.import_module("switchback_control")
    parts = ["# Reference of Python\n\nMade from the docstrings of the package.\n"]
    for name in sorted(swb.__all__, key=str.lower):
        thing = getattr(swb, name)
        if inspect.ismodule(thing):
            continue
        text = inspect.getdoc(thing) or ""
        if inspect.isclass(thing):
            parts.append(f"## {name}\n\n```text\n{text}\n```\n")
            for method, member in vars(thing).items():
                function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
                if method.startswith("_") or not (inspect.isfunction(function) and inspect.getdoc(function)):
                    continue
                call = "" if isinstance(member, property) else signature(function).replace("(self, ", "(").replace("(self)", "()")
                parts.append(f"**{name}.{method}**`{call or ' '}`\n\n{inspect.getdoc(function)}\n")
        elif callable(thing):
            parts.append(f"## {name}\n\n`{name}{signature(thing)}`\n\n```text\n{text}\n```\n")
        else:
            parts.append(f"## {name}\n\nA {type(thing).__name__}.\n")
    return "\n".join(parts)
