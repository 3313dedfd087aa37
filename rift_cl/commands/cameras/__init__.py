"""The cameras of a fit, kept in its folder, and camera paths of films derived from them.

``fit_cameras`` reads them for every command, ``photograph_place`` finds photographs that have
moved; ``focus`` is the point that the cameras look at, ``arc`` the directions that they cover;
``film_path`` is the camera path of a film: an orbit (``camera_path``), or a ``route`` along the
cameras of a capture from one side.
"""
