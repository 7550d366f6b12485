"""Identity of cars, bikes and walkers: the ready link next to norfair and to a new object per percept, on scenes made here."""
