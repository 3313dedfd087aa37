"""Amounts of memory: read from text, limited, and work cut to fit them."""

from __future__ import annotations

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

import rift_cl as rift
from rift_cl.cl import budget
from rift_cl.cl.budget import format_bytes, memory_budget, parse_bytes, plan_chunks
from rift_cl.errors import InputError, ResourceLimitError


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("1", 1),
        ("1073741824", 1 << 30),
        ("512M", 512 << 20),
        ("512m", 512 << 20),
        ("512MB", 512 << 20),
        ("512MiB", 512 << 20),
        ("512 MiB", 512 << 20),
        (" 1.5 GB ", 3 << 29),
        ("2G", 2 << 30),
        ("2T", 2 << 40),
        ("16KiB", 16 << 10),
        ("100B", 100),
        (".5K", 512),
    ],
)
def test_amounts_are_read(text, wanted):
    assert parse_bytes(text) == wanted


@pytest.mark.parametrize(
    "text",
    [
        "",
        " ",
        "0",
        "0.5",
        "-1G",
        "G",
        "1X",
        "1.2.3G",
        ".",
        "1e9",
        "nan",
        "inf",
        "1 G B",
        "9" * 400,
        "1GG",
        "0x10",
        "1,5G",
        "१G",
        "1G\n2G",
        "9999999999T",
    ],
)
def test_nonsense_amounts_are_refused(text):
    with pytest.raises(InputError, match="wanted a positive amount"):
        parse_bytes(text)


@given(st.integers(1, 1 << 40))
def test_whole_bytes_are_read_exactly(amount):
    assert parse_bytes(str(amount)) == amount


@pytest.mark.parametrize(
    ("amount", "text"),
    [(0, "0 B"), (1023, "1.02e+03 B"), (1024, "1 KiB"), (3 << 29, "1.5 GiB"), (5 << 40, "5 TiB")],
)
def test_amounts_are_written_for_people(amount, text):
    assert format_bytes(amount) == text


@given(
    count=st.integers(0, 2000),
    each=st.integers(0, 10**6),
    fixed=st.integers(0, 10**6),
    room=st.integers(1, 10**7),
)
def test_chunks_cover_everything_in_order_and_fit(count, each, fixed, room):
    if (room - fixed) // max(each, 1) < 1:
        with pytest.raises(ResourceLimitError):
            plan_chunks(count, each, fixed, room, what="slice")
        return
    chunks = plan_chunks(count, each, fixed, room, what="slice")
    assert [i for chunk in chunks for i in range(chunk.start, chunk.stop)] == list(range(count))
    sizes = [chunk.stop - chunk.start for chunk in chunks]
    assert all(size > 0 and fixed + size * each <= room for size in sizes)
    assert max(sizes, default=0) - min(sizes, default=0) <= 1
    most = (room - fixed) // max(each, 1)
    assert len(chunks) == -(-count // most), "no more chunks than it takes"


def test_a_part_that_cannot_fit_names_need_and_have():
    with pytest.raises(ResourceLimitError) as caught:
        plan_chunks(10, 3 << 20, 1 << 20, 2 << 20, what="slice")
    for part in ("one slice needs 4 MiB", "budget is 2 MiB", "RIFT_MEMORY", "--memory"):
        assert part in str(caught.value)


def test_fixed_need_above_the_budget_is_refused():
    with pytest.raises(ResourceLimitError):
        plan_chunks(1, 1, 100, 50, what="slice")


@pytest.fixture
def traits(monkeypatch):
    monkeypatch.delenv("RIFT_MEMORY", raising=False)
    monkeypatch.setattr(budget, "free_host_memory", lambda: 1000)
    return dataclasses.replace(
        rift.devices()[0].traits, memory=5000, is_cpu=True, unified=True, share=1.0, address_bits=64
    )


def test_budget_is_the_smallest_of_what_limits_it(traits, monkeypatch):
    assert memory_budget(traits) == 600
    assert memory_budget(dataclasses.replace(traits, memory=500)) == 500
    assert memory_budget(traits, 400) == 400
    assert memory_budget(traits, 10**9) == 600
    monkeypatch.setenv("RIFT_MEMORY", "300")
    assert memory_budget(traits) == 300
    assert memory_budget(traits, 400) == 400, "an argument goes before the environment"


def test_memory_of_its_own_is_not_bounded_by_the_host(traits):
    assert memory_budget(dataclasses.replace(traits, is_cpu=False, unified=False)) == 5000
    assert memory_budget(dataclasses.replace(traits, is_cpu=False, unified=True)) == 600


def test_a_share_of_the_memory_that_pointers_reach_is_used(traits):
    own = dataclasses.replace(traits, is_cpu=False, unified=False, share=0.85)
    assert memory_budget(own) == 4250
    assert memory_budget(dataclasses.replace(own, address_bits=10)) == 1024


def test_host_that_does_not_say_what_is_free(traits, monkeypatch):
    monkeypatch.setattr(budget, "free_host_memory", lambda: None)
    assert memory_budget(traits) == 5000


def test_bad_environment_is_a_named_error(traits, monkeypatch):
    monkeypatch.setenv("RIFT_MEMORY", "plenty")
    with pytest.raises(InputError, match="'plenty'"):
        memory_budget(traits)
    monkeypatch.setenv("RIFT_MEMORY", "")
    assert memory_budget(traits) == 600


def test_free_memory_of_this_machine_is_plausible():
    free = budget.free_host_memory()
    assert free is None or 1 << 20 < free < 1 << 60


def test_free_memory_without_proc(monkeypatch):
    def refuse(*_, **__):
        raise OSError

    monkeypatch.setattr(budget.Path, "read_text", refuse)
    budget._free_host_memory.cache_clear()
    free = budget.free_host_memory()
    assert free is None or free > 1 << 20


def test_device_keeps_its_limit(monkeypatch):
    monkeypatch.delenv("RIFT_MEMORY", raising=False)
    assert rift.open_device("0", memory=12345).budget == 12345
    monkeypatch.setenv("RIFT_MEMORY", "11K")
    assert rift.open_device("0").budget == 11 << 10
