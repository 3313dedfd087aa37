"""The studies of ``tools/compare_bases.py``, one file each.

Every study has ``NAME`` and ``TITLE``; ``settings(plan)``, what of the plan decides its result;
``compute(plan, device, kept)``, which yields a result (what JSON can hold: ``total``, the number of
runs, and ``runs``, a flat record of each) after every run, where ``kept`` is what an earlier
command with the same settings left; ``tables(result)`` and ``pictures(result)``, which show a
result, finished or not, from that alone; and ``verdicts(result)``, sentences that are worked out
from its figures: a basis that loses is said to lose.
"""
