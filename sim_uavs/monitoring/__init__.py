"""What platforms of the scenario `traffic` derive from their cameras unless they are given another specification.

The specification links percepts to cars and recognises how they go through crossings (thesis, 8.7.4); its units have the map.
"""
