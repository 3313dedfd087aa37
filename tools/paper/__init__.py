"""The paper's figures, one file each.

Every figure has ``NAME`` and ``TITLE``; ``settings(plan)``, what of the plan decides its result;
``compute(plan, device, kept)``, which does the experiment and yields what JSON can hold after each
part of it, where ``kept`` is what an earlier run with the same settings left; and
``show(page, result)``, which draws a result, finished or not, from that alone.
"""
