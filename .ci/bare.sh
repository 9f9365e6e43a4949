#!/bin/sh
# The smoke workflow in a bare Debian: its minimal base with python3, python3-venv and make.
# Nothing of the machine is used but its settings of pip, which say where packages come from, and
# the folders that these name, given in BARE_FOLDERS.
set -eu
for program in mmdebstrap chroot unshare; do
    command -v "$program" >/dev/null || { echo "SKIPPED: $program not found (apt-get install mmdebstrap)"; exit 0; }
done
[ "$(id -u)" = 0 ] || { echo "SKIPPED: only root may enter another root folder"; exit 0; }
folder=$(mktemp -d)
trap 'rm -rf --one-file-system "$folder"' EXIT
root=$folder/root
mmdebstrap --quiet --variant=minbase --include=python3,python3-venv,make,ca-certificates bookworm "$root"
mkdir "$root/project"
git archive HEAD | tar -x -C "$root/project"
[ -f /etc/pip.conf ] && cp /etc/pip.conf "$root/etc/"
if [ -f /etc/ssl/certs/ca-certificates.crt ]; then
    cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
fi
export root
# What is mounted is seen within this block alone, and gone with it.
unshare --mount --propagation private sh -eu -c '
    mount -t proc proc "$root/proc"
    for place in ${BARE_FOLDERS:-}; do
        mkdir -p "$root$place"
        mount --bind -o ro "$place" "$root$place"
    done
    start=$(date +%s)
    # In the same network, with settings of pip and proxies, and nothing else of the environment.
    chroot "$root" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin $(env | grep -E "^(PIP_|https?_proxy=)" || true) \
        make -C /project smoke
    test -s "$root/project/results/tables/index.html"
    echo "bare: make smoke passed in $(($(date +%s) - start)) s"
'
