"""Performance profiles as SVG, in the look of the plots of `report`."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import Mapping, Sequence

COLOURS = (
    "#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22"
)  # fmt: skip
WIDTH, HEIGHT = 860.0, 520.0
LEFT, RIGHT, TOP, BOTTOM = 80.0, 650.0, 40.0, 465.0
WORST = 1e3  # ratios drawn


def profile(costs: Mapping[str, Sequence[float | None]]) -> dict[str, list[tuple[float, float]]]:
    """For each solver the steps (ratio to the best, share of the problems solved within it); None is not solved.
    Problems that nobody solves do not count."""
    columns = list(zip(*costs.values()))
    best = [min((c for c in column if c is not None), default=None) for column in columns]
    counted = sum(b is not None for b in best)
    out = {}
    for name, values in costs.items():
        ratios = sorted(v / b for v, b in zip(values, best) if v is not None and b is not None)
        out[name] = [(r, (k + 1) / counted) for k, r in enumerate(ratios)]
    return out


def write(path: Path, title: str, cost: str, costs: Mapping[str, Sequence[float | None]]) -> None:
    """Draw the profile of some solvers; costs are positive and in the same order of problems."""
    curves = profile(costs)
    furthest = max((r for steps in curves.values() for r, _ in steps), default=1.0)
    decades = math.log10(min(max(furthest, 1.5), WORST)) * 1.02

    def x(ratio: float) -> float:
        return LEFT + min(math.log10(ratio) / decades, 1.0) * (RIGHT - LEFT)

    def y(share: float) -> float:
        return BOTTOM + share / 1.04 * (TOP - BOTTOM)

    def text(at: float, height: float, anchor: str, words: str) -> str:
        return f'<text x="{at:.1f}" y="{height:.1f}" text-anchor="{anchor}">{escape(words, quote=False)}</text>'

    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" font-family="sans-serif" '
        'font-size="12">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for tick in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000):
        if math.log10(tick) <= decades:
            at = x(tick)
            out.append(f'<line x1="{at:.1f}" y1="{BOTTOM}" x2="{at:.1f}" y2="{TOP}" stroke="#ddd"/>')
            out.append(text(at, BOTTOM + 17, "middle", str(tick)))
    for fifth in range(6):
        at = y(fifth / 5)
        out.append(f'<line x1="{LEFT}" y1="{at:.1f}" x2="{RIGHT}" y2="{at:.1f}" stroke="#ddd"/>')
        out.append(text(LEFT - 6, at + 4, "end", f"{fifth / 5:.1f}"))
    out.append(
        f'<rect x="{LEFT:g}" y="{TOP:g}" width="{RIGHT - LEFT:g}" height="{BOTTOM - TOP:g}" fill="none" stroke="#444"/>'
    )
    middle = 0.5 * (LEFT + RIGHT)
    out.append(text(middle, TOP - 14, "middle", title))
    out.append(text(middle, HEIGHT - 14, "middle", f"{cost}, multiple of the best"))
    out.append(f'<g transform="translate(18 {0.5 * (TOP + BOTTOM):.1f}) rotate(-90)">')
    out += [text(0, 0, "middle", "share of problems solved"), "</g>"]
    for k, (name, steps) in enumerate(curves.items()):
        style = f'fill="none" stroke="{COLOURS[k % len(COLOURS)]}" stroke-width="1.6"'
        style += ("", ' stroke-dasharray="6 3"', ' stroke-dasharray="2 2"')[k // len(COLOURS) % 3]
        points, share = [(LEFT, y(0))], 0.0
        for ratio, reached in steps:
            points += [(x(ratio), y(share)), (x(ratio), y(reached))]
            share = reached
        points.append((RIGHT, y(share)))
        out.append(f'<polyline points="{" ".join(f"{a:.2f},{b:.2f}" for a, b in points)}" {style}/>')
        height = TOP + 10 + 18 * k
        out.append(f'<line x1="{RIGHT + 12}" y1="{height}" x2="{RIGHT + 36}" y2="{height}" {style}/>')
        out.append(text(RIGHT + 42, height + 4, "start", name))
    out.append("</svg>")
    path.write_text("\n".join(out) + "\n")
