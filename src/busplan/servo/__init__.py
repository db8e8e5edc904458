"""The servo core: does the circle stay round when the bus delivers its set-points at this period?

One axis after the other is simulated at a fixed step, from the set-points of a circle to the position of the
table; what comes out is measured as ISO 230-4 measures real machines, and the stability margins of the position
loop stand beside it. Nothing here opens a file, prints, or knows a profile.

Read in this order: `parameters` (what can be set), `path`, `delivery`, `rows`, `kernel`, `axis`, `mechanics`,
`contour`, `margins`, `circle` (all of it joined). Only `parameters` and `checks` do without numpy.
"""
