"""From a kernel's source to a program of a device, whatever its driver's compiler does.

``builder`` is what a device asks. ``source`` puts a kernel's text together. ``driver_record`` says
what is known of a driver: whether it keeps what it compiles in our ``kernel_cache`` (then the
driver compiles in this process, and ``cache_check`` looks after its files), or whether we keep the
binaries (``program_store``) that a child process compiles (``guarded_build``, ``worker``), and
launches (``first_launch``) where a process died of that.
``intel_runtime`` finds the driver that the extra ``intel`` brings.
"""
