"""The servo core: does the circle stay round when the bus delivers its set-points at this period?

Each axis is simulated at a fixed step, from the set-points of a circle to the position of the table. The result is
measured as ISO 230-4 measures real machines, and the stability margins of the position loops are computed. Nothing here
opens a file, prints, or depends on profiles.

Read in this order: `parameters`, `runnable`, `margins`, `path`, `delivery`, `rows`, `kernel`, `axis`, `contour`,
`circle`. Only `parameters`, `runnable` and `kernel` do not need numpy.
"""
