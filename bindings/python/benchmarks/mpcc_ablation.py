"""What the parts of the solver for programs with complementarity pairs are worth: each switched off in turn.

usage: mpcc_ablation.py [--list] [--variants REGEX] [--out DIR] [options of mpcc_train.py]
       mpcc_ablation.py --page [--random FILE ...] [--out DIR]

Runs the problems of mpcc_train.py with the defaults beside IPOPT's homotopy, then once for each variant, and writes
mpcc.md, its plots and its data to the folder (by default docs/benchmarks). `--page` writes page and plots again from
the data that is there; `--random` first takes over what `mpcc_train.py --json FILE` wrote about random problems, once for
each mode of IPOPT.

Variants are made from the table of options: every value of an enumeration, or of an integer between 0 and 1, that is
not the default; and those of NUMBERS. Options of discretisations, which these problems do not have, are left out, and
so are variants that the library does not know.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
import textwrap
from pathlib import Path
from typing import Any

import numpy as np

import mpcc_compare
import mpcc_growth
import mpcc_ipopt
import mpcc_profile
import mpcc_train
from mpcc_problems import ROOT, collection

ELSEWHERE = {
    "rk_family", "n_s", "n_fe", "discretisation", "stage_form", "cross", "step_equilibration", "rho_h", "gamma_h",
    "initial_guess", "log_level", "linear_solver", "ordering", "accuracy", "dcs_form", "integration", "zeno", "ambiguity",
    "dense", "sensitivity", "adjoint", "explain", "ocp_start",
}  # fmt: skip

NUMBERS: list[tuple[str, dict[str, str]]] = [
    ("relaxation falls linearly", {"sigma_exponent": "1"}),
    ("relaxation falls by 10", {"sigma_factor": "0.1", "sigma_exponent": "1"}),
    ("first relaxation 0.1", {"sigma_init": "0.1"}),
    ("first relaxation 10", {"sigma_init": "10"}),
    ("barrier = relaxation", {"mu_over_sigma": "1"}),
    ("barrier = 0.01 relaxation", {"mu_over_sigma": "0.01"}),
    ("no rung is taken back", {"sigma_retries": "0"}),
    ("no second-order corrections", {"max_soc": "0"}),
    ("short plateau", {"plateau_mu": "1e-2"}),
    ("relaxation falls from the start", {"plateau_mu": "0.1", "plateau_viol": "1e10"}),
]

KEPT = ("solved", "outcome", "iterations", "cpu", "objective")  # of the results of a variant


def variants(swb: Any) -> list[tuple[str, dict[str, str]]]:
    """Labels and options, without the defaults."""
    known = swb.options()
    out = []
    for o in known.values():
        if o.name in ELSEWHERE:
            continue
        if o.kind == "enum":
            out += [(f"{o.name} = {v}", {o.name: v}) for v in o.values if v != o.default]
        elif o.kind == "int" and (o.min, o.max) == (0, 1):
            out.append((f"{o.name} = {1 - o.default}", {o.name: str(1 - o.default)}))
    return out + [(label, options) for label, options in NUMBERS if all(name in known for name in options)]


def figures(problems: dict, default: dict[str, dict], results: dict[str, dict], peer: dict[str, dict]) -> dict:
    """A variant beside the defaults."""
    record = mpcc_compare.compare(problems, results, peer)
    both = [n for n in problems if results[n]["solved"] and default[n]["solved"]]
    optimal = [n for n in both if problems[n].get("known", {}).get("expect", "optimal") == "optimal"]
    far = mpcc_compare.RELATIVE
    by = {n: mpcc_compare.distance(results[n]["objective"], default[n]["objective"]) for n in optimal}
    mean = mpcc_compare.geometric_mean
    s = record["summary"]
    return {
        "solved": s["solved"],
        "lost": [n for n in problems if default[n]["solved"] and not results[n]["solved"]],
        "gained": [n for n in problems if results[n]["solved"] and not default[n]["solved"]],
        "iterations": mean(max(results[n]["iterations"], 1) / max(default[n]["iterations"], 1) for n in both),
        "cpu": mean(max(results[n]["cpu"], 1e-9) / max(default[n]["cpu"], 1e-9) for n in both),
        "worse": sum(d > far for d in by.values()),
        "better": sum(d < -far for d in by.values()),
        "exact": s["exact"],
        "no_worse_than_peer": s["no_worse"],
    }  # fmt: skip


def costs(rows: dict[str, dict], what: str) -> list[float | None]:
    return [max(r[what], 1e-9) if r["solved"] else None for r in rows.values()]


# --- the page -----------------------------------------------------------------------------------------

PAGE = """# Programs with complementarity constraints

| date | machine | command |
|---|---|---|
| {date} | one core, shared with one to three other processes | `bindings/python/benchmarks/mpcc_ablation.py`, `mpcc_train.py` |

{count} problems `min f(x)` with bounds, rows and `0 <= G(x) _|_ H(x) >= 0` from NOSBENCH, MacMPEC, textbooks, and synthetic ones with known solutions;
{hard_count} hard ones with impacts, contact manipulation and time-optimal driving. The collections have no licence and are not part of this repository;
`mpcc_train.py` takes the folder where they are.

## Compared with IPOPT

IPOPT {ipopt} with MUMPS {mode}, for `sigma` = 1, 0.1, ..., with `{variant}` barrier update. Each solver has {limit:g} seconds for a problem; data:
[data/mpcc-train.json](data/mpcc-train.json), [data/mpcc-hard.json](data/mpcc-hard.json).{note}

- Ratios are geometric means of IPOPT over the library where both solve; `solver` leaves out the time in functions, which is the share `functions`.
- `no worse`: share of objectives within 1e-5 max(1, |f|) of IPOPT's on its exact branch, or below; `relaxed`: of IPOPT's relaxation.
- `identified`: the active set was found and the smooth problem solved; `exact`: max min(G, H) <= 1e-10.
- *Solved*: the solver says so, no violation is above 1e-6 and no product above 1e-7, or the solver recognises that there is no solution.

```
{families}
```

{lists}

![CPU time](mpcc-cpu.svg) ![iterations](mpcc-iterations.svg)

## Hard problems

```
{hard_families}
```

{hard_lists}

## Random problems

Programs of seed 3000 of `mpcc_contacts.py` and `mpcc_kinds.py`, compared by `mpcc_train.py --problems FOLDER --ipopt-mode linf`; no constant had been
chosen on this seed when the table was made. `worse` and `better` count objectives that differ by more than 1e-3 max(1, |f|) where both solve.

```
{random}
```

{random_words}

## Certificates

{certificates} `mpcc_judge.py` checks the claims by functions evaluated anew and by linear programs over all branches (HiGHS).

```
{judged}
```

## Options switched off

The {count} problems with one option changed ([data/mpcc-ablation.json](data/mpcc-ablation.json)); ratios above 1 mean that the variant needs more.
`worse` and `better` count objectives that differ by more than 1e-5 max(1, |f|), and `IPOPT` is the share of objectives no worse than IPOPT's.

```
{variants}
```

![iterations of the variants](mpcc-ablation.svg)

## Growth along time

Processor milliseconds of an iteration of programs that are banded along time, by `mpcc_growth.py`; `pendulum` has no pairs.

```
{growth}
```

{exponents}

A mass with dry friction moved by more and more control stages, by `friction_stages.py`: the homotopy from the guess alone, and the default search.

```
{friction}
```

{friction_exponents}
"""

#: Sections of the page behind this line are written by hand, and stay.
BY_HAND = "<!-- by hand -->"

MODE_WORDS = {
    "scholtes": "solves the relaxations `G H <= sigma` of Scholtes",
    "linf": "solves the elastic mode in the maximum norm, `min f + s / sigma` with `G H <= s` and `0 <= s <= 10`",
}


def filled(**values: Any) -> str:
    """The page with values, its paragraphs broken into lines again."""
    blocks = []
    for block in PAGE.split("\n\n"):
        text = block.format(**values)
        if block[0] not in "#`!{|-" or block.startswith(("{count}", "{certificates}")):
            text = textwrap.fill(text, 118, break_long_words=False, break_on_hyphens=False)
        blocks.append(text.rstrip("\n"))
    return "\n\n".join(blocks) + "\n"


def family_table(record: dict) -> str:
    number = mpcc_compare.number
    lines = [
        "family     problems  ours  IPOPT  CPU ratio  solver  functions  it. ratio  no worse  relaxed  identified   exact"
    ]
    for name, s in [*record["families"].items(), ("all", record["summary"])]:
        lines.append(
            f"{name:<10} {s['problems']:>8} {s['solved']:>5} {s['peer_solved']:>6} "
            f"{number(s['cpu_ratio'], '10.1f'):>10} {number(s['solver_ratio'], '7.1f'):>7} "
            f"{number(s['functions_share'], '10.0%'):>10} {number(s['iteration_ratio'], '10.2f'):>10} "
            f"{number(s['no_worse'], '9.1%'):>9} "
            f"{number(s['no_worse_than_relaxed'], '8.1%'):>8} {number(s['identified'], '11.1%'):>11} "
            f"{number(s['exact'], '7.1%'):>7}"
        )
    return "\n".join(lines)


def lists(record: dict) -> str:
    s = record["summary"]
    lines = []
    for key, words in (
        ("only_peer", "Solved by IPOPT alone"), ("only_ours", "Solved by the library alone"), ("neither", "Solved by neither"),
        ("worse", "Objective worse than IPOPT's"), ("better", "Objective better than IPOPT's"),
    ):  # fmt: skip
        names = ", ".join(f"`{n}`" for n in s[key]) or "none"
        lines.append(f"- {words} ({len(s[key])}): {names}.")
    known = ", ".join(f"{kind} {len(names)}" for kind, names in s["known"].items() if names)
    lines.append(f"- Compared with known solutions: {known or 'none are known'}.")
    return "\n".join(lines)


def certificates(rows: list[dict]) -> str:
    """The types of stationarity of the solutions, as a sentence."""
    answers = [r["ours"] for r in rows if r["ours"]["solved"] and r["ours"]["outcome"] == "solved"]
    types: dict[str, int] = {}
    for a in answers:
        label = f"{a['stationarity']}, {'B' if a['b_stationary'] else 'B not shown'}"
        types[label] = types.get(label, 0) + 1
    listed = ", ".join(f"{label}: {n}" for label, n in sorted(types.items()))
    return f"Types of stationarity of {len(answers)} solutions of both sets: {listed}."


def kind(name: str) -> str:
    """`disc` of `pushers:disc_3`."""
    return name.rpartition(":")[2].rpartition("_")[0]


def take_random(out: Path, files: list[Path]) -> None:
    """Keeps what is needed of some records: for each problem ours, and IPOPT's by its mode."""
    problems: dict[str, dict] = {}
    for record in (json.loads(f.read_text()) for f in files):
        for row in record["problems"]:
            mine = problems.setdefault(f"{kind(row['name'])}:{row['name']}", {"ours": {k: row["ours"][k] for k in KEPT}})
            peer = row["peer"]
            mine[record["run"]["ipopt_mode"]] = {k: peer[k] for k in KEPT} | {"branch": peer.get("branch")}
    keep(out, "mpcc-random", problems)


def random_table(out: Path) -> tuple[str, str]:
    """A row for each kind and for all, and what the solver claimed that IPOPT refutes."""
    number = mpcc_compare.number
    problems = json.loads((out / "data" / "mpcc-random.json").read_text())
    kinds: dict[str, list[dict]] = {}
    for name, row in problems.items():
        kinds.setdefault(name.partition(":")[0], []).append(row)
    head = f"{'kind':<12} {'problems':>8} {'ours':>5}"
    lines = [head + "".join(f" | {mode:>8} both worse better  CPU   it." for mode in mpcc_ipopt.MODES)]
    for name, rows in [*kinds.items(), ("all", list(problems.values()))]:
        line = f"{name:<12} {len(rows):>8} {sum(r['ours']['solved'] for r in rows):>5}"
        for mode in mpcc_ipopt.MODES:
            both = [(r["ours"], r[mode]) for r in rows if r["ours"]["solved"] and r[mode]["solved"]]
            by = [
                mpcc_compare.distance(o["objective"], p["objective"] if p["branch"] is None else p["branch"]) for o, p in both
            ]
            ratios = [
                mpcc_compare.geometric_mean(max(p[of], 1e-9) / max(o[of], 1e-9) for o, p in both) for of in ("cpu", "iterations")
            ]
            line += (
                f" | {sum(r[mode]['solved'] for r in rows):>8} {len(both):>4} {sum(d > 1e-3 for d in by):>5} "
                f"{sum(d < -1e-3 for d in by):>6} {number(ratios[0], '4.1f'):>4} {number(ratios[1], '5.2f'):>5}"
            )
        lines.append(line)
    refuted = [
        name.rpartition(":")[2] for name, r in problems.items()
        if r["ours"]["outcome"] == "infeasible" and any(r[mode]["solved"] for mode in mpcc_ipopt.MODES)
    ]  # fmt: skip
    anybody = sum(any(r[by]["solved"] for by in ("ours", *mpcc_ipopt.MODES)) for r in problems.values())
    words = (
        f"Of {anybody} programs that a solver solves the library solves {sum(r['ours']['solved'] for r in problems.values())}. "
        f"Called infeasible, and solved by IPOPT: {', '.join(f'`{name}`' for name in refuted) or 'none'}."
    )
    return "\n".join(lines), words


def judged(out: Path) -> str:
    """How many claims of each kind are true, false, or not decided."""
    lines = [f"{'set':<6} {'claim':<11} {'true':>5} {'false':>6} {'not decided':>12}"]
    for name in ("train", "hard"):
        record = json.loads((out / "data" / f"mpcc-judge-{name}.json").read_text())
        for kind in ("solved", "B", "S", "infeasible"):
            verdicts = [r["verdicts"][kind].split()[0] for r in record.values() if kind in r["verdicts"]]
            true, false, unknown = (verdicts.count(v) for v in ("true", "FALSE", "unknown"))
            lines.append(f"{name:<6} {kind:<11} {true:>5} {false:>6} {unknown:>12}")
    return "\n".join(lines)


def friction(out: Path) -> str:
    """The rows of friction_stages.py."""
    lines = [f"{'way':<9} {'stages':>6} {'cost':>9} {'its':>5} {'CPU s':>7} {'without certificate':>19}"]
    for r in json.loads((out / "data" / "mpcc-friction.json").read_text()):
        without = mpcc_compare.number(r["cpu_without_certificate"], "19.2f")
        lines.append(
            f"{r['way']:<9} {r['stages']:>6} {r['cost']:>9.6f} {r['iterations']:>5} {r['cpu']:>7.2f} {without:>19}"
        )
    return "\n".join(lines)


def friction_exponents(out: Path) -> str:
    """How seconds, and seconds of an iteration, grow with the number of stages."""
    rows = json.loads((out / "data" / "mpcc-friction.json").read_text())
    words = []
    for way in dict.fromkeys(r["way"] for r in rows):
        of = [{**r, "step": r["cpu"] / max(r["iterations"], 1)} for r in rows if r["way"] == way]
        n = np.log([r["stages"] for r in of])
        all_, step = (float(np.polyfit(n, np.log([r[k] for r in of]), 1)[0]) for k in ("cpu", "step"))
        words.append(f"{way} {all_:.2f} ({step:.2f} for an iteration)")
    return f"Exponents of the number of stages by least squares in logarithms: {', '.join(words)}."


def variant_table(rows: dict[str, dict], default: dict) -> str:
    number = mpcc_compare.number
    exact, peer = number(default["exact"], "6.1%"), number(default["no_worse"], "6.1%")
    lines = [
        f"{'variant':<40} solved lost gained iterations   CPU worse better  exact  IPOPT",
        f"{'defaults':<40} {default['solved']:>6} {'1.00':>22} {'1.00':>5} {exact:>19} {peer}",
    ]
    for label, v in rows.items():
        lines.append(
            f"{label[:40]:<40} {v['solved']:>6} {len(v['lost']):>4} {len(v['gained']):>6} "
            f"{number(v['iterations'], '10.2f'):>10} {number(v['cpu'], '5.2f'):>5} {v['worse']:>5} {v['better']:>6} "
            f"{number(v['exact'], '6.1%'):>6} {number(v['no_worse_than_peer'], '6.1%'):>6}"
        )
    return "\n".join(lines)


def growth(out: Path) -> tuple[str, str]:
    """The table of mpcc_growth.py, and its exponents in a sentence."""
    rows = json.loads((out / "data" / "mpcc-growth.json").read_text())
    words = []
    for name in dict.fromkeys(r["problem"] for r in rows):
        own = [r for r in rows if r["problem"] == name]
        keys = {"all": "ms", "functions": "ms_functions", "linear algebra": "ms_linear_algebra", "elsewhere": "ms_other"}
        words.append(f"{name}: " + ", ".join(f"{k} {mpcc_growth.exponent(own, v):.2f}" for k, v in keys.items()))
    sentence = "Exponents of the number of variables are by least squares in logarithms. " + " ".join(f"{w.capitalize()}." for w in words)
    return mpcc_growth.table(rows), sentence


def write_page(out: Path) -> None:
    """Page and plots from the data."""
    record = json.loads((out / "data" / "mpcc-train.json").read_text())
    hard = json.loads((out / "data" / "mpcc-hard.json").read_text())
    ablation = json.loads((out / "data" / "mpcc-ablation.json").read_text())
    rows = record["problems"]
    ours, peer = ({r["name"]: r[of] for r in rows if r["peer"]} for of in ("ours", "peer"))
    run = record["run"]
    label = f"IPOPT, {run['ipopt_mode']}, {run['ipopt_variant']}"
    for what, name, words in (("cpu", "mpcc-cpu", "CPU time"), ("iterations", "mpcc-iterations", "iterations")):
        mpcc_profile.write(
            out / f"{name}.svg", f"{len(rows)} programs with complementarity pairs", words,
            {"switchback": costs(ours, what), label: costs(peer, what)},
        )  # fmt: skip
    default = {r["name"]: r["ours"] for r in rows}
    curves = {"defaults": costs(default, "iterations")}
    curves |= {label: costs(v["results"], "iterations") for label, v in ablation.items()}
    mpcc_profile.write(out / "mpcc-ablation.svg", "Each part switched off", "iterations", curves)
    page = out / "mpcc.md"
    by_hand = page.read_text().partition(BY_HAND)[2] if page.exists() else "\n"
    page.write_text(
        filled(
            date=run["date"], count=len(rows), ipopt=run["ipopt"], variant=run["ipopt_variant"],
            note=f" {run['note']}" if run.get("note") else "", mode=MODE_WORDS[run["ipopt_mode"]], limit=run["limit"], hard_count=len(hard["problems"]),
            hard_families=family_table(hard), hard_lists=lists(hard), certificates=certificates(rows + hard["problems"]),
            random=random_table(out)[0], random_words=random_table(out)[1], judged=judged(out), friction=friction(out), friction_exponents=friction_exponents(out), families=family_table(record), lists=lists(record), growth=growth(out)[0], exponents=growth(out)[1],
            variants=variant_table({k: v["figures"] for k, v in ablation.items()}, record["summary"]),
        )
        + f"\n{BY_HAND}{by_hand}"
    )  # fmt: skip


def keep(out: Path, name: str, value: Any) -> None:
    """Write data; after every part of the run, which is long."""
    (out / "data").mkdir(parents=True, exist_ok=True)
    (out / "data" / f"{name}.json").write_text(json.dumps(mpcc_compare.finite(value)) + "\n")


# --- the run ------------------------------------------------------------------------------------------


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    mpcc_train.add_arguments(parser)
    parser.add_argument("--list", action="store_true", help="print the variants and do nothing")
    parser.add_argument("--variants", default="", metavar="REGEX", help="variants whose label matches")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "benchmarks", metavar="DIR")
    parser.add_argument("--page", action="store_true", help="write the page again from the data")
    parser.add_argument("--random", type=Path, nargs="+", default=[], metavar="FILE", help="records of random problems, for the page")
    parser.add_argument("--note", default="", metavar="TEXT", help="a sentence about the run, for the page")
    parser.add_argument("--hard", default="hard", metavar="NAME", help="a second set, for the defaults alone")
    parser.set_defaults(ipopt_mode="linf", limit=20.0)
    arguments = parser.parse_args()
    if arguments.random:
        take_random(arguments.out, arguments.random)
    if arguments.page:
        write_page(arguments.out)
        return 0
    problems = mpcc_train.chosen(arguments)
    if problems is None:
        return 0
    mpcc_ipopt.single_thread()
    with tempfile.TemporaryDirectory() as folder:
        bench = mpcc_train.Bench(arguments, Path(folder))
        every = [v for v in variants(bench.swb) if re.search(arguments.variants, v[0])]
        if arguments.list:
            for label, options in every:
                print(f"{label:<40} {' '.join(f'{k}={v}' for k, v in options.items())}")
            return 0

        def run(problems: dict[str, dict], options: dict[str, str]) -> dict[str, dict]:
            tasks = [("switchback", n, problems[n], options) for n in problems]
            return dict(zip(problems, mpcc_train.run_all(bench, tasks, arguments.jobs, arguments.limit)))

        def beside(problems: dict[str, dict]) -> tuple[dict, dict[str, dict], dict[str, dict]]:
            peer, default = mpcc_train.peer_results(arguments, bench, problems), run(problems, {})
            record = mpcc_compare.compare(problems, default, peer)
            record["run"] = mpcc_train.description(arguments, peer, {}) | {"note": arguments.note}
            print(mpcc_compare.table(record), flush=True)
            return record, default, peer

        record, default, peer = beside(problems)
        keep(arguments.out, "mpcc-train", record)
        keep(arguments.out, "mpcc-hard", beside(collection(arguments.problems, arguments.hard))[0])
        ablation = {}
        for label, options in every:
            results = run(problems, options)
            ablation[label] = {
                "options": options,
                "figures": figures(problems, default, results, peer),
                "results": {n: {k: r[k] for k in KEPT} for n, r in results.items()},
            }
            keep(arguments.out, "mpcc-ablation", ablation)
            mpcc_train.say(variant_table({label: ablation[label]["figures"]}, record["summary"]).splitlines()[-1])
    write_page(arguments.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
