"""Checks the prose of the pages and of the texts of options and errors.

usage: prose.py [--table]

A page has sentences of at most 40 words, on average at most 20, and no words that `docs/words.tsv` lists. Code, headings and pictures are no
sentences. A cell of a table is a text of its own; it counts for the longest sentence and not for the mean. Texts of options
(`crates/switchback-mpcc/src/settings/options.toml`) and of errors (`docs/errors.md`) are shown alone: none is a question or begins with a word that refers to
something before it. Entries of `CHANGELOG.md` have at most 15 words. `docs/dev/log/` is a record and is not checked. `--table` prints the
mean and the longest sentence of every page.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LONGEST = 40
MEAN = 20.0
CHANGE = 15
DANGLING = re.compile(r"(What|Which|Whether|Where|Whose|Who|Of|Those|The same|The one|The ones|It|They|This|These|That|As)\b")
PAGES = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "fuzz/README.md", "crates/*/README.md", "bindings/*/README.md", "docs/*.md", "docs/dev/*.md", "docs/dev/algorithms/*.md", "docs/benchmarks/*.md"]
#: Ends of a word with a full stop that end no sentence.
ABBREVIATIONS = re.compile(r"\b(e\.g|i\.e|etc|vs|cf|ch|eq|Eq|Fig|no|Dr|al|p|pp|Ch|[A-Z])\.$")


def words_to_avoid() -> list[tuple[re.Pattern[str], str, str]]:
    """Words that are not used: a pattern, the word as it is listed, and what is written instead."""
    rows = []
    for line in (ROOT / "docs" / "words.tsv").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            word, instead = line.split("\t")
            rows.append((re.compile(rf"\b(?:{word})\b", re.IGNORECASE), word, instead))
    return rows


def plain(text: str) -> str:
    """A text without mark-up: code and formulas are one word, links are their labels."""
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", " ", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"``.+?``|`[^`]+`", "CODE", text)
    text = re.sub(r"<[^>]+>", " ", text)
    return re.sub(r"\s+", " ", re.sub(r"[*_]{1,2}(\S[^*_]*?)[*_]{1,2}", r"\1", text)).strip()


def sentences(text: str) -> list[str]:
    """The sentences of a plain text."""
    found, start = [], 0
    for end in re.finditer(r"[.!?][\"')]*(?=\s+[^\sa-z]|\s*$)", text):
        if ABBREVIATIONS.search(text[start : end.start() + 1]):
            continue
        found.append(text[start : end.end()].strip())
        start = end.end()
    return [s for s in [*found, text[start:].strip()] if s]


def words(sentence: str) -> int:
    """The number of words; signs between words and numbers in formulas are none."""
    return sum(bool(re.search(r"[^\W_]", w)) for w in sentence.split())


def texts(page: str) -> tuple[list[str], list[str]]:
    """Paragraphs and items of lists, and cells of tables of a page."""
    blocks: list[str] = []
    cells: list[str] = []
    fenced = fresh = False
    for line in page.splitlines():
        stripped = line.strip()
        if stripped.startswith("```"):
            fenced, fresh = not fenced, True
            continue
        if fenced:
            continue
        if stripped.startswith("|"):
            fresh = True
            if not re.fullmatch(r"[|:\s-]+", stripped):
                cells += [c.strip() for c in re.split(r"(?<!\\)\|", stripped.strip("|")) if c.strip()]
        elif not stripped or stripped.startswith(("#", "<!--")):
            fresh = True
        else:
            item = re.match(r"(?:[-*+]|\d+\.)\s+", stripped)
            if fresh or item or not blocks:
                blocks.append(stripped[item.end() :] if item else stripped)
            else:
                blocks[-1] += " " + stripped
            fresh = False
    return [plain(b) for b in blocks], [plain(c) for c in cells]


def of_page(page: str) -> tuple[float, int, list[str]]:
    """Mean and largest number of words of the sentences of a page, and those that are too long."""
    blocks, cells = texts(page)
    counted = [(words(s), s) for b in blocks for s in sentences(b)]
    counted = [c for c in counted if c[0] > 0]
    in_cells = [(words(s), s) for c in cells for s in sentences(c)]
    mean = sum(n for n, _ in counted) / max(1, len(counted))
    return mean, max([n for n, _ in counted + in_cells], default=0), [s for n, s in counted + in_cells if n > LONGEST]


def avoided(page: str, avoid: list[tuple[re.Pattern[str], str, str]]) -> list[str]:
    blocks, cells = texts(page)
    found = []
    for text in blocks + cells:
        for pattern, _, instead in avoid:
            for match in pattern.finditer(text):
                around = text[max(0, match.start() - 30) : match.end() + 30]
                found.append(f"'{match[0]}' in '...{around}...': {instead}")
    return found


def alone(text: str) -> str | None:
    """Why a text that is shown alone cannot be understood alone."""
    for place, sentence in enumerate(sentences(plain(text))):
        if sentence.endswith("?"):
            return "is a question"
        if place == 0 and (begins := DANGLING.match(sentence)):
            return f"begins with '{begins[0]}'"
        if words(sentence) > LONGEST:
            return f"has a sentence of {words(sentence)} words"
    return None


def option_texts() -> list[tuple[str, str]]:
    """Name and text of every option and of every value of an enumeration. Read by lines: the file is ours, and old interpreters have no TOML."""
    found, name, table = [], "", ""
    for line in (ROOT / "crates/switchback-mpcc/src/settings/options.toml").read_text(encoding="utf-8").splitlines():
        if head := re.match(r"\[\[(\w+)\]\]", line):
            table = head[1]
        elif entry := re.match(r'name = "(.*)"', line):
            name = entry[1]
        elif entry := re.match(r'text = "(.*)"', line):
            found.append((f"{table} {name}", entry[1]))
        elif table in ("enum", "view") and (entry := re.match(r'\s+\["(\w+)",(?: "[^"]*", "[^"]*",)? "(.*)"\],', line)):
            found.append((f"{'value' if table == 'enum' else 'constant'} {entry[1]} of {name}", entry[2]))
    return found


def error_texts() -> list[tuple[str, str]]:
    """Cells of the tables of status codes and outcomes."""
    rows = [r for r in (ROOT / "docs" / "errors.md").read_text(encoding="utf-8").splitlines() if re.match(r"\| -?\d", r)]
    return [(cells[2], c.strip()) for r in rows for cells in [r.split("|")] for c in cells[3:-1] if c.strip()]


def of_changes(text: str) -> list[str]:
    """Entries of the changelog that are more than a short line."""
    entries = [line[2:] for line in text.splitlines() if line.startswith("- ")]
    found = [f"an entry of {words(plain(e))} words: '{plain(e)[:60]}...'" for e in entries if words(plain(e)) > CHANGE]
    return found + [f"a line that is no entry: '{line[:60]}'" for line in text.split("\n## ", 1)[-1].splitlines() if line.startswith("  ")]


def self_check() -> None:
    assert sentences("One. Two of 3.5 words, e.g. this. Of A. Author (2023).") == ["One.", "Two of 3.5 words, e.g. this.", "Of A. Author (2023)."]
    assert plain("a [link](b.md#c) of `x = 1` and **bold** ![p](q.svg)") == "a link of CODE and bold"
    assert texts("# H\n\none\ntwo\n- three\n  four\n\n| a | b |\n|---|---|\n```\ncode\n```\nlast") == (["one two", "three four", "last"], ["a", "b"])
    assert of_page("One two. Word" + " word" * 41)[1:] == (42, ["Word" + " word" * 41])
    assert words("x = 1 and CODE - y") == 5
    assert alone("What it does.") and alone("Is it?") and alone("The same with the square.") and not alone("Tolerance of the error.")
    rule = [(re.compile(r"\b(?:rungs?)\b", re.IGNORECASE), "rungs?", "homotopy step")]
    assert avoided("The rung, and `rung`.", rule) == ["'rung' in '...The rung, and CODE....': homotopy step"]
    assert of_changes("# C\n\n## 1\n\n- short\n- " + "w " * 16) and not of_changes("# C\n\n## 1\n\n- short")


def main() -> int:
    self_check()
    avoid = words_to_avoid()
    wrong: list[str] = []
    table = []
    for name in sorted({p for pattern in PAGES for p in ROOT.glob(pattern)}):
        page = name.read_text(encoding="utf-8")
        shown = name.relative_to(ROOT)
        mean, longest, long = of_page(page)
        table.append((str(shown), mean, longest))
        wrong += [f"{shown}: {words(s)} words: {s}" for s in long]
        if mean > MEAN:
            wrong.append(f"{shown}: {mean:.1f} words in a sentence on average, at most {MEAN:.0f} are wanted")
        wrong += [f"{shown}: {a}" for a in avoided(page, avoid)]
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    wrong += [f"CHANGELOG.md: {c}" for c in of_changes(changes) + avoided(changes, avoid)]
    for place, text in option_texts() + error_texts():
        why = alone(text)
        wrong += [f"{place}: {why}: '{text}'"] if why else []
        wrong += [f"{place}: {a}" for a in avoided(text, avoid)]
    if "--table" in sys.argv:
        print("\n".join(f"{name:45} {mean:5.1f} {longest:4}" for name, mean, longest in table))
    print("\n".join(wrong) if wrong else "the prose of all pages is as wanted")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
