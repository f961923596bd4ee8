#!/usr/bin/env bash
# All linters, each run even if one before it found something.
set -uo pipefail
cd "$(dirname "$0")/.."
status=0
check() {
    echo "--- $*"
    "$@" || status=1
}
check ruff check .
check ruff format --check --output-format concise .
check mypy
check lint-imports --no-cache
exit "$status"
