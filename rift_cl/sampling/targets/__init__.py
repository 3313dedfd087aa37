"""What is to be known: a target, what is believed of it, and how views observe its points."""
