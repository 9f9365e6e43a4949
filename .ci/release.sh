#!/bin/sh
# Source package and wheel of the tag at HEAD, checked and tried: make release
#
# Each Python from 3.11 on that is found tries the wheel in an empty environment, the oldest the
# source package, too, and pipx gives the command.
set -eu
version=$(sed -n 's/^__version__ = "\(.*\)"/\1/p' lfcore/__init__.py)
git tag --points-at HEAD | grep -qx "v$version" || { echo "HEAD has no tag v$version: git tag v$version" >&2; exit 1; }
grep -q "^## \[$version\]" CHANGELOG.md || { echo "CHANGELOG.md: has no section [$version]" >&2; exit 1; }
for file in CITATION.cff .zenodo.json; do
    grep -Eq "^ *\"?version\"?: \"?$version\"?,?$" "$file" || { echo "$file: has another version than $version" >&2; exit 1; }
done
python=$1
root=$PWD/build/release
rm -rf build/release && mkdir -p build/release
git archive --prefix=source/ "v$version" | tar -x -C build/release
$python -m venv "$root/tools"
export PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_QUIET=1
"$root/tools/bin/pip" install build twine pipx
cd "$root/source"
"$root/tools/bin/python" -m build --outdir "$root/dist" . >"$root/build.log"
"$root/tools/bin/twine" check --strict "$root"/dist/*
cd "$root"
try() {
    "$1" -m venv "$2"
    "$2/bin/pip" install "$3"
    "$2/bin/python" source/.ci/try_wheel.py
}
try "$python" from-source dist/*.tar.gz
for each in python3.11 python3.12 python3.13; do
    if "$each" --version >/dev/null 2>&1; then try "$each" "from-$each" dist/*.whl; else echo "no $each"; fi
done
PIPX_HOME=$root/pipx PIPX_BIN_DIR=$root/bin tools/bin/pipx install --python "$(command -v "$python")" dist/*.whl
test "$(bin/lfcore --version)" = "lfcore $version"
echo "build/release/dist: lfcore $version"
