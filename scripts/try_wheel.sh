#!/bin/sh
# usage: try_wheel.sh WHEEL VENV    install a wheel into a new environment VENV; the first example of the package and its tests must run
# there, with the libraries that the wheel brings, and no path of the machine that built it may be inside
#
# SuiteSparse of the system is hidden where namespaces are allowed (root, or user namespaces); where not, what is mapped is looked at.
set -eu
wheel=$1
venv=$2
here=$(pwd)
rm -rf "$venv"
python3 -m venv "$venv"
"$venv/bin/pip" --disable-pip-version-check install --quiet "$wheel" pytest hypothesis scipy matplotlib casadi
unset SWITCHBACK_LIBRARY PYTHONPATH || true
cd "$venv"
cat > example.py << 'END'
import re
import sys

import numpy as np
import switchback_control as swb

w = 2 * np.pi
A1, A2 = np.array([[1, w], [-w, 1]]), np.array([[1, -w], [w, 1]])
system = swb.System(nx=2)
system.add_subsystem(modes=[lambda x: A1 @ x, lambda x: A2 @ x], psi=lambda x: x @ x - 1, signs=[-1, 1])
run = swb.simulate(system, x0=[np.exp(-1), 0], t_span=np.pi / 2, rtol=1e-10)
assert run.success and abs(run.x_end - [-1.5974603774506984, -0.7614936206060108]).max() < 1e-8, run.x_end
with open("/proc/self/maps", encoding="utf-8") as maps:
    used = sorted({line.split()[-1] for line in maps if re.search(r"lib(ldl|amd|suitesparse|switchback)", line)})
print("\n".join(used))
foreign = [name for name in used if not name.startswith(sys.prefix)]
if foreign:
    sys.exit(f"libraries of the system are used: {foreign}")
with open(swb.library_path, "rb") as library:
    paths = re.findall(rb"/(?:home|root|work|build)/[\w./-]+", library.read())
if paths:
    sys.exit(f"paths of the machine that built it are inside: {paths[:3]}")
print(run)
END
cat > alone.sh << 'END'
for lib in ldl amd suitesparseconfig; do
    for file in /lib/*/lib$lib.so.? /usr/lib/*/lib$lib.so.? /usr/lib64/lib$lib.so.? /usr/local/lib/lib$lib.so.?; do
        [ ! -e "$file" ] || mount --bind /dev/null "$(readlink -f "$file")"
    done
done
exec "$@"
END
alone=""
for how in "unshare -m" "unshare -rm"; do
    if $how true 2> /dev/null; then
        alone="$how sh alone.sh"
        break
    fi
done
if [ -n "$alone" ] && $alone bin/python -c "import ctypes; ctypes.CDLL('libldl.so.2')" 2> /dev/null; then
    echo "libldl of the system could not be hidden"
    exit 1
fi
[ -n "$alone" ] || echo "left out: hiding SuiteSparse of the system: no namespaces here"
$alone bin/python example.py
# the examples in C, where they were built, need the SuiteSparse that is hidden
MPLBACKEND=Agg $alone bin/python -m pytest -q -p no:cacheprovider -k "not the_costs_are_those_in_c" ${WHEEL_TESTS:-"$here/bindings/python/tests"}
