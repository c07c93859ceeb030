"""A plain, slow, dense-matrix twin of the march, derived from the equations and not from the engine's code."""
