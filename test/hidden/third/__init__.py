"""A third hidden world: Masing hysteresis from closed curves, a lab's drives, and effects that have no name."""
