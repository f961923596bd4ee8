"""The report for machines that run tests: JUnit."""

from __future__ import annotations

from junitparser import Failure, JUnitXml, Properties, Property, Skipped, TestCase, TestSuite

from chute_ros.conformance.clause import Result, Verdict
from chute_ros.tools.conformance.report import ConformanceReport


def junit(report: ConformanceReport) -> str:
    """One test case a clause: a clause that is not supported or not tried is skipped."""
    suite = TestSuite(report.document)
    properties = Properties()  # type: ignore[no-untyped-call]
    for name, text in {**report.about, "device": report.device}.items():
        properties.add_property(Property(name, text))
    suite.append(properties)  # type: ignore[no-untyped-call]
    for one in report.results:
        suite.add_testcase(_case(report, one))
    if report.problem:
        case = TestCase("run", classname=report.document)
        case.result = [Failure(report.problem)]
        suite.add_testcase(case)
    xml = JUnitXml()
    xml.add_testsuite(suite)
    return str(xml.tostring().decode())  # type: ignore[no-untyped-call]


def _case(report: ConformanceReport, one: Result) -> TestCase:
    case = TestCase(one.clause.name, classname=report.document, time=round(one.took, 3))
    if one.verdict is Verdict.FAILED:
        case.result = [Failure(one.why)]
    elif one.verdict is not Verdict.PASSED:
        case.result = [Skipped(f"{one.verdict.value}: {one.why}")]
    else:
        case.system_out = one.why
    return case
