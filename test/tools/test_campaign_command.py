"""The command line of the campaign: mistakes are said before the first flight."""

import sys

import pytest

from chute_ros.tools import campaign


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--flights", "0"], "argument --flights: 0: need 1 or more"),
        (["--flights", "-5"], "argument --flights: -5: need 1 or more"),
        (["--jobs", "0"], "argument --jobs: 0: need 1 or more"),
        (["--jobs", "many"], "argument --jobs: invalid positive value: 'many'"),
        (["--page", "/nowhere/x.md"], "argument --page: /nowhere/x.md: no file can be written"),
        (["--page", "/tmp"], "argument --page: /tmp: no file can be written there"),
    ],
)
def test_a_mistake_is_said_at_once(arguments, words, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["campaign", *arguments])
    with pytest.raises(SystemExit) as ended:
        campaign.main()
    assert ended.value.code == 2
    told = capsys.readouterr()
    assert words in told.err
    assert told.out == ""


def test_it_writes_its_page_and_its_picture(monkeypatch, tmp_path, capsys):
    page = tmp_path / "campaign.md"
    arguments = ["--flights", "3", "--seed", "5", "--jobs", "1", "--page", str(page)]
    monkeypatch.setattr(sys, "argv", ["campaign", *arguments])
    campaign.main()
    assert "3 flights in" in capsys.readouterr().out
    assert "`make campaign FLIGHTS=3 SEED=5`" in page.read_text()
    assert page.with_suffix(".svg").read_text().startswith("<svg")
