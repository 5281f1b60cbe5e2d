"""The service `lint`: the findings of `check` and of the lint rules, with a cache, ignores and fixes."""
