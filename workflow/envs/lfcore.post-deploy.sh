#!/bin/sh
# The library itself, of this checkout: its packages are those of lfcore.yaml.
set -eu
python -m pip install flit_core
python -m pip install --no-deps --no-build-isolation --editable "${LFCORE_ROOT:-.}"
