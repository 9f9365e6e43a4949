#!/bin/sh
# The project in a bare Debian: its minimal base with python3, python3-venv and make.
#
#   make bare                                       make smoke, in Debian 12 (Python 3.11)
#   make bare SUITE=trixie STEPS="smoke wheel"      another Debian, more targets of make
#   make bare STEPS=container                       the steps of workflow/envs/Containerfile
#   make bare STEPS=test DEVICE=pocl                the tests on Debian's PoCL, which is installed, too
#   make bare STEPS=test DEVICE=pocl SUPPORT=yes    the same, and a row of the table in docs/robustness.md
#
# Nothing of the machine is used but its mirror of Debian, its settings of pip, which say where
# packages come from, and the folders that these name, given in BARE_FOLDERS.
set -eu
for program in mmdebstrap chroot unshare; do
    command -v "$program" >/dev/null || { echo "SKIPPED: $program not found (apt-get install mmdebstrap)"; exit 0; }
done
[ "$(id -u)" = 0 ] || { echo "SKIPPED: only root may enter another root folder"; exit 0; }
suite=${SUITE:-bookworm}
STEPS=${STEPS:-smoke}
folder=$(mktemp -d)
trap 'rm -rf --one-file-system "$folder"' EXIT
root=$folder/root
mirror=
if grep -qx 'ID=debian' /etc/os-release; then
    mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | head -n 1)
fi
packages=python3,python3-venv,make,ca-certificates${LFCORE_DEVICE:+,pocl-opencl-icd}${SUPPORT:+,git}
mmdebstrap --quiet --variant=minbase --include="$packages" "$suite" "$root" $mirror
git clone --quiet --no-hardlinks . "$root/project"
[ -f /etc/pip.conf ] && cp /etc/pip.conf "$root/etc/"
if [ -f /etc/ssl/certs/ca-certificates.crt ]; then
    cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
fi
export root suite STEPS
# What is mounted is seen within this block alone, and gone with it.
unshare --mount --propagation private sh -eu -c '
    mount -t proc proc "$root/proc"
    mount -t sysfs -o ro sysfs "$root/sys"
    for place in ${BARE_FOLDERS:-}; do
        mkdir -p "$root$place"
        mount --bind -o ro "$place" "$root$place"
    done
    # In the same network, with settings of pip and proxies, and nothing else of the environment.
    inside() {
        chroot "$root" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin \
            $(env | grep -E "^(PIP_|LFCORE_DEVICE=|SUPPORT=|https?_proxy=)" || true) "$@"
    }
    python=$(inside python3 -c "import platform; print(platform.python_version())")
    for step in $STEPS; do
        start=$(date +%s)
        if [ "$step" = container ]; then
            inside python3 /project/.ci/container.py /project
        else
            inside make -C /project "$step"
        fi
        echo "bare: $step passed in $(($(date +%s) - start)) s: Debian $suite, Python $python"
    done
'
[ -z "${SUPPORT:-}" ] || cp "$root/project/benchmarks/published/support.csv" benchmarks/published/
