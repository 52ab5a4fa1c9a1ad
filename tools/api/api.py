"""The C interface as include/api.json describes it: what the bindings, the fuzzer and the reference are made from.

    from api import load
    api = load(Path("include/api.json").read_text(encoding="utf-8"))

`make header` writes the file from the sources in Rust; a test compares it with what the header declares (header.py).
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Type:
    """A C type: a name with any number of `*`. `const` says whether what the first `*` points to is constant."""

    base: str
    stars: int = 0
    const: bool = False


@dataclass
class Parameter:
    """An argument of a function or of a callback."""

    name: str
    type: Type
    #: "in" or "out", as the description says; None if it says nothing (objects, numbers)
    direction: str | None = None
    #: between the brackets of the description, such as "n_lower" or "nx + nu + np + 2"; None if it is no array
    shape: str | None = None
    #: the rest of the description
    doc: str = ""
    #: name of the argument that holds the length of this array; None if there is none
    length: str | None = None
    #: does the description allow NULL?
    nullable: bool = False
    #: the enumeration whose numbers this argument takes or gives, such as "swb_outcome"
    enum: str | None = None
    #: of objects: "new", "shared", "exclusive" or "freed"
    object: str | None = None


@dataclass
class Function:
    name: str
    result: Type
    parameters: list[Parameter]
    doc: str


@dataclass
class Callback:
    """A type of functions that the user supplies."""

    name: str
    result: Type
    parameters: list[Parameter]
    doc: str


@dataclass
class Field:
    name: str
    type: Type
    doc: str


@dataclass
class Record:
    """A struct whose fields are known."""

    name: str
    fields: list[Field]
    doc: str


@dataclass
class Enum:
    name: str
    #: (name, number, description)
    values: list[tuple[str, int, str]]
    doc: str


@dataclass
class Api:
    version: tuple[int, int, int]
    enums: dict[str, Enum] = field(default_factory=dict)
    records: dict[str, Record] = field(default_factory=dict)
    callbacks: dict[str, Callback] = field(default_factory=dict)
    #: opaque types, with their descriptions
    objects: dict[str, str] = field(default_factory=dict)
    functions: dict[str, Function] = field(default_factory=dict)


def load(text: str) -> Api:
    """What the text of api.json says, in its order. Keys that are not known are an error."""
    data = json.loads(text)
    api = Api(tuple(int(part) for part in data["version"].split(".")))
    for e in data["enums"]:
        api.enums[e["name"]] = Enum(e["name"], [(v["name"], v["value"], v["doc"]) for v in e["values"]], e["doc"])
    for o in data["objects"]:
        api.objects[o["name"]] = o["doc"]
    for r in data["records"]:
        fields = [Field(f["name"], _type(f["type"]), f["doc"]) for f in r["fields"]]
        api.records[r["name"]] = Record(r["name"], fields, r["doc"])
    for kind, made, known in (("callbacks", Callback, api.callbacks), ("functions", Function, api.functions)):
        for f in data[kind]:
            parameters = [Parameter(**{**p, "type": _type(p["type"])}) for p in f["parameters"]]
            known[f["name"]] = made(f["name"], _type(f["result"]), parameters, f["doc"])
    return api


def _type(of: dict) -> Type:
    return Type(of["base"], of["stars"], of.get("const", False))
