"""usage: site_look.py SITE FOLDER    look at the pages of the site with headless Chromium, and keep the pictures in FOLDER

A page must show its title, more than a blank picture, no picture that could not be loaded, no formula that is not typeset or is cut off, and nothing wider
than the window. Of a reference every tenth page is looked at: they are made by one program. Left out where there is no Chromium.
"""

import json
import re
import shutil
import subprocess
import sys
import tempfile
from html import unescape
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
#: At the end of a page: what could not be loaded or typeset, what is too wide, and how much is to be seen.
PROBE = """<script>window.addEventListener("load", () => {
const lost = [...document.images].filter((i) => !i.naturalWidth).map((i) => i.src);
const raw = [...document.querySelectorAll(".arithmatex")].filter((e) =>
  !e.querySelector(".katex") || e.querySelector(".katex-error") || e.scrollWidth > e.clientWidth + 1 && e.clientWidth).map((e) => e.innerText);
const wide = document.documentElement.scrollWidth - window.innerWidth;
document.documentElement.dataset.look = JSON.stringify({lost, raw, wide, text: document.body.innerText.length, height: document.body.scrollHeight}); });
</script>"""


def chromium(*arguments: str) -> str:
    program = next(filter(None, map(shutil.which, NAMES)))
    with tempfile.TemporaryDirectory() as profile:
        command = [program, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars"]
        command += [f"--user-data-dir={profile}", "--allow-file-access-from-files", "--virtual-time-budget=5000", *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout


def look(page: Path, picture: Path) -> list[str]:
    """What is wrong with a page as it is shown."""
    text = page.read_text(encoding="utf-8")
    probed = page.with_name(f"look_{page.name}")
    probed.write_text(text.replace("</body>", PROBE + "</body>"), encoding="utf-8")
    try:
        shown = chromium("--window-size=1200,1600", "--dump-dom", f"--screenshot={picture}", probed.as_uri())
    finally:
        probed.unlink()
    found = re.search(r'data-look="([^"]*)"', shown)
    if not found:
        return ["is not shown to its end"]
    seen = json.loads(unescape(found[1]))
    wrong = [f"a picture is missing: {lost}" for lost in seen["lost"]]
    wrong += [f"a formula is not typeset, or cut off: {raw}" for raw in seen["raw"]]
    if seen["wide"] > 0:
        wrong.append(f"is {seen['wide']} pixels wider than the window")
    if seen["text"] < 200 or seen["height"] < 200:
        wrong.append(f"is almost empty: {seen}")
    if not picture.is_file() or picture.stat().st_size < 10_000:
        wrong.append("has a blank picture")
    return wrong


def main() -> int:
    site, folder = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    if not any(map(shutil.which, NAMES)):
        print("left out: looking at the pages: there is no Chromium here")
        return 0
    folder.mkdir(parents=True, exist_ok=True)
    pages = [p for p in sorted(site.rglob("*.html")) if "rust_api" not in p.parts and p.name not in ("404.html", "search.html")]
    references = [p for p in pages if p.parent.name.startswith("api_")]
    pages = [p for p in pages if p not in references or p.name == "index.html"] + references[::10]
    failed = 0
    for page in dict.fromkeys(pages):
        name = "-".join(page.relative_to(site).with_suffix("").parts)
        for what in look(page, folder / f"{name}.png"):
            failed += 1
            print(f"{page.relative_to(site)} {what}")
    print(f"looked at {len(pages)} pages: {folder}")
    return 1 if failed or not pages else 0


if __name__ == "__main__":
    sys.exit(main())
