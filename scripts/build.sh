#!/usr/bin/env bash
# Build both packages into build-<name> and install-<name>. The environment's local_setup.sh
# must have been sourced: an overlay of an earlier build must not be seen by the next.
set -euo pipefail
cd "$(dirname "$0")/.."
name=$CHUTE_ROS_ENV
# make's own variables would reach the make that CMake starts, and its job server is not there.
unset MAKEFLAGS MAKELEVEL MFLAGS
# Installed modules are compiled once, here; setuptools warns where that is switched off.
unset PYTHONDONTWRITEBYTECODE

# Children keep this lock: if we are killed, the next build waits until they have ended.
exec 9>"build-$name.lock"
flock 9

# CMake remembers the Python and the paths it found, and a killed compiler leaves half a file.
if [ -d "build-$name" ]; then
    if [ -e "build-$name/unfinished" ]; then
        why="the last build was cut off"
    elif ! cmp -s "build-$name/made_with" "$VIRTUAL_ENV/set_up.done"; then
        why="the environment changed"
    fi
    if [ -n "${why-}" ]; then
        echo "chute_ros build: starting afresh, $why" >&2
        rm -rf "build-$name" "install-$name"
    fi
fi
mkdir -p "build-$name"
cp "$VIRTUAL_ENV/set_up.done" "build-$name/made_with"
touch "build-$name/unfinished"

cmake_args=("-DPython3_EXECUTABLE=$VIRTUAL_ENV/bin/python3")
# Headers that set_up.py had to fetch are in a place where CMake does not look.
for header in "$VIRTUAL_ENV"/include/python3.*/Python.h; do
    [ ! -e "$header" ] || cmake_args+=("-DPython3_INCLUDE_DIR=$(dirname "$header")")
done

status=0
colcon --log-base "log-$name" build --build-base "build-$name" --install-base "install-$name" \
    --event-handlers status- desktop_notification- \
    --cmake-args "${cmake_args[@]}" --no-warn-unused-cli || status=$?
rm "build-$name/unfinished"
exit "$status"
