"""Scenes: references, derivatives, forces, and what is refused and how."""

import json
from pathlib import Path

def reference(name):
    folder = Path(__file__).resolve().parents[3] / "tests" / "data" / "reference" / "scenes"
    return json.loads((folder / name).read_text())
