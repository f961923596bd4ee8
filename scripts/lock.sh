#!/usr/bin/env bash
# Pin every dependency exactly, with hashes: requirements/*.in -> requirements/*.lock.
# Run by `make lock`, inside an environment made by set_up.py (which has uv).
set -euo pipefail
cd "$(dirname "$0")/../requirements"

# One lock serves every supported Python, so it is resolved for the oldest of them. The header
# and the index are left out: they would name paths and hosts of the machine that made the lock.
pin() {
    local lock=$1
    shift
    echo "requirements/$lock"
    UV_PYTHON_DOWNLOADS=never uv pip compile --quiet --upgrade --universal --python-version 3.10 \
        --generate-hashes --no-header --no-emit-index-url --no-annotate "$@" --output-file "$lock"
}

pin_distro() {
    sed -e "s/@DISTRO@/$1/" -e "/^ros-$2-/d" ros-wheels.in | pin "$1.lock" - runtime.in extra.in dev.in
}
pin_distro jazzy kilted
pin_distro kilted jazzy
pin sourced.lock runtime.in extra.in dev.in
pin installer.lock installer.in
pin mutate.lock mutate.in
pin fuzz.lock fuzz.in
pin docs.lock docs.in
pin bodies.lock bodies.in
pin case.lock case.in
