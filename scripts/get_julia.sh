#!/bin/sh
# usage: get_julia.sh DIR    prints the program that runs Julia: the one on the PATH, else one unpacked into DIR
#
# The unpacked one is the Julia 1.5.3 of Debian bullseye, from the archive that apt uses already; nothing is installed on
# the system. It runs on the C and C++ libraries of the system, as the library that it is to load does. Fails with a
# message where Julia cannot be had.
set -eu
if command -v julia > /dev/null; then
    command -v julia
    exit 0
fi
mkdir -p "$1"
dir=$(cd "$1" && pwd)
if [ -x "$dir/julia" ]; then
    echo "$dir/julia"
    exit 0
fi

give_up() {
    echo "julia: $*" >&2
    rm -rf "$dir/apt" "$dir/root"
    exit 1
}
command -v apt-get > /dev/null && command -v dpkg > /dev/null || give_up "neither on the PATH nor is there apt to unpack it with"
keys=/usr/share/keyrings/debian-archive-keyring.gpg
[ -e "$keys" ] || give_up "$keys is missing"

# The address of the archive, and an apt that knows the other suite only and believes that nothing is installed.
site=$(apt-get indextargets --format '$(SITE)' | grep -v security | head -n 1)
[ -n "$site" ] || site=$(sed -n 's/^deb .*\(https*:[^ ]*\) .*/\1/p; s/^URIs: *\([^ ]*\).*/\1/p' \
    /etc/apt/sources.list /etc/apt/sources.list.d/* 2> /dev/null | grep -v security | head -n 1)
[ -n "$site" ] || give_up "apt knows no archive"
apt=$dir/apt
mkdir -p "$apt/lists/partial" "$apt/cache/archives/partial"
: > "$apt/status"
echo "deb [signed-by=$keys] $site bullseye main" > "$apt/sources.list"
own_apt() {
    apt-get -qq -o "Dir::Etc::SourceList=$apt/sources.list" -o Dir::Etc::SourceParts=/dev/null \
        -o "Dir::State::Lists=$apt/lists" -o "Dir::State::Status=$apt/status" -o "Dir::Cache=$apt/cache" \
        -o APT::Install-Recommends=false -o APT::Sandbox::User=root "$@"
}
own_apt update >&2 || give_up "$site has no bullseye, or cannot be reached"

# What Julia needs, less what the system has in newer versions.
packages=$(own_apt -s install julia | sed -n 's/^Inst \([^ ]*\).*/\1/p' | grep -vE \
    '^(libc6|libc-bin|libgcc-s1|libstdc\+\+6|gcc-10-base|libcrypt1|debconf|dpkg|tar|perl-base|base-files)$') ||
    give_up "$site has no julia in bullseye"
# shellcheck disable=SC2086
(cd "$apt/cache/archives" && own_apt download $packages >&2) || give_up "its packages cannot be downloaded from $site"
mkdir -p "$dir/root"
for deb in "$apt"/cache/archives/*.deb; do dpkg -x "$deb" "$dir/root"; done

multiarch=$(dpkg --print-architecture | sed 's/amd64/x86_64/; s/arm64/aarch64/')-linux-gnu
lib=$dir/root/usr/lib/$multiarch
cat > "$dir/julia.new" <<END
#!/bin/sh
LD_LIBRARY_PATH="$lib:$lib/openblas-pthread:$lib/blas:$lib/lapack:$dir/root/lib/$multiarch\${LD_LIBRARY_PATH:+:\$LD_LIBRARY_PATH}"
export LD_LIBRARY_PATH
exec "$dir/root/usr/bin/julia" "\$@"
END
chmod +x "$dir/julia.new"
rm -rf "$apt"
"$dir/julia.new" --startup-file=no -e 'using LinearAlgebra, SparseArrays, Libdl, Test' >&2 || give_up "the unpacked one does not run here"
mv "$dir/julia.new" "$dir/julia"
echo "$dir/julia"
