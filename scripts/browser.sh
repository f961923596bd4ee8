#!/usr/bin/env bash
# The panel is tested in a browser: install Chromium where there is none and it can be.
set -euo pipefail
for name in chromium chromium-browser google-chrome; do
    ! command -v "$name" >/dev/null || exit 0
done
if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
    echo "chute_ros tests: the panel's need a browser: install Chromium (apt install chromium)" >&2
    exit 1
fi
echo "chute_ros tests: installs Chromium, in which the panel is tested" >&2
log=$(mktemp)
export DEBIAN_FRONTEND=noninteractive
if ! { apt-get update && apt-get install --yes --no-install-recommends chromium fonts-dejavu-core; } \
    >"$log" 2>&1; then
    tail -n 20 "$log" >&2
    exit 1
fi
rm "$log"
