"""How fast the engine is, side by side with LAMMPS and with a plain compiled loop."""
