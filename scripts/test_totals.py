"""Print the totals of all test results as the last line: test_totals.py BUILD_BASE PACKAGE...

Counts the JUnit files that pytest wrote under BUILD_BASE/PACKAGE. Fails if a test failed, if a
package has no result, and if no test was run at all.
"""

import sys
import xml.etree.ElementTree as ElementTree
from collections import Counter
from pathlib import Path


def count(result_file):
    """Outcomes of the test cases in one JUnit file."""
    outcomes = Counter()
    for case in ElementTree.parse(result_file).getroot().iter("testcase"):
        children = {child.tag for child in case}
        if children & {"failure", "error"}:
            outcomes["failed"] += 1
        elif "skipped" in children:
            outcomes["skipped"] += 1
        else:
            outcomes["passed"] += 1
    return outcomes


def result_files(package_dir):
    """pytest.xml is colcon's name for a Python package's results, *.xunit.xml is ament's."""
    return [*package_dir.glob("pytest.xml"), *package_dir.glob("test_results/**/*.xunit.xml")]


def main(build_base, *packages):
    total = Counter()
    complaints = []
    for package in packages:
        outcomes = Counter()
        for result_file in result_files(Path(build_base, package)):
            try:
                outcomes += count(result_file)
            except ElementTree.ParseError as error:
                complaints.append(f"{result_file} is not a whole result: {error}")
        if not outcomes["passed"] + outcomes["failed"]:
            complaints.append(f"no test of {package} was run")
        total += outcomes
    for complaint in complaints:
        print(f"test totals: {complaint}", file=sys.stderr)
    failed = total["failed"] + len(complaints)
    print(f"{total['passed']} passed, {failed} failed, {total['skipped']} skipped", flush=True)
    return 1 if failed or not packages else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
