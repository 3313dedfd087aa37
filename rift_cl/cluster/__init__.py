"""Work in several processes and on several machines, by Dask's scheduler and workers.

Nothing but names goes through the scheduler: a task is a function of this package, the settings of
a run and which part of it is meant; the worker reads the part from its file and writes what comes
of it to its file. What is sent is pickled, so that whoever may talk to a scheduler may run code on
its workers (``docs/how-to/scale_out.md``).
"""
