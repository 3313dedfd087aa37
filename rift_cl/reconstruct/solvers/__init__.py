"""Iterative reconstruction: the solvers, their data terms and their priors.

Methods, one a file: ``simultaneous_iteration`` (SIRT), ``conjugate_gradients`` (CGLS), ``fista``
and ``pdhg``, which ``tv`` offers as one function, and ``few_levels`` for limited angles. All run
through ``solver``. What they minimise: ``data_term``, the total variation of ``tv_functional``,
both together in ``tv_problem``, and the shape prior of ``disc_prior``. How rays are weighed:
``residual_weight`` (preconditioning), ``poisson_weights`` and ``measured_rays``; how much the
variation counts, by the noise: ``variation_weight``; how views are
taken in turn: ``ordered_subsets`` and ``view_subsets``.
"""
