"""Write the table of all functions of the interface that the fuzzer draws calls from.

usage: gen_table.py INTERFACE OUTPUT
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tools" / "api"))

from api import Api, Function, Parameter, Type, load  # noqa: E402

ELEMENTS = {"double": "E_DOUBLE", "int64_t": "E_INT64", "int32_t": "E_INT32", "int8_t": "E_INT8", "char": "E_CHAR"}
NUMBERS = {"int64_t": ("A_INT64", "i"), "int32_t": ("A_INT32", "i"), "uint64_t": ("A_UINT64", "i"), "double": ("A_DOUBLE", "d")}
RESULTS = {"swb_status": "R_STATUS", "void": "R_NOTHING"}


def argument(api: Api, function: Function, at: int) -> tuple[str, str]:
    """Initialiser of a struct argument, and how the value is passed."""
    p = function.parameters[at]
    kind, of, passed = kind_of(api, function, p)
    names = [q.name for q in function.parameters]
    length = names.index(p.length) if p.length else -1
    enum = list(api.enums).index(p.enum) if p.enum in api.enums else -1
    fields = [f'"{p.name}"', kind, of, str(length), str(enum), str(int(p.nullable)), str(int(p.type.const))]
    return f"{{{', '.join(fields)}}}", f"({declared(api, p.type)})v[{at}].{passed}"


def kind_of(api: Api, function: Function, p: Parameter) -> tuple[str, str, str]:
    base, stars = p.type.base, p.type.stars
    if base in api.objects:
        pointers = "A_HANDLE" if stars == 1 else "A_HANDLES" if p.shape else "A_NEW_HANDLE"
        return pointers, f"T_{base}", "p"
    if base in api.callbacks:
        return "A_CALLBACK", f"C_{base}", "f"
    if base in api.records:
        return "A_RECORD_IN" if p.type.const else "A_RECORD_OUT", f"S_{base}", "p"
    if base == "void" and stars == 1:
        return "A_USER_DATA", "0", "p"
    if stars == 0:
        kind, passed = NUMBERS[base]
        if any(q.length == p.name for q in function.parameters):
            kind = "A_LENGTH"
        if p.name == "struct_size":
            kind = "A_STRUCT_SIZE"
        return kind, "0", passed
    if base == "char" and p.type.const:
        return "A_TEXT" if stars == 1 else "A_TEXTS", "0", "p"
    if stars == 1 and base in ELEMENTS:
        return "A_ARRAY_IN" if p.type.const else "A_ARRAY_OUT", ELEMENTS[base], "p"
    raise ValueError(f"{function.name}: the fuzzer cannot draw {p.name} of type {p.type}")


def declared(api: Api, of: Type) -> str:
    base = f"struct {of.base}" if of.base in api.objects or of.base in api.records else of.base
    pointers = "const *" if of.stars == 2 and of.const else "*" * of.stars
    # Elements of an array of handles are constant, those of an array of texts too: as the header has it.
    if of.stars == 2 and of.base == "char":
        return "const char *const *"
    if of.stars == 2 and of.const:
        return f"const {base} *const *"
    return f"{'const ' if of.const else ''}{base} {pointers}".strip()


def thunk(api: Api, function: Function, passed: list[str]) -> list[str]:
    # A handle array in the header may be `struct x *const *`: C converts from `struct x **` by itself.
    call = f"{function.name}({', '.join(passed)})"
    body = {"R_STATUS": f"return {call};", "R_NOTHING": f"{call};\n    return 0;", "R_NUMBER": f"return {call};"}
    body["R_TEXT"] = f"return (int64_t)(intptr_t){call};"
    used = "" if passed else "    (void)v;\n"
    return [f"static int64_t call_{function.name}(const union value *v)", f"{{\n{used}    {body[result_of(function)]}\n}}"]


def result_of(function: Function) -> str:
    if function.result.stars:
        return "R_TEXT"
    return RESULTS.get(function.result.base, "R_NUMBER")


def number(names, prefix: str, end: str) -> str:
    return "enum { " + ", ".join([f"{prefix}{name}" for name in names] + [end]) + " };"


def generate(text: str) -> str:
    api = load(text)
    out = ["/* Made from api.json by gen_table.py. */"]
    out += ["#ifdef API_TABLE_NUMBERS"]
    out += [number(api.objects, "T_", "N_TYPES"), number(api.functions, "F_", "N_FUNCTIONS")]
    out += [number(api.callbacks, "C_", "N_CALLBACKS"), number(api.records, "S_", "N_RECORDS")]
    out += [number(api.enums, "E_", "N_ENUMS"), "#else"]
    out += ["const char *const type_names[] = {" + ", ".join(f'"{name}"' for name in api.objects) + "};"]
    out += ["const size_t record_sizes[] = {" + ", ".join(f"sizeof(struct {name})" for name in api.records) + "};"]
    sized = [str(int(r.fields[0].name == "struct_size")) for r in api.records.values()]
    out += ["const int record_sized[] = {" + ", ".join(sized) + "};"]
    for name, enum in api.enums.items():
        out += [f"static const int64_t values_{name}[] = {{{', '.join(str(v) for _, v, _ in enum.values)}}};"]
    out += ["const struct enumeration enums[] = {"]
    out += [f'    {{"{n}", values_{n}, {len(e.values)}}},' for n, e in api.enums.items()] + ["};"]
    frees, interrupts = {}, {}
    for f in api.functions.values():
        arguments = [argument(api, f, at) for at in range(len(f.parameters))]
        out += thunk(api, f, [passed for _, passed in arguments])
        if arguments:
            fields = ",\n    ".join(a for a, _ in arguments)
            out += [f"static const struct argument arguments_{f.name}[] = {{\n    {fields}}};"]
        for ending, table in (("_free", frees), ("_interrupt", interrupts)):
            if f.name.endswith(ending):
                table[f.name.removesuffix(ending)] = f.name
    out += ["const struct function functions[] = {"]
    for f in api.functions.values():
        arguments = f"arguments_{f.name}" if f.parameters else "NULL"
        out += [f'    {{"{f.name}", {result_of(f)}, {len(f.parameters)}, {arguments}, call_{f.name}}},']
    out += ["};"]
    for table, name in ((frees, "free_functions"), (interrupts, "interrupt_functions")):
        numbers = [f"F_{table[t]}" if t in table else "-1" for t in api.objects]
        out += [f"const int {name}[] = {{{', '.join(numbers)}}};"]
    return "\n".join(out + ["#endif", ""])


def main(arguments: list[str]) -> int:
    interface, output = arguments
    Path(output).write_text(generate(Path(interface).read_text(encoding="utf-8")), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
