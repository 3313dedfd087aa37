"""Splats in the browser: ``rift view``, and ``rift fit --view`` while it runs.

``job`` runs the command and ``watched`` a fit that is looked at; both own a ``viewer``, which
decides what is drawn when; ``page`` speaks with viser, ``guard`` says who may look, and ``pose`` is
where a page's camera is.
"""
