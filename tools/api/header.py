"""What include/switchback.h declares, read from its text: the second opinion on include/api.json.

The header has a fixed shape (cbindgen writes it), and every function has a description whose `@param` lines say which
way an argument goes, the shape of an array in brackets, and whether NULL is allowed. What cannot be understood is an
error: nothing is passed over in silence. Tests compare with api.json, which other code reads from the sources.
"""

from __future__ import annotations

import re

from api import Api, Callback, Enum, Field, Function, Parameter, Record, Type

COMMENT = r"(?:/\*\*(?P<doc>(?:(?!\*/).)*)\*/\s*)?"
DECLARATIONS = [
    ("enum", r"enum\s+(?P<name>\w+)\s*\{(?P<body>.*?)\}\s*;"),
    ("record", r"typedef\s+struct\s+(?P<name>\w+)\s*\{(?P<body>.*?)\}\s*(?P=name)\s*;"),
    ("object", r"typedef\s+struct\s+(?P<name>\w+)\s+(?P=name)\s*;"),
    ("callback", r"typedef\s+(?P<result>\w+)\s*\(\s*\*\s*(?P<name>\w+)\s*\)\s*\((?P<body>[^()]*)\)\s*;"),
    ("number", r"typedef\s+u?int\d+_t\s+(?P<name>\w+)\s*;"),
    ("function", r"(?:SWB_NODISCARD\s+)?SWB_API\s+(?P<result>[\w\s]+?[\s*]+)(?P<name>swb_\w+)\s*\((?P<body>[^()]*)\)\s*;"),
]


def parse(text: str) -> Api:
    """Everything the header declares, in its order."""
    version = tuple(int(_match(rf"#define SWB_VERSION_{part}\s+(\d+)", text)) for part in ("MAJOR", "MINOR", "PATCH"))
    api = Api(version)
    text = _c99(text)
    place = text.index("/**")  # the first description; comments in front of it are about the file
    while text[place:].strip():
        kind, found = _declaration(text, place)
        doc = _plain(found["doc"] or "")
        _add(api, kind, found, doc)
        place = found.end()
    return api


def _declaration(text: str, place: int) -> tuple[str, re.Match]:
    for kind, pattern in DECLARATIONS:
        found = re.compile(r"\s*" + COMMENT + pattern, flags=re.S).match(text, place)
        if found:
            return kind, found
    raise ValueError(f"not understood: {text[place:place + 200].strip()!r}")


def _add(api: Api, kind: str, found: re.Match, doc: str):
    name = found["name"]
    if kind == "enum":
        values = re.findall(r"(?:/\*\*((?:(?!\*/).)*)\*/\s*)?(\w+)\s*=\s*(-?\d+)", found["body"], flags=re.S)
        api.enums[name] = Enum(name, [(v, int(number), _plain(about)) for about, v, number in values], doc)
    elif kind == "record":
        fields = re.findall(r"(?:/\*\*((?:(?!\*/).)*)\*/\s*)?([^;/]+?)(\w+)\s*;", found["body"], flags=re.S)
        api.records[name] = Record(name, [Field(f, _type(kind), _plain(about)) for about, kind, f in fields], doc)
    elif kind == "object":
        api.objects[name] = doc
    elif kind == "callback":
        api.callbacks[name] = Callback(name, Type(found["result"]), _parameters(found["body"], doc), doc)
    elif kind == "function":
        api.functions[name] = Function(name, _type(found["result"]), _parameters(found["body"], doc), doc)


def _c99(text: str) -> str:
    """Without preprocessor lines; of conditional parts only those of C without fixed enumeration types."""
    lines, skip = [], []
    text = re.sub(r"\\\n", " ", text)
    for line in text.splitlines():
        word = line.split()[:1]
        if word in (["#if"], ["#ifdef"]):
            skip.append(True)
        elif word == ["#ifndef"]:
            skip.append(False)
        elif word == ["#else"]:
            skip[-1] = not skip[-1]
        elif word == ["#endif"]:
            skip.pop()
        elif not any(skip) and not line.startswith("#"):
            lines.append(line)
    return "\n".join(lines)


def _plain(doc: str) -> str:
    """A description without the stars of the comment."""
    lines = [re.sub(r"^\s*\* ?", "", line).rstrip() for line in doc.strip().splitlines()]
    return "\n".join(lines).strip()


def _match(pattern: str, text: str) -> str:
    found = re.search(pattern, text)
    if not found:
        raise ValueError(f"no {pattern} in the header")
    return found[1]


def _type(text: str) -> Type:
    words = text.replace("*", " * ").split()
    base = next(w for w in words if w not in ("*", "const", "struct", "enum"))
    first_star = words.index("*") if "*" in words else len(words)
    return Type(base, words.count("*"), "const" in words[:first_star])


def _parameters(body: str, doc: str) -> list[Parameter]:
    parts = [part.strip() for part in body.replace("\n", " ").split(",")]
    if parts == ["void"]:
        return []
    parameters = []
    for part in parts:
        name = re.search(r"(\w+)$", part)[1]
        parameters.append(Parameter(name, _type(part[: -len(name)])))
    about = _descriptions(doc)
    for p in parameters:
        if p.name in about:
            p.direction, p.shape, p.doc = about.pop(p.name)
            p.nullable = bool(re.search(r"\bNULL\b(?! on failure)|not wanted", p.doc))
            found = re.search(r"\benum (swb_\w+)", p.doc)
            p.enum = found[1] if found else None
    if about:
        raise ValueError(f"descriptions of what is no argument: {', '.join(about)}")
    _find_lengths(parameters)
    return parameters


def _descriptions(doc: str) -> dict[str, tuple[str, str | None, str]]:
    """From `@param[in] name [shape] text`, over several lines."""
    found = {}
    pattern = r"@param\[(in|out)\]\s+(\w+)[ \t]*(.*?)(?=\n\s*@|\n\s*\n|\Z)"
    for direction, name, text in re.findall(pattern, doc, flags=re.S):
        shape = re.match(r"\[([^\]]*)\]\s*", text)
        rest = text[shape.end():] if shape else text
        found[name] = (direction, shape[1] if shape else None, " ".join(rest.split()))
    return found


def _find_lengths(parameters: list[Parameter]):
    """An array is followed by its length: the argument its shape names, or else the next one that is a length."""
    numbers = {p.name for p in parameters if p.type == Type("int64_t")}
    for at, p in enumerate(parameters):
        if p.type.stars == 0 or p.shape is None:
            continue
        behind = [q.name for q in parameters[at + 1:] if q.name in numbers]
        p.length = p.shape if p.shape in numbers else f"n_{p.name}" if f"n_{p.name}" in behind else (behind or [None])[0]
