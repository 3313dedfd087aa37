"""Where to look from: which frequencies of a target a set of views samples, and which views to take."""
