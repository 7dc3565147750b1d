"""The engine's compiled core, as Python that an editor reads.

Nothing here is called. ``callbacks`` puts what stands below the line ``# ---- text ----`` of each file behind numbers
that it knows only when it runs (slots of the context, columns of the state, offsets in Chipmunk's memory), and compiles
that. Above the line these numbers, and the arrays that ``unpack`` makes of the context, are imported from ``names``,
for editors and linters alone.
"""
