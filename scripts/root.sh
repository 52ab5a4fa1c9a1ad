# Sets `root` to how packages are installed: nothing as root, sudo where it asks for no password, else none. Sourced by deps.sh, site_deps.sh.
if [ "$(id -u)" = 0 ]; then
    root=""
elif command -v sudo > /dev/null && sudo -n true 2> /dev/null; then
    root="sudo"
else
    root="none"
fi
