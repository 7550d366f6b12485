"""Object linkage structures (Heintz, Rudol, Doherty: "From images to traffic behavior"; thesis 8.5, 8.6).

`structures` steps all link processes of one specification; states, estimates and predictions are plain values.
Conditions are formulas, progressed by the engine of `reasoning` over the states of both objects.
"""
