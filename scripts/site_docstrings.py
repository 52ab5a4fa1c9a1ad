"""For mkdocstrings: tables in docstrings keep their columns, and plain attributes of a class are a table below its docstring."""

import re

from griffe import Attribute, Class, Docstring, Extension, Module, Object

#: Two words of a line with three spaces or more between them: nobody writes prose so.
COLUMNS = re.compile(r"\S {3,}\S")


class Tables(Extension):
    def on_package(self, *, pkg: Module, **_: object) -> None:
        visit(pkg)


def visit(of: Object) -> None:
    if of.docstring:
        of.docstring.value = "\n\n".join(map(kept, of.docstring.value.split("\n\n")))
    if isinstance(of, Class):
        fields(of)
    for member in of.members.values():
        if not member.is_alias:
            visit(member)


def kept(paragraph: str) -> str:
    return f"```text\n{paragraph}\n```" if COLUMNS.search(paragraph) and not paragraph.startswith("    ") else paragraph


def fields(of: Class) -> None:
    """Attributes that have no docstring, with their types and the comments `#:` above them, are told in the docstring of their class."""
    rows = []
    for name, member in list(of.members.items()):
        if name.startswith("_") or not isinstance(member, Attribute) or member.docstring or "property" in member.labels:
            continue
        above, at = [], (member.lineno or 1) - 2
        while at >= 0 and (line := of.lines_collection[of.filepath][at].strip()).startswith("#:"):
            above.insert(0, line[2:].strip())
            at -= 1
        kind = f"`{member.annotation}`" if member.annotation is not None else ""
        rows.append(f"| `{name}` | {kind} | {' '.join(above)} |")
        del of.members[name]
    if rows:
        table = "| attribute | type | |\n|---|---|---|\n" + "\n".join(rows)
        before = of.docstring.value if of.docstring else ""
        of.docstring = Docstring(f"{before}\n\n{table}".strip(), parent=of)
