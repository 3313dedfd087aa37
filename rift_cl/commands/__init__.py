"""The long commands: each one's settings, the work as a generator of reports, its run folder."""
