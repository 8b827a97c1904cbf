#!/usr/bin/env bash
# Makes the release archives of tauscope and tries each of them:
#
#     deploy/package.sh [--arch x86_64|aarch64] [--out DIR]
#
#   tauscope-VERSION-ARCH.tar.gz   program, documentation, completions, manual pages, systemd units
#   tauscope_VERSION_ARCH.deb      the same as a Debian package
#   tauscope-VERSION-ARCH.oci.tar  a container image file: `podman load -i`, `skopeo copy oci-archive:...`
#
# The default is this machine's architecture and target/package. It runs on Debian or Ubuntu and needs, beside
# Rust and a C compiler, `apt-get install binutils mmdebstrap skopeo umoci`; for the other architecture also
# `apt-get install gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user` and `rustup target add`. The program needs the
# glibc of the machine that builds it, or a newer one: build on the oldest system that you serve.
set -euo pipefail
cd "$(dirname "$0")/.."

arch=$(uname -m) out=target/package
while [ $# -gt 0 ]; do
    case $1 in
    --arch) arch=$2 ;;
    --out) out=$2 ;;
    *) sed -n '2,/^set /s/^# \{0,1\}//p' "$0" | sed '$d' >&2 && exit 2 ;;
    esac
    shift 2
done
case $arch in
x86_64) debian=amd64 ;;
aarch64) debian=arm64 ;;
*) echo "error: no packages for $arch; give x86_64 or aarch64" >&2 && exit 2 ;;
esac
triple=$arch-unknown-linux-gnu

# What runs a program of that architecture here.
run=() target=()
folder=${CARGO_TARGET_DIR:-target}
needed="cargo dpkg-deb mmdebstrap objdump skopeo umoci"
if [ "$arch" != "$(uname -m)" ]; then
    target=(--target "$triple")
    folder=$folder/$triple
    run=("qemu-$arch" -L "/usr/$arch-linux-gnu")
    needed="$needed qemu-$arch $arch-linux-gnu-gcc"
    linker=CARGO_TARGET_$(tr 'a-z-' 'A-Z_' <<<"$triple")_LINKER
    export "$linker=$arch-linux-gnu-gcc"
fi
for tool in $needed; do
    command -v "$tool" >/dev/null || { echo "error: $tool is missing; the head of $0 says what to install" >&2; exit 2; }
done

cargo build --locked --release "${target[@]}" --bin tauscope
program=$folder/release/tauscope
version=$(cargo metadata --no-deps --format-version 1 --locked |
    sed -n 's/.*"name":"tauscope","version":"\([^"]*\)".*/\1/p')
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The tree as a system has it.
root=$work/root/usr
install -D "$program" "$root/bin/tauscope"
"${run[@]}" "$program" man --out "$work/man" >/dev/null
mkdir -p "$root/share/man/man1"
for page in "$work"/man/*.1; do
    gzip -9n <"$page" >"$root/share/man/man1/${page##*/}.gz"
done
completion() { # SHELL FILE
    mkdir -p "$(dirname "$root/$2")"
    "${run[@]}" "$program" completions "$1" >"$root/$2"
}
completion bash share/bash-completion/completions/tauscope
completion zsh share/zsh/vendor-completions/_tauscope
completion fish share/fish/vendor_completions.d/tauscope.fish
install -Dm644 -t "$root/lib/systemd/system" deploy/systemd/tauscope@.service \
    deploy/systemd/tauscope-fleet.service deploy/systemd/tauscope-physics@.service deploy/systemd/tauscope-physics@.timer
install -Dm644 deploy/systemd/sysusers.conf "$root/lib/sysusers.d/tauscope.conf"
install -Dm644 -t "$root/share/doc/tauscope" README.md CHANGELOG.md LICENSE-APACHE LICENSE-MIT docs/*.md docs/*.png docs/*.svg
install -Dm644 -t "$root/share/doc/tauscope/examples" pipeline.yaml tests/data/demo_arm.urdf tests/data/demo.mcap \
    tests/data/demo.explained.yaml tests/data/demo.learnt.yaml
sed -i 's|tests/data/||' "$root/share/doc/tauscope/examples/pipeline.yaml"

mkdir -p "$out"
name=tauscope-$version-$arch

# The program works from where a package puts it: it checks a pipeline and finds the bundled contacts.
try() { # ROOT COMMAND...
    local usr=$1/usr
    shift
    "$@" --version | grep -qx "tauscope $version"
    "$@" check "$usr/share/doc/tauscope/examples/pipeline.yaml" >/dev/null
    rm -rf "$work/replayed"
    "$@" replay --pipeline "$usr/share/doc/tauscope/examples/pipeline.yaml" \
        "$usr/share/doc/tauscope/examples/demo.mcap" --out "$work/replayed" >"$work/replay.log"
    test -s "$work/replayed/summary.parquet"
}

# 1. The plain archive.
tarball=$out/$name.tar.gz
tar --create --gzip --owner=0 --group=0 --sort=name --transform "s|^\./usr|$name|" --file "$tarball" -C "$work/root" ./usr
mkdir -p "$work/plain" && tar --extract --file "$tarball" -C "$work/plain" && mv "$work/plain/$name" "$work/plain/usr"
try "$work/plain" "${run[@]}" "$work/plain/usr/bin/tauscope"
echo "tried $tarball"

# 2. The Debian package.
glibc=$(objdump -T "$program" | sed -n 's/.*(GLIBC_\([0-9.]*\)).*/\1/p' | sort -Vu | tail -1)
install -Dm644 /dev/stdin "$work/root/DEBIAN/control" <<END
Package: tauscope
Version: $version
Architecture: $debian
Maintainer: The tauscope developers <noreply@localhost>
Section: science
Priority: optional
Depends: libc6 (>= $glibc), libgcc-s1
Installed-Size: $(du -sk "$root" | cut -f1)
Description: contacts and missing physics from a robot arm's effort
 tauscope compares the torque that a robot arm measures with the torque that a
 digital twin expects for the same motion. It detects contacts and collisions,
 and explains which physics the twin leaves out.
END
install -Dm755 /dev/stdin "$work/root/DEBIAN/postinst" <<'END'
#!/bin/sh
set -e
if [ "$1" = configure ] && command -v systemd-sysusers >/dev/null; then
    systemd-sysusers tauscope.conf
    # For trials as this user, before a unit has started.
    install -d -o tauscope -g tauscope /var/lib/tauscope
fi
if [ -d /run/systemd/system ]; then
    systemctl daemon-reload
fi
END
package=$out/tauscope_${version}_$debian.deb
dpkg-deb --root-owner-group --build "$work/root" "$package" >/dev/null
rm -rf "$work/root/DEBIAN"
dpkg-deb --extract "$package" "$work/unpacked"
try "$work/unpacked" "${run[@]}" "$work/unpacked/usr/bin/tauscope"
echo "tried $package"

# 3. The image: the package on the C library of the system that built it, and nothing else.
# shellcheck source=/dev/null
suite=$(. /etc/os-release && echo "$VERSION_CODENAME")
mmdebstrap --quiet --variant=extract --architectures="$debian" --include=libc6,libgcc-s1 "$suite" "$work/base" 2>"$work/base.log" ||
    { cat "$work/base.log" >&2; exit 1; }
layout=$work/layout
umoci init --layout "$layout"
umoci new --image "$layout:$version"
rootless=()
[ "$(id -u)" = 0 ] || rootless=(--rootless)
umoci unpack "${rootless[@]}" --image "$layout:$version" "$work/bundle"
cp -a "$work/base/." "$work/root/usr" "$work/bundle/rootfs/"
umoci repack --image "$layout:$version" "$work/bundle"
umoci config --image "$layout:$version" --architecture "$debian" --os linux --config.entrypoint /usr/bin/tauscope \
    --config.workingdir /var/lib/tauscope --config.label "org.opencontainers.image.version=$version"
image=$out/$name.oci.tar
rm -f "$image"
skopeo copy --quiet "oci:$layout:$version" "oci-archive:$image:$version"
skopeo inspect "oci-archive:$image" | grep -q "\"Architecture\": \"$debian\""
skopeo copy --quiet "oci-archive:$image" "oci:$work/again:$version"
umoci unpack "${rootless[@]}" --image "$work/again:$version" "$work/started"
started=$work/started/rootfs
case $debian in
amd64) libraries=x86_64-linux-gnu loader=lib64/ld-linux-x86-64.so.2 ;;
arm64) libraries=aarch64-linux-gnu loader=lib/ld-linux-aarch64.so.1 ;;
esac
# With the image's own C library, and none of this machine's.
inside=("$started/$loader" --library-path "$started/lib/$libraries:$started/usr/lib/$libraries" "$started/usr/bin/tauscope")
[ ${#run[@]} -eq 0 ] || inside=("qemu-$arch" -L "$started" "$started/usr/bin/tauscope")
try "$started" "${inside[@]}"
echo "tried $image"

(cd "$out" && sha256sum "${tarball##*/}" "${package##*/}" "${image##*/}" >"$name.sha256")
echo "packages of tauscope $version for $arch are in $out"
