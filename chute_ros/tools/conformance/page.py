"""The report as one HTML page that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence

from chute_ros.conformance.clause import Packet, Result, Verdict
from chute_ros.tools.conformance.report import ConformanceReport
from chute_ros.tools.report_parts import cell, document, number, section, table, words
from chute_ros.tools.timeline import escaped

_TONES = {
    Verdict.PASSED: "good",
    Verdict.FAILED: "bad",
    Verdict.NOT_SUPPORTED: "quiet",
    Verdict.NOT_TRIED: "quiet",
}
#: Of a long trial so many packets are shown, from its beginning and its end; the whole is in the
#: recording (--mcap).
_FIRST, _LAST = 20, 20
_NO_CERTIFICATE = (
    '<p class="dim">No certificate: it shows what this device did on this bench on this day, and '
    "nothing of a canopy that opens.</p>\n"
)


def page(report: ConformanceReport) -> str:
    """The whole page."""
    title = f"Conformance of {report.device}: {report.document}"
    problem = f'<p><b class="bad">{escaped(report.problem)}</b></p>\n' if report.problem else ""
    about = [(cell(escaped(name)), words(escaped(text))) for name, text in report.about.items()]
    rows = [_row(one) for one in report.results]
    head = f"<h1>{escaped(title)}</h1>\n<p>{escaped(report.summary)}</p>\n{problem}"
    heads = ("verdict", "clause", "what the document says", "what was seen", "s")
    return document(
        title,
        [
            head + _NO_CERTIFICATE,
            section("Device, kit and bench", table(("", ""), about)),
            section("Clauses", table(heads, rows)),
            section("Packets", "".join(map(_proof, report.results))),
        ],
    )


def _row(one: Result) -> tuple[str, ...]:
    verdict = f'<b class="{_TONES[one.verdict]}">{escaped(one.verdict.value)}</b>'
    name = escaped(one.clause.name)
    clause = f'<a href="#{name}">{name}</a>' if one.proof else name
    source = f'<span class="dim">{escaped(one.clause.document)}, "{escaped(one.clause.section)}"'
    return (
        cell(verdict),
        cell(clause),
        words(f"{escaped(one.clause.text)}<br>{source}</span>"),
        words(escaped(one.why)),
        number(f"{one.took:.1f}"),
    )


def _proof(one: Result) -> str:
    if not one.proof:
        return ""
    shown = f"{len(one.proof)} packets"
    return (
        f'<details id="{escaped(one.clause.name)}"'
        f"{' open' if one.verdict is Verdict.FAILED else ''}>"
        f"<summary>{escaped(one.clause.name)}: {escaped(one.verdict.value)}, {shown}</summary>"
        f"{_packets(one.proof)}</details>\n"
    )


def _packets(packets: Sequence[Packet]) -> str:
    every = list(packets)
    left_out = len(every) - _FIRST - _LAST
    if left_out > 0:
        every = [*every[:_FIRST], *every[-_LAST:]]
    rows = [
        (
            number(f"{one.at:.3f}"),
            cell("sent" if one.sent else "received"),
            cell(escaped(one.sender)),
            words(f"{escaped(one.name)} {escaped(one.text)}<br><code>{one.raw.hex()}</code>"),
        )
        for one in every
    ]
    told = f"<p>{left_out} more between them are left out.</p>" if left_out > 0 else ""
    return table(("s", "", "by", "packet"), rows) + told
