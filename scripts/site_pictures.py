"""usage: site_pictures.py FOLDER [NAME ...]    run the examples in Python and keep small pictures of what they draw in FOLDER

All examples without names. A picture is called NAME-PICTURE.png. It is 720 pixels wide and has 64 colours, which plots do not exceed. Of an
animation the first, the middle and the last picture are kept. An example that takes more than LIMIT seconds, or draws nothing, is said.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

EXAMPLES = Path(__file__).resolve().parents[1] / "examples" / "python"
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


def main() -> int:
    folder = Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    failed = []
    for script in [EXAMPLES / f"{name}.py" for name in sys.argv[2:]] or sorted(EXAMPLES.glob("*.py")):
        start = time.monotonic()
        with tempfile.TemporaryDirectory() as place:
            try:
                environment = {**os.environ, "MPLBACKEND": "Agg"}
                subprocess.run([sys.executable, "-c", RUN, script, place], check=True, timeout=LIMIT, stdout=subprocess.DEVNULL, env=environment)
            except (subprocess.SubprocessError, OSError) as error:
                failed.append(f"{script.stem}: {type(error).__name__}, see above")
                continue
            drawn = [p for p in sorted(Path(place).iterdir()) if p.suffix in (".png", ".gif")]
            for old in folder.glob(f"{script.stem}-*.png"):
                old.unlink()
            for picture in drawn:
                name = picture.stem.removeprefix("python_").removeprefix(script.stem).strip("_-") or "picture"
                shown(picture).quantize(64, dither=Image.Dither.NONE).save(folder / f"{script.stem}-{name.replace('_', '-')}.png", optimize=True)
        if not drawn:
            failed.append(f"{script.stem} draws nothing")
        print(f"{script.stem}: {len(drawn)} pictures, {time.monotonic() - start:.0f} s", flush=True)
    print("\n".join(failed))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
