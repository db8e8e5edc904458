"""The one solver behind `plan`, the advice of `capacity` and the cures of `check`.

A *constraint* is what a plan must hold: it says what the slice must give. A *freedom* is what a plan may change. The
search finds the least change of the dearest freedom with all cheaper ones free; `busplan.buses.bus.Cost` is the order.
"""
