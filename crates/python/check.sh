#!/usr/bin/env bash
# A fresh virtual environment, `pip install .`, the tests of the package. The wheel is compiled with its own features: for minutes, the first time.
#
#   crates/python/check.sh [FOLDER of the environment]
set -euo pipefail
cd "$(dirname "$0")/../.."

folder=${1:-target/python/wheel}
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}
cargo build --release --quiet --package discrepancy --bins
python3 -m venv --clear "$folder"
"$folder/bin/pip" install --quiet numpy pandas polars .
SURMISE_DIAGNOSE="$CARGO_TARGET_DIR/release/diagnose" PYTHONDONTWRITEBYTECODE=1 \
    "$folder/bin/python" -m unittest discover --start-directory crates/python/tests
