"""The paper's figures, one file each.

Every figure has ``NAME`` and ``TITLE``, ``compute(full, device)``, which does the experiment and
gives back what JSON can hold, and ``show(page, result)``, which draws it from that alone.
"""
