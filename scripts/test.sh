#!/usr/bin/env bash
# Lint, trace the requirements, run the tests of both packages through colcon, print the totals.
# Needs env.sh sourced after a build.
set -uo pipefail
cd "$(dirname "$0")/.."
name=$CHUTE_ROS_ENV
unset MAKEFLAGS MAKELEVEL MFLAGS
# Hundreds of processes start: each would compile all that it imports.
unset PYTHONDONTWRITEBYTECODE

# Two runs in one clone would overwrite each other's results. Processes left over by a test must
# not hold the lock, hence 9>&- below.
exec 9>"log-$name.lock"
flock 9

failed=()
scripts/browser.sh 9>&- || failed+=("browser")
scripts/lint.sh 9>&- || failed+=("linters")
# A requirement without a test, and a test without a requirement.
PYTHONPATH="$PWD:$PYTHONPATH" python3 -m safety_case --check 9>&- || failed+=("safety case")

# Most tests wait for something that another process, a wire or the middleware does: two at a time
# for each core. Each worker has a ROS domain of its own (chute_ros/tools/isolation.py).
jobs=$((2 * $(nproc)))

# Results of tests that are no more would be counted.
colcon test-result --test-result-base "build-$name" --delete-yes >/dev/null
colcon --log-base "log-$name" test --build-base "build-$name" --install-base "install-$name" \
    --executor sequential --return-code-on-test-failure \
    --pytest-args --numprocesses "$((jobs < 8 ? jobs : 8))" --dist loadgroup \
    --event-handlers console_direct+ status- desktop_notification- 9>&- || failed+=("colcon test")
echo
colcon test-result --test-result-base "build-$name" --verbose | tail -n 200
if [ "${#failed[@]}" -gt 0 ]; then
    printf 'failed: %s\n' "${failed[@]}"
fi
# The totals come last, for people and for machines that read the end of a log.
python3 scripts/test_totals.py "build-$name" $(colcon list --names-only) || failed+=("totals")
exit $((${#failed[@]} > 0))
