"""``rift reconstruct``: from a scan in a file to a volume of slices, with a report.

``settings`` is what is asked for, ``slice_input`` turns rows of the file into projections,
``inversion`` turns projections into slices, ``kept_slabs`` keeps what is done, ``volume`` and
``report`` are what is left behind; ``job`` runs them.
"""
