"""Mission specifications: the JSON in which an agent proposes a mission."""
