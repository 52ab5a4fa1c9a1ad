#!/bin/sh
# usage: site_deps.sh BUILD    install what the pages of documentation are made with, after deps.sh
#
# Doxygen and Chromium through apt, if there is root or sudo; KaTeX unpacked into BUILD/katex; the generator of the pages into BUILD/venv.
set -eu
build=$1

say() { echo "site: $*"; }

. "$(dirname "$0")/root.sh"

packages=""
command -v doxygen > /dev/null || packages="$packages doxygen"
command -v chromium > /dev/null || command -v google-chrome > /dev/null || packages="$packages chromium"
if [ -n "$packages" ]; then
    say "missing packages:$packages"
    if [ "$root" != none ] && command -v apt-get > /dev/null; then
        $root apt-get update -qq
        # shellcheck disable=SC2086
        DEBIAN_FRONTEND=noninteractive $root apt-get install -y -qq --no-install-recommends $packages
    fi
fi
command -v doxygen > /dev/null || {
    say "the reference of C++ cannot be made without doxygen"
    exit 1
}

if [ ! -e "$build/katex/katex.min.js" ]; then
    say "unpacking KaTeX into $build/katex"
    rm -rf "$build/katex_deb"
    mkdir -p "$build/katex_deb" "$build/katex/contrib"
    download() { (cd "$build/katex_deb" && apt-get download -qq libjs-katex fonts-katex); }
    { download 2> /dev/null || { [ "$root" != none ] && $root apt-get update -qq && download; }; } || {
        say "formulas cannot be typeset without KaTeX"
        exit 1
    }
    for deb in "$build"/katex_deb/*.deb; do dpkg -x "$deb" "$build/katex_deb"; done
    cp -r "$build/katex_deb/usr/share/fonts/truetype/katex" "$build/katex/fonts"
    rm "$build"/katex/fonts/*.ttf "$build"/katex/fonts/*.woff
    cp "$build/katex_deb/usr/share/javascript/katex/contrib/auto-render.js" "$build/katex/contrib"
    cp "$build"/katex_deb/usr/share/javascript/katex/katex.min.* "$build/katex"
    rm -rf "$build/katex_deb"
fi

"$build/venv/bin/python" -c "import material, mkdocstrings, mkdocstrings_handlers.python, mkdoxy" 2> /dev/null || {
    say "installing MkDocs into $build/venv"
    "$build/venv/bin/pip" install --quiet --disable-pip-version-check 'mkdocs<2' 'mkdocs-material<10' 'mkdocstrings[python]' mkdoxy ruff
}
