"""The cameras of a fit: kept in its folder, and what they say of how a scene is to be looked at.

``fit_cameras`` is what every command asks, ``arc`` where about the scene the cameras stood,
``photograph_place`` how their photographs are found again.
"""
