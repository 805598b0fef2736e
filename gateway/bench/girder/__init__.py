"""Deflection of a crane girder from the rotations of its ends (Zhu et al. 2020, eq. 25 and 26)."""
