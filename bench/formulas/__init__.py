"""Progression of formulas and recognition of chronicles, next to other libraries."""
