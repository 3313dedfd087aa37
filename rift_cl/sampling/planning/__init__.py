"""Choose views: what a plan has to keep to, where views may stand, and how they are found."""
