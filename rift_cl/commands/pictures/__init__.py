"""Pictures and tables that more than one command puts into its report."""
