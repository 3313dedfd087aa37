"""No raw, ambiguous or mislabelled scan is read wrongly without a word; the table would tell."""

from __future__ import annotations

import pytest

from rift_cl.commands.cli import main
from rift_cl.errors import InputError
from rift_cl.io.scans import contract


@pytest.fixture
def stress(tool):
    return tool("stress_scans")


def test_every_file_gives_right_slices_or_a_sentence(stress, capsys):
    status = stress.main(stress.Options())
    printed = capsys.readouterr().out
    assert status == 0, printed
    assert int(printed.splitlines()[-1].split()[0]) >= 60
    assert "WRONG" not in printed


def test_every_sentence_names_the_file_and_ends(stress):
    for case in stress.cases():
        if case.wanted == stress.REFUSED:
            (sentence,) = stress.tried(case).said
            assert sentence.startswith("scan."), (case.truth, sentence)
            assert "\n" not in sentence and not sentence.endswith((".", ":", ";", ",", " "))


def test_the_command_refuses_in_one_line_and_writes_nothing(stress, capsys, tmp_path):
    refused = [case for case in stress.cases() if case.wanted == stress.REFUSED]
    for number, case in enumerate(refused):
        folder = tmp_path / str(number)
        folder.mkdir()
        options = [(f"--{name.replace('_', '-')}", str(v)) for name, v in case.options.items()]
        words = [word for option in options for word in option]
        command = ["reconstruct", str(case.write(folder)), "--out", str(folder / "out"), *words]
        assert main([*command, "--center", "47.5"]) == InputError.exit_status, case.truth
        told = capsys.readouterr().err.splitlines()
        # The line of progress and what is assumed of the file may come before the refusal.
        assert told[-1].startswith(f"rift: {folder}"), (case.truth, told)
        assert all("0/" in line or line.startswith("scan.") for line in told[:-1]), told
        assert not (folder / "out").exists(), case.truth


def test_counts_that_pass_for_attenuation_are_noticed(stress, monkeypatch, capsys):
    monkeypatch.setattr(contract, "possible_kinds", lambda seen: ("attenuation",))
    assert stress.main(stress.Options(only="named: uint16 counts without flats")) == 1
    assert "WRONG" in capsys.readouterr().out


def test_slices_of_a_wrong_level_are_noticed(stress, monkeypatch):
    case = next(case for case in stress.cases() if case.truth == "line integrals")
    assert stress.tried(case).what == stress.RIGHT
    true = stress.slices()
    monkeypatch.setattr(stress, "slices", lambda: 1.2 * true)
    assert stress.tried(case).what == stress.WRONG
