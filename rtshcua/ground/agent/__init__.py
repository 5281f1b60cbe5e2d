"""Mission specifications: missions as JSON, as an agent proposes them."""
