"""Displacement of a laser spot on a board of dots, from photographs (Zhu et al. 2020, sec. 2.3). Needs the extra `laser`."""
