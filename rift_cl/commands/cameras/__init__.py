"""The cameras of a fit: kept in its folder, and what they say of how a scene is to be looked at.

``fit_cameras`` is what every command asks, ``photograph_place`` how photographs are found again;
``focus`` says what cameras look at, ``arc`` from where; ``film`` is the way of a film's camera,
along a ``route`` where the cameras stood on one side.
"""
