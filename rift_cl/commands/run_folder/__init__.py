"""The folder that a run leaves behind: settings, figures, report."""
