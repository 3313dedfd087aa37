"""JSON that is nested too deeply is as wrong as any other, wherever the package reads some."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from rift_cl.child_process import read_message, write_message
from rift_cl.cl.build import cache_check, driver_record, program_store
from rift_cl.commands.fit.kind import kind_of_fit
from rift_cl.commands.sweep.one_run import is_done
from rift_cl.commands.sweep.report import Row
from rift_cl.errors import FileFormatError, OutputError
from rift_cl.io.json_fields import read_json_object
from rift_cl.json_parsing import parse_json

DEEP = "[" * 100_000 + "]" * 100_000
# Read by the parser of JSON, and too deep for what goes through it level by level.
HALF_DEEP = '{"a":' * 700 + "1" + "}" * 700


def test_what_is_nested_too_deeply_is_a_value_error():
    assert parse_json('{"a": [1, null]}') == parse_json(b'{"a": [1, null]}') == {"a": [1, None]}
    with pytest.raises(ValueError, match="deep"):
        parse_json(DEEP)


def test_kernel_cache_takes_it_for_damage(tmp_path, monkeypatch):
    for module in (program_store, driver_record):
        monkeypatch.setattr(module, "cache_folder", lambda: tmp_path)
    about = {"driver": "probe"}
    monkeypatch.setattr(program_store.json, "dumps", lambda *_, **__: DEEP)
    program_store.save("name", program_store.Stored(about, b"binary"))
    assert program_store.load("name") is None
    monkeypatch.undo()
    (tmp_path / "checksums.json").write_text(DEEP)
    assert cache_check.remove_damaged(tmp_path) == 0


def test_a_childs_answer_is_then_none(tmp_path, monkeypatch):
    path = tmp_path / "answer"
    monkeypatch.setattr("json.dumps", lambda _: DEEP)
    with path.open("wb") as file:
        write_message(file, {})
    with path.open("rb") as file:
        assert read_message(file) is None


@pytest.mark.parametrize("content", [DEEP, HALF_DEEP])
def test_figures_of_a_run_that_cannot_be_read_are_named(tmp_path, content):
    (tmp_path / "metrics.json").write_text(content)
    run = SimpleNamespace(settings=SimpleNamespace(out=tmp_path))
    with pytest.raises(OutputError, match=r"metrics\.json"):
        Row.of(run, "")


def test_other_files_of_a_run(tmp_path):
    path = tmp_path / "config.json"
    path.write_text(DEEP)
    assert not is_done(tmp_path)
    assert kind_of_fit(["--config", str(path)]) == kind_of_fit([str(path)]) == "photos"
    with pytest.raises(FileFormatError, match=r"config\.json.*deep"):
        read_json_object(path)
