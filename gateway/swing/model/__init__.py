"""The spherical pendulum as the housing sees it, and a motion of it over a window."""
