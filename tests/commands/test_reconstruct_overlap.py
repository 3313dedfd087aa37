"""Reading ahead and writing behind: the order stays, errors arrive, no thread is left."""

import threading

import pytest

from rift_cl.commands.reconstruct.overlap import Behind, ahead


def test_results_come_in_order_and_one_ahead():
    begun = []

    def square(number):
        begun.append(number)
        return number**2

    with ahead(range(5), square) as results:
        assert next(results) == (0, 0)
        taken = dict(results)
    assert taken == {1: 1, 2: 4, 3: 9, 4: 16}
    assert begun == [0, 1, 2, 3, 4]


def test_nothing_to_do_is_nothing_done():
    with ahead([], abs) as results:
        assert list(results) == []


def test_an_error_arrives_where_its_result_would():
    with ahead([4, 2, 0, 1], lambda n: 8 // n) as results:
        assert [next(results), next(results)] == [(4, 2), (2, 4)]
        with pytest.raises(ZeroDivisionError):
            next(results)


def test_whoever_stops_early_leaves_no_thread():
    before = threading.active_count()
    with ahead(range(100), abs) as results:
        next(results)
    assert threading.active_count() == before


def test_what_is_written_behind_is_all_written_in_order():
    written = []
    with Behind() as behind:
        for number in range(20):
            behind.do(written.append, number)
    assert written == list(range(20))


def test_an_error_of_the_last_piece_is_not_lost():
    def fail():
        raise OSError("the disk is full")

    with pytest.raises(OSError, match="full"), Behind() as behind:
        behind.do(fail)
    with pytest.raises(OSError, match="full"), Behind() as behind:
        behind.do(fail)
        behind.do(list)


def test_an_error_of_the_block_is_the_one_that_is_raised():
    with pytest.raises(KeyError), Behind() as behind:
        behind.do({}.__getitem__, 1)
        raise KeyError("mine")
