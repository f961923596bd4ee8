#!/usr/bin/env bash
# The panel is tested in a browser, and a browser prints the safety case: install Chromium where there
# is none and it can be. With the argument chromium-driver also what steers it from outside.
set -euo pipefail
packages=()
found() {
    local name
    for name in "$@"; do
        ! command -v "$name" >/dev/null || return 0
    done
    return 1
}
found chromium chromium-browser google-chrome || packages+=(chromium fonts-dejavu-core)
[ "${1:-}" != chromium-driver ] || found chromedriver || packages+=(chromium-driver)
[ "${#packages[@]}" -gt 0 ] || exit 0
if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
    echo "chute_ros: a browser is needed: install ${packages[*]} (apt install ${packages[*]})" >&2
    exit 1
fi
echo "chute_ros: installs ${packages[*]}: the panel is tested in a browser, and a browser prints" >&2
log=$(mktemp)
export DEBIAN_FRONTEND=noninteractive
if ! { apt-get update && apt-get install --yes --no-install-recommends "${packages[@]}"; } \
    >"$log" 2>&1; then
    tail -n 20 "$log" >&2
    echo "chute_ros: Ubuntu's archive has no Chromium: install Google Chrome's package" >&2
    exit 1
fi
rm "$log"
