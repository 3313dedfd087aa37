"""Where to look from: what frequencies of a target views sample, and what views to take."""
