"""Every table and figure of "Optimal frequency for undulatory motion in granular media", computed."""
