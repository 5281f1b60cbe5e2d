"""The checks of declarations before lowering: names, types, and one module for each subject in `checks`."""
