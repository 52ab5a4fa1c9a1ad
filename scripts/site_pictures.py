"""usage: site_pictures.py FOLDER [NAME ...]    run examples in Python and recipes, and keep small pictures of what they draw

NAME is an example or a recipe (the tutorial, a page of docs/howto); without names all are run. Pictures of examples are
FOLDER/gallery/NAME-PICTURE.png, those of a recipe FOLDER/NAME.png or FOLDER/NAME-PICTURE.png. They are 720 pixels wide and have 64 colours, which plots
do not exceed. Of an animation the first, the middle and the last picture are kept. What takes more than LIMIT seconds, or draws nothing, is said.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES, RECIPES = ROOT / "examples" / "python", [ROOT / "docs" / "tutorial.md", *sorted((ROOT / "docs" / "howto").glob("*.md"))]
WIDTH = 720
LIMIT = 600
#: Figures are written as pixels whatever an example asks for.
RUN = f"""
import runpy, sys
from pathlib import Path
from matplotlib.figure import Figure
write = Figure.savefig
def savefig(self, path, *args, **options):
    if not isinstance(path, (str, Path)):
        return write(self, path, *args, **options)
    write(self, Path(path).with_suffix(".png"), dpi={WIDTH} / self.get_size_inches()[0], facecolor="white")
Figure.savefig = savefig
sys.argv = sys.argv[1:]
sys.path.insert(0, str(Path(sys.argv[0]).parent))
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def shown(drawn: Path) -> Image.Image:
    """A picture, or three of an animation side by side."""
    with Image.open(drawn) as picture:
        n = getattr(picture, "n_frames", 1)
        frames = []
        for k in dict.fromkeys((0, n // 2, n - 1)):
            picture.seek(k)
            frames.append(picture.convert("RGB"))
    whole = Image.new("RGB", (sum(f.width for f in frames), frames[0].height), "white")
    for k, frame in enumerate(frames):
        whole.paste(frame, (k * frame.width, 0))
    return whole.resize((WIDTH, round(whole.height * WIDTH / whole.width)), Image.Resampling.LANCZOS) if whole.width > WIDTH else whole


def blocks(page: Path, place: Path) -> Path:
    """The code of a recipe as a script."""
    script = place / f"{page.stem}.py"
    script.write_text("\n".join(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.S)), encoding="utf-8")
    return script


def main() -> int:
    folder = Path(sys.argv[1]).resolve()
    (folder / "gallery").mkdir(parents=True, exist_ok=True)
    every = {p.stem: p for p in [*sorted(EXAMPLES.glob("*.py")), *RECIPES]}
    failed = []
    for name, source in [(name, every[name]) for name in sys.argv[2:] or every]:
        start = time.monotonic()
        with tempfile.TemporaryDirectory() as temporary:
            place, recipe = Path(temporary), source.suffix == ".md"
            script = blocks(source, place) if recipe else source
            try:
                environment = {**os.environ, "MPLBACKEND": "Agg"}
                command = [sys.executable, "-c", RUN, script, place]
                subprocess.run(command, check=True, timeout=LIMIT, stdout=subprocess.DEVNULL, env=environment, cwd=place)
            except (subprocess.SubprocessError, OSError) as error:
                failed.append(f"{name}: {type(error).__name__}, see above")
                continue
            drawn = [p for p in sorted(place.iterdir()) if p.suffix in (".png", ".gif")]
            for old in [] if recipe else folder.glob(f"gallery/{name}-*.png"):
                old.unlink()
            for picture in drawn:
                what = picture.stem.removeprefix("python_").removeprefix(name).strip("_-") or "picture"
                whole = name if recipe and picture.stem == name else f"{name}-{what.replace('_', '-')}"
                shown(picture).quantize(64, dither=Image.Dither.NONE).save(folder / ("" if recipe else "gallery") / f"{whole}.png", optimize=True)
        if not drawn:
            failed.append(f"{name} draws nothing")
        print(f"{name}: {len(drawn)} pictures, {time.monotonic() - start:.0f} s", flush=True)
    print("\n".join(failed))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
